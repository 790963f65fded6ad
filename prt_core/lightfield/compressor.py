"""What every compressor of HRDFs offers: one channel of a surface light field in fewer numbers."""

from abc import ABC, abstractmethod
from copy import copy

import numpy as np

from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.compress.parameters import Parameters
from prt_core.compress.state import expect_state, value_of
from prt_core.errors import expect, expect_array, expect_indices
from prt_core.lightfield.code import MOST
from prt_core.lightfield.hrdf import bilinear_weights, split_places
from prt_core.runtime.progress import run

# The step of rounding in thresholds, and the share of the squared error that rounding may add
# where numbers are counted instead: see docs/decisions on the code of light fields.
_STEP, _ROUNDING = 1.25, 1 / 64
# Elements that are read at once.
_PAIRS = 1 << 14


class HRDFCompressor(Parameters, ABC):
    """Base of the compressors of HRDFs, by scikit-learn's conventions.

    `fit` learns a dictionary (`train_steps`) and writes every HRDF in it (`encode_steps`), each
    part by itself where a dictionary serves several thresholds. A subclass gives both, `decode`,
    `_entries`, `n_numbers_`, `nbytes`, `_dictionary`, `_coefficients` and `_restore`, and has the
    parameters `n_coefficients` and `threshold`.

    Attributes
    ----------
    n_points_ : int
    shape_ : (int, int)
        Rows m1 and columns m2 of an HRDF.
    step_ : float
        What numbers are whole multiples of.
    """

    def sparsity(self):
        """The rule for what is kept, a `Sparsity`; `PRTError` where parameters are wrong."""
        return Sparsity(self.n_coefficients, self.threshold)

    def expect_params(self):
        """The estimator itself; `PRTError` where a parameter is wrong, whatever the HRDFs are."""
        self.sparsity()
        return self

    def fit(self, hrdfs, labels=None):
        """Compress one channel.

        Parameters
        ----------
        hrdfs : (n_points, m1, m2) float
        labels : (n_points,) int, optional
            Clusters, each with a dictionary of its own; default: one cluster.

        Returns
        -------
        self
        """
        return run(self.fit_steps(hrdfs, labels))

    def fit_steps(self, hrdfs, labels=None):
        """`fit` of `hrdfs` and `labels` as a generator of `Progress`; closing it cancels."""
        hrdfs, labels = expect_hrdfs(hrdfs, labels)
        yield from self.train_steps(hrdfs, labels)
        yield from self.encode_steps(hrdfs, labels)
        return self

    @abstractmethod
    def train_steps(self, hrdfs, labels):
        """Learn the dictionary of (n_points, m1, m2) `hrdfs` in clusters `labels` (n_points,)."""

    @abstractmethod
    def encode_steps(self, hrdfs, labels):
        """Write (n_points, m1, m2) `hrdfs` of clusters `labels` (n_points,) in the dictionary."""

    def trial_steps(self, hrdfs, labels, threshold):
        """What another threshold would leave and take; a generator of `Progress`.

        Parameters
        ----------
        hrdfs : (n, m1, m2) float32
        labels : (n,) int32
        threshold : float

        Returns
        -------
        HRDFCompressor
            A fitted one of these HRDFs, with the dictionary that was learned.
        """
        model = copy(self).set_params(threshold=threshold)
        yield from model.encode_steps(hrdfs, labels)
        return model

    def for_chroma(self):
        """The same for a chroma channel, with half the coefficients, as published; not fitted."""
        count = self.n_coefficients
        return self.clone().set_params(n_coefficients=count and -(-count // 2))

    def halved(self):
        """The same with half as many pairs or atoms; None where it has none, or one. Not fitted."""
        return None

    @abstractmethod
    def decode(self, points):
        """(n, m1, m2) float32: the HRDFs of `points` (n,) int, or a slice, as they were kept."""

    def entries(self, points, cells):
        """Single elements, without decoding the rest (equations 3 and 4).

        Parameters
        ----------
        points : (n,) int
        cells : (n,) int
            One for each of the points: row * m2 + column.

        Returns
        -------
        (n,) float32
        """
        self._expect_fitted()
        points = expect_array("points", points, (None,), np.int64, 0, self.n_points_ - 1)
        most = self.shape_[0] * self.shape_[1] - 1
        cells = expect_array("cells", cells, (len(points),), np.int64, 0, most)
        result = np.empty(len(points), np.float32)
        for first in range(0, len(points), _PAIRS):
            part = slice(first, first + _PAIRS)
            result[part] = self._entries(points[part], cells[part])
        return result

    @abstractmethod
    def _entries(self, points, cells):
        """`entries` of indices that were checked, not too many."""

    def interpolated(self, row, column):
        """One value of each point, between four of its cells.

        Parameters
        ----------
        row, column : (n_points,) float32
            Places as `HRDFLayout.places` gives them.

        Returns
        -------
        (n_points,) float32
        """
        self._expect_fitted()
        m1, m2 = self.shape_
        row, up = split_places(np.array(row, np.float32), m1)
        column, right = split_places(np.array(column, np.float32), m2)
        weights = bilinear_weights(up, right)
        points, first = np.arange(self.n_points_), row.astype(np.int64) * m2 + column
        beside, below = int(m2 > 1), m2 * int(m1 > 1)
        result = np.zeros(self.n_points_, np.float32)
        for k, offset in enumerate((0, beside, below, below + beside)):
            result += weights[:, k] * self.entries(points, first + offset)
        return result

    @property
    @abstractmethod
    def n_numbers_(self):
        """Numbers that are kept of all HRDFs together, without the dictionary."""

    @property
    @abstractmethod
    def nbytes(self):
        """Bytes at fixed width: dictionary, indices, counts, scales and numbers."""

    @property
    def coded_nbytes(self):
        """Bytes of the arrays of `state`: the same, entropy-coded."""
        return sum(part.nbytes for part in self.state().values() if isinstance(part, np.ndarray))

    @property
    def dictionary_nbytes(self):
        """Bytes of the dictionary's part in that."""
        return sum(part.nbytes for part in self._dictionary().values())

    def state(self):
        """Everything that `from_state` needs: a dict of arrays and of values that JSON knows."""
        self._expect_fitted()
        return {
            "params": self.get_params(),
            "n_points": self.n_points_,
            "shape": list(self.shape_),
            "step": self.step_,
            **self._dictionary(),
            **self._coefficients(),
        }

    @classmethod
    def from_state(cls, state, labels):
        """The fitted compressor of a `state`.

        Parameters
        ----------
        state : dict
        labels : (n_points,) int32
            The clusters that it was fitted with.

        Returns
        -------
        HRDFCompressor

        Raises
        ------
        PRTError
            Something is missing, of another shape or type, or does not fit the rest.
        """
        model = value_of(state, "params", lambda params: cls(**params))
        model.n_points_ = value_of(state, "n_points", int)
        model.shape_ = value_of(state, "shape", lambda shape: tuple(int(n) for n in shape))
        model.step_ = value_of(state, "step", float)
        expect_state(
            len(labels) == model.n_points_ and len(model.shape_) == 2 and model.step_ > 0,
            "its clusters, points and tables do not fit each other",
        )
        model._restore(state, labels)
        return model

    @abstractmethod
    def _dictionary(self):
        """The arrays of the dictionary, for a state."""

    @abstractmethod
    def _coefficients(self):
        """The arrays of the HRDFs in it, for a state."""

    @abstractmethod
    def _restore(self, state, labels):
        """Set the attributes of both; `PRTError` where they do not fit."""

    def _expect_fitted(self):
        expect(
            hasattr(self, "step_"),
            f"{type(self).__name__}: holds nothing yet; call fit(hrdfs) first",
        )

    def _points(self, points):
        self._expect_fitted()
        if isinstance(points, slice):
            return np.arange(self.n_points_)[points]
        return expect_indices("points", points, self.n_points_)

    def _step(self, squared_error, n_numbers, peak):
        """What numbers are rounded to multiples of.

        Parameters
        ----------
        squared_error : float
            Of all HRDFs, before rounding.
        n_numbers : int
        peak : float
            The largest number.
        """
        if self.threshold is not None:
            step = _STEP * self.threshold
        else:
            # Rounding to multiples of a step adds step^2 / 12 a number.
            step = np.sqrt(12 * _ROUNDING * squared_error / max(n_numbers, 1))
        # Numbers stay whole ones that float32 knows, also where nothing is left out.
        return float(max(step, peak / (1 << 24), 1e-30))


def rounded(values, step):
    """(...) int32: `values` (...) float in steps of `step`."""
    return np.rint(np.clip(values / step, 1 - MOST, MOST - 1)).astype(np.int32)


def expect_hrdfs(hrdfs, labels=None):
    """(n, m1, m2) float32 `hrdfs` and (n,) int32 `labels`, checked; `PRTError` where wrong."""
    hrdfs = expect_array("hrdfs", hrdfs, (None, None, None), np.float32)
    expect(hrdfs.size, f"hrdfs: expected at least one HRDF of one cell, got {hrdfs.shape}")
    n = len(hrdfs)
    if labels is None:
        return hrdfs, np.zeros(n, np.int32)
    return hrdfs, expect_array("labels", labels, (n,), np.int32, 0, n - 1)
