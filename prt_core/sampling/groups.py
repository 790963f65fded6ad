"""Objects that are taken together: instances of one mesh when asking, many small ones otherwise."""

from typing import NamedTuple

import numpy as np

from prt_core.sampling.neighbours import morton

# Objects with more points have neighbours enough of their own.
_ALONE = 2048
# Objects that are certified each for itself, at most; where there are more, small ones are not.
_EACH = 12


class Groups(NamedTuple):
    """Points in groups.

    Attributes
    ----------
    index : (n_points,) int64
    names : dict of int -> str
        What each group is called.
    """

    index: np.ndarray
    names: dict


def alike(scene):
    """Points whose neighbours may be asked about each other.

    An object's own, and where it is small those of all objects of the same mesh: what one of a
    hundred stones sees, the stone beside it often sees as well.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    (n_points,) int64
        Group of each point.
    """
    counts = np.bincount(scene.points.object_index, minlength=len(scene.objects))
    group, known = np.arange(len(scene.objects)), {}
    for number, item in enumerate(scene.objects):
        if 0 < counts[number] <= _ALONE:
            mesh = item.n_vertices, item.corner_vertex.tobytes(), item.face_sizes.tobytes()
            group[number] = known.setdefault(mesh, number)
    return group[scene.points.object_index]


def certified_together(scene):
    """Points whose error is told in one figure: an object's, or that of small ones side by side.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Groups
    """
    index = scene.points.object_index
    counts = np.bincount(index, minlength=len(scene.objects))
    present = np.flatnonzero(counts)
    group = np.arange(len(scene.objects))
    if len(present) > _EACH:
        least = len(index) / _EACH
        small = present[counts[present] < least]
        small = small[_along_a_curve(scene, small)]
        # Stretches of the curve that hold about so many points; each begins with an object of it.
        place = np.floor((np.cumsum(counts[small]) - counts[small]) / least).astype(np.int64)
        _, first, which = np.unique(place, return_index=True, return_inverse=True)
        group[small] = small[first][which.reshape(-1)]
    names = {}
    for number in np.unique(group[present]):
        members = present[group[present] == number]
        more = f" and {len(members) - 1:,} more" if len(members) > 1 else ""
        names[int(number)] = scene.objects[number].name + more
    return Groups(group[index], names)


def _along_a_curve(scene, objects):
    """(n,) int: an order of objects in which those that follow each other are near."""
    index = scene.points.object_index
    counts = np.maximum(np.bincount(index, minlength=len(scene.objects)), 1)
    middles = [np.bincount(index, x, len(counts)) / counts for x in scene.points.positions.T]
    middles = np.stack(middles, axis=1)[objects]
    low = middles.min(axis=0)
    return np.argsort(morton(middles - low, np.ptp(middles, axis=0).max()), kind="stable")
