"""Spherical harmonics: the light's lowest frequencies alone (Sloan et al. 2002)."""

import numpy as np

from prt_core.basis import harmonics, rotation_of_harmonics, texel_harmonics
from prt_core.compress.base import Compressor, pieces
from prt_core.compress.state import array_of, expect_state
from prt_core.errors import expect, expect_array, expect_whole
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.sphere import FACES, CubeMap, rotation_matrix


class Harmonics(Compressor):
    """Rows as coefficients of spherical harmonics.

    Shadows come out as soft as the order allows; turning the environment costs one small matrix.

    Parameters
    ----------
    order : int
        Degrees 0 to order - 1: order^2 coefficients a point and output.

    Attributes
    ----------
    coefficients_ : (n_points, order^2, n_outputs) float32
        What each point receives under a light that is one harmonic.
    """

    def __init__(self, order=5):
        self.order = order

    def expect_params(self):
        expect_whole("order", self.order, 1, 10)
        return self

    def fit_steps(self, rows):
        order = self.expect_params().order
        expect(
            rows.resolution is not None,
            "rows: harmonics need the texels of a cube map; say its resolution",
        )
        if hasattr(rows, "prepare_steps"):
            yield from rows.prepare_steps()
        self._integrals = texel_harmonics(rows.resolution, order, FACES)
        # A light of one harmonic is its mean over each texel.
        means = self._integrals / CubeMap(rows.resolution).solid_angles[:, None]
        coded = rows.code.light(means.astype(np.float32))

        def project(points):
            return rows.code.responses(rows.features(points), coded)

        parts, done = [], 0
        for part in in_parallel(project, rows.blocks()):
            parts.append(part)
            done += len(part)
            yield Progress("harmonics", done, rows.n_points)
        self.coefficients_ = np.concatenate(parts)
        return self._fitted(rows)

    def project(self, light):
        """Coefficients of a light: (order^2, n_channels) float64."""
        return self._integrals.T @ self._as_light(light).astype(np.float64)

    def product_of_coefficients(self, coefficients, rotation=None):
        """`product` with a light given by coefficients, turned by `rotation` (degrees or matrix).

        Returns (n_points, n_outputs) float32.
        """
        self._expect_fitted()
        if rotation is not None:
            turn = rotation_of_harmonics(rotation_matrix(rotation), self.order)
            coefficients = turn @ coefficients
        shape = self.order**2, self.n_channels_
        values = expect_array("coefficients", coefficients, shape, np.float32)
        return np.einsum("nko,ko->no", self.coefficients_, np.take(values, self.reads_, axis=1))

    @property
    def nbytes(self):
        self._expect_fitted()
        return self.coefficients_.nbytes

    def _product(self, light):
        return self.product_of_coefficients(self.project(light))

    def _entries(self, points, columns):
        result = np.empty((len(points), self.n_outputs_), np.float32)
        integrals = self._integrals.astype(np.float32)
        for part in pieces(len(points)):
            coefficients = self.coefficients_[points[part]]
            result[part] = np.einsum("nko,nk->no", coefficients, integrals[columns[part]])
        return result

    def _state(self):
        return {"coefficients": self.coefficients_}

    def _restore(self, state):
        _expect_cube_map(self)
        order = expect_whole("order", self.order, 1)
        shape = self.n_points_, order**2, self.n_outputs_
        self.coefficients_ = array_of(state, "coefficients", shape, "float32")
        self._integrals = texel_harmonics(self.resolution_, order, FACES)


class Irradiance(Compressor):
    """Nine coefficients and the normal: no shadows, no bounces (Ramamoorthi & Hanrahan 2001).

    What every scene can do without a bake, so the floor for all others. A product is cut at zero,
    and so is each entry: what entries add up to under a light may be more.
    """

    # The clamped cosine's factors of degree 0, 1 and 2.
    _FACTORS = np.pi * np.array([1, *(2 / 3,) * 3, *(1 / 4,) * 5])

    def fit_steps(self, rows):
        expect(
            hasattr(rows, "transport"),
            "rows: irradiance needs the points' normals; give the rows of a transport",
        )
        yield Progress("irradiance", 0, rows.n_points)
        normals = rows.transport.normals
        self.weights_ = (harmonics(normals, 3) * (self._FACTORS / np.pi)).astype(np.float32)
        self._integrals = texel_harmonics(rows.resolution, 3, FACES)
        return self._fitted(rows)

    @property
    def nbytes(self):
        self._expect_fitted()
        return self.weights_.nbytes

    def _product(self, light):
        coefficients = (self._integrals.T @ np.asarray(light, np.float64)).astype(np.float32)
        # Nine terms overshoot below zero behind a hard light.
        return np.maximum(self.weights_ @ np.take(coefficients, self.reads_, axis=1), 0)

    def _entries(self, points, columns):
        integrals = self._integrals[columns].astype(np.float32)
        values = np.maximum(np.einsum("nk,nk->n", self.weights_[points], integrals), 0)
        return np.repeat(values[:, None], self.n_outputs_, axis=1)

    def _state(self):
        return {"weights": self.weights_}

    def _restore(self, state):
        _expect_cube_map(self)
        self.weights_ = array_of(state, "weights", (self.n_points_, 9), "float32")
        self._integrals = texel_harmonics(self.resolution_, 3, FACES)


def _expect_cube_map(model):
    expect_state(
        model.resolution_ and 6 * model.resolution_**2 == model.n_directions_,
        "its directions are no cube map",
    )
