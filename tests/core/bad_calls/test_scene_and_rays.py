"""Wrong calls of `prt_core.reflectance`, `prt_core.scene` and `prt_core.rays`."""

import numpy as np
import pytest

from prt_core import rays, reflectance, scene
from prt_core.evaluate import to_display
from prt_core.scene import Mesh, Scene, with_atlas
from tests.view_transforms import plain_view_transform

from .calls import (
    RNG,
    Call,
    any_of,
    camera,
    caster,
    directions,
    faults_of,
    method,
    plain,
    with_scene,
)


def mesh_call(there):
    mesh = there.meshes[0]
    names = ("name vertices corner_vertex corner_normal triangle_corners materials "
             "corner_material receives two_sided face_sizes own_mesh owner").split()  # fmt: skip
    good = {name: getattr(mesh, name) for name in names}
    good["corner_uv"] = RNG.random((len(mesh.corner_vertex), 2))

    def make(**arguments):
        return Scene.from_meshes([Mesh(**arguments)], max_hidden=0).points.positions

    # Positions may be anywhere, and texture coordinates too.
    may = ("vertices 3e38", "vertices negative", "corner_uv 3e38", "corner_uv negative",
           "corner_normal negative", "name other text", "owner other text", "owner empty text",
           "corner_material", "corner_normal 3e38")  # fmt: skip
    return Call(make, good, may)


def unwrapped(there):
    mesh = there.meshes[0]
    mesh.corner_uv = mesh.vertices[mesh.corner_vertex][:, :2] / 2 + 0.5
    return mesh


def geometry_image(there):
    layout = scene.geometry_layout(unwrapped(there), "uv")
    tracer = rays.BruteForceCaster(layout.vertices, layout.triangles)
    good = {"scene": there.scene, "caster": tracer, "layout": layout, "size": 3}
    return Call(scene.with_geometry_image, good)


def atlas(there):
    mesh = unwrapped(there)
    maps = {mesh.name: mesh.corner_uv}

    def call(scene, size, corner_uv):
        parts = there.meshes
        return with_atlas(scene, parts, {mesh.name: corner_uv}, size, rays.BruteForceCaster)

    return Call(call, {"scene": there.scene, "size": (4, 3), "corner_uv": maps[mesh.name]})


CALLS = {
    "Materials": plain(
        reflectance.Materials,
        ("albedo one more", "albedo one less", "albedo negative", "albedo 3e38"),
        albedo=np.full((5, 3), 0.5),
    ),
    "Mesh, Scene.from_meshes": mesh_call,
    "Scene.from_meshes": lambda t: Call(Scene.from_meshes, {"meshes": t.meshes, "max_hidden": 10}),
    "compare": lambda t: Call(scene.compare, {"old": t.scene, "new": t.scene}),
    "Scene.to_frame": method(
        lambda t: t.scene, "to_frame", ("positions another axis",), positions=np.ones((2, 3))
    ),
    "Scene.to_world": method(
        lambda t: t.scene, "to_world", ("positions another axis",), positions=np.ones((2, 3))
    ),
    "camera_rays": plain(
        scene.camera_rays, ("camera",), camera=camera(), width=3, height=2, samples=1
    ),
    "view_rays": plain(scene.view_rays, ("camera",), camera=camera(), width=3, height=2, samples=1),
    "Camera": plain(
        scene.Camera,
        ("shift", "panorama", "clip list", "frame list"),
        matrix=np.eye(4),
        tangent=0.5,
        lens="orthographic",
        sensor_fit="vertical",
        shift=(0.1, 0.2),
        pixel_aspect=(1.0, 2.0),
        clip=(0.1, 100.0),
        panorama=(-1.0, 1.0, -1.0, 1.0),
        fisheye=(1.0, 2.0, 3.0, 4.0),
        frame=(30, 20),
    ),
    "Scene.make_caster": method(
        lambda t: t.scene,
        "make_caster",
        ("objects None",),
        name="brute",
        objects=lambda t: np.ones(len(t.scene.objects), bool),
    ),
    "with_camera_image": with_scene(
        scene.with_camera_image,
        camera=lambda t: camera(),
        width=lambda t: 3,
        height=lambda t: 2,
        samples=lambda t: 1,
    ),
    "geometry_layout": lambda t: Call(
        scene.geometry_layout, {"mesh": unwrapped(t), "parametrisation": "uv"}
    ),
    "with_geometry_image": geometry_image,
    "SplitMeshes.split": lambda t: Call(
        lambda meshes, marked: scene.SplitMeshes(meshes).split(marked),
        {"meshes": t.meshes, "marked": np.zeros(scene.SplitMeshes(t.meshes).n_edges, bool)},
    ),
    "split_evenly": lambda t: Call(scene.split_evenly, {"meshes": t.meshes}),
    "with_atlas": atlas,
    "mesh_digests": lambda t: Call(scene.mesh_digests, {"meshes": t.meshes}),
    "ViewTransform": plain(
        scene.ViewTransform, ("name",), table=plain_view_transform().table, exposure=1.0, name="AgX"
    ),
    "ViewTransform.display": method(
        lambda _: plain_view_transform(),
        "display",
        ("radiance",),
        radiance=np.ones((5, 3), np.float32),
        exposure=1.0,
    ),
    "to_display": plain(
        to_display,
        ("linear",),
        linear=np.ones((2, 3, 3)),
        view_transform=plain_view_transform(),
        exposure=1.0,
    ),
    "changes": plain(scene.changes, source={"a": "1"}, digests={"b": "1"}),
    "make_caster": lambda t: Call(
        rays.make_caster,
        {"name": "brute", "vertices": t.scene.vertices, "triangles": t.scene.triangles},
        ("vertices 3e38", "vertices negative"),
    ),
    "BruteForceCaster.occluded": method(
        caster,
        "occluded",
        ("distances an infinity",),
        origins=np.zeros((5, 3), np.float32),
        directions=directions().astype(np.float32),
        distances=np.ones(5, np.float32),
    ),
    "BruteForceCaster.intersect": method(
        caster,
        "intersect",
        any_of("origins", "directions"),
        origins=np.zeros((5, 3), np.float32),
        directions=directions().astype(np.float32),
    ),
    "as_rays": plain(rays.as_rays, origins=np.zeros((5, 3)), directions=directions()),
    "shared": lambda t: Call(rays.shared, {"caster": caster(t)}),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
