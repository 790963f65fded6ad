"""Pictures of a bake under way: what it knows by now, as a bake that can be relit.

A first look comes before all else: few points, spread evenly over the surface, with half as many
directions along an edge. Then the sampler's levels tell more and more (see `LevelDone`), until
every row is known, and after that the rounds of bounce rays. A point that is not known takes from
those around it, and bounces come from few rays of few points (see `transport.partial`). Random
numbers of pictures are their own, and none of their rays is counted or kept: the bake is the same
without them.
"""

import time
from dataclasses import dataclass

import numpy as np

from prt_core.bake.bake import Bake
from prt_core.bake.coarse import Coarse
from prt_core.bake.emission import Emission
from prt_core.errors import expect_flag, expect_number
from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling import Spread
from prt_core.sampling.neighbours import surface_levels
from prt_core.sphere import CubeMap
from prt_core.transport import SpreadGather, visibility_bits

# Points of the first look; of those that gather light and serve while the light moves, at most;
# and of a picture before all are known, at most.
_FIRST, _COARSE, _MOST = 1000, 4096, 16384
# Bytes of all rows beyond which they are not held for pictures before the last.
_MOST_BYTES = 1 << 29
# A picture of a level has so many times the points of the one before; the power of the points that
# are known by which the seconds of pictures grow (4 % of 60,000: 0.11 s to show, all: 0.55 s).
_MORE, _COST = 2.5, 0.5


@dataclass
class PartialBake(Bake):
    """What a bake under way knows: a `Bake` that relights, without gloss.

    Attributes
    ----------
    scene, transport, lamps, world, camera, settings, report, source, path, origin
        As those of a `Bake`; the transport is a `PartialTransport`, the report is empty, and it
        has no path.
    dense, emission, reflections, cameras, world_image, view_transform
        As those of a `Bake`: no dense points, and no gloss.
    known_percent : float
        Of the points: those whose rows are known.
    error : float
        Estimate of the relative L2 error of radiance, under an even sky and two soft suns, the
        worst: of what points take from others, and of the bounces.
    coarse : PartialBake, or None
        The same from few points, for light that moves; None where that is what it is.
    """

    known_percent: float = 0.0
    error: float = 1.0
    coarse: "PartialBake | None" = None


class Pictures:
    """Hands out what a bake knows while it runs (see `bake_steps`); for one bake.

    Whoever looks on calls `take`, from any thread.

    Parameters
    ----------
    share : float, optional
        Of the time of the bake so far: where pictures after the first, with what `spent` is told
        of and another one, would take more of it, that one waits; the second comes in any case.
        Default: every picture is made.
    to_the_end : bool
        Whether the last picture is that of the finished bake, bit for bit.
    """

    def __init__(self, share=None, to_the_end=True):
        self._share = None if share is None else expect_number("share", share, above=0, below=1)
        self.to_the_end = expect_flag("to_the_end", to_the_end)
        self._began, self._spent = time.perf_counter(), 0.0
        self._latest = self._coarse = self._bits = self._emission = self._blocks = None
        self._n_shown = self._count = 0
        # What the newest picture took, and of how many points it was.
        self._last = 0.0, 1

    def take(self):
        """The newest `PartialBake` that was not taken yet, or None."""
        latest, self._latest = self._latest, None
        return latest

    def spent(self, seconds):
        """Showing a picture took so many seconds of the bake's time."""
        self._last = self._last[0] + seconds, self._last[1]
        # There is always a first one, whatever it takes.
        self._spent += seconds if self._count > 1 else 0

    def begin(self, scene, cube_map, settings, caster, beside, joined=False):
        """The scene is known, and looked at for the first time, unless it has been.

        Parameters
        ----------
        scene : Scene
        cube_map : CubeMap
        settings : BakeSettings
        caster : RayCaster
        beside : Beside
        joined : bool
            Whether the bake's own rows are to join those of the first look (see `block`).
        """
        self._given, self._beside = (cube_map, settings, caster), beside
        if self._coarse is not None and self._digest == scene.fingerprint():
            self._coarse.caster = caster
            return
        self.detailed(scene)
        self._digest = scene.fingerprint()
        start = time.perf_counter()
        rng = generator(settings.seed, Stage.PICTURES, 0)
        count = min(_FIRST, len(scene.points))
        points = surface_levels(scene.points, self._spread.groups, count, 2.0, rng)[0]
        half = None if joined else CubeMap(max(1, cube_map.resolution // 2))
        bits = visibility_bits(scene, half or cube_map, caster, points)
        if joined:
            self._blocks = [(points, bits)]
        self._show_few(points, bits, start, half)

    def detailed(self, scene):
        """The points of the scene are these from now on."""
        if self._coarse is None or scene is not self._coarse.scene:
            self._spread = Spread(scene)
            self._coarse, self._few = Coarse(scene, *self._given, self._spread), None
            self._n_shown = 0

    def level(self, points, bits):
        """The rows of some points are known (see `LevelDone`)."""
        count = min(len(points), _MOST)
        if len(points) == len(self._coarse.scene.points):
            self.visible(bits.nbytes, bits.copy)
        elif count >= _MORE * max(self._n_shown, _FIRST) and self.is_due(count):
            start, few = time.perf_counter(), points[:_COARSE]
            if self._few is None or len(few) > self._few.count:
                self._show_few(few, bits[few], start)
            elif count > _COARSE:
                self._show_rows(points[:count], bits, start)

    def block(self, points, bits):
        """The rows (n, n_bytes) of some points, a slice or (n,) int, are known."""
        if self._blocks is None:
            # The first look was one with fewer directions: the next picture is that of all rows.
            return
        step = max(1, len(self._coarse.scene.points) // _COARSE)
        if isinstance(points, slice):
            points = np.arange(points.start, points.stop)
        self._blocks.append((points[::step], bits[::step]))
        known, rows = (np.concatenate(parts) for parts in zip(*self._blocks, strict=True))
        known, first = np.unique(known, return_index=True)
        if len(known) >= _MORE * self._n_shown and self.is_due(len(known)):
            self._show_few(known, rows[first], time.perf_counter())

    def visible(self, nbytes, read):
        """All rows are known, of so many bytes: `read()` gives (n_points, n_bytes) uint8."""
        if self.is_due() and nbytes <= _MOST_BYTES:
            start, bits = time.perf_counter(), read()
            if self._bits is None or not np.array_equal(self._bits, bits):
                self._bits = bits
                transport = self._coarse.transport(bits, None, self._few_of_all().gather)
                self._publish(transport, len(bits), 0, start)

    def emitted(self, direct):
        """What all points receive of each emitter, (n_emitters, n_points, 4) float32, is known."""
        self._emission = direct
        if self._bits is not None and self.is_due():
            start = time.perf_counter()
            transport = self._coarse.transport(self._bits, None, self._few_of_all().gather)
            self._publish(transport, len(self._bits), 0, start)

    def bounced(self, gather, error):
        """K of all points, (n_points, n_points) CSR, by the rays so far is known."""
        if self._bits is not None:
            transport = self._coarse.transport(self._bits, None, gather)
            self._publish(transport, len(self._bits), 0, time.perf_counter(), error)

    def finished(self, read, gather, error):
        """All is known: rows as `visible` reads them, K or None, and the error of the bounces."""
        bits = read()
        if self._bits is None or not np.array_equal(self._bits, bits):
            self._bits = bits
        self._few_of_all()
        self.bounced(gather, error)

    def is_due(self, n_points=None):
        """Whether there is time for a picture that knows so many points, None: all."""
        if self._share is None:
            return True
        if self._latest is not None or self._count < 2:
            return self._latest is None
        seconds, known = self._last
        more = (n_points or len(self._coarse.scene.points)) / known
        most = self._share * (time.perf_counter() - self._began)
        return self._spent + seconds * more**_COST <= most

    def _show_few(self, points, bits, start, row_map=None):
        """Rows of few points: a picture, and all that serves while the light moves."""
        coarse, spread = self._coarse, self._coarse.shares(points)
        transport = coarse.transport(bits, spread, None, row_map)
        transport.gather, noise = coarse.gathered(points, spread, coarse.probed(transport))
        direct = coarse.left_out_error(points, transport)
        emission, dim = coarse.emitted(points, spread)
        self._few = _Few(len(points), transport.gather, noise, emission, dim)
        self._few.bake = self._publish(transport, len(points), direct, start)

    def _few_of_all(self):
        """`_Few`, where no level came by: the bake had all rows to begin with."""
        if self._few is None:
            known = np.arange(0, len(self._bits), max(1, len(self._bits) // _COARSE))
            self._show_few(known, self._bits[known], time.perf_counter())
        return self._few

    def _show_rows(self, points, bits, start):
        """Rows of more points; bounces are those of few."""
        shares = self._coarse.shares(points)
        transport = self._coarse.transport(bits[points], shares, self._few.gather)
        direct = self._coarse.left_out_error(points, transport)
        self._publish(transport, len(points), direct, start)

    def _publish(self, transport, n_known, direct, start, error=None):
        """Make the picture the newest; returns its `PartialBake`."""
        scene, few = self._coarse.scene, self._few
        beside, world = self._beside, self._beside.world
        share = n_known / len(scene.points)
        if error is None:
            error = ((1 - share) * direct + few.noise).max()
            error = float(np.sqrt(max(error, few.dim if self._emission is None else 0)))
        received = few.emission if self._emission is None else self._emission
        emission = None if received is None else Emission(scene.emitters, received)
        bake = PartialBake(
            scene, transport, list(beside.lamps), world and world.texels, beside.camera,
            self._given[1].stored(), {},
            dict(beside.source or {}), None, dict(beside.origin or {}), None, emission,
            cameras=dict(beside.cameras or {}), world_image=world and world.image,
            view_transform=beside.view_transform,
            known_percent=100 * share, error=error, coarse=few.bake,
        )  # fmt: skip
        self._latest, self._n_shown, self._count = bake, n_known, self._count + 1
        self._last = 0.0, max(n_known, 1)
        self.spent(time.perf_counter() - start)
        return bake


def handed_out(steps, pictures, show):
    """The steps of a bake; `show` is called with each picture, in the thread that drives them.

    Parameters
    ----------
    steps : generator of Progress
    pictures : Pictures
        That the bake was given.
    show : callable(PartialBake)
    """
    try:
        while True:
            try:
                progress, result = next(steps), None
            except StopIteration as end:
                progress, result = None, end
            picture = pictures.take()
            if picture is not None:
                show(picture)
            if result is not None:
                return result.value
            yield progress
    finally:
        steps.close()


@dataclass
class _Few:
    """What is known by the rays of few points."""

    count: int
    gather: SpreadGather | None
    noise: np.ndarray  # (3,) squared relative error of their bounces
    emission: np.ndarray | None  # (n_emitters, n_points, 4) float32
    dim: float  # squared relative error of that
    bake: PartialBake | None = None
