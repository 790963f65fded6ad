"""What surfaces look like between their corners, sampled once on lattices in triangles."""

import hashlib
from copy import copy

import numpy as np

from prt_core.scene.lattice import lattice_of_hits, lattice_size


class LatticePaint:
    """The `Paint` of a mesh whose materials were sampled on a lattice in each triangle.

    A triangle of level n has samples at the barycentric coordinates (i / n, j / n), in the order of
    `lattice_index`; between them values are linear. Triangles may share samples.

    Parameters
    ----------
    corner_values : dict of str -> (n_corners, n_channels) array
        What is painted, at all corners; between those of triangles that have no lattice values are
        linear.
    triangle_corners : (n_triangles, 3) int
        Of those that have a lattice.
    levels, starts : (n_triangles,) int
        Where the samples of each begin.
    samples : dict of str -> (n_samples, n_channels) array
        Of the same names.
    """

    def __init__(self, corner_values, triangle_corners, levels, starts, samples):
        corners = np.asarray(triangle_corners, np.int64).reshape(-1, 3)
        # A corner belongs to one face, so two corners in order know their triangle.
        self._base = int(corners.max(initial=0)) + 1
        key = self._key(corners)
        order = np.argsort(key, kind="stable")
        self._keys = key[order]
        self._levels = np.asarray(levels, np.int64)[order]
        self._starts = np.asarray(starts, np.int64)[order]
        self._corner_values, self.samples = corner_values, samples

    def _key(self, corners):
        return (corners[:, 0] * self._base + corners[:, 1]) * self._base + corners[:, 2]

    def _rows(self, corners):
        """(m,) int: which lattice each three corners have, -1 for none."""
        corners = np.asarray(corners, np.int64)
        key = np.where((corners < self._base).all(axis=1), self._key(corners), -1)
        row = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where(self._keys[row] == key, row, -1) if len(self._keys) else 0 * key - 1

    def at(self, corners, weights):
        """See `Paint`."""
        weights = np.asarray(weights, np.float64)
        row = self._rows(corners)
        inside = np.flatnonzero(row >= 0)
        row = row[inside]
        cell, shares = lattice_of_hits(self._levels[row], weights[inside, 1:])
        cell += self._starts[row][:, None]
        values = {}
        for name, of_corner in self._corner_values.items():
            result = np.einsum("mk,mkc->mc", weights, of_corner[corners].astype(np.float64))
            result[inside] = np.einsum("mk,mkc->mc", shares, self.samples[name][cell])
            values[name] = result
        return values

    def alike(self, corners):
        """See `Paint`."""
        row = self._rows(corners)
        alone = -1 - np.arange(len(row))
        if not len(self._keys):
            return alone
        lattice = self._starts * (int(self._levels.max()) + 1) + self._levels
        return np.where(row >= 0, lattice[row], alone)

    def texels(self, corners):
        """See `Paint`."""
        row = self._rows(corners)
        return np.where(row >= 0, self._levels[row] ** 2 / 2, 0.0)

    def only(self, names):
        """The same paint of some of its quantities, a set of names; None where it has none."""
        kept = {name: values for name, values in self._corner_values.items() if name in names}
        if not kept:
            return None
        paint = copy(self)
        paint._corner_values = kept
        paint.samples = {name: self.samples[name] for name in kept}
        return paint

    def digest(self):
        """See `Paint`."""
        digest = hashlib.blake2b(digest_size=16)
        for array in (self._keys, self._levels, self._starts):
            digest.update(np.ascontiguousarray(array))
        for name in self.samples:
            digest.update(name.encode() + np.ascontiguousarray(self.samples[name]).tobytes())
        return digest.digest()

    @property
    def n_samples(self):
        """How many samples there are."""
        return len(next(iter(self.samples.values()), ()))

    @property
    def nbytes(self):
        """Memory of all that is kept."""
        return sum(v.nbytes for d in (self.samples, self._corner_values) for v in d.values())


def lattice_starts(levels):
    """(n,) int64: where the samples of each lattice begin when they stand one after another."""
    sizes = lattice_size(np.asarray(levels, np.int64))
    return np.concatenate([[0], np.cumsum(sizes)[:-1]]) if len(sizes) else sizes
