"""A ray caster that writes down every answer, so that no ray is cast twice after a kill.

A sampler decides what to trace from what it has seen. Run again from the beginning on the answers
that are written down it decides the same, and reaches the place where it was stopped in the time
of its arithmetic alone. So any sampler can be resumed, and none has to store what it knows.
"""

import numpy as np

from prt_core.rays import shared

NAME = "ray_journal"
# Rays of a chunk: what a kill loses at most, with what was not yet answered.
CHUNK = 1 << 19
# Bytes of the digest of a chunk's rays.
_HEAD = 8
_MOST_CHUNKS = 1 << 16


class JournalMismatch(Exception):
    """The rays are not those that were written down; the journal was emptied."""


class RayJournal:
    """A `RayCaster` around another, for one thread and rays in the same order in every run.

    Parameters
    ----------
    caster : RayCaster
    store : BakeStore
    name : str
        Of the array the answers are kept in.
    """

    threads = 1

    def __init__(self, caster, store, name=NAME):
        self._caster, self._store, self._array_name = shared(caster), store, name
        self.name, self.batch = caster.name, self._caster.batch
        self._open()

    def _open(self):
        width = _HEAD + CHUNK // 8
        self._array = self._store.create(
            self._array_name, (_MOST_CHUNKS, width), "uint8", (1, width)
        )
        self._index = -1
        self._next()

    def _next(self):
        self._index += 1
        self._fill, self._digest = 0, np.uint64(0)
        self._known = None
        if self._array.holds(self._index):
            kept = self._array[self._index]
            self._expected = kept[:_HEAD].view(np.uint64)[0]
            self._known = np.unpackbits(kept[_HEAD:], bitorder="little").view(bool)
        self._answers = np.empty(CHUNK, bool) if self._known is None else self._known

    def occluded(self, origins, directions):
        """See `RayCaster`; from the journal as far as it goes."""
        result = np.empty(len(origins), bool)
        first = 0
        while first < len(origins):
            stop = min(len(origins), first + CHUNK - self._fill)
            part = slice(first, stop)
            slot = slice(self._fill, self._fill + stop - first)
            if self._known is None:
                self._answers[slot] = self._caster.occluded(origins[part], directions[part])
            result[part] = self._answers[slot]
            self._digest += _sum(origins[part]) + np.uint64(3) * _sum(directions[part])
            self._fill = slot.stop
            first = stop
            if self._fill == CHUNK:
                self._close_chunk()
        return result

    def _close_chunk(self):
        if self._known is not None and self._digest != self._expected:
            self.remove()
            self._open()
            raise JournalMismatch
        if self._known is None:
            head = np.frombuffer(self._digest.tobytes(), np.uint8)
            row = np.concatenate([head, np.packbits(self._answers, bitorder="little")])
            self._array[self._index] = row
        self._next()

    def intersect(self, origins, directions):
        """See `RayCaster`; not written down."""
        return self._caster.intersect(origins, directions)

    def remove(self):
        """Take the journal out of the store."""
        self.clear(self._store, self._array_name)

    @staticmethod
    def clear(store, name=NAME):
        """Take the journal `name` of a finished sampling out of a store, where it is there."""
        store.remove(name)

    def close(self):
        """Leaves the caster inside open."""


def _sum(vectors):
    """A sum of bits that does not depend on how the rays are cut into calls."""
    return np.ascontiguousarray(vectors, np.float32).view(np.uint32).sum(dtype=np.uint64)
