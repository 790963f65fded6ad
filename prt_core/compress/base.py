"""What every compressor offers: scikit-learn's conventions, relighting, and its size."""

from abc import ABC, abstractmethod

import numpy as np
from sklearn.base import BaseEstimator

from prt_core.compress.rows import ArrayRows, Rows
from prt_core.errors import expect, expect_array
from prt_core.progress import run


class Compressor(BaseEstimator, ABC):
    """Base of the compressors: parameters in `__init__`, results with a trailing underscore.

    A subclass gives `fit_steps`, a generator of `Progress` that sets its attributes,
    `_relight(light)` and `nbytes`; and calls `_fitted(rows)` once its attributes are set.
    """

    def fit(self, rows, y=None):
        """Compress rows.

        Parameters
        ----------
        rows : Rows, or (n_points, n_directions) or (n_points, n_directions, n_channels) array

        Returns
        -------
        self
        """
        return run(self.fit_steps(as_rows(rows)))

    @abstractmethod
    def fit_steps(self, rows):
        """`fit` as a generator of `Progress`; closing it cancels."""

    def relight(self, light):
        """Colours under a light.

        Parameters
        ----------
        light : (n_directions, n_channels) float

        Returns
        -------
        (n_points, n_channels) float32
        """
        self._expect_fitted()
        light = np.asarray(light, np.float32)
        light = light[:, None] if light.ndim == 1 else light
        light = expect_array("light", light, (self.n_directions_, self.n_channels_))
        return self._relight(light)

    @property
    @abstractmethod
    def nbytes(self):
        """Bytes of everything that relighting reads."""

    def _fitted(self, rows):
        self.n_points_, self.n_directions_ = rows.n_points, rows.n_directions
        self.n_channels_, self.resolution_ = rows.n_channels, rows.resolution
        self.gain_ = rows.gain
        return self

    def _expect_fitted(self):
        expect(
            hasattr(self, "n_points_"),
            f"{type(self).__name__}: holds nothing yet; call fit(rows) first",
        )


def as_rows(rows):
    """`Rows` as they are, arrays as `ArrayRows`."""
    return rows if isinstance(rows, Rows) else ArrayRows(np.asarray(rows))


def expect_count(name, value, least=1):
    """A whole number of at least `least`."""
    expect(
        isinstance(value, int | np.integer) and value >= least,
        f"{name}: expected a whole number >= {least}, got {value!r}",
    )
    return int(value)
