"""Points on backs: appended, shared as fronts are, and the same as those that are forced."""

import numpy as np

from prt_core.scene import Scene, with_backs
from tests.meshes import plane, sphere


def scenes(**settings):
    return Scene.from_meshes([plane(4, name="sheet", **settings), sphere(3, 0.3, (0, 0, 2))])


def test_backs_that_are_added_are_those_that_are_forced():
    scene, forced = scenes(), scenes(two_sided=True)
    added = with_backs(scene, scene.triangle_object == 0)
    assert (scene.lattice_back == -1).all() and len(added.points) > len(scene.points)
    np.testing.assert_array_equal(added.lattice_back, forced.lattice_back)
    assert added.fingerprint() == forced.fingerprint() != scene.fingerprint()
    again = with_backs(added, scene.triangle_object == 0)
    assert again is added


def test_a_point_has_one_back_whichever_triangle_asks_first():
    scene = scenes()
    sheet = np.flatnonzero(scene.triangle_object == 0)
    first = np.isin(np.arange(len(scene.triangles)), sheet[:3])
    in_two = with_backs(with_backs(scene, first), scene.triangle_object == 0)
    at_once = with_backs(scene, scene.triangle_object == 0)
    assert len(in_two.points) == len(at_once.points)
    owner = np.repeat(np.arange(len(scene.triangles)), scene.lattice_sizes)
    for sided in (in_two, at_once):
        front, back = sided.lattice[owner < len(sheet)], sided.lattice_back[owner < len(sheet)]
        points = sided.points
        np.testing.assert_array_equal(points.positions[front], points.positions[back])
        np.testing.assert_array_equal(points.normals[front], -points.normals[back])
        assert not points.visible[back].any()
        np.testing.assert_array_equal(np.unique(back), np.arange(len(scene.points), len(points)))
    assert (at_once.lattice_back[owner >= len(sheet)] == -1).all()
