"""Rows of a dictionary in few bits each number, with a scale a row."""

from dataclasses import dataclass

import numpy as np

from prt_core.compress.state import array_of, expect_state
from prt_core.lightfield.code import pack, unpack


@dataclass
class KeptRows:
    """Dictionaries of several clusters, as they are kept.

    Attributes
    ----------
    numbers : (n_rows, n_cells) int16
        In units of the scale divided by 2^(bits - 1) - 1.
    scales : (n_rows,) float32
    counts : (n_clusters,) int64
        Rows of each cluster.
    bits : int
    """

    numbers: np.ndarray
    scales: np.ndarray
    counts: np.ndarray
    bits: int

    @classmethod
    def of(cls, dictionaries, bits):
        """Round the `dictionaries`, a list of (k, n_cells) float, to so many `bits` a number."""
        rows = np.concatenate(dictionaries).astype(np.float32)
        scales = np.abs(rows).max(axis=1, initial=0)
        steps = np.where(scales > 0, scales, 1) / _most(bits)
        numbers = np.rint(rows / steps[:, None]).astype(np.int16)
        return cls(numbers, scales, np.array([len(each) for each in dictionaries]), bits)

    @property
    def values(self):
        """List of (k, n_cells) float32: the rows of each cluster."""
        rows = self.numbers * (self.scales / np.float32(_most(self.bits)))[:, None]
        return np.split(rows.astype(np.float32), np.cumsum(self.counts)[:-1])

    @property
    def nbytes(self):
        """Bytes of numbers, scales and counts."""
        return -(-self.numbers.size * self.bits // 8) + 4 * len(self.scales) + 2 * len(self.counts)

    def arrays(self):
        """The arrays of a state, a dict."""
        return {
            "dictionary": pack(self.numbers.ravel(), self.bits),
            "scales": self.scales,
            "counts": self.counts.astype(np.int32),
        }

    @classmethod
    def from_state(cls, state, n_clusters, n_cells, bits):
        """Those whose `arrays` are in a `state`; `PRTError` where they do not fit.

        Parameters
        ----------
        state : dict
        n_clusters, n_cells, bits : int

        Returns
        -------
        KeptRows
        """
        scales = array_of(state, "scales", (None,), "float32")
        counts = array_of(state, "counts", (None,), "int32", len(scales) + 1).astype(np.int64)
        good = len(counts) >= n_clusters and counts.sum() == len(scales)
        expect_state(good, "its dictionary does not fit its clusters")
        size = len(scales) * n_cells
        data = array_of(state, "dictionary", (-(-size * bits // 8),), "uint8")
        numbers = unpack(data, size, bits).reshape(-1, n_cells).astype(np.int16)
        return cls(numbers, scales, counts, bits)


def _most(bits):
    return (1 << bits - 1) - 1
