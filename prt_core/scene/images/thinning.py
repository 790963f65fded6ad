"""A triangulated sphere thinned out to a tetrahedron, level by level, and the way back.

From each level to the next a set of vertices, no two of which are neighbours, is drawn to a
neighbour each (half-edge collapses, Hoppe 1996): what was the star of the vertex is then a fan
around the neighbour.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.scene.images.closed_surface import triangle_areas

# Neighbours of a vertex that may be taken out. One with five can always be, and always is there.
_MOST_RING, _SURE_RING = 12, 5


@dataclass(frozen=True)
class Level:
    """A mesh, and which of its vertices the next coarser one lacks.

    Attributes
    ----------
    names : (n,) int64
        Its vertices in the whole mesh.
    faces : (m, 3) int64
        Of 0 to n - 1, like all that follows.
    kept : (n - k,) int64
        The vertices of the coarser level, in its order.
    removed : (k,) int64
    rings : (k, width) int64
        The neighbours of each removed vertex, counter-clockwise; -1 where there are no more.
    target : (k,) int64
        Place in the ring of the neighbour that it was drawn to.
    """

    names: np.ndarray
    faces: np.ndarray
    kept: np.ndarray
    removed: np.ndarray
    rings: np.ndarray
    target: np.ndarray


def thin_out(vertices, faces):
    """Levels of a mesh from fine to coarse.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int
        Of a closed surface without handles.

    Returns
    -------
    levels : list of Level
    tetrahedron : (4, 3) int64
        The faces of what is left of the last one.
    """
    levels, names = [], np.arange(len(vertices))
    while len(names) > 4:
        level = _thinner(vertices[names], names, faces)
        levels.append(level)
        drawn = np.arange(len(names))
        drawn[level.removed] = level.rings[np.arange(len(level.removed)), level.target]
        faces = drawn[faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        new = np.full(len(names), -1)
        new[level.kept] = np.arange(len(level.kept))
        faces, names = new[faces], names[level.kept]
    return levels, faces


class Edges:
    """Which vertices of a closed mesh are neighbours, and in which order.

    Parameters
    ----------
    n : int
        Vertices; each has a face.
    faces : (m, 3) int

    Attributes
    ----------
    degree : (n,) int64
        Neighbours of each vertex.
    """

    def __init__(self, n, faces):
        self.n = n
        start = faces.ravel()
        key = start * n + np.roll(faces, -1, axis=1).ravel()
        order = np.argsort(key)
        self._key = key[order]
        self._stop = self._key - start[order] * n
        # What comes after `stop`, around `start`.
        self._next = np.roll(faces, -2, axis=1).ravel()[order]
        self.degree = np.bincount(start, minlength=n)
        self._first = np.cumsum(self.degree) - self.degree

    def has(self, start, stop):
        """Whether there is an edge between two vertices, for arrays of them."""
        key = start * self.n + stop
        place = np.minimum(np.searchsorted(self._key, key), len(self._key) - 1)
        return self._key[place] == key

    def rings(self, chosen):
        """(m, width) neighbours of `some` counter-clockwise, -1 behind the last one."""
        count = self.degree[chosen]
        result = np.full((len(chosen), count.max()), -1)
        result[:, 0] = self._stop[self._first[chosen]]
        for k in range(1, result.shape[1]):
            here = np.flatnonzero(k < count)
            key = chosen[here] * self.n + result[here, k - 1]
            result[here, k] = self._next[np.searchsorted(self._key, key)]
        return result

    def independent(self, rank, allowed, rounds):
        """Vertices no two of which are neighbours, those of low rank first.

        Parameters
        ----------
        rank : (n,) int
            All different.
        allowed : (n,) bool
        rounds : int
            Each takes those of lowest rank among their neighbours that are left.

        Returns
        -------
        (k,) int64
        """
        waiting, chosen = allowed.copy(), np.zeros(self.n, bool)
        for _ in range(rounds):
            value = np.where(waiting, rank, self.n)
            new = waiting & (value < np.minimum.reduceat(value[self._stop], self._first))
            if not new.any():
                break
            chosen |= new
            waiting &= ~new & ~np.logical_or.reduceat(new[self._stop], self._first)
        return np.flatnonzero(chosen)


def _thinner(vertices, names, faces):
    """One `Level`."""
    n = len(names)
    edges = Edges(n, faces)
    star = np.bincount(faces.ravel(), np.repeat(triangle_areas(vertices[faces]), 3), n)
    # Small stars first, and few neighbours: the coarser mesh stays even.
    rank = np.argsort(np.argsort(star * 2.0 ** np.clip(edges.degree - 6, 0, 99), kind="stable"))
    for most in (_MOST_RING, _SURE_RING):
        removed = edges.independent(rank, edges.degree <= most, rounds=2)
        removed = removed[np.argsort(rank[removed])][: n - 4]
        rings = edges.rings(removed)
        target = _targets(vertices, removed, rings, edges)
        good = target >= 0
        if good.any():
            break
    return Level(
        names, faces, np.setdiff1d(np.arange(n), removed[good]),
        removed[good], rings[good], target[good],
    )  # fmt: skip


def _targets(vertices, removed, rings, edges):
    """Place in the ring of the nearest neighbour whose new edges are none yet; -1: none is."""
    count = (rings >= 0).sum(axis=1)
    away = ((vertices[rings] - vertices[removed][:, None]) ** 2).sum(axis=2)
    order = np.argsort(np.where(rings >= 0, away, np.inf), axis=1, kind="stable")
    target = np.full(len(removed), -1)
    owners, keys = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    # A fan's new edges go to all of the ring but the target and the two beside it.
    step = np.arange(2, rings.shape[1] - 1)
    for attempt in range(rings.shape[1]):
        left = np.flatnonzero((target < 0) & (attempt < count))
        at = order[left, attempt]
        real = step < count[left, None] - 1
        end = rings[left[:, None], (at[:, None] + step) % count[left, None]]
        begin = np.broadcast_to(rings[left, at][:, None], end.shape)
        fine = ~(real & edges.has(begin, end)).any(axis=1)
        target[left[fine]] = at[fine]
        usable = real & fine[:, None]
        owners.append(np.broadcast_to(left[:, None], usable.shape)[usable])
        keys.append((np.minimum(begin, end) * edges.n + np.maximum(begin, end))[usable])
    # An edge that several want is made by the first of them, the others stay for this time.
    owner, key = np.concatenate(owners), np.concatenate(keys)
    order = np.lexsort([owner, key])
    target[owner[order[1:][np.diff(key[order]) == 0]]] = -1
    return target
