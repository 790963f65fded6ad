"""Boxes around what has changed, and which rays may meet them.

What a point sees along a direction can only have changed where its ray meets a place that has
changed. Such places are kept in a few boxes; the rays that pass all of them by are as they were.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from prt_core.errors import expect_array, expect_kind
from prt_core.rays import boxes_around
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap

# Boxes at most, and how much of a box's surface a cut in two has to save.
_MOST, _SAVES = 32, 0.1
# Where along each axis it may be cut, and cells of the grid that many triangles are put into.
_PLANES, _GRID = 4, 12
# Rays start off the surface, and in float32: boxes are so much larger, of their frame.
_MARGIN = 1e-4
# Points, and bytes of their directions, worked on together: what they take stays in the cache.
_BLOCK, _TOGETHER = 256, 4096
# One through a component of a direction, at most: a ray along a face of a box is limited by neither
# of the two planes, and no product is 0 times infinity.
_STEEPEST = np.float32(1e30)


@dataclass(frozen=True)
class Boxes:
    """Axis-aligned boxes, with a ball about the middle of each: what they hold is in both.

    Attributes
    ----------
    low, high : (n, 3) float64
        Their corners, in the frame of the rays.
    radius : (n,) float64
        Of the balls; default: half the diagonals.
    """

    low: np.ndarray
    high: np.ndarray
    radius: np.ndarray | None = None

    def __post_init__(self):
        for name in ("low", "high"):
            corners = expect_array(name, getattr(self, name), (len(self.low), 3), np.float64)
            object.__setattr__(self, name, corners)
        most = np.linalg.norm(self.high - self.low, axis=1) / 2
        radius = most if self.radius is None else np.minimum(self.radius, most)
        object.__setattr__(self, "radius", radius)

    def __len__(self):
        return len(self.low)

    @classmethod
    def none(cls):
        """No box."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)))

    @classmethod
    def around(cls, corners):
        """Few boxes that hold triangles: cut in two where that leaves out much of a box.

        Parameters
        ----------
        corners : (n, 3, 3) float
            Of the triangles.
        """
        corners = np.asarray(corners, np.float64).reshape(-1, 3, 3)
        if not len(corners):
            return cls.none()
        low, high = _gathered(corners.min(axis=1), corners.max(axis=1))
        middle = (low + high) / 2
        root = _Node(np.arange(len(low)), low, high)
        leaves = [root]
        while 0 < len(leaves) < _MOST:
            # The largest first.
            leaf = max(leaves, key=lambda node: node.surface if node.can_be_cut else -1)
            if not leaf.can_be_cut:
                break
            parts = _cut(leaf.members, low, high, middle)
            leaf.can_be_cut = False
            if parts:
                leaf.children = [_Node(part, low, high) for part in parts]
                leaves = [node for node in leaves if node is not leaf] + leaf.children
        _, members = root.best()
        return cls(*zip(*(_around(low[part], high[part]) for part in members), strict=True))

    def joined(self, other):
        """These and others.

        Parameters
        ----------
        other : Boxes
        """
        return Boxes(
            np.vstack([self.low, other.low]),
            np.vstack([self.high, other.high]),
            np.append(self.radius, other.radius),
        )

    def moved(self, scale, shift):
        """The boxes at `scale` times their place and a `shift`, a number and (3,) float."""
        return Boxes(self.low * scale + shift, self.high * scale + shift, self.radius * scale)

    def grown(self, share):
        """The boxes, larger on all sides by a share of their diagonals."""
        more = share * np.linalg.norm(self.high - self.low, axis=1, keepdims=True)
        return Boxes(self.low - more, self.high + more, self.radius + np.sqrt(3) * more[:, 0])

    def overlap(self, low, high):
        """Which of other boxes these overlap.

        Parameters
        ----------
        low, high : (m, 3) float
            Their corners.

        Returns
        -------
        (m,) bool
        """
        result = np.zeros(len(low), bool)
        for mine_low, mine_high in zip(self.low - _MARGIN, self.high + _MARGIN, strict=True):
            result |= ((low <= mine_high) & (high >= mine_low)).all(axis=1)
        return result

    def rays(self, origins, directions):
        """Which rays may meet a box.

        Parameters
        ----------
        origins : (n, 3) float
        directions : (n, k, 3) float
            Of the rays of each.

        Returns
        -------
        (n, k) bool
        """
        directions = np.ascontiguousarray(directions, np.float32)
        result = np.zeros(directions.shape[:2], bool)
        flat, ways = result.reshape(-1), directions.reshape(-1, 3)
        for box in self._each():
            near, far, radius = _seen_from(*box, origins)
            unit, angle, inside = _ball(near, far, radius)
            may = np.matmul(directions, unit[:, :, None])[:, :, 0] >= np.cos(angle)[:, None]
            place = np.flatnonzero((may | inside[:, None]) & ~result)
            row = place // directions.shape[1]
            inverses = _inverse(ways[place].T)[:, :, None]
            flat[place] = _meets(near[row], far[row], inverses)[:, 0]
        return result

    def _each(self):
        """Low and high corner, and radius, of each."""
        return zip(self.low, self.high, self.radius, strict=True)

    def texels(self, origins, cube_map, wanted=None):
        """The directions of a cube map whose rays from points may meet a box.

        Parameters
        ----------
        origins : (n, 3) float
        cube_map : CubeMap
        wanted : (n, ceil(n_directions / 8)) uint8, optional
            Where it is 0 nobody asks, and the result is 0 as well.

        Returns
        -------
        (n, ceil(n_directions / 8)) uint8
            In the order of visibility bits.
        """
        expect_kind("cube_map", cube_map, CubeMap)
        middle, spread, samples, inverses = _bytes_of(cube_map.resolution)
        result = np.zeros((len(origins), len(middle)), np.uint8)

        def one(first):
            part = slice(first, first + _BLOCK)
            flat = result[part].reshape(-1)
            for box in self._each():
                near, far, radius = _seen_from(*box, origins[part])
                unit, angle, inside = _ball(near, far, radius)
                may = _may_meet(unit, angle, inside, middle, spread)
                if wanted is not None:
                    may &= wanted[part] != 0
                place = np.flatnonzero(may)
                # What another box has filled needs no second look.
                place = place[flat[place] != 255]
                for start in range(0, len(place), _TOGETHER):
                    some = place[start : start + _TOGETHER]
                    row, byte = np.divmod(some, len(middle))
                    met = _meets(near[row], far[row], inverses.take(byte, axis=1))
                    met &= inside[row, None] | (
                        np.einsum("mx,xmk->mk", unit[row], samples.take(byte, axis=1))
                        >= np.cos(angle[row])[:, None]
                    )
                    flat[some] |= np.packbits(met, axis=1, bitorder="little")[:, 0]

        with one_blas_thread():
            on_all_cores(one, range(0, len(origins), _BLOCK))
        if wanted is not None:
            result &= wanted
        last = cube_map.n_directions % 8
        if last:
            result[:, -1] &= np.uint8((1 << last) - 1)
        return result


def _gathered(low, high):
    """The boxes of triangles, or of those in each cell of a grid where they are many."""
    if len(low) <= _GRID**3:
        return low, high
    middle = (low + high) / 2
    start, extent = middle.min(axis=0), np.ptp(middle, axis=0)
    cell = np.minimum((middle - start) / np.maximum(extent, 1e-300) * _GRID, _GRID - 1)
    number = np.ravel_multi_index(cell.astype(np.int64).T, (_GRID,) * 3)
    low, high = boxes_around(number, low, high)
    there = np.isfinite(low[:, 0])
    return low[there], high[there]


class _Node:
    """Some boxes, and the parts that they may be cut into."""

    def __init__(self, members, low, high):
        self.members, self.children = members, []
        self.surface = _surface(low[members], high[members])
        self.can_be_cut = len(members) > 1

    def best(self):
        """(surface, parts): one box, or those of the children where these save enough."""
        if self.children:
            (one, first), (two, second) = (child.best() for child in self.children)
            if one + two < (1 - _SAVES) * self.surface:
                return one + two, first + second
        return self.surface, [self.members]


def _surface(low, high):
    """Of the box around boxes, as far as it is seen from all sides."""
    x, y, z = high.max(axis=0) - low.min(axis=0)
    return x * y + y * z + z * x


def _cut(members, low, high, middle):
    """Two parts of the members of a box, the smallest that a plane makes; none where none does."""
    best, parts = np.inf, []
    places = middle[members]
    start, extent = places.min(axis=0), np.ptp(places, axis=0)
    for axis in range(3):
        for step in range(1, _PLANES):
            first = places[:, axis] < start[axis] + extent[axis] * step / _PLANES
            if not first.any() or first.all():
                continue
            cut = [members[first], members[~first]]
            surface = sum(_surface(low[part], high[part]) for part in cut)
            if surface < best:
                best, parts = surface, cut
    return parts


def _around(low, high):
    """Low and high corner of the box around boxes, and how far from its middle they reach."""
    first, last = low.min(axis=0), high.max(axis=0)
    middle = (first + last) / 2
    reach = np.maximum(np.abs(low - middle), np.abs(high - middle))
    return first, last, np.linalg.norm(reach, axis=1).max()


def _seen_from(low, high, radius, origins):
    """(n, 3) float32 twice: the corners of a box from points, with its margin; and its ball's."""
    margin = _MARGIN * max(1.0, float(np.abs([low, high]).max()))
    origins = np.asarray(origins, np.float64)
    return (
        (low - margin - origins).astype(np.float32),
        (high + margin - origins).astype(np.float32),
        np.float32(radius + 2 * margin),
    )


def _meets(near, far, inverses):
    """(n, k) bool: whether rays from zero meet boxes, (n, 3) each; `inverses` (3, n, k) are one
    through each component of their directions."""
    enter, leave = np.float32(0), np.float32(np.inf)
    for axis, inverse in enumerate(inverses):
        one, other = near[:, axis, None] * inverse, far[:, axis, None] * inverse
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other, out=one), out=one)
    return enter <= leave


@lru_cache(4)
def _bytes_of(resolution):
    """Of each byte the middle of its directions, the largest angle to it, they, and 1 / them."""
    cube_map = CubeMap(resolution)
    n_bytes = -(-cube_map.n_directions // 8)
    samples = np.resize(cube_map.samples, (8 * n_bytes, 3))
    # The last byte is filled up with its own.
    samples[cube_map.n_directions :] = cube_map.samples[-1]
    samples = samples.reshape(n_bytes, 8, 3)
    middle = samples.mean(axis=1)
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-9)
    cosine = np.einsum("bx,bkx->bk", middle, samples).min(axis=1)
    return (
        middle.astype(np.float32),
        np.arccos(np.clip(cosine, -1, 1)).astype(np.float32),
        np.ascontiguousarray(np.moveaxis(samples.astype(np.float32), 2, 0)),
        np.ascontiguousarray(np.moveaxis(_inverse(samples.astype(np.float32)), 2, 0)),
    )


def _inverse(values):
    """One through each of some values; `_STEEPEST` at most, with their sign."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.clip(1 / values, -_STEEPEST, _STEEPEST)


def _ball(near, far, radius):
    """The ball about the middle of a box as points see it.

    Returns
    -------
    unit : (n, 3) float32
        Towards its middle.
    angle : (n,) float32
        Between that and its rim.
    inside : (n,) bool
        Whether the point lies in it.
    """
    centre = (near + far) / 2
    away = np.maximum(np.linalg.norm(centre, axis=1), np.float32(1e-30))
    inside = away <= radius * np.float32(1.0001)
    angle = np.arcsin(np.clip(radius / away, 0, 1)) + np.float32(1e-3)
    return centre / away[:, None], angle, inside


def _may_meet(unit, angle, inside, middle, spread):
    """(n, n_bytes) bool: whether a ball (see `_ball`) may be met along a byte's directions."""
    # The angle between is at most the sum of both where its cosine is at least that of the sum:
    # cos(a + b) = cos a cos b - sin a sin b, all in one product.
    mine = np.column_stack([unit, -np.cos(angle), np.sin(angle)]).astype(np.float32)
    theirs = np.column_stack([middle, np.cos(spread), np.sin(spread)]).astype(np.float32)
    return (mine @ theirs.T >= 0) | inside[:, None]
