"""What every compressor offers: scikit-learn's conventions, two reads, its size.

A form holds what points receive, rows as they are; what a surface makes of that is not its matter
(see `ExitRadiance`).
"""

from abc import ABC, abstractmethod
from copy import copy

import numpy as np

from prt_core.compress.parameters import Parameters
from prt_core.compress.rows import ArrayRows, Rows
from prt_core.compress.rows.row_code import expect_reads
from prt_core.compress.state import value_of
from prt_core.errors import expect, expect_array, expect_kind, expect_numbers, expect_whole
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.progress import run

_PAIRS = 1 << 14


class Compressor(Parameters, ABC):
    """Base of the compressors: parameters in `__init__`, results with a trailing underscore.

    A subclass gives `fit_steps`, a generator of `Progress` that sets its attributes, the reads
    `_product(light)` and `_entries(points, columns)`, and `nbytes`; it calls `_fitted(rows)` once
    its attributes are set. `_state` and `_restore` let it be kept in a store.
    """

    # Parameters with which all of a light is used.
    _UNCUT = {}

    def uncut(self):
        """The same form, for lights of which nothing may be spared: white ones, single texels."""
        return copy(self).set_params(**self._UNCUT)

    def expect_params(self):
        """The estimator itself; `PRTError` where a parameter is wrong, whatever the rows are."""
        return self

    def fit(self, rows, y=None):
        """Compress rows.

        Parameters
        ----------
        rows : Rows, or (n_points, n_directions) or (n_points, n_directions, n_outputs) array
        y : object, optional
            Not used: scikit-learn hands it over.

        Returns
        -------
        self
        """
        return run(self.fit_steps(as_rows(rows)))

    @abstractmethod
    def fit_steps(self, rows):
        """`fit` as a generator of `Progress`; closing it cancels."""

    def product(self, light):
        """The compressed matrix times a light: what points receive, with all that the rows hold.

        Parameters
        ----------
        light : (n_directions, n_channels) float
            With the channels that the outputs read.

        Returns
        -------
        (n_points, n_outputs) float32
        """
        return self._product(self._as_light(light))

    def entries(self, points, columns):
        """Single elements of the compressed matrix, none of it left out (see `uncut`).

        `product` with a light is their sum: output o of a point adds up `entries` in all columns
        times the light there, in the channel that o reads.

        Parameters
        ----------
        points : (n,) int
        columns : (n,) int
            Directions: one for each of the points.

        Returns
        -------
        (n, n_outputs) float32
        """
        self._expect_fitted()
        points = expect_array("points", points, (None,), np.int64, 0, self.n_points_ - 1)
        shape = (len(points),)
        columns = expect_array("columns", columns, shape, np.int64, 0, self.n_directions_ - 1)
        return self._entries(points, columns)

    @abstractmethod
    def _product(self, light):
        """`product` with a light that was checked."""

    @abstractmethod
    def _entries(self, points, columns):
        """`entries` of indices that were checked."""

    def _as_light(self, light):
        """A light that this form can be lit by, (n_directions, n_channels) float32."""
        self._expect_fitted()
        light = expect_numbers("light", light)
        light = light[:, None] if light.ndim == 1 else light
        shape = self.n_directions_, self.n_channels_
        return expect_array("light", light, shape, np.float32, -BRIGHTEST, BRIGHTEST)

    def state(self):
        """Everything that `from_state` needs: a dict of arrays and of values that JSON knows."""
        self._expect_fitted()
        return {
            "params": self.get_params(),
            "n_points": self.n_points_,
            "n_directions": self.n_directions_,
            "reads": self.reads_.tolist(),
            "resolution": self.resolution_,
            **self._state(),
        }

    @classmethod
    def from_state(cls, state):
        """The fitted compressor of a `state`.

        Raises
        ------
        PRTError
            Something is missing, of another shape or type, or does not fit the rest.
        """
        expect_kind("state", state, dict)
        model = value_of(state, "params", lambda params: cls(**params))
        for name in ("n_points", "n_directions"):
            setattr(model, name + "_", value_of(state, name, int))
        model.reads_ = _reads_of(state)
        model.resolution_ = value_of(state, "resolution", lambda n: None if n is None else int(n))
        model._restore(state)
        return model

    @abstractmethod
    def _state(self):
        """The part of `state` that is this compressor's own."""

    @abstractmethod
    def _restore(self, state):
        """Set the attributes of a `_state`; `PRTError` where it does not fit."""

    @property
    @abstractmethod
    def nbytes(self):
        """Bytes of everything that a product reads."""

    def _fitted(self, rows):
        self.n_points_, self.n_directions_ = rows.n_points, rows.n_directions
        self.reads_, self.resolution_ = np.asarray(rows.reads), rows.resolution
        return self

    @property
    def n_outputs_(self):
        """Numbers that a point receives."""
        return len(self.reads_)

    @property
    def n_channels_(self):
        """Channels of a light."""
        return int(self.reads_.max()) + 1

    def _expect_fitted(self):
        expect(
            hasattr(self, "n_points_"),
            f"{type(self).__name__}: holds nothing yet; call fit(rows) first",
        )


def _reads_of(state):
    """The channels that outputs read; before they were named, each read its own."""
    if "reads" in state:
        return value_of(state, "reads", expect_reads)
    return np.arange(value_of(state, "n_channels", lambda n: expect_whole("n_channels", n, 1, 64)))


def pieces(count):
    """Consecutive slices of so many pairs of a point and a column, each of which fits a cache."""
    for first in range(0, count, _PAIRS):
        yield slice(first, min(first + _PAIRS, count))


def as_rows(rows):
    """`Rows` as they are, arrays as `ArrayRows`."""
    return rows if isinstance(rows, Rows) else ArrayRows(rows)
