"""A closed surface over the unit sphere, from coarse to fine (Praun & Hoppe 2003).

The surface is thinned out to a tetrahedron. On the way back each vertex enters where it sees all
its neighbours, so that no triangle is flipped, and all vertices move, one at a time among their
neighbours, towards true angles and even areas: ears and fingers get their share of the sphere.
"""

import numpy as np

from prt_core.errors import expect
from prt_core.scene.images.closed_surface import triangle_areas
from prt_core.scene.images.thinning import Edges, thin_out
from prt_core.sphere import tangents

# How much even areas count beside true angles.
_EVEN = 2.0
# Share of a median side's square that is added to all: triangles without area keep some room.
_ROUND = 1e-3
# Visits of every vertex at each level but the last; there, until less than this is gained.
_SWEEPS, _LAST_SWEEPS, _ENOUGH = 12, 60, 1e-4
_HALVINGS = 40


def spherical_positions(name, vertices, faces):
    """Where on the unit sphere each vertex of a closed surface goes.

    Parameters
    ----------
    name : str
        What an error calls it.
    vertices : (n, 3) float64
    faces : (m, 3) int
        Without handles (see `closed_surface`).

    Returns
    -------
    (n, 3) float64
        Unit vectors, for which no face is flipped (see `turned`).

    Raises
    ------
    PRTError
        Rounding errors flipped one all the same.
    """
    levels, tetrahedron = thin_out(vertices, faces)
    place = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(3)
    if turned(place, tetrahedron)[0] < 0:
        place = place[[1, 0, 2, 3]]
    for level in reversed(levels):
        here = _Mesh(vertices[level.names], level.faces)
        place = _inserted(here, place, level)
        stars, before = here.stars(), np.inf
        for _ in range(_LAST_SWEEPS if level is levels[0] else _SWEEPS):
            for star in stars:
                star.move(place)
            now = here.loss(place)
            if now > before * (1 - _ENOUGH):
                break
            before = now
    n_flipped = int((turned(place, faces) <= 0).sum())
    expect(
        not n_flipped,
        f"{name}: {n_flipped:,} triangles are too thin to be laid over a sphere; unwrap the object "
        "and use its UV map",
    )
    return place


def turned(place, faces):
    """(m,) float64: twice the area of each face on the sphere, below zero where it is flipped."""
    a, b, c = (place[faces[:, k]].T for k in range(3))
    return _dot(a, _cross(b - a, c - a))


def evenness(vertices, faces, place):
    """How well the sphere samples the surface.

    Returns
    -------
    efficiency : float
        Of the L2 stretch (Sander et al. 2001): 1 where the map is an isometry but for its scale.
    least : float
        Density of samples on the hundredth of the surface with the fewest, 1 being the mean.
    """
    mesh = _Mesh(vertices, faces, 0.0)
    area = turned(place, faces) / 2
    efficiency = 4 * np.pi / ((mesh.angles(place) / area) @ (mesh.area / area))
    density = area / np.maximum(mesh.area, 1e-30)
    order = np.argsort(density)
    share = np.cumsum(mesh.area[order]) / mesh.area.sum()
    return float(efficiency), float(density[order[np.searchsorted(share, 0.01)]])


class _Mesh:
    """What a mesh over the sphere has to lose: angles that are wrong, and areas.

    For a triangle of sides L and area A on the surface, l and a on the sphere, it is

        (sum of w l^2 + EVEN A^2) / a,    w = (L'^2 + L''^2 - L^2) / 16 of the other two sides.

    The first part is the Dirichlet energy of the way from the sphere to the surface, least where
    angles are kept; the second, summed, is least where areas are. Both grow without bound where a
    triangle of the sphere vanishes, and a triangle of the surface without area is no obstacle.
    """

    def __init__(self, vertices, faces, round_off=_ROUND):
        self.faces, self.n = faces, len(vertices)
        corners = vertices[faces]
        area = triangle_areas(corners)
        scale = 4 * np.pi / area.sum()
        self.area = area * scale
        square = _opposite(corners) * scale
        square += round_off * np.median(square)
        self.weight = (square.sum(axis=1, keepdims=True) - 2 * square) / 16
        self.constant = _EVEN * self.area**2

    def stars(self):
        """A few `_Star` that have every vertex once."""
        edges, left = Edges(self.n, self.faces), np.ones(self.n, bool)
        rank = np.random.default_rng(0).permutation(self.n)
        result = []
        while left.any():
            group = edges.independent(rank, left, self.n)
            left[group] = False
            result.append(_Star(self, group))
        return result

    def angles(self, place):
        """(m,) float64: the sum of w l^2."""
        return (self.weight * _opposite(place[self.faces])).sum(axis=1)

    def loss(self, place):
        """Of all triangles."""
        return float(((self.angles(place) + self.constant) / turned(place, self.faces)).sum() * 2)


class _Star:
    """Vertices that are no neighbours of each other, and the faces around each of them.

    A face is seen from its corner in `some`: `a` and `b` are the other two, in order.
    """

    def __init__(self, mesh, group):
        self.some = group
        local = np.full(mesh.n, -1)
        local[group] = np.arange(len(group))
        of = local[mesh.faces.ravel()]
        corner = np.argsort(of, kind="stable")[np.count_nonzero(of < 0) :]
        face, k = np.divmod(corner, 3)
        self._of = of[corner]
        self._first = np.searchsorted(self._of, np.arange(len(group)))
        self._a, self._b = (mesh.faces[face, (k + j) % 3] for j in (1, 2))
        self._w, self._wa, self._wb = (mesh.weight[face, (k + j) % 3] for j in (0, 1, 2))
        self._constant = mesh.constant[face]

    def around(self, place):
        """What stays while the vertices move: the other corners, and their part of the loss."""
        a, b = place[self._a].T, place[self._b].T
        return a, b, self._w * _dot(a - b, a - b) + self._constant

    def corner_sums(self, a):
        """(3, k): the sum of the neighbours of each vertex."""
        return np.add.reduceat(a, self._first, axis=1)

    def move(self, place, steps=1):
        """Newton steps of each vertex for itself, in place, as far as they lose less.

        In a single vertex the loss is a square over something linear: convex, wherever no face
        is flipped.
        """
        around = self.around(place)
        here = np.ascontiguousarray(place[self.some].T)
        value = self.value(here, *around)
        for _ in range(steps):
            step = self._newton(here, *around)
            left = np.arange(here.shape[1])
            for share in 3.0 ** -np.arange(8):
                tried = _unit(here[:, left] + share * step[:, left])
                values = self.value(tried, *around, left)
                better = values < value[left]
                here[:, left[better]], value[left[better]] = tried[:, better], values[better]
                left = left[~better]
                if not len(left):
                    break
        place[self.some] = here.T

    def value(self, here, a, b, far, subset=None):
        """Loss around each vertex (of `some` of them) at (3, k); infinite where a face flips."""
        w, x, of, first = self._wa, self._wb, self._of, self._first
        if subset is not None and len(subset) < len(first):
            new = np.full(len(first), -1)
            new[subset] = np.arange(len(subset))
            part = np.flatnonzero(new[of] >= 0)
            w, x, of, a, b, far = w[part], x[part], new[of[part]], a[:, part], b[:, part], far[part]
            first = np.searchsorted(of, np.arange(len(subset)))
        v = here[:, of]
        va, vb = a - v, b - v
        area = _dot(v, _cross(va, vb))
        with np.errstate(divide="ignore", invalid="ignore"):
            value = (far + w * _dot(vb, vb) + x * _dot(va, va)) / area
        return np.add.reduceat(np.where(area > 0, value, np.inf), first)

    def _newton(self, here, a, b, far):
        """(3, k): steps in the tangent planes."""
        one, two = (way.T for way in tangents(here.T))
        v, one_v, two_v, cross = here[:, self._of], one[:, self._of], two[:, self._of], _cross(a, b)
        va, vb = a - v, b - v
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 / _dot(v, _cross(va, vb))
            ratio = (far + self._wa * _dot(vb, vb) + self._wb * _dot(va, va)) * share
            slope = -2 * (self._wa * vb + self._wb * va) * share
            bend = 2 * (self._wa + self._wb) * share
            cross = cross * share
            s, t, c, d = (_dot(x, y) for x in (slope, cross) for y in (one_v, two_v))
            parts = [
                s - ratio * c,
                t - ratio * d,
                bend - 2 * s * c + 2 * ratio * c * c,
                bend - 2 * t * d + 2 * ratio * d * d,
                2 * ratio * c * d - s * d - t * c,
            ]
            g, h, gg, hh, gh = np.add.reduceat(np.stack(parts), self._first, axis=1)
            scale = 1 / np.maximum(gg * hh - gh * gh, 1e-12 * gg * hh)
            x, y = (gh * h - hh * g) * scale, (gh * g - gg * h) * scale
            return (x * one + y * two) / np.maximum(np.hypot(x, y), 1)


def _inserted(mesh, coarse, level):
    """Positions of a level from those of the next coarser one.

    What was the star of a removed vertex is a fan around its target, no face of it flipped: so
    the target sees the whole ring, and places near it, to the left of both edges of the ring that
    meet there, see it from inside.
    """
    place = np.empty((mesh.n, 3))
    place[level.kept] = coarse
    count = (level.rings >= 0).sum(axis=1)
    rows = np.arange(len(count))
    at, before, after = (place[level.rings[rows, (level.target + k) % count]].T for k in (0, -1, 1))
    inwards = _unit(_unit(_cross(before, at)) + _unit(_cross(at, after)))
    inwards *= np.sqrt(_dot(after - at, after - at))
    star = _Star(mesh, level.removed)
    around = star.around(place)
    # The middle of the ring sees all of it as a rule.
    best = _unit(star.corner_sums(around[0]))
    value = star.value(best, *around)
    for k in range(_HALVINGS):
        tried = _unit(at + inwards * 0.5**k)
        values = star.value(tried, *around)
        best, value = np.where(values < value, tried, best), np.minimum(values, value)
        if k > 2 and np.isfinite(value).all():
            break
    place[level.removed] = best.T
    star.move(place, 6)
    return place


def _opposite(corners):
    """(m, 3) squares of the sides opposite to each of (m, 3, 3) corners."""
    return ((np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)) ** 2).sum(axis=2)


# Vectors are columns from here on: (3, m).


def _cross(a, b):
    return np.stack([
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
    ])  # fmt: skip


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(v):
    return v / np.sqrt(np.maximum(_dot(v, v), 1e-300))
