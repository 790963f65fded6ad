"""Highlights: what lobes reflect of lamps.

A lamp that looks as wide as lobes are, or wider, is sampled in two ways, by its own surface and by
the lobes, which are weighed by how densely each falls (Veach 1995, the balance heuristic). Where
lobes would hardly find it, only its own surface is. Where something hides a part of it, cells of
that are sampled as much as they are seen (see `transport.lamp_cells`); in all it brings what is
received. A lamp that looks small is one direction, and lobes are widened by it as by facets that
turn.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.light import Lamp
from prt_core.light.lamp_rays import met
from prt_core.relight.sampled_lobes import SampledLobes, local
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points
from prt_core.transport.lamp_cells import warped

# Half the width of a lamp, in parts of the alpha of a lobe, above which it is sampled.
_SMALL = 0.25
# 2**POWER samples of each kind.
POWER = 4
# The share of a lamp that is seen, as samples know it, at most.
_MOST_SEEN = 1.25
# Samples of lobes that fall on a lamp, in parts of its own, below which they are left out; of lamps
# within a cone, half of which is this in radians.
_HARDLY, _WIDEST = 0.25, 0.6
# Places worked on at once.
_PART = 1 << 11
# Of the plastic number, for shifts of places that follow one another (Roberts 2018).
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


def highlights(groups, frames, lamp, received, world, outgoing, power=POWER, seen=None):
    """What lobes at k places reflect of a lamp.

    Parameters
    ----------
    groups : list of (alpha, powers)
        Their lobes, (k, 2) and (k, N_POWERS, 3) float32 (see `PointLobes.at`).
    frames : (k, 3, 3) float
        Tangents and normals.
    lamp : Lamp or BrightPixels
    received : (k, 3) float32
        Irradiance / pi.
    world, outgoing : (k, 3) float
    power : int, optional
        2**power samples of each kind, where the lamp is sampled; those of a picture's samples are
        averaged once more. None: every lamp is one direction.
    seen : callable((j,) int) -> (j, side, side) float32, or None; optional
        How much of the cells of a wide lamp some of the places see, by their numbers; None, and by
        default: as much of each.

    Returns
    -------
    (k, 3) float32
    """
    result = np.zeros((len(world), 3), np.float32)
    places = _Places(groups, frames, received, world, outgoing)

    def one(first):
        here = places[first : first + _PART]
        direction, angle = lamp.seen_from(here.world)
        towards = local(direction[:, None], here.frames)
        wide = np.zeros(len(angle), bool)
        if power is not None and isinstance(lamp, Lamp) and not lamp.is_small:
            wide = angle > _SMALL * _narrowest(here.groups)
        some = np.flatnonzero(~wide)
        if len(some):
            result[first + some] = _of_one(here[some], towards[some], angle[some])
        hardly = np.zeros(len(angle), bool)
        if wide.any():
            cone = lamp.cone_from(here.world)
            most = here.lobes.density_within(towards[:, 0], cone)
            hardly = (most * np.pi * angle**2 < _HARDLY) & (cone < _WIDEST)
        for some, both in ((wide & hardly, False), (wide & ~hardly, True)):
            some = np.flatnonzero(some)
            if len(some):
                cells = None if seen is None else seen(first + some)
                result[first + some] = _sampled(here[some], lamp, power, cells, both)

    on_all_cores(one, range(0, len(world), _PART))
    return result


@dataclass(frozen=True)
class _Places:
    """The arguments of `highlights`, of some of the places."""

    groups: list
    frames: np.ndarray
    received: np.ndarray
    world: np.ndarray
    outgoing: np.ndarray

    def __getitem__(self, some):
        groups = [(alpha[some], powers[some]) for alpha, powers in self.groups]
        arrays = self.frames, self.received, self.world, self.outgoing
        return _Places(groups, *(array[some] for array in arrays))

    @property
    def view(self):
        """(k, 3) float32: to the viewer, in the frames."""
        return local(self.outgoing[:, None], self.frames)[:, 0]

    @property
    def lobes(self):
        """Their `SampledLobes`."""
        return SampledLobes(self.groups, self.view)


def _of_one(here, towards, angle):
    """(k, 3): what lobes reflect of a lamp that is one direction (k, 1, 3), of half angles (k,)."""
    # A facet that turns by an angle turns what it mirrors by two: half of it, in the mean.
    spread = (angle / 2 / np.sqrt(2)).astype(np.float32)[:, None]
    widened = [(np.minimum(np.hypot(alpha, spread), 1), powers) for alpha, powers in here.groups]
    light = np.float32(np.pi) * here.received[:, None]
    return SampledLobes(widened, here.view).at(towards).reflected(light)


def _sampled(here, lamp, power, cells, both):
    """(k, 3): what lobes reflect of a lamp that is sampled, and by the lobes where it is `both`."""
    k, m, lobes = len(here.world), 1 << power, here.lobes
    shift = _number(here.world)[:, None, None] * _STEPS
    uv = (sobol_points(power) + 0.5 / m + shift) % 1
    starts, on_lamp = np.repeat(here.world, m, axis=0), uv if cells is None else warped(uv, cells)
    ways, _, light = lamp.sample(starts, on_lamp.reshape(-1, 2))
    incoming = local(ways.reshape(k, m, 3), here.frames)
    along, arriving = lobes.at(incoming), _arriving(light, incoming)
    arrives = arriving.sum(axis=1)
    if both:
        density = met(lamp, starts, ways)[1].reshape(k, m) * _thicker(cells, on_lamp)
        arriving *= _share(density, along.density)[..., None]
    reflected = along.reflected(arriving)
    if both:
        reflected += _found(here, lobes, lamp, starts, 1 - uv[..., ::-1], cells)
    # Between points more may be received than could arrive, as where a ball turns away.
    there = np.abs(arrives) > 1e-30
    share = np.where(there, np.pi * m * here.received / np.where(there, arrives, 1), _MOST_SEEN)
    return np.clip(share, 0, _MOST_SEEN) * reflected / m


def _found(here, lobes, lamp, starts, uv, cells):
    """(k, 3): what samples of lobes find of a lamp beyond what its own samples bring."""
    k, m, _ = uv.shape
    incoming = lobes.sample(uv)
    ways = np.matmul(incoming, here.frames).reshape(-1, 3)
    on_lamp, density = met(lamp, starts, ways)
    there, light = np.flatnonzero(density > 0), np.zeros((k * m, 3))
    light[there] = lamp.sample(starts[there], on_lamp[there])[2]
    density = density.reshape(k, m) * _thicker(cells, on_lamp.reshape(k, m, 2))
    along, arriving = lobes.at(incoming), _arriving(light, incoming)
    # They fall by the density of lobes; what they meet is radiance.
    rest = 1 - _share(density, along.density)
    arriving *= (rest * density / np.maximum(along.density, 1e-30))[..., None]
    return along.reflected(arriving)


def _arriving(light, incoming):
    """(k, m, 3) float32: light (k m, 3) along directions (k, m, 3), on the surfaces."""
    light = light.reshape(incoming.shape).astype(np.float32)
    return light * np.maximum(incoming[..., 2:], 0)


def _thicker(cells, on_lamp):
    """How much more densely samples fall at places (k, m, 2) of a lamp by what is seen of it."""
    if cells is None:
        return 1.0
    place = np.minimum((on_lamp * cells.shape[1]).astype(np.int64), cells.shape[1] - 1)
    here = cells[np.arange(len(cells))[:, None], place[..., 0], place[..., 1]]
    return here / np.maximum(cells.mean(axis=(1, 2)), 1e-30)[:, None]


def _share(density, by_lobes):
    """Of samples that fall by `density` (k, m), where those of lobes fall too."""
    both = density + by_lobes
    return np.where(both > 0, density / np.maximum(both, 1e-300), 1).astype(np.float32)


def _narrowest(groups):
    """(k,) float32: alpha of the narrowest lobe of each place."""
    result = np.float32(1)
    for alpha, powers in groups:
        there = powers.any(axis=(1, 2))
        result = np.minimum(result, np.where(there, np.sqrt(alpha.prod(axis=1)), 1))
    return result


def _number(world):
    """(k,) int: of a place, the same whoever asks."""
    bits = np.ascontiguousarray(world, np.float32).view(np.uint32).astype(np.uint64)
    mixed = (bits * np.array([2654435761, 2246822519, 3266489917], np.uint64)).sum(axis=1)
    return ((mixed ^ mixed >> np.uint64(15)) & np.uint64(0xFFFFF)).astype(np.int64)
