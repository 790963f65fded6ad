"""Surface light fields: what leaves every point of a surface in all directions, a light at a time.

The radiance of a point is an HRDF. Each light's HRDFs are clustered, and luma and two chroma
channels are compressed by themselves (Miandji et al. 2013), after the median of each HRDF, which
is what the point sends everywhere alike. Radiance of lights adds up, so lights can be dimmed and
given another colour afterwards.
"""

import json
from functools import partial

import numpy as np

from prt_core.compress.parameters import Parameters
from prt_core.compress.state import array_of, expect_state, value_of
from prt_core.errors import (
    PRTError,
    expect,
    expect_array,
    expect_indices,
    expect_kind,
    expect_number,
    expect_numbers,
    expect_seed,
)
from prt_core.lightfield.clustering import expect_clusters
from prt_core.lightfield.code import byte_planes, from_byte_planes
from prt_core.lightfield.field_error import field_error
from prt_core.lightfield.fit import fit_lights_steps
from prt_core.lightfield.goals import Goal
from prt_core.lightfield.hrdf import FROM_YCBCR, HRDFLayout
from prt_core.lightfield.light_radiance import LightRadiance
from prt_core.lightfield.methods import compressor_from_text
from prt_core.lightfield.planes import joined, split
from prt_core.lightfield.viewer import Viewer, in_frames
from prt_core.runtime.progress import run

# Points that are decoded at once, and factors of lights, at most.
_BLOCK, _MOST_WEIGHT = 1 << 12, 1e9


class SurfaceLightField(Parameters):
    """All HRDFs of a surface, compressed.

    One of `n_coefficients`, `threshold`, `psnr` and `megabytes` says how far.

    Parameters
    ----------
    method : str
        `NAME` or `NAME:key=value,key=value`: ceob, cpca, ksvd, harmonics, haar or dct.
    n_coefficients : int, optional
        Of an HRDF's luma, at most; its two chroma channels have half of them each, as published.
    threshold : float, optional
        One for all points, channels and lights: what squared error a number must save, as its
        root and in units of radiance. Chroma's is in proportion to what it does to R, G and B.
    psnr : float, optional
        Decibels of equation 5, of R, G and B, that are reached.
    megabytes : float, optional
        10^6 bytes of the entropy-coded field that are not exceeded.
    n_clusters : int, optional
        Of each light's points; None: as many, and with as few pairs or atoms, as make the field
        smallest, or nearest at its size.
    peak : float, optional
        Radiance of the brightest lamp, from which decibels are counted; default: the largest
        radiance of the field.
    seed : int

    Attributes
    ----------
    n_points_, n_lights_ : int
    layout_ : HRDFLayout
    frames_ : (n_points, 3, 3) float32
    labels_ : (n_lights, n_points) int32
        Clusters.
    bases_ : (n_lights, 3, n_points) float16
        The median of each HRDF's luma, Cb and Cr.
    compressors_ : list of list of HRDFCompressor
        Of each light its luma, Cb and Cr, each beyond its base.
    peak_ : float
    """

    def __init__(
        self,
        method="ceob",
        n_coefficients=None,
        threshold=None,
        psnr=None,
        megabytes=None,
        n_clusters=1,
        peak=None,
        seed=0,
    ):
        self.method = method
        self.n_coefficients = n_coefficients
        self.threshold = threshold
        self.psnr = psnr
        self.megabytes = megabytes
        self.n_clusters = n_clusters
        self.peak = peak
        self.seed = seed

    def goal(self):
        """The `Goal` of the parameters; `PRTError` where there is none, or are several."""
        return Goal(self.n_coefficients, self.threshold, self.psnr, self.megabytes)

    def expect_params(self):
        """The estimator itself; `PRTError` where a parameter is wrong, whatever the field is."""
        goal = self.goal()
        expect(
            self.n_clusters is not None or goal.n_coefficients is None,
            "n_clusters: with n_coefficients more clusters are always nearer; give their number",
        )
        if self.peak is not None:
            expect_number("peak", self.peak, above=0)
        expect_seed(self.seed)
        self.compressor(threshold=1.0).expect_params()
        return self

    def compressor(self, **goals):
        """An `HRDFCompressor` of the method for one channel, with `goals` as its parameters."""
        return compressor_from_text(self.method, seed=self.seed, **goals)

    def fit(self, radiance, frames):
        """Compress a field.

        Parameters
        ----------
        radiance : (n_points, m1, m2, 3) or (n_lights, n_points, m1, m2, 3) float
            Linear Rec.709, what leaves the points in the directions of an `HRDFLayout`. Of
            several lights, one at a time is read, so it may lie on disk.
        frames : (n_points, 3, 3) float
            Tangents and normal as rows (see `tangent_frames`).

        Returns
        -------
        self
        """
        return run(self.fit_steps(radiance, frames))

    def fit_steps(self, radiance, frames):
        """`fit` of `radiance` and `frames` as a generator of `Progress`; closing it cancels."""
        self.expect_params()
        lights = LightRadiance(radiance)
        expect_clusters(self.n_clusters, lights.n_points)
        layout = HRDFLayout(*lights.shape)
        frames = expect_array("frames", frames, (lights.n_points, 3, 3), np.float32)
        peak = self.peak or lights.largest()
        fitted = yield from fit_lights_steps(self, lights, peak)
        self.n_points_, self.n_lights_ = lights.n_points, lights.n_lights
        self.layout_, self.frames_, self.peak_ = layout, frames, peak
        labels, self.compressors_, bases = zip(*fitted, strict=True)
        self.labels_, self.bases_ = np.stack(labels), np.stack(bases)
        return self

    def decode(self, points, weights=None):
        """HRDFs as they were kept.

        Parameters
        ----------
        points : (n,) int, or slice
        weights : (n_lights,) or (n_lights, n_channels) float, optional
            Factors of the lights, of all three channels or each of R, G and B; default: 1.

        Returns
        -------
        (n, m1, m2, 3) float32
        """
        self._expect_fitted()
        if isinstance(points, slice):
            points = np.arange(self.n_points_)[points]
        points = expect_indices("points", points, self.n_points_)
        result = np.empty((len(points), *self.layout_.shape, 3), np.float32)
        for first in range(0, len(points), _BLOCK):
            part = points[first : first + _BLOCK]
            read = partial(_decoded, points=part)
            result[first : first + _BLOCK] = self._mixed(read, part, weights)
        return result

    def entries(self, points, cells, weights=None):
        """Single elements, without decoding the rest (equations 3 and 4).

        Parameters
        ----------
        points : (n,) int
        cells : (n,) int
            One for each of the points: row * m2 + column.
        weights : (n_lights,) or (n_lights, n_channels) float, optional

        Returns
        -------
        (n, 3) float32
        """
        self._expect_fitted()
        points = expect_array("points", points, (None,), np.int64, 0, self.n_points_ - 1)
        return self._mixed(lambda model: model.entries(points, cells), points, weights)

    def toward(self, directions, weights=None):
        """Radiance that leaves each point, between the four nearest directions that are kept.

        Made from the coefficients; `viewer` is several times as fast for many views.

        Parameters
        ----------
        directions : (n_points, 3) float
            Unit vectors in the world, from the points to the viewer. Below the facet they count
            as their nearest on the horizon.
        weights : (n_lights,) or (n_lights, n_channels) float, optional

        Returns
        -------
        (n_points, 3) float32
        """
        row, column = self._places(directions)
        read = partial(_interpolated, row=row, column=column)
        return self._mixed(read, slice(None), weights)

    def each_toward(self, directions):
        """`toward` the `directions` (n_points, 3) of each light: (n_lights, n_points, 3) float32.

        While lamps are dimmed and the view stays, their mixture costs next to nothing.
        """
        row, column = self._places(directions)
        read = partial(_interpolated, row=row, column=column)
        return np.stack([self._mixed(read, slice(None), own) for own in np.eye(self.n_lights_)])

    def viewer(self, weights=None, most_bytes=1 << 30):
        """A `Viewer` of a mixture of lights.

        Parameters
        ----------
        weights : (n_lights,) or (n_lights, n_channels) float, optional
        most_bytes : int
            Of memory for its table; where it takes more, views are made from the coefficients.

        Returns
        -------
        Viewer
        """
        return Viewer(self, weights, most_bytes)

    def error(self, radiance, weights=None):
        """The `FieldError` against `radiance` (n_points, m1, m2, 3) of the lights with `weights`.

        Weights are (n_lights,) or (n_lights, n_channels) float, and 1 by default.
        """
        self._expect_fitted()
        return field_error(self, radiance, self.peak_, weights)

    @property
    def nbytes(self):
        """Bytes at fixed width: dictionaries, clusters, indices, places, numbers and scales."""
        self._expect_fitted()
        bits = sum(int(labels.max()).bit_length() for labels in self.labels_)
        models = sum(model.nbytes for models in self.compressors_ for model in models)
        return models + -(-bits * self.n_points_ // 8) + self.bases_.nbytes

    @property
    def coded_nbytes(self):
        """Bytes of the same, entropy-coded: see `coded_nbytes_of`."""
        return coded_nbytes_of(self.state())

    def state(self):
        """Everything that `from_state` needs: a dict of arrays and of values that JSON knows.

        `data` is the compressed field; `frames` belong to the surface and not to its light.
        """
        self._expect_fitted()
        data, index, values = self._data()
        return {
            "params": self.get_params(),
            "shape": list(self.layout_.shape),
            "peak": self.peak_,
            "compressors": values,
            "index": index,
            "data": data,
            "frames": self.frames_,
        }

    def _data(self):
        """All arrays of all compressors in one, where each is, and the plain values of each."""
        arrays = {
            "labels": byte_planes(self.labels_.astype("<u2")),
            "bases": byte_planes(self.bases_.astype("<f2")),
        }
        values = []
        # What a text would say of each channel again.
        defaults = self.compressor().get_params()
        for light, models in enumerate(self.compressors_):
            values.append([])
            for channel, model in enumerate(models):
                state = model.state()
                kept = {k: v for k, v in state.items() if isinstance(v, np.ndarray)}
                params = {k: v for k, v in state["params"].items() if v != defaults[k]}
                values[-1].append({"params": params, "step": state["step"]})
                arrays.update({f"{light}.{channel}.{k}": v for k, v in kept.items()})
        return *joined(arrays), values

    @classmethod
    def from_state(cls, state):
        """The fitted field of a `state`.

        Raises
        ------
        PRTError
            Something is missing, of another shape or type, or does not fit the rest.
        """
        expect_kind("state", state, dict)
        field = value_of(state, "params", lambda params: cls(**params))
        field.layout_ = value_of(state, "shape", lambda shape: HRDFLayout(*shape))
        field.peak_ = value_of(state, "peak", float)
        field.frames_ = array_of(state, "frames", (None, 3, 3), "float32")
        field.n_points_ = len(field.frames_)
        arrays = split(state)
        values = value_of(state, "compressors", list)
        field.n_lights_ = len(values)
        shape = field.n_lights_, field.n_points_
        field.labels_ = from_byte_planes(arrays, "labels", shape, "<u2").astype(np.int32)
        field.bases_ = from_byte_planes(arrays, "bases", (shape[0], 3, shape[1]), "<f2")
        expect_state(np.isfinite(field.bases_).all(), "'bases' holds what it cannot")
        field.compressors_ = [
            [field._restored(arrays, light, channel, value) for channel, value in enumerate(each)]
            for light, each in enumerate(value_of(state, "compressors", _lists_of_three))
        ]
        return field

    def _restored(self, arrays, light, channel, values):
        start = f"{light}.{channel}."
        kept = {k.removeprefix(start): v for k, v in arrays.items() if k.startswith(start)}
        model = self.compressor()
        params = value_of(values, "params", lambda params: {**model.get_params(), **params})
        known = {"n_points": self.n_points_, "shape": self.layout_.shape, "params": params}
        return type(model).from_state({**values, **known, **kept}, self.labels_[light])

    def expect_weights(self, weights):
        """(n_lights, 3) float32 of `weights` (n_lights,) or (n_lights, n_channels), or of None."""
        self._expect_fitted()
        if weights is None:
            return np.ones((self.n_lights_, 3), np.float32)
        weights = expect_numbers("weights", weights)
        weights = weights[:, None] if weights.ndim == 1 else weights
        wanted = (self.n_lights_, 3 if weights.shape[-1:] == (3,) else 1)
        limits = -_MOST_WEIGHT, _MOST_WEIGHT
        weights = expect_array("weights", weights, wanted, np.float32, *limits)
        return np.broadcast_to(weights, (self.n_lights_, 3))

    def _mixed(self, read, points, weights):
        """Radiance of some points under all lights, of what `read` gives for one channel of one."""
        weights = self.expect_weights(weights)
        total = None
        for light, weight in enumerate(weights):
            # Where all are dark, one says what shape the darkness has.
            if weight.any() or light == self.n_lights_ - 1 and total is None:
                channels = np.stack([read(model) for model in self.compressors_[light]], axis=-1)
                base = self.bases_[light][:, points].T.astype(np.float32)
                channels += base.reshape(len(base), *(1,) * (channels.ndim - 2), 3)
                own = channels @ (FROM_YCBCR * weight).astype(np.float32)
                total = own if total is None else total + own
        return total

    def _places(self, directions):
        self._expect_fitted()
        shape = self.n_points_, 3
        directions = expect_array("directions", directions, shape, np.float32)
        local = in_frames(self.frames_.transpose(1, 2, 0), directions)
        return self.layout_.places_of(*local)

    def _expect_fitted(self):
        expect(
            hasattr(self, "compressors_"),
            "SurfaceLightField: holds nothing yet; call fit(radiance, frames) first",
        )


def coded_nbytes_of(state):
    """Bytes of a field's `state`: its `data`, and the text that describes them."""
    return len(state["data"]) + len(json.dumps([state["index"], state["compressors"]]))


def _decoded(model, points):
    return model.decode(points)


def _interpolated(model, row, column):
    return model.interpolated(row, column)


def _lists_of_three(value):
    if not all(len(each) == 3 and all(isinstance(v, dict) for v in each) for each in value):
        raise PRTError("expected three channels of each light")
    return value
