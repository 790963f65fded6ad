"""The field of incoming light: what arrives at glossy points from each block of directions.

Made once a light: for each point and block of texels the mean of the radiance that comes from
there, V L + (1 - V) times what is in the way sends out. The brightest texels are taken out before:
where a sun stands within a block matters, so each of them is asked for by its own visibility bit.
A view is then a few look-ups for each point (see `transport.glossy_view`).
"""

from functools import cached_property

import numpy as np

from prt_core.errors import expect_array, expect_kind
from prt_core.runtime.halves import halves
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import Blocks, CubeMap
from prt_core.transport.bright_texels import bits_of
from prt_core.transport.lobe_cuts import COARSER, detail_of
from prt_core.transport.reflections import Reflections
from prt_core.transport.visibility import expect_bits

# Texels that are taken out at most, and how many times brighter than the mean each of them is.
MOST_BRIGHT, _BRIGHTER = 48, 8.0
# Blocks along the edge of a face for wide lobes and for narrow ones, which begin below a roughness.
_WIDE, _NARROW, _NARROW_BELOW = 8, 16, 0.4
# Texels of light in detail, along the edge of one of the bake's.
FINER = 4
# Points worked on at once.
_PART = 1024


class IncomingField:
    """Light that arrives at glossy points.

    Parameters
    ----------
    reflections : Reflections
    bits : (n_points, n_bytes) uint8
        Visibility of all bake points.

    Attributes
    ----------
    values : (n, 3, n_blocks) uint16
        Mean radiance of each block without the bright texels (see `runtime.halves`).
    coarse : (n, 3, n_coarse) uint16
        Of blocks `COARSER` times as wide.
    light_map : CubeMap
        Of the light in detail, as fine as the bake's or finer.
    bright : (n_bright,) int32
        Its texels that are apart.
    bright_light : (n_bright, 3) float32
        What each of them has more than the rest of its block: radiance times solid angle.
    rest : (n_texels, 3) float32
        The light in detail without that.
    """

    def __init__(self, reflections, bits):
        self.reflections = expect_kind("reflections", reflections, Reflections)
        blocks = reflections.blocks
        self._bits = expect_bits("bits", bits, blocks.cube_map.n_directions)
        parts = [
            slice(first, min(first + _PART, len(reflections)))
            for first in range(0, len(reflections), _PART)
        ]
        self._parts = parts
        patterns = on_all_cores(
            lambda part: blocks.patterns(self._bits[reflections.points[part]]), parts
        )
        n_bytes = -(-blocks.n_texels // 8)
        empty = np.zeros((0, len(blocks), n_bytes), np.uint8)
        self._patterns = np.concatenate([empty, *patterns])
        coarse = 6 * max(blocks.side // COARSER, 1) ** 2
        self.values = np.zeros((len(reflections), 3, len(blocks)), np.uint16)
        self.coarse = np.zeros((len(reflections), 3, coarse), np.uint16)

    @cached_property
    def open(self):
        """(n, n_blocks) uint8: how much of each block the sky shows in, in 255ths."""
        blocks = self.reflections.blocks
        angles = blocks.cube_map.solid_angles
        whole = np.maximum(blocks.sums(angles), 1e-30)

        def one(part):
            share = blocks.pattern_sums(self._patterns[part], angles) / whole
            return np.rint(255 * np.minimum(share, 1)).astype(np.uint8)

        parts = on_all_cores(one, self._parts)
        return np.concatenate([np.zeros((0, len(blocks)), np.uint8), *parts])

    def update(self, light, sent, by_entry=None, detailed=None):
        """Fill the field in for a light.

        Parameters
        ----------
        light : (n_directions, 3) float32, or None
            Radiance of the sky; None: black.
        sent : (n_points, 3) float32
            What bake points send out to all sides.
        by_entry : (m, 3) float32, optional
            What is sent towards the points that see it, of every entry of the reflections, where
            that depends on the side from which it is seen.
        detailed : (n_texels, 3) float32, optional
            The sky on a cube map `FINER` times as fine as the bake's, for narrow lobes.
        """
        blocks, reflections = self.reflections.blocks, self.reflections
        cube_map = blocks.cube_map
        if light is None:
            light = np.zeros((cube_map.n_directions, 3), np.float32)
        light = expect_array("light", light, (cube_map.n_directions, 3), np.float32)
        sent = expect_array("sent", sent, (len(self._bits), 3), np.float32)
        if by_entry is not None:
            shape = len(reflections.met), 3
            by_entry = expect_array("by_entry", by_entry, shape, np.float32)
        self.light_map = cube_map
        if detailed is not None:
            self.light_map = CubeMap(FINER * cube_map.resolution)
            shape = self.light_map.n_directions, 3
            light = expect_array("detailed", detailed, shape, np.float32)
        fine = Blocks(self.light_map, blocks.side)
        self.bright, more = bright_texels(light, fine)
        self.bright_light = (more * self.light_map.solid_angles[self.bright, None]).astype(
            np.float32
        )
        self.rest = light.copy()
        self.rest[self.bright] -= more
        self._details, self._bright_bits = {}, None
        # Of the bake's own texels what all their parts have.
        texels = Blocks(self.light_map, cube_map.resolution)
        angles = self.light_map.solid_angles[:, None]
        areas = np.repeat(blocks.solid_angles, 256)[:, None]
        weighted = texels.sums(self.rest * angles)
        tables = (blocks.pattern_tables(weighted) / areas).astype(np.float32)
        base = 256 * np.arange(len(blocks), dtype=np.int32)
        # Two rows at the end, which negative indices count from, are of what returns no light.
        shining = np.zeros((len(sent) + 2, 3), np.float32)
        np.multiply(sent, np.float32(1 / 255), out=shining[:-2])

        def one(part):
            patterns = self._patterns[part]
            total = np.zeros((patterns.shape[0] * len(blocks), 3), np.float32)
            for byte, table in enumerate(tables):
                index = (base + patterns[..., byte]).ravel()
                some = np.flatnonzero(patterns[..., byte].ravel())
                total[some] += table.take(index[some], axis=0)
            places, entries = reflections.places(part)
            share = reflections.share[entries, None]
            if by_entry is None:
                total[places] += shining[reflections.met[entries]] * share
            else:
                total[places] += by_entry[entries] * (share * np.float32(1 / 255))
            total = np.ascontiguousarray(total.reshape(-1, len(blocks), 3).swapaxes(1, 2))
            self.values[part] = halves(total)
            self.coarse[part] = halves(self._coarser(total))

        on_all_cores(one, self._parts)

    def _coarser(self, values):
        """(n, 3, n_coarse) means of (n, 3, n_blocks)."""
        blocks = self.reflections.blocks
        side = max(blocks.side // COARSER, 1)
        step = blocks.side // side

        def sums(array):
            parts = array.reshape(-1, 6, side, step, side, step)
            return parts.sum(axis=(3, 5)).reshape(*array.shape[:-1], 6 * side * side)

        angles = blocks.solid_angles.astype(np.float32)
        return sums(values * angles) / sums(angles)

    def detail(self, parts):
        """What parts of blocks have more of the light than the blocks (see `detail_of`)."""
        if parts not in self._details:
            side = self.reflections.blocks.side
            self._details[parts] = detail_of(self.rest, self.light_map, side, parts)
        return self._details[parts]

    @property
    def bright_directions(self):
        """(n_bright, 3) float64 unit vectors."""
        return self.light_map.directions[self.bright]

    def bright_seen(self, rows):
        """(n, n_bright) bool: which bright texels are seen from points by `rows` (n,)."""
        if self._bright_bits is None:
            cube_map, points = self.reflections.blocks.cube_map, self.reflections.points
            texels = cube_map.texel_along(*self.bright_directions.T)
            self._bright_bits = bits_of(self._bits, texels)[points]
        return self._bright_bits[rows]

    @property
    def nbytes(self):
        """Of the arrays."""
        own = self.values.nbytes + self.coarse.nbytes + self._patterns.nbytes
        return own + self.reflections.nbytes


def sides_of(roughness, resolution):
    """How many blocks along an edge lobes need.

    Parameters
    ----------
    roughness : (n,) float
        The slider.
    resolution : int
        Of the cube map.

    Returns
    -------
    (n,) int
    """
    wide, fine = (divisor(resolution, side) for side in (_WIDE, _NARROW))
    return np.where(np.asarray(roughness) < _NARROW_BELOW, fine, wide)


def divisor(resolution, side):
    """The largest divisor of `resolution` that is `side` at most."""
    return max(n for n in range(1, min(side, resolution) + 1) if resolution % n == 0)


def bright_texels(light, blocks):
    """Texels that are far brighter than the sky in the mean.

    Parameters
    ----------
    light : (n_directions, 3) float32
    blocks : Blocks

    Returns
    -------
    texels : (k,) int32
        By what they bring, at most `MOST_BRIGHT`.
    more : (k, 3) float32
        What each has more than the mean of the other texels of its block.
    """
    cube_map, value = blocks.cube_map, light.max(axis=1)
    power = value * cube_map.solid_angles
    mean = power.sum() / (4 * np.pi)
    chosen = np.flatnonzero(value > _BRIGHTER * mean)
    if len(chosen) > MOST_BRIGHT:
        chosen = chosen[np.argpartition(-power[chosen], MOST_BRIGHT)[:MOST_BRIGHT]]
    chosen = np.sort(chosen).astype(np.int32)
    others = light.astype(np.float64)
    others[chosen] = 0
    weights = np.ones(len(light))
    weights[chosen] = 0
    counts = np.maximum(blocks.sums(weights), 1)
    mean_of_others = (blocks.sums(others) / counts[:, None])[blocks.of_texel[chosen]]
    more = light[chosen] - np.minimum(mean_of_others, light[chosen])
    return chosen, more.astype(np.float32)
