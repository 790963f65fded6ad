"""Boxes around what has changed: no ray that meets a triangle passes all of them by."""

import numpy as np
import pytest

from prt_core import Scene
from prt_core.scene.boxes import Boxes
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import unpack
from tests.meshes import caster_of, plane, sphere, wall


def bits_of(boxes, origins, cube_map, **more):
    return unpack(boxes.texels(origins, cube_map, **more), cube_map.n_directions, np.uint8) > 0


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes(
        [
            sphere(8, 0.2, (0.5, 0.4, 0.3), name="ball"),
            wall(0.9, 0.5, 0.7, name="screen"),
            plane(4, -0.3, 0.1, name="leaf", z=0.7),
        ]
    )


@pytest.mark.parametrize("resolution", [5, 8])
def test_rays_that_meet_a_triangle_are_in_no_doubt(scene, resolution):
    cube_map, rng = CubeMap(resolution), np.random.default_rng(3)
    boxes = Boxes.around(scene.vertices[scene.triangles])
    assert 3 <= len(boxes) <= 32
    origins = rng.uniform(-0.9, 0.9, (150, 3)).astype(np.float32)
    origins[:5] = scene.points.positions[:5]
    ways = np.tile(cube_map.samples.astype(np.float32), (len(origins), 1))
    caster = caster_of(scene)
    met = caster.occluded(np.repeat(origins, cube_map.n_directions, axis=0), ways)
    met = met.reshape(len(origins), -1)
    may = bits_of(boxes, origins, cube_map)
    assert not (met & ~may).any()
    # And not many more than do.
    assert may.sum() < 2.5 * met.sum()
    rays = boxes.rays(origins, ways.reshape(len(origins), -1, 3))
    assert not (met & ~rays).any() and (rays != may).mean() < 1e-3


def test_only_what_is_wanted_is_told(scene):
    cube_map = CubeMap(8)
    boxes = Boxes.around(scene.vertices[scene.triangles])
    origins = np.random.default_rng(1).uniform(-0.9, 0.9, (40, 3))
    wanted = np.random.default_rng(2).integers(0, 256, (40, 48), np.uint8)
    wanted[:, ::3] = 0
    every = boxes.texels(origins, cube_map)
    np.testing.assert_array_equal(boxes.texels(origins, cube_map, wanted), every & wanted)


def test_what_lies_apart_gets_boxes_of_its_own():
    near = np.array([[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.1]]])
    boxes = Boxes.around(np.concatenate([near, near + [5, 0, 0]]))
    assert len(boxes) == 2
    np.testing.assert_allclose(np.sort(boxes.low[:, 0]), [0, 5])
    assert len(Boxes.around(np.zeros((0, 3, 3)))) == 0
    moved = boxes.moved(2, np.array([1, 0, 0]))
    np.testing.assert_allclose(np.sort(moved.high[:, 0]), [1.2, 11.2])
    point = np.array([[5.05, 0.05, 0.05], [2, 0, 0]])
    assert boxes.overlap(point, point).tolist() == [True, False]
    assert boxes.grown(30).overlap(point, point).all()


def test_a_ball_is_not_met_at_the_corners_of_its_box():
    ball = Scene.from_meshes([sphere(12, 0.3, name="ball")])
    boxes = Boxes.around(ball.vertices[ball.triangles])
    half = (boxes.high - boxes.low)[0].max() / 2
    assert len(boxes) == 1 and half <= boxes.radius[0] < 1.25 * half
    cube_map = CubeMap(16)
    origins = np.array([[3.0, 2.5, 2.0], [0, -3, 0.3], [0.1, 0, 0]])
    may = bits_of(boxes, origins, cube_map)
    loose = bits_of(Boxes(boxes.low, boxes.high), origins, cube_map)
    assert not (may & ~loose).any() and may[0].sum() < 0.85 * loose[0].sum()
    assert may[2].all()
    rays = boxes.rays(origins, np.tile(cube_map.samples.astype(np.float32), (3, 1, 1)))
    assert (rays != may).mean() < 1e-3
    # What is done to the boxes is done to the balls.
    other = boxes.moved(2, 1.0).joined(Boxes(np.zeros((1, 3)), np.ones((1, 3))))
    np.testing.assert_allclose(other.radius, [2 * boxes.radius[0], np.sqrt(3) / 2])
    assert boxes.grown(0.1).radius[0] > boxes.radius[0]
