"""A scene is built of some meshes at a time: the same bit for bit, in the memory of what it is."""

import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from prt_core.reflectance import Materials
from prt_core.runtime.array_parts import held_once, parts_of
from prt_core.scene import Mesh, Scene
from prt_core.scene.paint import Look
from prt_core.store.scene_checks import check_scene
from tests.meshes import Stripes, glowing, plane, sphere

STACK = "prt_core.scene.stack"


def bent_quad(name, x):
    """A quad of two triangles that are shaded flat and do not look in one direction."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.8], [0, 1, 0.0]]) + [x, 0, 0]
    up, triangles = np.tile([0, 0, 1.0], (4, 1)), [[0, 1, 2], [0, 2, 3]]
    colour = np.full((4, 3), 0.5)
    return Mesh(name, corners, range(4), up, triangles, colour, face_sizes=[4], flat=True)


def all_kinds():
    """Meshes with points of all kinds: shown, of bent faces, hidden; painted, glowing, sided."""
    floor = plane(2, -3, 3, name="floor", albedo=0.6)
    painted = plane(4, -1, 1, name="painted", z=-0.3)
    painted = replace(painted, paint=Stripes(painted))
    thin = sphere(5, 0.3, (1, 1, 1), name="thin")
    thin = replace(
        thin,
        materials=thin.materials.replaced(opacity=np.full((len(thin.corner_vertex), 1), 0.5)),
        bounced=Look(Materials(albedo=np.linspace(0, 1, thin.corner_normal.size).reshape(-1, 3))),
        two_sided=True,
    )
    line = replace(floor, name="line", vertices=floor.vertices * [1, 0, 1])
    lamp = glowing(sphere(4, 0.2, (0, 0, 2), name="lamp"), (3, 2, 1))
    return [
        floor, bent_quad("one", 4), line, painted, thin, lamp, bent_quad("two", 6),
        replace(painted, name="again", vertices=painted.vertices + [0, 0, 1]),
    ]  # fmt: skip


def far_apart():
    """Meshes that no one frame serves, so that places are looked up in others' triangles."""
    tiny = sphere(5, 0.01, name="tiny")
    planet = plane(2, -1e6, 1e6, name="planet")
    return [planet, sphere(5, 0.3, name="ball"), replace(tiny, vertices=tiny.vertices + 1e5)]


@pytest.mark.parametrize("meshes", [all_kinds, far_apart])
def test_meshes_one_by_one_give_the_scene_of_all_at_once(meshes, monkeypatch):
    whole = Scene.from_meshes(meshes())
    monkeypatch.setattr(sys.modules[STACK], "_CORNERS", 1)
    monkeypatch.setattr(sys.modules[STACK], "_TRIANGLES", 7)
    monkeypatch.setattr(sys.modules["prt_core.rays.frames"], "_TRIANGLES", 5)
    parts = Scene.from_meshes(meshes())
    assert parts.fingerprint() == whole.fingerprint() and parts.messages == whole.messages
    for name in ("triangle_normals", "triangle_lifts", "triangle_level", "lattice_start"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name)), name
    for name, array in whole.points.arrays().items():
        assert np.array_equal(parts.points.arrays()[name], array), name
    # What is shown comes first.
    assert (np.diff(parts.points.visible.astype(int)) <= 0).all()
    assert (len(parts.frames) > 1) == (meshes is far_apart)


def test_what_each_point_takes_while_a_scene_is_built_and_looked_at(monkeypatch):
    # Ten million points have to be built in 8 GB, of which the batch takes some.
    monkeypatch.setattr(sys.modules[STACK], "_CORNERS", 1)
    monkeypatch.setattr(sys.modules[STACK], "_TRIANGLES", 1 << 10)
    ball = sphere(24)
    peaks, counts = [], []
    for count in (8, 40):
        places = [
            replace(ball, name=f"{n}", vertices=ball.vertices + 3 * n, corner_normal=normals)
            for n, normals in enumerate([ball.corner_normal.copy() for _ in range(count)])
        ]
        tracemalloc.start()
        scene = Scene.from_meshes(places)
        check_scene(scene)
        scene.fingerprint()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        counts.append(len(scene.points))
    each = (peaks[1] - peaks[0]) / (counts[1] - counts[0])
    # The meshes of instances, their places and normals, take 170 more.
    assert each < 450, each


def test_instances_have_one_set_of_materials():
    ball = sphere(5)
    own = np.linspace(0, 1, ball.corner_normal.size).reshape(-1, 3)
    ball = replace(ball, materials=Materials(albedo=own))
    copies = [replace(ball, name=f"{n}", vertices=ball.vertices + 3 * n) for n in range(4)]
    scene = Scene.from_meshes([*copies, plane(4, albedo=0.2)])
    assert len(scene.surfaces.corner_materials) == len(own) + 1
    assert scene.objects[0].corner_vertex is scene.objects[3].corner_vertex
    inside = np.flatnonzero(scene.triangle_object == 3)
    at = scene.materials_at(inside, np.zeros((len(inside), 2)), np.zeros(len(inside), bool))
    first = scene.objects[3].parts.triangle_corners[:, 0]
    assert np.allclose(at.albedo, own[first], atol=1e-15)


def test_parts_are_the_whole_and_one_value_takes_no_room():
    array = np.arange(30.0).reshape(10, 3)[::-1]
    assert b"".join(part.tobytes() for part in parts_of(array)) == array.tobytes()
    assert held_once(array) is array
    once = held_once(np.tile([2.0, 5], (7, 1)))
    assert once.strides[0] == 0 and np.array_equal(once, np.tile([2.0, 5], (7, 1)))
    assert len(held_once(np.zeros(0))) == 0
