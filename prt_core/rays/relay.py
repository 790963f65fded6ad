"""A caster that only one thread may call, for work in another thread."""

import time

import numpy as np

from prt_core.rays.caster import Hits
from prt_core.runtime.progress import Pace

_FEWEST = 1 << 15


class RelayCaster:
    """A `RayCaster` whose rays are cast in the thread that serves `errands`, a part at a time.

    Parameters
    ----------
    caster : RayCaster
    errands : prt_core.runtime.progress.Errands
    seconds : float
        That a part may take the serving thread.
    """

    threads = 1

    def __init__(self, caster, errands, seconds):
        self._caster, self._errands = caster, errands
        self._pace = Pace(seconds, _FEWEST)
        self.name, self.batch = caster.name, caster.batch

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
            return self._errands.call(self._caster.intersect, origins, directions)
        parts = self._pace.parts(0, len(origins))
        return Hits.joined(
            [self._cast("intersect", origins[part], directions[part]) for part in parts]
        )

    def _cast(self, name, *arguments):
        result, spent = self._errands.call(_timed, getattr(self._caster, name), *arguments)
        self._pace.worked(spent)
        return result

    def close(self):
        """Leaves the caster inside open."""


def _timed(function, *arguments):
    start = time.perf_counter()
    return function(*arguments), time.perf_counter() - start
