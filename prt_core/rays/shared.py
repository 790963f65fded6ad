"""One caller's batches, shared out among the threads that a caster allows."""

import numpy as np

from prt_core.errors import expect_caster
from prt_core.runtime.threads import on_all_cores

# Rays of a batch; below so many another thread is not worth its start.
_BATCH, _FEW = 1 << 20, 1 << 12


class SharedCaster:
    """A `RayCaster` for one caller, around one that several threads may call."""

    threads = 1

    def __init__(self, caster):
        self._caster = caster
        self.name = caster.name
        self.batch = _BATCH

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        n_rays, caster = len(origins), self._caster
        size = min(caster.batch, max(_FEW, -(-n_rays // caster.threads)))
        if n_rays <= size:
            return caster.occluded(origins, directions, distances)
        result = np.empty(n_rays, bool)

        def one(first):
            part = slice(first, first + size)
            limit = None if distances is None else distances[part]
            result[part] = caster.occluded(origins[part], directions[part], limit)

        on_all_cores(one, range(0, n_rays, size))
        return result

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        return self._caster.intersect(origins, directions)

    def close(self):
        """Leaves the caster inside open."""


def shared(caster):
    """The caster itself where it spreads the work on its own."""
    expect_caster(caster)
    return SharedCaster(caster) if caster.threads > 1 else caster
