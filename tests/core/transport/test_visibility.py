import numpy as np
import pytest

from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import received_light, unpack
from tests.meshes import caster_of, plane, sphere, wall


def traced(scene, resolution):
    cube_map = CubeMap(resolution)
    caster = caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    return cube_map, bits


def even(cube_map, bits, scene):
    sky = np.ones((cube_map.n_directions, 3), np.float32)
    return received_light(bits, scene.points.normals, cube_map, sky)


@pytest.mark.parametrize("scale, shift", [(1, 0), (1e-3, 0), (1e5, 0), (1, 1e5)])
def test_an_unoccluded_plate_sees_the_whole_sky(scale, shift):
    mesh = plane(4, -scale, scale)
    mesh.vertices = mesh.vertices + shift
    scene = Scene.from_meshes([mesh])
    cube_map, bits = traced(scene, 8)
    np.testing.assert_allclose(even(cube_map, bits, scene), 1, rtol=1e-6)


def test_a_convex_body_shades_only_itself_by_its_horizon():
    scene = Scene.from_meshes([sphere(12)])
    cube_map, bits = traced(scene, 16)
    # Less the sliver between the texels' traced directions and the horizon.
    np.testing.assert_allclose(even(cube_map, bits, scene), 1, atol=1e-2)


def test_inside_a_closed_ball_nothing_is_seen():
    scene = Scene.from_meshes([sphere(8, inside=True)])
    assert not traced(scene, 8)[1].any()


@pytest.mark.parametrize("k", [0.5, 1.0, 2.0])
def test_beside_an_infinite_wall(k):
    # At a distance x from a wall of height k x: the wall hides (1 - 1 / sqrt(1 + k^2)) / 2.
    floor = plane(3, -0.01, 0.01, z=0.0, name="floor")
    scene = Scene.from_meshes([floor, wall(1.0, k, 300.0)], max_hidden=0)
    resolution = 64
    cube_map, bits = traced(scene, resolution)
    middle = np.linalg.norm(scene.to_world(scene.points.positions)[:, :2], axis=1) < 1e-6
    seen = even(cube_map, bits, scene)[middle][0, 0]
    hidden = (1 - 1 / np.sqrt(1 + k * k)) / 2
    # A texel at the wall's upper edge counts whole or not at all.
    assert abs((1 - seen) - hidden) < 1.0 / resolution


def test_no_light_through_the_surface():
    # Shading normals that lean: nothing below the geometric horizon may be set.
    mesh = plane(3)
    mesh.corner_normal = np.broadcast_to([0.8, 0, 0.6], mesh.corner_normal.shape)
    scene = Scene.from_meshes([mesh])
    cube_map, bits = traced(scene, 8)
    seen = unpack(bits, cube_map.n_directions) > 0
    assert not seen[:, cube_map.samples[:, 2] < 0].any()
    assert not seen[:, cube_map.vectors @ [0.8, 0, 0.6] < 0].any()
    assert seen.any()


def test_blocks_and_batches_do_not_matter():
    scene = Scene.from_meshes([sphere(6, 0.5, (0, 0, 1)), plane(5)])
    cube_map = CubeMap(5)  # 150 directions: the last byte is not full
    caster = caster_of(scene)
    whole = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    caster.batch = 131
    parts = [
        visibility_bits(scene, cube_map, caster, slice(f, f + 7))
        for f in range(0, len(scene.points), 7)
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_relighting_is_linear_and_a_sun_does_no_harm():
    scene = Scene.from_meshes([sphere(6, 0.5, (0, 0, 1)), plane(5)])
    cube_map, bits = traced(scene, 8)
    rng = np.random.default_rng(0)
    dim = rng.random((cube_map.n_directions, 3)).astype(np.float32)
    sun = np.zeros_like(dim)
    sun[300] = 1e5
    parts = [received_light(bits, scene.points.normals, cube_map, x) for x in (dim, sun, dim + sun)]
    np.testing.assert_allclose(parts[2], parts[0] + parts[1], rtol=2e-5, atol=1e-4)


def test_points_that_see_nothing_receive_nothing():
    scene = Scene.from_meshes([plane(5)])
    cube_map, bits = traced(scene, 8)
    sky = np.ones((cube_map.n_directions, 3), np.float32)
    assert not received_light(np.zeros_like(bits), scene.points.normals, cube_map, sky).any()
