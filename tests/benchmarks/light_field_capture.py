"""The capture of light fields against Cycles' own camera on the same rays, and its speed.

    python tests/benchmarks/light_field_capture.py [MESH …]

A camera of Cycles of a few pixels looks along each of some rays, from where the light field's
starts; its samples are as many as ours. Printed are the medians of the relative differences, ours
against it and its own two seeds; paths a CPU second of ours and of a plain render of as many
pixels; and how fast that same render is through a camera that is a shader, which is what such a
camera costs: the rest is that a light field's rays graze surfaces and come from below, too.
"""

import resource
import sys
import tempfile
from contextlib import contextmanager
from itertools import combinations, product
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

import prt_core.blender  # noqa: F401  (makes Blender's side known)
from prt_core.bake.light_field import points_of
from prt_core.blender.light_field_scene import light_field_camera, light_field_meshes_steps
from prt_core.blender.light_field_shader import GRAZING
from prt_core.blender.passes.traces import no_output
from prt_core.blender.small_render import small_render
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from prt_core.sphere import hemisphere_directions

ANGLES, N_POINTS, SAMPLES = (5, 3), 12, 64
_SIDE, _SEEDS = 4, (1, 2, 3)
_SETTINGS = "max_bounces", "diffuse_bounces", "glossy_bounces", "sampling_pattern"
_SCALE = 0.7
# The rays of Cycles' own orthographic camera.
_SHADER = """
shader prt_plain(output point position = point(0.0), output vector direction = vector(0, 0, 1),
    output color throughput = color(1.0))
{
    point raster = camera_shader_raster_position();
    position = point((raster[0] - 0.5) * %(scale)s, (raster[1] - 0.5) * %(scale)s, 0.0);
}
"""


def scene_with(mesh=None, roughness=0.3):
    """A glossy object over a floor, a lamp and an even sky."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    # Neighbouring pixels are independent then: blue noise would make the mean of one camera's few
    # pixels better than that of pixels that lie apart.
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    if mesh is None:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, location=(0, 0, 1))
    elif mesh.suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=str(mesh))
    else:
        bpy.ops.wm.obj_import(filepath=str(mesh))
    item = bpy.context.object
    item.name = "model"
    size = max(item.dimensions)
    if mesh is not None:
        item.scale = [2 / size] * 3
        bpy.ops.object.transform_apply(location=False, rotation=True, scale=True)
        low = np.array([v.co for v in item.data.vertices]).min(axis=0)
        item.location.z -= float((item.matrix_world @ Matrix.Translation(low)).translation.z)
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("glossy")
    if material.node_tree is None:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.6, 0.35, 0.2, 1)
    shader.inputs["Roughness"].default_value = roughness
    item.data.materials.clear()
    item.data.materials.append(material)
    bpy.ops.mesh.primitive_plane_add(size=8)
    bpy.context.object.name = "floor"
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.energy, lamp.size = 300, 1.5
    holder = bpy.data.objects.new("lamp", lamp)
    holder.location = (0.5, -0.5, 4)
    scene.collection.objects.link(holder)
    world = bpy.data.worlds.new("sky")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.2, 0.3, 0.5, 1)
    scene.world = world
    return scene


def rays_of(points, angles):
    """Starts and directions of view (n, rows, columns, 3), and which are not bent."""
    rows, columns = angles
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    ways = np.einsum("ijk,nkx->nijx", hemisphere_directions(u, v), points.frames)
    height = np.linalg.norm(points.above, axis=1)
    slope = np.einsum("nijx,nx->nij", ways, points.above / height[:, None])
    start = points.positions[:, None, None] + (height[:, None, None] / slope)[..., None] * ways
    return start, ways, slope > GRAZING


def own_camera(scene, starts, ways, samples, seed):
    """(n, 3): what a camera of Cycles of a few pixels sees along each ray."""
    seen = []
    with small_render(scene) as render:
        target = render.scene
        for item in scene.objects:
            target.collection.objects.link(item)
        target.world = scene.world
        for name in _SETTINGS:
            setattr(target.cycles, name, getattr(scene.cycles, name))
        target.cycles.blur_glossy, target.cycles.seed = 0, seed
        camera = render.add_camera(
            Matrix(), type="ORTHO", ortho_scale=1e-7, clip_start=1e-6, clip_end=1e6
        )
        for start, way in zip(starts, ways, strict=True):
            z = way
            x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
            x /= np.linalg.norm(x)
            matrix = np.eye(4)
            matrix[:3] = np.stack([x, np.cross(z, x), z, start], axis=1)
            camera.matrix_world = Matrix(matrix.tolist())
            with no_output():
                pixels = render.pixels(_SIDE, _SIDE, samples)
            seen.append(pixels.mean(axis=(0, 1)))
    return np.array(seen, np.float64)


def compare(scene, n_points=N_POINTS, samples=SAMPLES):
    """Medians of relative differences: of ours and Cycles' own, of its own two seeds; rays."""
    uid = scene.session_uid
    built = Scene.from_meshes(run(light_field_meshes_steps(uid, ["model"])), 0)
    camera, _ = light_field_camera(uid, built)
    points = points_of(built)
    points = points[np.linspace(0, len(points) - 1, n_points).astype(int)]
    starts, ways, straight = rays_of(points, ANGLES)
    ours = []
    # As many pixels of as many samples as the other has: they are drawn alike.
    many = points[np.repeat(np.arange(n_points), _SIDE**2)]
    for seed in _SEEDS:
        shot = camera.shoot(many, ANGLES, samples, seed, spread=0.0)[0][0].astype(np.float64)
        ours.append(shot.reshape(n_points, _SIDE**2, *ANGLES, 3).mean(axis=1)[straight])
    own = [own_camera(scene, starts[straight], ways[straight], samples, s) for s in _SEEDS]
    apart = np.median([_differences(*pair) for pair in product(ours, own)])
    seeds = np.median([_differences(*pair) for pair in combinations(own, 2)])
    return apart, seeds, len(own[0])


def _differences(one, two):
    return np.abs(one - two).sum(axis=1) / ((one + two).sum(axis=1) / 2 + 1e-6)


def cpu():
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def speed(scene, angles=(32, 16), samples=32, n_points=256, turns=3):
    """Paths a CPU second of a block, of plain renders of as many pixels, and of those by a shader.

    The light field sees the model from all sides, so plain renders do from four, by turns with it;
    of each the best of some turns counts, for others work on the machine.
    """
    uid = scene.session_uid
    built = Scene.from_meshes(run(light_field_meshes_steps(uid, ["model"])), 0)
    camera, _ = light_field_camera(uid, built)
    points = points_of(built)
    points = points[np.linspace(0, len(points) - 1, n_points).astype(int)]
    width = int(np.sqrt(n_points * angles[0] * angles[1])) // 2
    n_paths, n_plain = n_points * angles[0] * angles[1] * samples, 4 * width**2 * samples
    quickest = np.zeros(3)
    with _plain_shader() as shader:
        for _ in range(turns):
            rates = [n_paths / _spent(camera.shoot, points, angles, samples, 3)]
            for seen_by in (None, shader):
                rates.append(n_plain / _spent(_plain_views, scene, width, samples, seen_by))
            quickest = np.maximum(quickest, rates)
    return quickest


def _spent(function, *arguments):
    begun = cpu()
    function(*arguments)
    return cpu() - begun


@contextmanager
def _plain_shader():
    """The path of a shader that is a plain camera."""
    from _cycles import osl_compile

    with tempfile.TemporaryDirectory() as folder:
        text, compiled = Path(folder) / "prt_plain.osl", Path(folder) / "prt_plain.oso"
        text.write_text(_SHADER % {"scale": _SCALE})
        assert osl_compile(str(text), str(compiled))
        yield compiled


def _plain_views(scene, width, samples, shader):
    for number in range(4):
        _plain(scene, width, samples, np.pi / 4 + np.pi / 2 * number, shader)


def _plain(scene, width, samples, angle, shader=None):
    """Render the model as it fills a picture, from an angle and a little above."""
    item = scene.objects["model"]
    box = np.array([item.matrix_world @ Matrix.Translation(c).translation
                    for c in item.bound_box])  # fmt: skip
    middle = (box.min(axis=0) + box.max(axis=0)) / 2
    with small_render(scene) as render:
        for each in scene.objects:
            render.scene.collection.objects.link(each)
        render.scene.world = scene.world
        for name in _SETTINGS:
            setattr(render.scene.cycles, name, getattr(scene.cycles, name))
        render.scene.cycles.blur_glossy = 0
        turned = Matrix.Rotation(angle, 4, "Z") @ Matrix.Rotation(1.2, 4, "X")
        matrix = Matrix.Translation(middle) @ turned @ Matrix.Translation([0, 0, 6])
        camera = render.add_camera(matrix, type="ORTHO", ortho_scale=_SCALE)
        if shader is not None:
            # Where the scene of the context is one of Cycles, Blender asks it for more.
            idle = render.keep(bpy.data.scenes.new("idle"))
            with bpy.context.temp_override(scene=idle, view_layer=idle.view_layers[0]):
                camera.data.type, camera.data.custom_mode = "CUSTOM", "EXTERNAL"
                camera.data.custom_filepath = str(shader)
        with no_output():
            return render.pixels(width, width, samples)


def main(paths):
    print(f"Blender {bpy.app.version_string}")
    for path in [None, *map(Path, paths)]:
        scene = scene_with(path)
        apart, seeds, n_rays = compare(scene)
        ours, plain, by_shader = speed(scene)
        print(
            f"{path.stem if path else 'sphere'}: {n_rays} rays, ours {apart:.2%}, two seeds "
            f"{seeds:.2%}, ratio {apart / seeds:.2f}; k paths a CPU second {ours / 1e3:.0f}, plain "
            f"{plain / 1e3:.0f}, ratio {ours / plain:.2f}; plain by a shader "
            f"{by_shader / 1e3:.0f}, ratio {by_shader / plain:.2f}"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
