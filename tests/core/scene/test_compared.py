"""What two states of a scene have in common."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import Scene
from prt_core.scene import compare, with_backs, with_details
from tests.meshes import plane, sphere, wall

FLOOR = plane(7, name="floor")
BALL = sphere(8, 0.2, (0.5, 0.4, 0.3), name="ball")
SCREEN = wall(0.9, 0.5, 0.7, name="screen")


def scene_of(*meshes):
    return Scene.from_meshes(list(meshes), max_hidden=40)


def moved(mesh, *by, **more):
    return replace(mesh, vertices=mesh.vertices + np.array(by, float), **more)


@pytest.mark.parametrize(
    ("after", "said", "kept"),
    [
        ((FLOOR, BALL, SCREEN), "no object changed", {"floor", "ball", "screen"}),
        ((SCREEN, FLOOR, BALL), "no object changed", {"floor", "ball", "screen"}),
        ((FLOOR, moved(BALL, 0.1, 0, 0), SCREEN), "ball moved", {"floor", "screen"}),
        ((FLOOR, moved(BALL, 0, 0, 2), SCREEN), "ball moved", {"floor", "screen"}),
        ((FLOOR, replace(BALL, vertices=BALL.vertices * 1.2), SCREEN), "ball changed",
         {"floor", "screen"}),
        ((FLOOR, BALL), "screen deleted", {"floor", "ball"}),
        ((FLOOR, BALL, SCREEN, moved(BALL, 0.5, 0, 0, name="cup")), "cup added",
         {"floor", "ball", "screen"}),
        ((FLOOR, replace(BALL, name="egg"), SCREEN), "no object changed",
         {"floor", "egg", "screen"}),
        ((FLOOR, replace(BALL, diffuse_rays=False), SCREEN), "ball moved", {"floor", "screen"}),
    ],
)  # fmt: skip
def test_objects_and_points_are_told_apart(after, said, kept):
    old, new = scene_of(FLOOR, BALL, SCREEN), scene_of(*after)
    compared = compare(old, new)
    assert str(compared) == said
    names = np.array([item.name for item in new.objects])
    mine = np.isin(names[new.points.object_index], sorted(kept))
    shown = new.points.visible
    assert (compared.old_of[mine & shown] >= 0).all() and (compared.old_of[~mine] < 0).all()
    point = np.flatnonzero(compared.old_of >= 0)
    before = compared.old_of[point]
    assert len(np.unique(before)) == len(before)
    np.testing.assert_allclose(
        new.to_world(new.points.positions[point]), old.to_world(old.points.positions[before]),
        atol=1e-8,
    )  # fmt: skip
    known = np.flatnonzero(compared.triangle_of >= 0)
    now = compared.triangle_of[known]
    np.testing.assert_allclose(
        new.to_world(new.vertices[new.triangles[now]].reshape(-1, 3)),
        old.to_world(old.vertices[old.triangles[known]].reshape(-1, 3)),
        atol=1e-8,
    )


def test_boxes_are_where_it_was_and_where_it_is():
    old, new = scene_of(FLOOR, BALL, SCREEN), scene_of(FLOOR, moved(BALL, 0, 0, 2), SCREEN)
    compared = compare(old, new)
    for boxes, up in ((compared.before, 0), (compared.after, 2)):
        low, high = (new.to_world(c) for c in (boxes.low, boxes.high))
        np.testing.assert_allclose(low.min(axis=0), BALL.vertices.min(axis=0) + [0, 0, up])
        np.testing.assert_allclose(high.max(axis=0), BALL.vertices.max(axis=0) + [0, 0, up])
    unseen = replace(BALL, diffuse_rays=False)
    compared = compare(scene_of(FLOOR, unseen), scene_of(FLOOR, moved(unseen, 0.2, 0, 0)))
    assert len(compared.before) == len(compared.after) == 0


def test_backs_and_details_are_matched_by_place():
    scenes = []
    for meshes, turn in (((FLOOR, BALL), 0), ((BALL, moved(SCREEN, 0, 0, 0), FLOOR), 1)):
        scene = scene_of(*meshes)
        number = [item.name for item in scene.objects].index("floor")
        floor = np.flatnonzero(scene.triangle_object == number)
        backs = np.zeros(len(scene.triangles), bool)
        backs[floor[: 20 + 4 * turn]] = True
        scene = with_backs(scene, backs)
        inside = np.array([[0.3, 0.3], [0.2, 0.5], [0.1, 0.1 + 0.2 * turn]])
        scenes.append(with_details(scene, floor[[3, 7, 9]], inside, np.zeros(3, bool)))
    old, new = scenes
    compared = compare(old, new)
    details = compared.old_of[new.details.point]
    assert details.tolist() == [*old.details.point[:2], -1]
    backs = np.unique(new.lattice_back[new.lattice_back >= 0])
    before = np.unique(old.lattice_back[old.lattice_back >= 0])
    assert set(before) <= set(compared.old_of[backs]) and -1 in compared.old_of[backs]
