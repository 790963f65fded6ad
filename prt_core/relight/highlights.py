"""Highlights: what lobes reflect of lamps.

A lamp that looks as wide as lobes are, or wider, is sampled in two ways, by its own surface and by
the lobes, which are weighed by how densely each falls (Veach 1995, the balance heuristic). Where
something hides a part of it, cells of its surface are sampled as much as they are seen (see
`transport.lamp_cells`); in all it brings what is received. A lamp that looks small is one
direction, and lobes are widened by it as by facets that turn.
"""

import numpy as np

from prt_core.light import Lamp
from prt_core.light.lamp_rays import met
from prt_core.reflectance import principled_lobes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points
from prt_core.transport.lamp_cells import warped

# Half the width of a lamp, in parts of the alpha of a lobe, above which it is sampled.
_SMALL = 0.25
# 2**POWER samples of each kind.
POWER = 4
# The share of a lamp that is seen, as samples know it, at most.
_MOST_SEEN = 1.25
# Places worked on at once.
_PART = 1 << 11
# Of the plastic number, for shifts of places that follow one another (Roberts 2018).
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


def highlights(materials, frames, lamp, received, world, outgoing, power=POWER, seen=None):
    """What lobes at k places reflect of a lamp.

    Parameters
    ----------
    materials : Materials
    frames : (k, 3, 3) float
        Tangents and normals.
    lamp : Lamp or BrightPixels
    received : (k, 3) float32
        Irradiance / pi.
    world, outgoing : (k, 3) float
    power : int, optional
        2**power samples of each kind, where the lamp is sampled; those of a picture's samples are
        averaged once more. None: every lamp is one direction.
    seen : (k, side, side) float32, optional
        How much of the cells of a wide lamp each place sees; default: as much of each.

    Returns
    -------
    (k, 3) float
    """
    frames = frames.astype(np.float64)
    view = np.einsum("nx,nkx->nk", outgoing, frames)[:, None]
    direction, angle = lamp.seen_from(world)
    wide = np.zeros(len(world), bool)
    if power is not None and isinstance(lamp, Lamp) and not lamp.is_small:
        wide = angle > _SMALL * narrowest_alpha(materials)
    result = np.zeros((len(world), 3))
    some = np.flatnonzero(~wide)
    if len(some):
        lobes = principled_lobes(_widened(materials[some], angle[some]))
        incoming = np.einsum("nx,nkx->nk", direction[some], frames[some])[:, None]
        result[some] = np.pi * received[some] * lobes.eval(incoming, view[some])[:, 0]

    def one(first):
        part = many[first : first + _PART]
        lobes = principled_lobes(materials[part])
        ways = frames[part], view[part], world[part]
        cells = None if seen is None else seen[part]
        result[part] = _sampled(lobes, lamp, *ways, received[part], power, cells)

    many = np.flatnonzero(wide)
    on_all_cores(one, range(0, len(many), _PART))
    return result


def _sampled(lobes, lamp, frames, view, world, received, power, cells):
    """(k, 3): what lobes reflect of a lamp that gives irradiance / pi (k, 3)."""
    k, m = len(world), 1 << power
    shift = _number(world)[:, None, None] * _STEPS
    uv = (sobol_points(power) + 0.5 / m + shift) % 1
    starts, on_lamp = np.repeat(world, m, axis=0), uv if cells is None else warped(uv, cells)
    ways, _, light = lamp.sample(starts, on_lamp.reshape(-1, 2))
    what = lobes, lamp, starts, frames, view
    own = _Seen(*what, ways.reshape(k, m, 3), cells, light, on_lamp)
    local = lobes.sample(view, 1 - uv[..., ::-1])
    ways = np.einsum("nmk,nkx->nmx", local, frames)
    by_lobes = _Seen(*what, ways, cells)
    arrives = own.brought(1).sum(axis=1)
    reflected = own.brought(own.reflectance) * own.share_of_lamp[..., None]
    # Samples of lobes fall by the density of these; what they meet is radiance.
    rest = by_lobes.brought(by_lobes.reflectance) * (1 - by_lobes.share_of_lamp)[..., None]
    odds = by_lobes.density / np.maximum(by_lobes.by_lobes, 1e-30)
    reflected = reflected.sum(axis=1) + (rest * odds[..., None]).sum(axis=1)
    # Between points more may be received than could arrive, as where a ball turns away.
    there = np.abs(arrives) > 1e-30
    share = np.where(there, np.pi * m * received / np.where(there, arrives, 1), _MOST_SEEN)
    return np.clip(share, 0, _MOST_SEEN) * reflected / m


class _Seen:
    """A lamp along directions (k, m, 3), and what lobes make of it."""

    def __init__(self, lobes, lamp, starts, frames, view, ways, cells, light=None, on_lamp=None):
        shape = ways.shape[:2]
        uv, density = met(lamp, starts, ways.reshape(-1, 3))
        if light is None:
            light = lamp.sample(starts, uv)[2] * (density > 0)[:, None]
        light, density = light.reshape(*shape, 3), density.reshape(shape)
        if cells is not None:
            # Samples fall the more densely the more is seen, and so bring the less.
            mean = np.maximum(cells.mean(axis=(1, 2), dtype=np.float64), 1e-30)[:, None]
            uv = uv.reshape(*shape, 2) if on_lamp is None else on_lamp
            place = np.minimum((uv * cells.shape[1]).astype(np.int64), cells.shape[1] - 1)
            which = np.arange(len(cells))[:, None]
            density = density * cells[which, place[..., 0], place[..., 1]] / mean
            light = light * mean[..., None]
        local = np.einsum("nmx,nkx->nmk", ways, frames)
        self._arriving = light * np.maximum(local[..., 2:], 0)
        self.density, self.by_lobes = density, lobes.pdf(local, view)
        self.reflectance = lobes.eval(local, view)
        both = self.density + self.by_lobes
        self.share_of_lamp = np.where(both > 0, self.density / np.maximum(both, 1e-300), 1)

    def brought(self, factor):
        """(k, m, 3): irradiance of each, times a factor."""
        return self._arriving * factor


def narrowest_alpha(materials):
    """(k,) float: alpha of the narrowest lobe of each of k `Materials`."""
    coat = np.where(materials.coat[:, 0] > 0, materials.coat_roughness[:, 0], 1)
    return np.minimum(materials.roughness[:, 0], coat) ** 2


def _number(world):
    """(k,) int: of a place, the same whoever asks."""
    bits = np.ascontiguousarray(world, np.float32).view(np.uint32).astype(np.uint64)
    mixed = (bits * np.array([2654435761, 2246822519, 3266489917], np.uint64)).sum(axis=1)
    return ((mixed ^ mixed >> np.uint64(15)) & np.uint64(0xFFFFF)).astype(np.int64)


def _widened(materials, angle):
    """`Materials` whose lobes are as wide as they and discs of half angles (k,) together."""
    # A facet that turns by an angle turns what it mirrors by two: half of it, in the mean.
    spread = angle / 2 / np.sqrt(2)
    widened = {
        name: np.minimum(np.sqrt(np.hypot(getattr(materials, name)[:, 0] ** 2, spread)), 1)
        for name in ("roughness", "coat_roughness")
    }
    return materials.replaced(**{name: values[:, None] for name, values in widened.items()})
