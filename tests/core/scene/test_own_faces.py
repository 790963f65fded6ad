"""Rays below a face of their point: which share of them, in closed form."""

import numpy as np
import pytest

from prt_core.scene import Mesh, Scene
from prt_core.scene.own_faces import OwnFaces


def ridge(degrees, two_sided=False):
    """Two slopes of three triangles that meet smoothly, each so steep; they look up."""
    fall = np.tan(np.deg2rad(degrees))
    vertices = np.array([(0, 0, 0), (0, 1, 0), (0, 3, 0), (1, 1, -fall), (-1, 1, -fall)], float)
    faces = np.array([(0, 3, 1), (1, 3, 2), (0, 1, 4), (1, 2, 4)])
    normals = np.tile([0, 0, 1.0], (faces.size, 1))
    corners, albedo = np.arange(faces.size).reshape(-1, 3), np.full((faces.size, 3), 0.5)
    return Mesh("ridge", vertices, faces.ravel(), normals, corners, albedo, two_sided=two_sided)


def middle_of(scene):
    (points,) = np.nonzero(np.abs(scene.to_world(scene.points.positions) - [0, 1, 0]).max(1) < 1e-6)
    return points


def shares_below(scene, point, ways):
    ways = np.broadcast_to(np.array(ways, np.float32)[:, None], (len(ways), 7001, 3))
    ways = ways.reshape(1, -1, 3)
    part = slice(int(point), int(point) + 1)
    below = OwnFaces(scene).below(part, ways, np.random.default_rng(5))
    return below.reshape(-1, 7001).mean(axis=1)


def test_a_ray_is_below_as_many_of_the_faces_around_as_it_is_in_truth():
    scene = Scene.from_meshes([ridge(40)], max_hidden=0)
    (middle,) = middle_of(scene)
    up, level, along = (0, 0, 1), (0.97, 0, 0.24), (0.1, 0.97, 0.2)
    shares = shares_below(scene, middle, [up, level, along])
    # Of four faces: none, the two of the far slope, none.
    np.testing.assert_allclose(shares, [0, 0.5, 0], atol=4 * np.sqrt(0.25 / 7001))


def test_rays_of_a_back_are_below_what_is_in_front():
    scene = Scene.from_meshes([ridge(40, two_sided=True)], max_hidden=0)
    front, back = middle_of(scene)
    assert scene.points.normals[back, 2] < 0
    shares = shares_below(scene, back, [(0, 0, -1), (-0.97, 0, -0.24), (0, 0, 1)])
    np.testing.assert_allclose(shares, [0, 0.5, 1], atol=4 * np.sqrt(0.25 / 7001))


@pytest.mark.parametrize("degrees, is_bent", [(15, False), (25, True)])
def test_little_bends_do_not_count_and_cost_no_random_numbers(degrees, is_bent):
    scene = Scene.from_meshes([ridge(degrees)], max_hidden=0)
    ways = np.tile(np.float32([0.995, 0, 0.1]), (len(scene.points), 11, 1))
    drawn, fresh = (np.random.default_rng(3) for _ in range(2))
    below = OwnFaces(scene).below(slice(0, len(scene.points)), ways, drawn)
    assert below.any() == is_bent
    assert (drawn.random() == fresh.random()) != is_bent
