"""Lobes of metal that is seen in reflections, as weights of the light.

As glimpses (see `transport.glimpse`) such lobes are not summed as for a viewer: they are evaluated
at the middles of blocks, for some of what a point sees of metal, and one of the bake points that
stand in the way of each stands for all of them, as often as it has weight.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_used
from prt_core.transport.glimpse import LEAST, lifted
from prt_core.transport.lobe_values import lobe_values
from prt_core.transport.visibility import unpack

# What a point sees of metal, at most, and lobes worked on at once.
_MOST, _AT_ONCE = 8, 32
_GOLDEN = 0.6180339887498949


class SeenLobes:
    """Lobes of metal towards those who see it.

    Parameters
    ----------
    transport : Transport
    reflections : sequence of Reflections
    lobes : object
        See `ViewWeights`.
    strong : (n_points,) bool
        Which points are metal.

    Attributes
    ----------
    strong : (n_points,) bool
    """

    def __init__(self, transport, reflections, lobes, strong):
        self.strong = strong
        self._transport, self._reflections, self._lobes = transport, reflections, lobes
        self._part = np.full(transport.n_points, -1, np.int32)
        self._row = np.zeros(transport.n_points, np.int64)
        self._first, first = [], 0
        for index, part in enumerate(reflections):
            self._part[part.points], self._row[part.points] = index, np.arange(len(part))
            self._first.append(first)
            first += len(part)

    def weights(self, row, point, towards, weight, n):
        """What the lobes of points bring to those who see them.

        Parameters
        ----------
        row : (k,) int
            Who sees them, ascending.
        point : (k,) int
            Points that are metal.
        towards : (k, 3) float32
            From them to who sees them.
        weight : (k, 3) float32
            How much it sends on.
        n : int
            How many there are who may see some.

        Returns
        -------
        texels : (n, 3, n_directions) float32
        row, point, weight
            Of bake points whose radiance is seen in metal, and (m, 3) weights of that.
        """
        row, point, towards, weight = _some(row, point, towards, weight)
        texels = np.zeros((n, 3, self._transport.n_directions), np.float32)
        found = []
        for index in np.unique(self._part[point]):
            mine = np.flatnonzero(self._part[point] == index)
            for first in range(0, len(mine), _AT_ONCE):
                some = mine[first : first + _AT_ONCE]
                part = row[some], point[some], towards[some], weight[some]
                found.append(self._of_part(index, *part, texels))
        nothing = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3), np.float32)
        joined = [np.concatenate(each) for each in zip(nothing, *found, strict=True)]
        return texels, joined

    def _of_part(self, index, row, point, towards, weight, texels):
        reflections, transport = self._reflections[index], self._transport
        blocks, rows = reflections.blocks, self._row[point]
        normals = transport.normals[point]
        towards = lifted(towards, normals)
        cosine = np.einsum("kx,kx->k", towards, normals)
        directions = np.ascontiguousarray(blocks.directions.T, np.float32)
        lobe = np.zeros((len(row), 3, len(blocks)), np.float32)
        for alpha, powers in self._lobes.at(self._first[index] + rows, cosine)[0]:
            width = np.maximum(np.sqrt(alpha.prod(axis=1)), LEAST)
            n_powers = powers_used(powers)
            values = np.stack(
                lobe_values(directions, normals, towards, width, None, n_powers), axis=1
            )
            factors = powers[:, :n_powers].swapaxes(1, 2)
            lobe += np.maximum(np.matmul(factors, values), 0)
        lobe *= weight[:, :, None]
        angles = transport.cube_map.solid_angles.astype(np.float32)
        seen = unpack(transport.bits[point], transport.n_directions) * angles
        spread = lobe[:, :, blocks.of_texel]
        spread *= seen[:, None]
        first = np.flatnonzero(np.diff(row, prepend=-1))
        texels[row[first]] += np.add.reduceat(spread, first, axis=0)
        return self._in_the_way(reflections, row, rows, point, lobe)

    def _in_the_way(self, reflections, row, rows, point, lobe):
        """One of what stands in the way of each lobe, for all of it."""
        who, entry = entries_of(reflections.start, rows)
        block, met = reflections.block[entry], reflections.met[entry]
        share = reflections.share[entry] * (reflections.blocks.solid_angles[block] / 255)
        brings = lobe[who, :, block] * share[:, None].astype(np.float32)
        brings[met < 0] = 0
        chance = brings.sum(axis=1, dtype=np.float64)
        sums = np.bincount(who, chance, len(rows))
        ends = np.cumsum(chance)
        start = np.concatenate([[0.0], ends])[np.searchsorted(who, np.arange(len(rows)))]
        some = np.flatnonzero(sums > 0)
        wanted = start + sums * (((point + 7 * row) * _GOLDEN) % 1)
        pick = np.minimum(np.searchsorted(ends, wanted[some], side="right"), len(ends) - 1)
        good = (who[pick] == some) & (chance[pick] > 0)
        some, pick = some[good], pick[good]
        weight = brings[pick] * (sums[some] / chance[pick])[:, None]
        return row[some], met[pick], weight.astype(np.float32)


def entries_of(start, rows):
    """Entries of some rows of a table whose rows begin at `start`.

    Parameters
    ----------
    start : (n + 1,) int
    rows : (k,) int

    Returns
    -------
    which : (m,) int
        Of the k.
    entry : (m,) int
    """
    counts = start[rows + 1] - start[rows]
    which = np.repeat(np.arange(len(rows)), counts)
    before = np.cumsum(counts) - counts
    return which, np.arange(len(which)) + np.repeat(start[rows] - before, counts)


def _some(row, point, towards, weight):
    """At most `_MOST` of each row, by weight, which then stand for all."""
    value = weight.sum(axis=1, dtype=np.float64)
    kept = value > 0
    row, point, towards, weight, value = (x[kept] for x in (row, point, towards, weight, value))
    if not len(row):
        return row, point, towards, weight
    first = np.flatnonzero(np.diff(row, prepend=-1))
    counts = np.diff(first, append=len(row))
    chosen, factor = [], []
    for start, count in zip(first, counts, strict=True):
        if count <= _MOST:
            chosen.append(np.arange(start, start + count))
            factor.append(np.ones(count))
            continue
        ends = np.cumsum(value[start : start + count])
        places = (np.arange(_MOST) + point[start] * _GOLDEN % 1) / _MOST * ends[-1]
        pick = start + np.minimum(np.searchsorted(ends, places, side="right"), count - 1)
        chosen.append(pick)
        factor.append(ends[-1] / (_MOST * value[pick]))
    chosen, factor = np.concatenate(chosen), np.concatenate(factor).astype(np.float32)
    return row[chosen], point[chosen], towards[chosen], weight[chosen] * factor[:, None]
