"""What points send towards one viewer, as weights: of what they see of the sky, and of the scene.

A view that stays is linear in the light once and for all. A point's lobe weighs each texel that the
point sees; where something is in the way it weighs what the bake point that stands for it sends
(see `transport.reflections`), which is a weight of what that point receives. Metal that is seen in
a reflection sends a lobe of its own (see `transport.seen_lobes`).
"""

from copy import copy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from prt_core.errors import expect_array, expect_kind
from prt_core.reflectance.fresnel_powers import powers_used
from prt_core.reflectance.mean_gloss import more_by_gloss
from prt_core.sphere import Blocks, CubeMap
from prt_core.transport.lobe_values import lobe_values
from prt_core.transport.mirror import mirrored_share
from prt_core.transport.seen_lobes import SeenLobes, entries_of
from prt_core.transport.sent import Sent
from prt_core.transport.transport import Transport
from prt_core.transport.visibility import UNIT, horizon_bits, unpack

# Lobes are evaluated at so many places along the edge of a texel, by what they are wide.
_PLACES = 1, 2, 4


@dataclass(frozen=True)
class Weights:
    """What some points send towards the viewer.

    Attributes
    ----------
    texels : (n, 3, n_directions) float32
        Of the radiance of each texel of the sky, by channel.
    row, point : (m,) int
        Which of the points sends on what a bake point receives, and whose.
    received : (m, 3) float32
        How much of that, by channel.
    """

    texels: np.ndarray
    row: np.ndarray
    point: np.ndarray
    received: np.ndarray


class ViewWeights:
    """Weights of the light that bake points send towards a viewer.

    Parameters
    ----------
    scene : Scene
    transport : Transport
        Of its points.
    reflections : sequence of Reflections
        What its glossy points see.
    lobes : object
        The lobes of these points, one after the other, as `PointLobes` has them:
        `at(rows, cosine)`, `strength()`, `frames`.
    outgoing : (n_points, 3) float
        Unit vectors towards the viewer.
    mirrors : float
        Alpha below which a lobe is a mirror.
    metal : float
        How much of straight light those reflect that are seen as metal in reflections.
    """

    def __init__(self, scene, transport, reflections, lobes, outgoing, mirrors, metal):
        self._transport = expect_kind("transport", transport, Transport)
        self._scene, self._lobes, self._outgoing = scene, lobes, self._expect_outgoing(outgoing)
        self._reflections, self._mirrors = reflections, mirrors
        self._part = np.full(transport.n_points, -1, np.int32)
        self._row = np.zeros(transport.n_points, np.int64)
        self._first, first = [], 0
        for index, part in enumerate(reflections):
            self._part[part.points] = index
            self._row[part.points] = np.arange(len(part))
            self._first.append(first)
            first += len(part)
        strong = np.zeros(transport.n_points, bool)
        glossy = np.concatenate([part.points for part in reflections])
        strong[glossy] = lobes.strength() > metal
        self._seen = SeenLobes(transport, reflections, lobes, strong)
        sends = transport.sends
        self._through = sends if isinstance(sends, Sent) else None
        shown = sends.albedo if isinstance(sends, Sent) else sends
        self._even = shown - transport.materials.stand_in
        # To others, with what gloss sends in the mean.
        self._front = shown + more_by_gloss(transport.materials)

    def toward(self, outgoing):
        """`ViewWeights` of the same towards another viewer, (n_points, 3) unit vectors."""
        other = copy(self)
        other._outgoing = self._expect_outgoing(outgoing)
        return other

    def _expect_outgoing(self, outgoing):
        shape = self._transport.n_points, 3
        return expect_array("outgoing", outgoing, shape, np.float32, -UNIT, UNIT)

    def of(self, points):
        """The `Weights` of some points, (n,) int."""
        transport, points = self._transport, np.asarray(points)
        texels = np.zeros((len(points), 3, transport.n_directions), np.float32)
        normals, outgoing = transport.normals[points], self._outgoing[points]
        cosine = np.einsum("nx,nx->n", normals, outgoing)
        share = np.ones((len(points), 3), np.float32)
        sums = _Received(self._through)
        part = np.where(cosine > 0, self._part[points], -1)
        for index in np.unique(part[part >= 0]):
            mine = np.flatnonzero(part == index)
            rows = self._row[points[mine]]
            groups, left = self._lobes.at(self._first[index] + rows, cosine[mine])
            share[mine] = left
            weights = self._lobe_weights(self._first[index] + rows, points[mine], groups)
            seen = unpack(transport.bits[points[mine]], transport.n_directions)
            texels[mine] += weights * seen[:, None]
            self._reflected(index, mine, rows, points[mine], weights * (1 - seen)[:, None],
                            texels, sums)  # fmt: skip
        own = np.arange(len(points))
        sums.add(own, points, share * self._even[points], share)
        return Weights(texels, *sums.joined())

    def lobes_at(self, points):
        """Lobes of glossy points towards the viewer, whatever is in their way.

        Parameters
        ----------
        points : (n,) int
            That face the viewer.

        Returns
        -------
        weights : (n, 3, n_directions) float32
            Of the radiance of each texel.
        diffuse : (n, 3) float32
            What they leave of diffuse light, in parts of that of the view from straight above.
        """
        points = np.asarray(points)
        normals, outgoing = self._transport.normals[points], self._outgoing[points]
        cosine = np.einsum("nx,nx->n", normals, outgoing)
        rows = np.asarray(self._first)[self._part[points]] + self._row[points]
        groups, left = self._lobes.at(rows, cosine)
        return self._lobe_weights(rows, points, groups), left

    def _lobe_weights(self, rows, points, groups):
        """(n, 3, n_directions): lobes of points times the cosine and the texels' solid angles."""
        cube_map = self._transport.cube_map
        normals, outgoing = self._transport.normals[points], self._outgoing[points]
        result = np.zeros((len(points), 3, cube_map.n_directions), np.float32)
        for alpha, powers in groups:
            widest = alpha.max(axis=1)
            narrow = widest < self._mirrors
            some = np.flatnonzero(narrow & powers.any(axis=(1, 2)))
            if len(some):
                facing = np.einsum("nx,nx->n", normals[some], outgoing[some])
                ways = 2 * facing[:, None] * normals[some] - outgoing[some]
                result[some, :, cube_map.texel_along(*ways.T)] += mirrored_share(
                    facing, powers[some]
                )
            # Half as wide as a lobe is what its places lie apart, or less.
            wanted = np.pi / 2 / cube_map.resolution / np.maximum(widest, 1e-4)
            kinds = np.searchsorted(_PLACES[:-1], wanted - 1e-3)
            brushed = alpha[:, 0] != alpha[:, 1]
            for kind in np.unique(kinds[~narrow]):
                for apart in (False, True):
                    mine = ~narrow & (kinds == kind) & (brushed == apart)
                    some = np.flatnonzero(mine & powers.any(axis=(1, 2)))
                    if not len(some):
                        continue
                    axes, width = None, alpha[some, 0]
                    if apart:
                        width = np.maximum(alpha[some], self._mirrors)
                        axes = self._lobes.frames[rows[some], :2]
                    result[some] += _on_texels(
                        cube_map, _PLACES[kind], normals[some], outgoing[some], width, axes,
                        powers[some],
                    )  # fmt: skip
        return result

    def _reflected(self, index, mine, rows, points, weights, texels, sums):
        """What is in the way: what it sends, added to what points send themselves."""
        reflections, scene = self._reflections[index], self._scene
        cube_map, blocks = self._transport.cube_map, reflections.blocks
        above = unpack(horizon_bits(scene, cube_map, points), cube_map.n_directions)
        weights *= above[:, None]
        weights = weights[:, :, blocks.texels].sum(axis=3)
        row, entry = entries_of(reflections.start, rows)
        met = reflections.met[entry]
        row, entry, met = (values[met >= 0] for values in (row, entry, met))
        block = reflections.block[entry]
        weight = weights[row, :, block]
        strong = self._seen.strong[met]
        some = ~strong
        sums.add(mine[row[some]], met[some], weight[some] * self._front[met[some]], weight[some])
        if strong.any():
            row, met, weight = row[strong], met[strong], weight[strong]
            sums.add(mine[row], met, weight * self._even[met], weight)
            towards = -blocks.directions[block[strong]].astype(np.float32)
            light, (row, met, weight) = self._seen.weights(row, met, towards, weight, len(mine))
            texels[mine] += light
            sums.add(mine[row], met, weight * self._front[met], weight)


class _Received:
    """Lists of who sends on what which point receives."""

    def __init__(self, through):
        self._through, self._parts = through, []

    def add(self, row, point, weight, reached):
        """Light of the front of points by `weight`; `reached`: of light that comes through them."""
        self._parts.append((row, point, weight))
        if self._through is not None:
            behind = self._through.opposite[point]
            has = behind >= 0
            share = reached[has] * self._through.translucency[point[has]]
            self._parts.append((row[has], behind[has], share))

    def joined(self):
        """(rows, points, weights) of all."""
        return (np.concatenate(each) for each in zip(*self._parts, strict=True))


def _on_texels(cube_map, places, normals, outgoing, alpha, axes, powers):
    """(n, 3, n_directions): lobes times their Fresnel terms, over each texel."""
    directions, angles = _inside_texels(cube_map.resolution, places)
    n_powers = powers_used(powers)
    values = lobe_values(directions, normals, outgoing, alpha, axes, n_powers)
    parts = []
    for value in values:
        value *= angles
        parts.append(value.reshape(len(value), places**2, -1).sum(axis=1))
    factors = powers[:, :n_powers].swapaxes(1, 2)
    return np.maximum(np.matmul(factors, np.stack(parts, axis=1)), 0)


@lru_cache(maxsize=8)
def _inside_texels(resolution, places):
    """Directions (3, m) inside texels, one of each of them after the other, and solid angles."""
    fine = CubeMap(resolution * places)
    order = Blocks(fine, resolution).texels.T.ravel()
    directions = np.ascontiguousarray(fine.directions[order].T, np.float32)
    return directions, fine.solid_angles[order].astype(np.float32)
