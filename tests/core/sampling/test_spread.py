import numpy as np
import pytest

from prt_core import Scene
from prt_core.sampling import Spread
from tests.meshes import plane, sphere


@pytest.fixture(scope="module")
def scene():
    floor, roof = plane(17, name="floor"), plane(17, name="roof", z=0.3)
    return Scene.from_meshes([floor, roof, sphere(4, 0.1, (3, 0, 0), name="bead")])


def known(scene, *objects):
    index = scene.points.object_index
    return np.concatenate([np.flatnonzero(index == number)[::7] for number in objects])


def test_known_points_have_their_own_and_others_a_mean_of_those_around(scene):
    points = known(scene, 0, 1, 2)
    shares = Spread(scene).shares(points)
    dense = shares.toarray()
    np.testing.assert_array_equal(dense[points], np.eye(len(points)))
    np.testing.assert_allclose(dense.sum(axis=1), 1, rtol=1e-6)
    assert dense.min() >= 0
    # What varies evenly over a floor is given back nearly so.
    place = scene.points.positions
    floor = scene.points.object_index == 0
    told = shares @ place[points]
    assert np.abs(told - place)[floor].max() < 0.15 and np.abs(told - place)[floor].mean() < 0.03


def test_points_take_from_their_own_object(scene):
    points = known(scene, 0, 1, 2)
    shares = Spread(scene).shares(points).tocoo()
    index = scene.points.object_index
    assert (index[shares.row] == index[points[shares.col]]).all()


def test_where_none_of_an_object_is_known_the_nearest_that_faces_alike_is_taken(scene):
    points = known(scene, 0, 2)
    shares = Spread(scene).shares(points)
    roof = np.flatnonzero(scene.points.object_index == 1)
    givers = points[shares[roof].tocoo().col]
    assert (scene.points.object_index[givers] == 0).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=1e-6)


def test_of_a_small_object_other_sides_take_from_what_faces_as_they_do():
    beads = [sphere(4, 0.1, (x, 0, 0), name=f"bead {x}") for x in (0, 0.3)]
    scene = Scene.from_meshes([*beads, plane(3, name="floor", z=-3)])
    index, normals = scene.points.object_index, scene.points.normals
    one, other = (np.flatnonzero(index == number) for number in (0, 1))
    top = one[[np.argmax(normals[one, 2])]]
    points = np.concatenate([top, other])
    shares = Spread(scene).shares(points).tocoo()
    takers = np.isin(shares.row, one)
    row, column = shares.row[takers], points[shares.col[takers]]
    facing = np.einsum("mx,mx->m", normals[row], normals[column])
    # Only one point of its own is known, which says nothing of the underside.
    assert facing.min() > -0.1 and (column[normals[row, 2] < -0.5] != top).all()
    assert (column[normals[row, 2] > 0.5] == top).all()


def test_left_out_points_take_nothing_from_themselves(scene):
    points = known(scene, 0, 1)
    some = points[::3]
    shares = Spread(scene).left_out(points, some).toarray()
    assert (shares[np.arange(len(some)), np.searchsorted(points, some)] == 0).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=1e-6)


def test_a_single_known_point_serves_all_but_itself_if_left_out(scene):
    spread, one = Spread(scene), np.array([5])
    np.testing.assert_allclose(spread.shares(one).toarray(), 1)
    assert spread.left_out(one, one).nnz == 0
