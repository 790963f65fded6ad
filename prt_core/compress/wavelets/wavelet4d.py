"""Adaptive 4D wavelets (Cheslack-Postava et al. 2007): rows and columns in wavelets.

Rows are transformed over directions, columns over points. A column of a large wavelet light is a
smooth picture and is transformed deeply; that of a small one is sparse already and would only
grow. Each column stops at the depth that needs the fewest terms; on a mesh it also takes the better
of two transforms, told by the sign of its depth.
"""

import numpy as np

from prt_core.basis import (
    ORTHONORMAL,
    ImageWavelet,
    PointHaar,
    PointMultiwavelet,
    haar_areas,
    wavelet_rows,
)
from prt_core.compress.base import Compressor
from prt_core.compress.light_terms import heaviest
from prt_core.compress.parameters import expect_optional
from prt_core.compress.state import array_of, expect_state, value_of
from prt_core.compress.wavelets.column_coder import ColumnCoder
from prt_core.compress.wavelets.column_pictures import columns_by_depth, picture_of
from prt_core.compress.wavelets.columns import transposed_steps
from prt_core.compress.wavelets.mixed_rows import mixed_wavelets
from prt_core.compress.wavelets.quantise import SCALINGS
from prt_core.compress.wavelets.sparse_columns import (
    SparseColumns,
    column_bytes,
    groups_state,
    unpack_groups,
)
from prt_core.errors import (
    expect,
    expect_flag,
    expect_number,
    expect_offers,
    expect_one_of,
    expect_seed,
    expect_whole,
)
from prt_core.runtime.threads import on_all_cores

MODES = ("adaptive", "4d", "2d")


class Wavelet4D(Compressor):
    """Sparse quantised columns, each at its own depth, and one inverse transform a frame.

    Parameters
    ----------
    columns : ImageWavelet, PointMultiwavelet or PointHaar, optional
        The transform of columns: an image's wavelet where the points are its pixels in reading
        order, one on the points' own hierarchy on any mesh. Default: none, which leaves `mode`
        "2d".
    rows : {"haar", "d4", "d6", "d8"}
        The transform of rows on cube map faces.
    error : float
        Relative L2 error of the matrix, quantisation included: met, and by not more than 2 %.
        0: every term is kept.
    nbytes_wanted : int, optional
        Instead of `error`: the bytes that the columns may take.
    mode : {"adaptive", "4d", "2d"}
        Best depth for each column; always all; never any.
    bits : int or None
        Of a quantised coefficient, 2 to 16; None: float32.
    scaling : {"root", "levels", "none"}
    dither : bool
        How coefficients are quantised (see `quantise`).
    light_error : float or None
        Wavelets of a light are left out when relighting, while their expected share of the colours
        stays below this; 0: all are used. None: a tenth of the matrix' error.
    n_terms : int or None
        Wavelets a light is cut to, at most.
    memory : int
        Bytes that fitting may hold, the result apart. The transformed rows are in a temporary
        file of 4 bytes an entry.
    seed : int
        Of the dithering and of the sample of columns.

    Attributes
    ----------
    depths_ : (n_columns,) int
        Steps of each column; columns are the directions' wavelets, one output after another
        (three outputs as luminance and two differences).
    counts_ : (n_columns,) int
        Terms of each column.
    n_coefficients_ : int
    matrix_error_ : float
        Relative L2 of the matrix, measured on the whole of it.
    limit_ : float
        Square of the smallest term that was kept.
    importance_ : (n_directions,) float16
        Size of each wavelet's columns, relative to the largest.
    """

    _UNCUT = {"n_terms": None, "light_error": 0.0}

    def __init__(
        self,
        columns=None,
        rows="haar",
        error=0.02,
        nbytes_wanted=None,
        mode="adaptive",
        bits=9,
        scaling="root",
        dither=False,
        light_error=None,
        n_terms=None,
        memory=1 << 29,
        seed=0,
    ):
        self.columns = columns
        self.rows = rows
        self.error = error
        self.nbytes_wanted = nbytes_wanted
        self.mode = mode
        self.bits = bits
        self.scaling = scaling
        self.dither = dither
        self.light_error = light_error
        self.n_terms = n_terms
        self.memory = memory
        self.seed = seed

    def fit_steps(self, rows):
        with (yield from self.columns_steps(rows)) as file:
            return (yield from self.fit_columns_steps(rows, file))

    def columns_steps(self, rows):
        """The first half of `fit`: rows in wavelets, and turned.

        Parameters
        ----------
        rows : Rows

        Returns
        -------
        ColumnFile
            To be closed. The same for any error, mode and bits.
        """
        self._check(rows)
        if hasattr(rows, "prepare_steps"):
            yield from rows.prepare_steps()
        mixed, encode = mixed_wavelets(rows, self.rows)
        order = self._prepare(rows.n_points, mixed)
        n_columns = rows.n_directions * len(mixed)
        return (yield from transposed_steps(encode, n_columns, order, self.memory))

    def fit_columns_steps(self, rows, file):
        """The second half of `fit`: columns in wavelets, cut and packed.

        Parameters
        ----------
        rows : Rows
        file : ColumnFile
            Of `columns_steps`.

        Returns
        -------
        self
        """
        self._check(rows)
        mixed, _ = mixed_wavelets(rows, self.rows)
        self._prepare(rows.n_points, mixed)
        most = 0 if self.mode == "2d" else self._transform.depth
        coder = ColumnCoder(
            self._transform, most if self.mode == "4d" else 0, most,
            self.bits, self.scaling, self.dither, self.memory, self.seed,
        )  # fmt: skip
        level, _ = haar_areas(rows.resolution)
        strata = np.arange(len(mixed))[:, None] * (level.max() + 1) + level
        encoded, self.matrix_error_, self.limit_ = yield from coder.fitting_steps(
            file, strata.ravel(), self.error, self.nbytes_wanted
        )
        energies = file.energies.reshape(len(mixed), -1).sum(axis=0)
        self.importance_ = _relative(np.sqrt(energies))
        self._pack(encoded, file.shape[0])
        return self._fitted(rows)

    def expect_params(self):
        if self.columns is not None:
            expect_offers("columns", self.columns, ("n", "depth", "forward_step"), "a transform")
        expect_one_of("mode", self.mode, MODES)
        expect_one_of("rows", self.rows, ORTHONORMAL)
        expect_one_of("scaling", self.scaling, SCALINGS)
        expect_number("error", self.error, 0, below=1)
        if self.bits is not None:
            expect_whole("bits", self.bits, 2, 16)
        expect_flag("dither", self.dither)
        if self.light_error is not None:
            expect_number("light_error", self.light_error, 0, below=1)
        expect_whole("memory", self.memory, 1)
        expect_seed(self.seed)
        expect_optional("nbytes_wanted", self.nbytes_wanted, 1)
        expect_optional("n_terms", self.n_terms, 1)
        return self

    def _check(self, rows):
        self.expect_params()
        expect(
            rows.resolution is not None,
            "rows: 4D wavelets need the texels of a cube map; say its resolution",
        )
        n = getattr(self.columns, "n", rows.n_points)
        expect(
            n == rows.n_points,
            f"columns: a transform of {n} points, the rows have {rows.n_points}",
        )

    def _prepare(self, n_points, mixed):
        self._transform = self.columns or ImageWavelet((1, n_points))
        if self.mode == "2d":
            # Without steps the order is all that counts.
            self._transform = self._transform.haar or self._transform
        self._order = getattr(self._transform, "order", np.arange(n_points))
        self._mixed = mixed
        return self._order

    def _pack(self, encoded, n_columns):
        names = np.array([column.name for column in encoded], int)
        depths = np.array([column.depth for column in encoded], int)
        counts = np.array([len(column.places) for column in encoded], int)
        _, words = column_bytes(counts, self._transform.n, self.bits)
        # One packing for each length of words; its columns by depth.
        self._groups = []
        for word in np.unique(words):
            mine = np.flatnonzero(words == word)
            mine = mine[np.argsort(depths[mine], kind="stable")]
            part = [encoded[i] for i in mine]
            packed = SparseColumns.pack(
                self._transform.n, int(word), self.bits, names[mine],
                [c.size for c in part], [c.places for c in part], [c.values for c in part],
            )  # fmt: skip
            self._groups.append((depths[mine], packed))
        self._count(n_columns)

    def _count(self, n_columns):
        self.depths_, self.counts_ = np.zeros(n_columns, int), np.zeros(n_columns, int)
        for depths, packed in self._groups:
            self.depths_[packed.names], self.counts_[packed.names] = abs(depths), packed.counts
        self.n_coefficients_ = int(self.counts_.sum())

    @property
    def nbytes(self):
        """Of the columns (places, values, sizes, counts, names), the order and features of the
        points, and the weights of the wavelets."""
        self._expect_fitted()
        result = sum(packed.nbytes for _, packed in self._groups)
        result += sum(array.nbytes for array in _points_state(self._transform).values())
        return result + self.importance_.nbytes

    def choose(self, light):
        """The wavelets that a light is cut to: those that weigh most in the colours.

        Parameters
        ----------
        light : (n_directions, n_channels) float

        Returns
        -------
        coefficients : (n_directions, n_channels) float32
            Of the light; zero for all others.
        """
        light = self._as_light(light)
        coefficients = wavelet_rows(light.T, self.resolution_, self.rows).T
        share = self.matrix_error_ / 10 if self.light_error is None else self.light_error
        importance = self.importance_.astype(np.float64)
        # Each channel counts as often as it is read.
        counts = np.bincount(self.reads_, minlength=self.n_channels_)
        weight = (coefficients.astype(np.float64) ** 2 * counts).sum(axis=1) * importance**2
        result = np.zeros_like(coefficients)
        chosen = heaviest(weight, self.n_terms, share)
        result[chosen] = coefficients[chosen]
        return result

    def _product(self, light):
        coefficients = self.choose(light)
        read = np.take(coefficients, self.reads_, axis=1)
        pictures = self._pictures((self._mixed[:, None] * read).reshape(-1, self.n_outputs_))
        result = np.empty((self.n_points_, self.n_outputs_), np.float32)
        result[self._order] = pictures.T
        return result

    def _entries(self, points, columns):
        """By columns, all points at once: those of several directions are one inverse transform."""
        result = np.empty((len(points), self.n_outputs_), np.float32)
        places, (used, which) = np.argsort(self._order), np.unique(columns, return_inverse=True)
        each = 4 * self.n_outputs_ * (len(self._mixed) * self.n_directions_ + 4 * self.n_points_)
        per = int(np.clip(self.memory / each, 1, 256))
        for first in range(0, len(used), per):
            block = used[first : first + per]
            lights = np.zeros((len(block), self.n_directions_), np.float32)
            lights[np.arange(len(block)), block] = 1
            coefficients = wavelet_rows(lights, self.resolution_, self.rows).T
            weights = self._mixed[:, None, None] * coefficients[None, :, :, None]
            pictures = self._pictures(weights.reshape(-1, len(block) * self.n_outputs_))
            pictures = pictures.reshape(len(block), self.n_outputs_, -1)
            mine = np.flatnonzero((which >= first) & (which < first + per))
            result[mine] = pictures[which[mine] - first, :, places[points[mine]]]
        return result

    def _pictures(self, weights):
        """(m, n_points): columns times (n_columns, m) weights, points in the order of columns."""
        quantised = self.scaling if self.bits is not None else "none"
        # Quantised are roots (see `quantise`).
        decode = (lambda v: v * np.abs(v)) if quantised == "root" else np.asarray
        columns = columns_by_depth(self._groups, weights, decode)
        jobs = [({d: part for d, part in columns.items() if d >= 0}, self._transform)]
        plain = {-d: part for d, part in columns.items() if d < 0}
        if plain:
            jobs.append((plain, self._transform.haar))
        parts = on_all_cores(
            lambda job: picture_of(*job, weights.shape[1], quantised == "levels"), jobs
        )
        return np.sum(parts, axis=0)

    def state(self):
        state = super().state()
        # The transform of columns is told by `_points_state`, or by the image's size.
        state["params"] = {key: v for key, v in state["params"].items() if key != "columns"}
        return state

    def _state(self):
        state = {
            "matrix_error": self.matrix_error_,
            "limit": self.limit_,
            "importance": self.importance_,
            "mixed": self._mixed.astype(np.float32),
            **groups_state(self._groups),
            **_points_state(self._transform),
        }
        if isinstance(self._transform, PointHaar):
            return state
        return {**state, "image": [*map(int, self._transform.shape), self._transform.wavelet]}

    def _restore(self, state):
        self.matrix_error_ = value_of(state, "matrix_error", float)
        self.limit_ = value_of(state, "limit", float)
        expect_state(self.bits is None or self.bits in range(2, 17), "'bits' is out of range")
        if "order" in state:
            self.columns = _points_transform(state, self.n_points_)
        else:
            self.columns = value_of(state, "image", _image_wavelet)
            expect_state(self.columns.n == self.n_points_, "'image' has another size")
        mixed = array_of(state, "mixed", (None, self.n_outputs_), "float32")
        self._prepare(self.n_points_, mixed)
        self.importance_ = array_of(state, "importance", (self.n_directions_,), "float16")
        n_columns = len(mixed) * self.n_directions_
        self._groups = value_of(
            state, "groups", lambda _: unpack_groups(state, self.n_points_, n_columns, self.bits)
        )
        least = -self._transform.depth if self._transform.haar else 0
        expect_state(
            all(least <= d.min() and d.max() <= self._transform.depth for d, _ in self._groups),
            "'groups' are too deep",
        )
        self._count(n_columns)


def _relative(importance):
    """Shares of the largest, float16: all that is compared is one wavelet with another."""
    return (importance / (importance.max(initial=0) or 1)).astype(np.float16)


def _points_state(transform):
    """The arrays that tell a transform on points; none for images."""
    state = {}
    if isinstance(transform, PointHaar):
        state["order"] = transform.order.astype(_index_type(transform.n))
    if isinstance(transform, PointMultiwavelet):
        state["features"] = transform.features
        state["check"] = np.array([transform.check()])
    return state


def _points_transform(state, n_points):
    """The transform of a `_points_state`."""
    order = array_of(state, "order", (n_points,), _index_type(n_points), n_points)
    if "features" not in state:
        return PointHaar.from_order(order)
    features = array_of(state, "features", (n_points, None), "int8")
    transform = PointMultiwavelet.from_order(order, features)
    checks, check = transform.check(), array_of(state, "check", (1,), "float64")[0]
    expect_state(abs(checks - check) < 1e-5, f"a basis came out as {checks}, expected {check}")
    return transform


def _index_type(n):
    return np.uint16 if n <= 1 << 16 else np.int32


def _image_wavelet(words):
    height, width, wavelet = words
    return ImageWavelet((int(height), int(width)), wavelet)
