import subprocess
import sys

import bpy
import numpy as np
import pytest

from prt_core.rays import BruteForceCaster
from prt_core.scene import Scene
from tests.meshes import plane, sphere


@pytest.fixture(scope="module")
def rays():
    scene = Scene.from_meshes([sphere(10, 0.5, (0, 0, 0.6)), plane(9)])
    rng = np.random.default_rng(0)
    origins = scene.ray_origins[rng.integers(0, len(scene.points), 3000)]
    directions = rng.normal(size=origins.shape).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return scene, origins, directions


@pytest.mark.parametrize("name", ["blender", "bvhtree"])
def test_blender_agrees_with_brute_force(rays, name):
    scene, origins, directions = rays
    caster = scene.make_caster(name)
    oracle = BruteForceCaster(scene.vertices.astype(np.float32), scene.triangles)
    try:
        np.testing.assert_array_equal(
            caster.occluded(origins, directions), oracle.occluded(origins, directions)
        )
        reach = np.linspace(0.01, 1, len(origins)).astype(np.float32)
        limited = caster.occluded(origins, directions, reach)
        assert (limited != oracle.occluded(origins, directions, reach)).sum() <= 2
        assert 0 < limited.sum() < caster.occluded(origins, directions).sum()
        hits, wanted = caster.intersect(origins, directions), oracle.intersect(origins, directions)
        # A ray on the edge of two triangles may be given to either, and so may one that goes
        # into the very surface it starts from, at a vertex.
        away = wanted.distance > 1e-5
        assert (hits.triangle != wanted.triangle)[away].sum() <= 3
        assert ((hits.triangle >= 0) != (wanted.triangle >= 0)).sum() <= 1
        same = (hits.triangle == wanted.triangle) & (hits.triangle >= 0)
        np.testing.assert_allclose(hits.distance[same], wanted.distance[same], rtol=1e-4, atol=1e-6)
        assert len(caster.occluded(origins[:0], directions[:0])) == 0
    finally:
        caster.close()


@pytest.mark.parametrize("name", ["blender", "bvhtree"])
@pytest.mark.parametrize("seed", [None, 5])
def test_contacts_and_great_planes(name, seed):
    """A plate 1 mm above a floor in a scene of a kilometre; no surface meets its own rays."""
    matrix = np.eye(3)
    if seed is not None:
        matrix = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        matrix *= np.linalg.det(matrix)
    ground, plate = plane(3, -500, 500, name="ground"), plane(5, -1, 1, name="plate", z=1e-3)
    for mesh in (ground, plate):
        mesh.vertices = mesh.vertices @ matrix.T
        mesh.corner_normal = mesh.corner_normal @ matrix.T
    scene = Scene.from_meshes([ground, plate])
    points = scene.points
    middle = np.linalg.norm(scene.to_world(points.positions), axis=1) < 0.5
    angle = np.linspace(0, 2 * np.pi, 41)[:-1]
    caster = scene.make_caster(name)
    try:
        for rise in (1, 0.3, 1e-2, 1e-4):
            local = np.stack([np.cos(angle), np.sin(angle), np.full(40, rise)], axis=1)
            ways = (local / np.linalg.norm(local, axis=1, keepdims=True)) @ matrix.T
            ways = np.tile(ways.astype(np.float32), (len(points), 1))
            blocked = caster.occluded(np.repeat(scene.ray_origins, 40, axis=0), ways)
            blocked = blocked.reshape(-1, 40)
            if rise >= 1e-2:
                assert blocked[middle & (points.object_index == 0)].all()
            assert not blocked[points.object_index == 1].any()
            assert not blocked[(points.object_index == 0) & ~middle & points.visible].any()
    finally:
        caster.close()


def test_the_open_scene_is_left_alone(rays):
    scene, origins, directions = rays
    before = bpy.context.scene, len(bpy.data.objects), len(bpy.data.meshes)
    caster = scene.make_caster("blender")
    caster.occluded(origins, directions)
    caster.close()
    assert before == (bpy.context.scene, len(bpy.data.objects), len(bpy.data.meshes))
    assert len(bpy.data.scenes) == 1 and not bpy.data.node_groups


_BESIDE_BUSY_THREADS = """
import threading, time
import bpy, numpy as np
from prt_core.blender.casters import BlenderCaster

def busy():
    while not ended.is_set():
        sum(range(50))
        time.sleep(0)

caster = BlenderCaster(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
ended = threading.Event()
threads = [threading.Thread(target=busy) for _ in range(2)]
for thread in threads:
    thread.start()
toward = np.full((64, 3), 3**-0.5, np.float32)
for _ in range(300):
    assert caster.occluded(np.zeros((64, 3), np.float32), toward).all()
    assert not caster.occluded(np.zeros((64, 3), np.float32), -toward).any()
ended.set()
"""


def test_rays_are_cast_while_other_threads_run_python():
    """Blender 5.0 crashed in each of five runs where the rays had a context of their own."""
    done = subprocess.run([sys.executable, "-c", _BESIDE_BUSY_THREADS], capture_output=True)
    assert done.returncode == 0, done.stderr[-2000:]


_RENDERS_BESIDE_WORK = """
import threading, time
import bpy
from mathutils import Matrix
from prt_core.blender.small_render import small_render
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import Progress

def busy(n):
    for done in range(n):
        for _ in range(200):
            sum(range(50))
            time.sleep(0)
        yield Progress("busy", done, n)

steps = steps_in_thread(busy(1 << 30), MainThreadCalls(), "busy")
next(steps)
with small_render() as render:
    render.add_camera(Matrix())
    for _ in range(20):
        assert render.pixels(8, 8, 1).shape == (8, 8, 3)
        next(steps)
steps.close()
"""


def test_renders_stand_beside_work_in_threads():
    """Blender 5.0 crashed in two of three runs of ten renders beside threads that did not stop."""
    done = subprocess.run([sys.executable, "-c", _RENDERS_BESIDE_WORK], capture_output=True)
    assert done.returncode == 0, done.stderr[-2000:]
