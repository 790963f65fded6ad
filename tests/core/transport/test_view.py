"""Directions from points to the viewer: of a place, of a direction, of one for each point."""

import numpy as np
import pytest

from prt_core import Camera, PRTError, Scene, View
from tests.meshes import plane

POINTS = np.random.default_rng(3).normal(size=(5, 3))


def test_a_place_is_seen_along_straight_lines():
    place = np.array([2.0, 3.0, 7.0])
    ways = View(place).outgoing(POINTS)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    away = np.linalg.norm(place - POINTS, axis=1, keepdims=True)
    np.testing.assert_allclose(POINTS + ways * away, np.broadcast_to(place, (5, 3)))


def test_a_view_far_away_is_one_direction_for_all():
    ways = View(direction=[0, 3, 4]).outgoing(POINTS)
    np.testing.assert_allclose(ways, np.broadcast_to([0, 0.6, 0.8], (5, 3)))


def test_each_point_may_have_a_direction_of_its_own():
    given = POINTS[::-1] * 7
    ways = View(direction=given).outgoing(POINTS)
    np.testing.assert_allclose(ways, given / np.linalg.norm(given, axis=1, keepdims=True))
    with pytest.raises(PRTError, match="view: direction: expected an array of shape .4, 3."):
        View(direction=given).outgoing(POINTS[:4])


def test_what_faces_away_is_seen_from_above_at_its_slant():
    normals = np.tile([0.0, 0.6, 0.8], (5, 1))
    view = View([2.0, -1.0, 0.0])
    plain, above = view.outgoing(POINTS), view.above(POINTS, normals).outgoing(POINTS)
    cosine, lifted = plain @ normals[0], above @ normals[0]
    assert (cosine < 0).any() and (cosine > 0).any()
    np.testing.assert_allclose(lifted, np.abs(cosine), atol=1e-12)
    np.testing.assert_allclose(above[cosine > 0], plain[cosine > 0], atol=1e-12)
    with pytest.raises(PRTError, match="normals"):
        view.above(POINTS, normals[:4])


def test_a_camera_looks_from_where_it_stands():
    scene = Scene.from_meshes([plane(3)], max_hidden=0)
    matrix = np.eye(4)
    matrix[:3, 3] = 2, 3, 7
    view = View.of_camera(Camera(matrix, 0.5))
    points = scene.to_world(scene.points.positions)
    np.testing.assert_array_equal(view.outgoing(points), View([2, 3, 7]).outgoing(points))


@pytest.mark.parametrize(
    ("view", "message"),
    [
        (lambda: View(), "view: expected a position or a direction, and not both"),
        (lambda: View([1, 2, 3], [1, 2, 3]), "view: expected a position or a direction, and not"),
        (lambda: View([1, 2]), "view: position: expected an array of shape"),
        (lambda: View(direction=[[0, 0, 1], [0, 0, 0]]), "expected vectors of length above zero"),
        (lambda: View(direction=np.ones((2, 5, 3))), "expected .3,. or .n_points, 3., got .2, 5,"),
        (lambda: View(POINTS[3]).outgoing(POINTS), "view: position: is that of a point"),
    ],
)
def test_what_is_no_view_is_said(view, message):
    with pytest.raises(PRTError, match=message):
        view()


def test_an_orthographic_camera_looks_from_far_away():
    turned = np.array([[1, 0, 0, 5], [0, 0, -1, 6], [0, 1, 0, 7], [0, 0, 0, 1.0]])
    view = View.of_camera(Camera(turned, 2.0, lens="orthographic"))
    np.testing.assert_allclose(view.outgoing(np.eye(3)), [[0, -1, 0]] * 3, atol=1e-12)
