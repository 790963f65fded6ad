import bpy
import numpy as np
import pytest

from prt_core.rays import BruteForceCaster, make_caster
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
    caster = make_caster(name, scene.vertices, scene.triangles)
    oracle = BruteForceCaster(scene.vertices, scene.triangles)
    try:
        np.testing.assert_array_equal(
            caster.occluded(origins, directions), oracle.occluded(origins, directions)
        )
        reach = np.linspace(0.01, 1, len(origins)).astype(np.float32)
        limited = caster.occluded(origins, directions, reach)
        assert (limited != oracle.occluded(origins, directions, reach)).sum() <= 2
        assert 0 < limited.sum() < caster.occluded(origins, directions).sum()
        hits, wanted = caster.intersect(origins, directions), oracle.intersect(origins, directions)
        # A ray on the edge of two triangles may be given to either.
        assert (hits.triangle != wanted.triangle).sum() <= 3
        same = (hits.triangle == wanted.triangle) & (hits.triangle >= 0)
        np.testing.assert_allclose(hits.distance[same], wanted.distance[same], rtol=1e-4, atol=1e-6)
        assert len(caster.occluded(origins[:0], directions[:0])) == 0
    finally:
        caster.close()


def test_the_open_scene_is_left_alone(rays):
    scene, origins, directions = rays
    before = bpy.context.scene, len(bpy.data.objects), len(bpy.data.meshes)
    caster = make_caster("blender", scene.vertices, scene.triangles)
    caster.occluded(origins, directions)
    caster.close()
    assert before == (bpy.context.scene, len(bpy.data.objects), len(bpy.data.meshes))
    assert len(bpy.data.scenes) == 1 and not bpy.data.node_groups
