"""Rows of all points that lie tile by tile in a store, read at random and written by tiles.

What a tile was sampled to is never changed. What asking again finds goes into arrays of a turn of
its own, and single rows that were found out otherwise stay in memory: so a bake that was stopped
finds again what it had found, from the same beginning.
"""

import threading
from collections import OrderedDict

import numpy as np

from prt_core.bake import visibility
from prt_core.runtime.threads import on_all_cores

# Counts of a tile (see `Sampled.attributes`), and the points of its levels.
COUNTS = (
    "rays", "open_points", "open_entries", "hemisphere_entries", "given_up", "first", "disagree",
    "check", "follow", "rest",
)  # fmt: skip
_LEVELS = 54
_KINDS = "bits", "traced"


class TileArrays:
    """What one turn found of tiles, in a store.

    Parameters
    ----------
    arrays : dict of str -> BakeArray
        bits, traced : (n_tiles, n_rows, n_bytes) uint8; counts : (n_tiles, 64) int64.
    """

    def __init__(self, arrays):
        self._arrays = arrays

    @classmethod
    def begun(cls, store, turn, n_tiles, n_rows, n_bytes):
        """Those of a turn, made, or taken as far as they are there."""
        block = visibility.BLOCK
        shape = n_tiles, -(-n_rows // block) * block, n_bytes
        arrays = {
            kind: store.create(_name(kind, turn), shape, "uint8", (1, block, n_bytes))
            for kind in _KINDS
        }
        width = len(COUNTS) + _LEVELS
        counts = store.create(_name("counts", turn), (n_tiles, width), "int64", (1, width))
        return cls({**arrays, "counts": counts})

    @classmethod
    def opened(cls, store, turn):
        """Those of a turn that another process has begun."""
        return cls({kind: store.array(_name(kind, turn)) for kind in (*_KINDS, "counts")})

    @staticmethod
    def remove(store):
        """Take those of all turns out of a store."""
        for name in store.files.names():
            if name.startswith("tile_"):
                store.remove(name)

    def __getitem__(self, kind):
        return self._arrays[kind]

    def holds(self, tile):
        """Whether all of a tile is there."""
        return all(array.holds(tile) for array in self._arrays.values())

    def write(self, tile, sampled):
        """Keep what was found of a tile; the counts come last."""
        for kind in _KINDS:
            array = self._arrays[kind]
            rows = np.zeros((1, *array.shape[1:]), np.uint8)
            rows[0, : len(sampled.bits)] = getattr(sampled, kind)
            array[tile : tile + 1] = rows
        counts = np.zeros((1, len(COUNTS) + _LEVELS), np.int64)
        attributes = {**sampled.attributes, "rays": sampled.rays}
        counts[0, : len(COUNTS)] = [attributes[name] for name in COUNTS]
        levels = sampled.attributes["levels"][:_LEVELS]
        counts[0, len(COUNTS) : len(COUNTS) + len(levels)] = levels
        self._arrays["counts"][tile : tile + 1] = counts

    def counts(self, tiles):
        """(n, 64) int64 of some tiles."""
        return np.concatenate([self._arrays["counts"][tile : tile + 1] for tile in tiles])


class TileRows:
    """(n_points, n_bytes) uint8: bits, or which were traced, indexed as an array is.

    Parameters
    ----------
    kind : {"bits", "traced"}
    tiles : list of (n,) int64
    first : TileArrays
        What all tiles were sampled to.
    n_bytes : int
        Of pieces that are kept in memory once they were read.
    """

    dtype, ndim = np.dtype(np.uint8), 2

    def __init__(self, kind, tiles, first, n_bytes):
        self._kind, array = kind, first[kind]
        self._arrays = [array] * len(tiles)
        self._rows = array.shape[1]
        n_points = sum(map(len, tiles))
        self.shape = n_points, array.shape[2]
        self._place = np.empty(n_points, np.int64)
        for number, points in enumerate(tiles):
            self._place[points] = number * self._rows + np.arange(len(points))
        # Rows that were set since, ascending.
        self._points, self._own = np.zeros(0, np.int64), np.zeros((0, self.shape[1]), np.uint8)
        self._chunk = array.chunks[1]
        self._most = max(4, n_bytes // (self._chunk * self.shape[1]))
        self._pieces, self._lock = OrderedDict(), threading.Lock()

    def __len__(self):
        return self.shape[0]

    @property
    def own(self):
        """(n,) int64, ascending, and (n, n_bytes) uint8: points whose rows were set, and these."""
        return self._points, self._own

    def replace(self, tile, points, arrays):
        """From now on a tile, of these points, is as another turn found it."""
        with self._lock:
            self._arrays[tile] = arrays[self._kind]
            for key in [key for key in self._pieces if key * self._chunk // self._rows == tile]:
                del self._pieces[key]
        kept = ~np.isin(self._points, points)
        self._points, self._own = self._points[kept], self._own[kept]

    def __getitem__(self, key):
        """Rows of points, a slice or (n,) int; or, of (points, bytes), single bytes."""
        points, byte = key if isinstance(key, tuple) else (key, None)
        if isinstance(points, slice):
            points = np.arange(*points.indices(len(self)))
        place = self._place[points]
        order = np.argsort(place, kind="stable")
        piece = place[order] // self._chunk
        starts = np.flatnonzero(np.diff(piece, prepend=-1))
        result = np.empty((len(points), *(() if byte is not None else self.shape[1:])), np.uint8)

        def one(rows):
            rows_there = self._read(int(place[rows[0]] // self._chunk))
            inside = place[rows] % self._chunk
            result[rows] = rows_there[inside] if byte is None else rows_there[inside, byte[rows]]

        on_all_cores(one, np.split(order, starts[1:]) if len(order) else [])
        if len(self._points):
            slot = np.minimum(np.searchsorted(self._points, points), len(self._points) - 1)
            own = np.flatnonzero(self._points[slot] == points)
            slot = slot[own]
            result[own] = self._own[slot] if byte is None else self._own[slot, byte[own]]
        return result

    def __setitem__(self, points, values):
        """Set whole rows of points (n,) int, each named once; they stay in memory."""
        kept = ~np.isin(self._points, points)
        points = np.concatenate([self._points[kept], points])
        values = np.concatenate([self._own[kept], np.asarray(values, np.uint8)])
        order = np.argsort(points, kind="stable")
        self._points, self._own = points[order], values[order]

    def _read(self, piece):
        with self._lock:
            rows = self._pieces.get(piece)
            if rows is not None:
                self._pieces.move_to_end(piece)
                return rows
        tile, first = divmod(piece * self._chunk, self._rows)
        rows = self._arrays[tile][tile, first : first + self._chunk]
        with self._lock:
            self._pieces[piece] = rows
            while len(self._pieces) > self._most:
                self._pieces.popitem(last=False)
        return rows


def _name(kind, turn):
    return f"tile_{kind}{turn}"
