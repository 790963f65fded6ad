"""What every compressor offers: scikit-learn's conventions, relighting, and its size."""

from abc import ABC, abstractmethod
from copy import copy

import numpy as np

from prt_core.compress.parameters import Parameters
from prt_core.compress.rows import ArrayRows, Rows
from prt_core.compress.state import array_of, value_of
from prt_core.errors import expect, expect_array, expect_kind, expect_numbers
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.progress import run


class Compressor(Parameters, ABC):
    """Base of the compressors: parameters in `__init__`, results with a trailing underscore.

    A subclass gives `fit_steps`, a generator of `Progress` that sets its attributes,
    `_relight(light)` and `nbytes`; it calls `_fitted(rows)` once its attributes are set. `_state`
    and `_restore` let it be kept in a store.
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
        rows : Rows, or (n_points, n_directions) or (n_points, n_directions, n_channels) array
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

    def relight(self, light):
        """Colours under a light.

        Parameters
        ----------
        light : (n_directions, n_channels) float

        Returns
        -------
        (n_points, n_channels) float32
        """
        return self._relight(self._as_light(light))

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
        state = {
            "params": self.get_params(),
            "n_points": self.n_points_,
            "n_directions": self.n_directions_,
            "n_channels": self.n_channels_,
            "resolution": self.resolution_,
            **self._state(),
        }
        return state if self.gain_ is None else {**state, "gain": self.gain_}

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
        for name in ("n_points", "n_directions", "n_channels"):
            setattr(model, name + "_", value_of(state, name, int))
        model.resolution_ = value_of(state, "resolution", lambda n: None if n is None else int(n))
        shape = model.n_points_, model.n_channels_
        model.gain_ = array_of(state, "gain", shape, "float32") if "gain" in state else None
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
    return rows if isinstance(rows, Rows) else ArrayRows(rows)
