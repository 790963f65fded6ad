"""What two states of a scene have in common: objects, bake points, and where they differ."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from prt_core.errors import expect_kind
from prt_core.scene.boxes import Boxes
from prt_core.scene.scene import Scene

# Places are the same within this share of the scene's size: that of rounding.
_SAME = 1e-9
# Normals of the same point, which are kept in float32.
_SAME_NORMAL = 1e-5
# And lengths of what was moved, within that of Blender's matrices.
_SAME_SHAPE = 1e-5
# Objects are this far apart, beyond any distance in a scene.
_APART = 100.0


@dataclass(frozen=True)
class Compared:
    """How a scene differs from what it was.

    Attributes
    ----------
    old_of : (n_points,) int64
        What each of its bake points was before: -1 where it is new.
    triangle_of : (n_old_triangles,) int64
        What each triangle of before is now: -1 where it is no more.
    moved, changed, added, gone : tuple of str
        Objects that rays meet otherwise than before: those that are elsewhere or turned; others
        that are deformed or edited; new ones; those that are there no more.
    before, after : Boxes
        Around the triangles of these where they were, and where they are; in the frame of the
        scene as it is now.
    """

    old_of: np.ndarray
    triangle_of: np.ndarray
    moved: tuple
    changed: tuple
    added: tuple
    gone: tuple
    before: Boxes
    after: Boxes

    def __str__(self):
        parts = [
            f"{', '.join(names[:3])}{' …' if len(names) > 3 else ''} {what}"
            for names, what in (
                (self.moved, "moved"),
                (self.changed, "changed"),
                (self.added, "added"),
                (self.gone, "deleted"),
            )
            if names
        ]
        return "; ".join(parts) or "no object changed"


def compare(old, new):
    """`Compared`: how a scene differs from what it was.

    Objects are those of one name, or, where one was renamed, of the same triangles. Materials
    count only where they let light pass: rays do not ask for anything else.

    Parameters
    ----------
    old, new : Scene
    """
    old, new = (_Seen(expect_kind("scene", scene, Scene)) for scene in (old, new))
    pairs, moved, changed = _pairs(old, new)
    kept_old = np.zeros(len(old.scene.objects), bool)
    kept_new = np.zeros(len(new.scene.objects), bool)
    for mine, other in pairs:
        kept_old[mine] = kept_new[other] = True
    names = [item.name for item in new.scene.objects]
    before = {item.name for item in old.scene.objects}
    added = [n for n, kept in zip(names, kept_new, strict=True) if not kept and n not in before]
    gone = [
        item.name
        for item, kept in zip(old.scene.objects, kept_old, strict=True)
        if not kept and item.name not in (*moved, *changed)
    ]
    frame = new.scene
    return Compared(
        _points(old, new, pairs),
        _triangles(old, new, pairs),
        tuple(moved),
        tuple(changed),
        tuple(added),
        tuple(gone),
        Boxes.around((old.met(~kept_old) - frame.centre) / frame.size),
        Boxes.around((new.met(~kept_new) - frame.centre) / frame.size),
    )


class _Seen:
    """A scene as rays meet it, object by object."""

    def __init__(self, scene):
        self.scene = scene
        n_objects = len(scene.objects)
        self.triangles = _grouped(scene.triangle_object, n_objects)
        self.is_detail = np.zeros(len(scene.points), bool)
        self.is_detail[scene.details.point] = True
        self.points = _grouped(scene.points.object_index, n_objects)
        self.places = scene.to_world(scene.points.positions)

    def corners(self, number):
        """(n, 3, 3) float64: triangles of an object, in the world."""
        scene = self.scene
        corners = scene.vertices[scene.triangles[self.triangles[number]]]
        return scene.centre + scene.size * corners

    def met(self, objects):
        """(n, 3, 3) float64: triangles of all that diffuse rays meet of some objects (bool)."""
        met = [n for n in np.flatnonzero(objects) if self.scene.objects[n].diffuse_rays]
        return np.concatenate([np.zeros((0, 3, 3)), *(self.corners(number) for number in met)])

    def passing(self, number):
        """What of an object's triangles lets light pass: arrays that are compared."""
        opacity, triangles = self.scene.opacity, self.triangles[number]
        if opacity is None or not opacity.passing[triangles].any():
            return ()
        triangles = triangles[opacity.passing[triangles]]
        count = opacity.along[triangles].astype(np.int64) ** 2
        inside = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        sides = (opacity.first, opacity.first_of_back)
        cells = [opacity.cells[np.repeat(side[triangles], count) + inside] for side in sides]
        return opacity.passing[self.triangles[number]], count, *cells


def _grouped(number, n_groups):
    """Places of each number from 0 on, ascending."""
    order = np.argsort(number, kind="stable")
    ends = np.searchsorted(number[order], np.arange(1, n_groups))
    return np.split(order, ends)


def _pairs(old, new):
    """Pairs of objects that are where and what they were; names of moved and changed ones."""
    number = {item.name: index for index, item in enumerate(old.scene.objects)}
    pairs, moved, changed, left = [], [], [], []
    for index, item in enumerate(new.scene.objects):
        mine = number.pop(item.name, None)
        if mine is not None and _alike(old, mine, new, index):
            pairs.append((mine, index))
        else:
            left.append((index, mine))
    # What was renamed is found by what it is.
    free = [mine for _, mine in left if mine is not None] + list(number.values())
    by_size = {}
    for mine in free:
        by_size.setdefault(len(old.corners(mine)), []).append(mine)
    for index, mine in left:
        rivals = by_size.get(len(new.corners(index)), [])
        same = next((other for other in rivals if _alike(old, other, new, index)), None)
        if same is not None:
            rivals.remove(same)
            pairs.append((same, index))
        elif mine is not None:
            of_kind = moved if _is_moved(old, mine, new, index) else changed
            of_kind.append(new.scene.objects[index].name)
    return pairs, moved, changed


def _is_moved(old, mine, new, other):
    """Whether an object has the triangles it had, elsewhere."""
    first, second = old.corners(mine), new.corners(other)
    if first.shape != second.shape:
        return False
    sides = [np.linalg.norm(c - np.roll(c, 1, axis=1), axis=2) for c in (first, second)]
    return np.allclose(*sides, _SAME_SHAPE, _SAME * new.scene.size)


def _alike(old, mine, new, other):
    """Whether rays meet an object of either scene alike."""
    one, two = old.scene.objects[mine], new.scene.objects[other]
    first, second = old.corners(mine), new.corners(other)
    if one.diffuse_rays != two.diffuse_rays or first.shape != second.shape:
        return False
    same = np.array_equal(first, second)
    if not same and not np.allclose(first, second, 0, _SAME * new.scene.size):
        return False
    parts = old.passing(mine), new.passing(other)
    return len(parts[0]) == len(parts[1]) and all(
        np.array_equal(*each) for each in zip(*parts, strict=True)
    )


def _triangles(old, new, pairs):
    """(n_old_triangles,) int64: what triangles of objects in pairs are now, -1 of others."""
    now = np.full(len(old.scene.triangles), -1, np.int64)
    for mine, other in pairs:
        now[old.triangles[mine]] = new.triangles[other]
    return now


def _points(old, new, pairs):
    """(n_points,) int64: what points of objects in pairs were before, -1 where they were not."""
    old_of = np.full(len(new.places), -1, np.int64)
    left_old, left_new = [], []
    for mine, other in pairs:
        one, two = old.points[mine], new.points[other]
        plain_one, plain_two = one[~old.is_detail[one]], two[~new.is_detail[two]]
        rest = one[old.is_detail[one]], two[new.is_detail[two]]
        # In the same order: points at one place that look otherwise are told apart by it.
        if len(plain_one) == len(plain_two) and _same_points(old, plain_one, new, plain_two).all():
            old_of[plain_two] = plain_one
        else:
            rest = one, two
        left_old.append(rest[0])
        left_new.append(rest[1])
    if left_old:
        _match(old, left_old, new, left_new, old_of)
    return old_of


def _same_points(old, one, new, two):
    """(n,) bool: whether points are at the same place and face the same way."""
    near = np.abs(old.places[one] - new.places[two]).max(axis=1, initial=0)
    good = near <= _SAME * new.scene.size
    for name in ("normals", "geometric_normals"):
        first, second = (getattr(s.scene.points, name) for s in (old, new))
        apart = np.abs(first[one] - second[two]).max(axis=1, initial=0)
        good &= apart <= _SAME_NORMAL
    return good


def _match(old, left_old, new, left_new, old_of):
    """Match points of each pair by place and normals; those with a double are not."""
    size = new.scene.size
    one, two = np.concatenate(left_old), np.concatenate(left_new)
    if not len(one) or not len(two):
        return

    def features(seen, points, groups):
        number = np.repeat(np.arange(len(groups)), [len(each) for each in groups])
        p = seen.scene.points
        return np.hstack(
            [
                (seen.places[points] - new.scene.centre) / size,
                # Normals are float32; a thousandth of them is as much as of places.
                1e-4 * p.normals[points],
                1e-4 * p.geometric_normals[points],
                _APART * number[:, None],
            ]
        )

    tree = cKDTree(features(old, one, left_old))
    # float32 of normals, at a ten-thousandth.
    distance, index = tree.query(
        features(new, two, left_new), k=2, distance_upper_bound=2 * _SAME + 1e-4 * _SAME_NORMAL
    )
    single = np.isfinite(distance[:, 0]) & ~np.isfinite(distance[:, 1])
    chosen, place = index[single, 0], two[single]
    claimed = np.bincount(chosen, minlength=len(one))
    alone = claimed[chosen] == 1
    old_of[place[alone]] = one[chosen[alone]]
