"""A caster that only one thread may call, for work in another thread."""

import time
from concurrent.futures import wait

import numpy as np

from prt_core.rays.caster import Hits
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.main_thread import MainThreadCalls
from prt_core.runtime.progress import Pace
from prt_core.runtime.stillness import waiting
from prt_core.runtime.threads import on_all_cores, started, works_alone

_FEWEST = 1 << 15
# Seconds between looks at whether work in other threads has ended, at most.
_POLL = 0.05


class RelayCaster:
    """A `RayCaster` whose rays are cast in the thread that serves `calls`, a part at a time.

    Parameters
    ----------
    caster : RayCaster
    calls : prt_core.runtime.progress.MainThreadCalls
    seconds : float or None
        That a part may take the serving thread; None: no parts.
    """

    threads = 1

    def __init__(self, caster, calls, seconds):
        self._caster, self._calls = caster, calls
        self._pace = Pace(seconds, _FEWEST)
        self.name, self.batch = caster.name, caster.batch

    @property
    def too_deep(self):
        """See `PassingCaster`."""
        return getattr(self._caster, "too_deep", 0)

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        result = np.empty(len(origins), bool)
        for part in self._pace.parts(0, len(origins)):
            limit = None if distances is None else distances[part]
            result[part] = self._cast("occluded", origins[part], directions[part], limit)
        return result

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        if not len(origins):
            return self._calls.call(self._caster.intersect, origins, directions)
        parts = self._pace.parts(0, len(origins))
        return Hits.joined(
            [self._cast("intersect", origins[part], directions[part]) for part in parts]
        )

    def _cast(self, name, *arguments):
        result, spent = self._calls.call(_timed, getattr(self._caster, name), *arguments)
        self._pace.worked(spent)
        return result

    def close(self):
        """Leaves the caster inside open."""


def _timed(function, *arguments):
    start = time.perf_counter()
    return function(*arguments), time.perf_counter() - start


def cast_on_all_cores(caster, function, items):
    """`[function(caster, item) for item in items]`, on all cores, whatever the caster allows.

    Rays of a caster that one thread alone may call are cast in this one, while the others work on
    what they have met.

    Parameters
    ----------
    caster : RayCaster
    function : callable(RayCaster, item)
        Should spend its time in numpy.
    items : iterable
    """
    items = list(items)
    if caster.threads > 1 or works_alone(items):
        return on_all_cores(lambda item: function(caster, item), items)
    calls = MainThreadCalls()
    relay = RelayCaster(caster, calls, None)
    with one_blas_thread():
        pieces = started(lambda item: function(relay, item), items)
        try:
            for piece in pieces:
                piece.add_done_callback(lambda _: calls.wake())
            while not all(piece.done() for piece in pieces):
                calls.serve(_POLL)
        finally:
            calls.stop()
            with waiting():
                wait(pieces)
    return [piece.result() for piece in pieces]
