"""The field of incoming light: what arrives at glossy points from each block of directions.

Made once a light: for each point and block of texels the mean of the radiance that comes from
there, V L + (1 - V) times what is in the way sends out. The brightest texels are taken out before:
where a sun stands within a block matters, so each of them is asked for by its own visibility bit.
A view is then a few look-ups for each point (see `transport.glossy_view`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from prt_core.errors import expect_array, expect_kind
from prt_core.runtime.halves import halves, wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import Blocks, CubeMap
from prt_core.transport.bright_texels import bits_of
from prt_core.transport.field_nodes import field_nodes
from prt_core.transport.lobe_cuts import detail_of, pieces
from prt_core.transport.places import Places
from prt_core.transport.reflections import Reflections
from prt_core.transport.visibility import expect_bits

# Texels that are taken out at most, and how many times brighter than the mean each of them is.
MOST_BRIGHT, _BRIGHTER = 48, 8.0
# Blocks along the edge of a face for wide lobes and for narrow ones, which begin below a roughness.
_WIDE, _NARROW, _NARROW_BELOW = 8, 16, 0.4
# Bright texels in one cell of a cube map of this are one for wide lobes.
_MERGED = 16
# Texels of light in detail, along the edge of one of the bake's.
FINER = 4
# Points worked on at once: what belongs to them stays in the cache.
_PART = 128


class IncomingField:
    """Light that arrives at glossy points.

    Parameters
    ----------
    reflections : Reflections
    bits : (n_points, n_bytes) uint8
        Visibility of all bake points.

    Attributes
    ----------
    nodes : FieldNodes
        The blocks, and larger ones.
    values : (n, 3, n_nodes) uint16
        Mean radiance of each of them without the bright texels (see `runtime.halves`).
    directions : (n_nodes, 3) float32
        Where that comes from in the mean of all points.
    spread : (n_nodes,) float32
        How far from there it comes: variance along an axis.
    light_map : CubeMap
        Of the light in detail, as fine as the bake's or finer.
    bright : (n_bright,) int32
        Its texels that are apart.
    apart, merged : BrightLight
        What points see of these beyond the rest of their blocks: for views, and with those that lie
        close together as one. In fields of wide blocks both are the same.
    rest : (n_texels, 3) float32
        The light in detail without that.
    mean_light : (n_texels,) float
        What comes from where in the mean of all points, of what the blocks hold.
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
        self.nodes, self._lights = field_nodes(blocks.side), []
        self.values = np.zeros((len(reflections), 3, len(self.nodes)), np.uint16)

    @cached_property
    def open(self):
        """(n, n_blocks) uint8: how much of each block the sky shows in, in 255ths."""
        blocks = self.reflections.blocks

        def one(part):
            share = blocks.pattern_shares(self._patterns(part))
            return np.rint(255 * np.minimum(share, 1)).astype(np.uint8)

        parts = on_all_cores(one, self._parts)
        return np.concatenate([np.zeros((0, len(blocks)), np.uint8), *parts])

    @cached_property
    def _mean_open(self):
        return self.open.mean(axis=0, dtype=np.float64) / 255

    def _patterns(self, part):
        """Bits of some of the points, block by block: quicker to make than they are large."""
        return self.reflections.blocks.patterns(self._bits[self.reflections.points[part]])

    def update(self, light, sent, detailed=None, settled=True):
        """Fill the field in for a light.

        Parameters
        ----------
        light : (n_directions, 3) float32, or None
            Radiance of the sky; None: black.
        sent : (n_points, 3) float32
            What bake points send out to all sides.
        detailed : (n_texels, 3) float32, optional
            The sky on a cube map `FINER` times as fine as the bake's, for narrow lobes.
        settled : bool
            Leave larger blocks to `settle`, which comes later, where not.
        """
        blocks, reflections = self.reflections.blocks, self.reflections
        cube_map = blocks.cube_map
        if light is None:
            light = np.zeros((cube_map.n_directions, 3), np.float32)
        light = expect_array("light", light, (cube_map.n_directions, 3), np.float32)
        sent = expect_array("sent", sent, (len(self._bits), 3), np.float32)
        self.light_map = cube_map
        if detailed is not None:
            self.light_map = CubeMap(FINER * cube_map.resolution)
            shape = self.light_map.n_directions, 3
            light = expect_array("detailed", detailed, shape, np.float32)
        fine = Blocks(self.light_map, blocks.side)
        self.bright, more = bright_texels(light, fine)
        self.rest = light.copy()
        self.rest[self.bright] -= more
        self._details, self._known = {}, {}
        apart = [self._apart(more, self.reflections.blocks.side <= _WIDE)]
        if self.reflections.blocks.side > _WIDE:
            apart.append(self._apart(more, True))
        # Of the bake's own texels what all their parts have.
        texels = Blocks(self.light_map, cube_map.resolution)
        angles = self.light_map.solid_angles[:, None]
        areas = np.repeat(blocks.solid_angles, 256)[:, None]
        n_blocks = len(blocks)
        weighted = texels.sums(self.rest * angles)
        tables = (blocks.pattern_tables(weighted) / areas).astype(np.float32)
        tables = np.ascontiguousarray(tables.swapaxes(1, 2))
        base = 256 * np.arange(n_blocks)
        # Two rows at the end, which negative indices count from, are of what returns no light.
        shining = np.zeros((3, len(sent) + 2), np.float32)
        np.multiply(sent.T, np.float32(1 / 255), out=shining[:, :-2])

        def one(part):
            patterns = self._patterns(part)
            total = np.zeros((len(patterns), 3, n_blocks), np.float32)
            for byte, table in enumerate(tables):
                index = base + patterns[..., byte]
                for channel in range(3):
                    # No index is out of bounds; where that need not be seen to it is quicker.
                    total[:, channel] += table[channel].take(index, mode="wrap")
            places, entries = reflections.places(part, 3 * n_blocks)
            met, share = reflections.met[entries], reflections.share[entries]
            flat = total.reshape(-1)
            for channel in range(3):
                flat[places] += shining[channel].take(met) * share
                places += n_blocks
            self.values[part, :, :n_blocks] = halves(total)
            if settled:
                self.values[part, :, n_blocks:] = halves(self.nodes.larger(total))
            seen = bits_of(self._bits[reflections.points[part]], bright_texel)
            seen = seen.astype(np.float32)
            for light, brought in apart:
                light.values[part] = halves(seen @ brought).reshape(len(seen), 3, -1)
            return total.reshape(-1, n_blocks).sum(axis=0).astype(np.float64)

        self._lights = [light for light, _ in apart]
        self.apart, self.merged = self._lights[0], self._lights[-1]
        bright_texel = cube_map.texel_along(*self.light_map.directions[self.bright].T)
        self._place(sum(on_all_cores(one, self._parts)) / max(3 * len(reflections), 1))

    def resend(self, entries, which, change):
        """Take in what some entries of the reflections send beyond what they did.

        Larger blocks follow in `settle`.

        Parameters
        ----------
        entries : (m,) int
            Ascending.
        which : (m,) int
            Rows of `change`.
        change : (k, 3) float32
            Of radiance towards the points that see it.
        """
        reflections, n_nodes = self.reflections, len(self.nodes)

        def one(part):
            own = reflections.start[[part.start, part.stop]]
            # Of another kind of integer all of them would be copied.
            first, last = np.searchsorted(entries, own.astype(entries.dtype))
            some, values = entries[first:last], self.values[part].reshape(-1)
            places = reflections.places(part, 3 * n_nodes)[0][some - own[0]]
            more = change[which[first:last]]
            more *= reflections.share[some, None] * np.float32(1 / 255)
            for channel in more.T:
                total = wholes(values.take(places))
                total += channel
                # What rounding leaves of light that has gone.
                values[places] = halves(np.maximum(total, 0, out=total))
                places += n_nodes

        on_all_cores(one, self._parts)

    def settle(self):
        """Give larger blocks what `resend` gave to the smallest, after the last of it."""

        def one(part):
            smallest = wholes(self.values[part, :, : self.nodes.first[1]])
            self.values[part, :, self.nodes.first[1] :] = halves(self.nodes.larger(smallest))

        on_all_cores(one, self._parts)

    def _apart(self, more, merged):
        """A `BrightLight`, yet dark, and (n_bright, 3 n_apart) what each texel brings to it."""
        texels = self.light_map.directions[self.bright]
        light = more * self.light_map.solid_angles[self.bright, None]
        near = np.arange(len(texels))
        if merged:
            _, near = np.unique(CubeMap(_MERGED).texel_along(*texels.T), return_inverse=True)
        n = int(near.max(initial=-1)) + 1
        # What is no brighter than the rest of its block has its direction all the same.
        power = np.maximum(light.sum(axis=1, dtype=np.float64), 1e-30)
        sums = np.zeros((n, 3))
        np.add.at(sums, near, power[:, None] * texels)
        lengths = np.linalg.norm(sums, axis=1)
        spread = np.maximum(1 - lengths / np.bincount(near, power, n), 0).astype(np.float32)
        brought = np.zeros((len(texels), 3, n), np.float32)
        brought[np.arange(len(texels)), :, near] = light
        values = np.zeros((len(self.reflections), 3, n), np.uint16)
        directions = (sums / lengths[:, None]).astype(np.float32)
        return BrightLight(directions, spread, values), brought.reshape(len(texels), 3 * n)

    def _place(self, mean):
        """Put nodes where their light is, of what all points see of blocks in the mean."""
        blocks, fine = self.reflections.blocks, Blocks(self.light_map, self.reflections.blocks.side)
        sky = self.rest.mean(axis=1, dtype=np.float64) * self._mean_open[fine.of_texel]
        of_sky = fine.sums(sky * self.light_map.solid_angles) / blocks.solid_angles
        met = np.maximum(mean - of_sky, 0)
        self.mean_light = sky + met[fine.of_texel]
        self.directions, self.spread = self.nodes.placed(self.light_map, self.mean_light)

    def places(self, cut):
        """The `Places` of a `LobeCut` under the light."""
        key = id(cut)
        if key not in self._known:
            self._known[key] = cut, self._places_of(cut)
        return self._known[key][1]

    def _places_of(self, cut):
        parts, core, nodes = cut.parts, cut.core, cut.nodes
        if parts not in self._details:
            side = self.reflections.blocks.side
            fine, order = CubeMap(side * parts), pieces(side, parts)
            self._details[parts] = (
                fine.directions.astype(np.float32)[order],
                fine.solid_angles.astype(np.float32)[order],
                detail_of(self.rest, self.light_map, side, parts),
            )
        ways, angles, detail = (
            array[:, core].reshape(-1, *array.shape[2:]) for array in self._details[parts]
        )
        ways = [ways, self.directions[nodes], self.apart.directions]
        ones = np.ones(len(self.apart.spread), np.float32)
        spread = [angles / np.float32(12), self.spread[nodes], self.apart.spread]
        angles = [angles, self.nodes.solid_angles[nodes], ones]
        return Places(
            np.ascontiguousarray(np.concatenate(ways).T), np.concatenate(angles),
            np.concatenate(spread), core, parts * parts, nodes, detail,
        )  # fmt: skip

    @property
    def nbytes(self):
        """Of the arrays."""
        own = self.values.nbytes + self.open.nbytes
        own += sum(light.values.nbytes for light in self._lights)
        return own + self.reflections.nbytes


@dataclass(frozen=True)
class BrightLight:
    """Bright texels, or groups of them.

    Attributes
    ----------
    directions : (m, 3) float32
        Where their light comes from.
    spread : (m,) float32
        How far from there: variance along an axis.
    values : (n, 3, m) uint16
        What points see of it: radiance times solid angle (see `runtime.halves`).
    """

    directions: np.ndarray
    spread: np.ndarray
    values: np.ndarray


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
