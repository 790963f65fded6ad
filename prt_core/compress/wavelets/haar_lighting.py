"""Non-linear wavelet lighting (Ng et al. 2003): Haar rows, lights cut to the best few wavelets."""

import numpy as np
import scipy.sparse as sp

from prt_core.basis import haar_areas, haar_rows, haar_texels
from prt_core.compress.base import Compressor, pieces
from prt_core.compress.light_terms import heaviest
from prt_core.compress.parameters import expect_optional
from prt_core.compress.state import array_of, expect_state, value_of
from prt_core.errors import expect, expect_kind, expect_number, expect_one_of, expect_whole
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress

SELECTIONS = ("unweighted", "area", "transport")
# Luminance and two differences: what three outputs have in common is stored once.
OPPONENTS = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])


class HaarLighting(Compressor):
    """Sparse quantised wavelet rows, multiplied by the light's most important wavelets.

    Parameters
    ----------
    n_terms : int or None
        Wavelets a light is cut to; None: all.
    selection : {"transport", "area", "unweighted"}
        Which count most: largest coefficient; weighted by the wavelet's area; or by the size of
        its column of the matrix.
    step : float
        Quantisation step as a share of the largest coefficient of the direct rows: entries below
        half of it vanish.
    """

    _UNCUT = {"n_terms": None}

    def __init__(self, n_terms=256, selection="transport", step=1 / 254):
        self.n_terms = n_terms
        self.selection = selection
        self.step = step

    def expect_params(self):
        expect_one_of("selection", self.selection, SELECTIONS)
        expect_number("step", self.step, above=0, below=1)
        expect_optional("n_terms", self.n_terms, 1)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        expect(
            rows.resolution is not None,
            "rows: Haar lighting needs the texels of a cube map; say its resolution",
        )
        if hasattr(rows, "prepare_steps"):
            yield from rows.prepare_steps()
        self._mix = OPPONENTS if rows.n_outputs == 3 else np.eye(rows.n_outputs)
        largest = 0.0
        for points in rows.blocks(max(1, rows.n_points // 16)):
            sample = self._encode(rows.block(points[:: max(1, len(points) // 64)]))
            largest = max(largest, float(np.abs(sample).max(initial=0)))
        self.step_ = self.step * largest or 1.0

        def quantise(points):
            scaled = np.rint(self._encode(rows.block(points)) / np.float32(self.step_))
            return [_sparse(part) for part in scaled], (scaled**2).sum(axis=1, dtype=np.float64)

        parts, energy, done = [], 0.0, 0
        for matrices, squares in in_parallel(quantise, rows.blocks(256)):
            parts.append(matrices)
            energy = energy + squares
            done += matrices[0].shape[0]
            yield Progress("wavelets", done, rows.n_points)
        self.columns_ = [sp.vstack(p, format="csc") for p in zip(*parts, strict=True)]
        self.importance_ = np.sqrt(energy.sum(axis=0)) * self.step_
        _, self._areas = haar_areas(rows.resolution)
        return self._fitted(rows)

    def terms(self, light, n_terms=None, selection=None):
        """The wavelets a light is cut to.

        Parameters
        ----------
        light : (n_directions, n_channels) float
        n_terms, selection : optional
            Instead of the estimator's own.

        Returns
        -------
        chosen : (n,) int
            Sorted.
        coefficients : (n_directions, n_channels)
            All of the light's.
        """
        coefficients = self.transform_light(light)
        return self.choose(coefficients, n_terms or self.n_terms, selection), coefficients

    def transform_light(self, light):
        """Wavelet coefficients of a light, (n_directions, n_channels)."""
        return haar_rows(self._as_light(light).T, self.resolution_).T

    def choose(self, coefficients, n_terms, selection=None):
        """The `n_terms` largest coefficients under the selection's weights, sorted."""
        selection = selection or self.selection
        # Each channel counts as often as it is read.
        counts = np.bincount(self.reads_, minlength=coefficients.shape[1])
        weight = (coefficients**2 * counts.astype(coefficients.dtype)).sum(axis=1)
        if selection == "area":
            # An edge of the row changes an orthonormal coefficient by the root of its area.
            weight = weight * self._areas
        elif selection == "transport":
            weight = weight * self.importance_**2
        return heaviest(weight, n_terms)

    def products(self, chosen, coefficients):
        """(n_points, n_outputs) float32: received of the `chosen` wavelets' `coefficients`."""
        result = np.zeros((self.n_points_, self.n_outputs_), np.float32)
        read = coefficients[chosen][:, self.reads_]
        for shares, columns in zip(self._mix, self.columns_, strict=True):
            light = read * (shares * self.step_)
            used = np.flatnonzero(shares)
            block = columns[:, chosen].astype(np.float32)
            result[:, used] += block @ np.ascontiguousarray(light[:, used], np.float32)
        return result

    @property
    def nbytes(self):
        """Of the sparse columns: a value and a row for each coefficient."""
        self._expect_fitted()
        return sum(m.data.nbytes + m.indices.nbytes + m.indptr.nbytes for m in self.columns_)

    def _product(self, light):
        return self.products(*self.terms(light))

    def _entries(self, points, columns):
        result = np.zeros((len(points), self.n_outputs_), np.float32)
        for part in pieces(len(points)):
            places, values = haar_texels(columns[part], self.resolution_)
            for shares, matrix in zip(self._mix, self.columns_, strict=True):
                looked_up = _looked_up(matrix, points[part, None], places)
                sums = np.einsum("nt,nt->n", looked_up, values) * np.float32(self.step_)
                result[part] += sums[:, None] * shares.astype(np.float32)
        return result

    def _state(self):
        state = {"step": self.step_, "importance": self.importance_}
        for i, matrix in enumerate(self.columns_):
            state[f"data{i}"] = matrix.data
            state[f"indices{i}"] = matrix.indices.astype(np.int32)
            state[f"indptr{i}"] = matrix.indptr.astype(np.int32)
        return state

    def _restore(self, state):
        n_points, n_directions = self.n_points_, self.n_directions_
        self.step_ = value_of(state, "step", float)
        self.importance_ = array_of(state, "importance", (n_directions,), "float64")
        expect_state(
            self.resolution_ and 6 * self.resolution_**2 == n_directions,
            "its directions are no cube map",
        )
        self._mix = OPPONENTS if self.n_outputs_ == 3 else np.eye(self.n_outputs_)
        self.columns_ = []
        for i in range(self.n_outputs_):
            starts = array_of(state, f"indptr{i}", (n_directions + 1,), "int32")
            n = int(starts[-1])
            rows = array_of(state, f"indices{i}", (n,), "int32", n_points)
            kind = getattr(state.get(f"data{i}"), "dtype", None)
            expect_state(
                kind in (np.int8, np.int16, np.int32)
                and starts[0] == 0 and (np.diff(starts) >= 0).all(),
                "its columns do not fit each other",
            )  # fmt: skip
            data = array_of(state, f"data{i}", (n,), kind)
            matrix = sp.csc_matrix((data, rows, starts), shape=(n_points, n_directions))
            matrix.sort_indices()
            self.columns_.append(matrix)
        _, self._areas = haar_areas(self.resolution_)

    def _encode(self, block):
        """(n_groups, n, n_directions) wavelets of mixed outputs."""
        mixed = np.einsum("ndc,gc->gnd", block, self._mix.astype(np.float32), optimize=True)
        return haar_rows(mixed, round((block.shape[1] / 6) ** 0.5))


class IncrementalLighting:
    """Products frame after frame by what changed (Overbeck et al. 2006).

    Each frame spends its terms on the wavelets whose difference to what is already in the
    picture matters most; while the light stands still the picture converges to the exact one.

    Parameters
    ----------
    model : HaarLighting
        Fitted.
    n_terms : int, optional
        A frame; default: the model's.
    """

    def __init__(self, model, n_terms=None):
        expect_kind("model", model, HaarLighting, "a fitted HaarLighting")
        model._expect_fitted()
        if n_terms is not None:
            expect_whole("n_terms", n_terms, 1)
        self.model, self.n_terms = model, n_terms or model.n_terms
        self.shown = np.zeros((model.n_directions_, model.n_channels_), np.float32)
        # In float64: thousands of small differences add up.
        self._received = np.zeros((model.n_points_, model.n_outputs_))

    def product(self, light):
        """(n_points, n_outputs) float32 after one more frame under `light`."""
        wanted = self.model.transform_light(light)
        difference = wanted - self.shown
        chosen = self.model.choose(difference, self.n_terms)
        self._received += self.model.products(chosen, difference)
        self.shown[chosen] = wanted[chosen]
        return self._received.astype(np.float32)


def _looked_up(matrix, rows, columns):
    """Entries of a CSC matrix with sorted columns, float32 in the shape of `columns`.

    By halving all columns at once; scipy goes through each of them from its beginning.
    """
    if not matrix.nnz:
        return np.zeros(columns.shape, np.float32)
    first, end = matrix.indptr[columns], matrix.indptr[columns + 1]
    last = end
    while (going := first < last).any():
        middle = first + (last - first) // 2
        below = going & (matrix.indices[np.minimum(middle, matrix.nnz - 1)] < rows)
        first = np.where(below, middle + 1, first)
        last = np.where(going & ~below, middle, last)
    at = np.minimum(first, matrix.nnz - 1)
    held = (first < end) & (matrix.indices[at] == rows)
    return np.where(held, matrix.data[at], 0).astype(np.float32)


def _sparse(values):
    """CSR of integers in float32, in the smallest type that holds them."""
    largest = np.abs(values).max(initial=0)
    kind = np.int8 if largest < 128 else np.int16 if largest < 1 << 15 else np.int32
    matrix = sp.csr_matrix(values.astype(kind))
    matrix.indices = matrix.indices.astype(np.int32)
    return matrix
