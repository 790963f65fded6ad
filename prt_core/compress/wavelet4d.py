"""Adaptive 4D wavelets (Cheslack-Postava et al. 2007): rows and columns in wavelets.

Rows are transformed over directions, columns over points. A column of a large wavelet light is a
smooth picture and is transformed deeply; that of a small one is sparse already and would only
grow. Each column stops at the depth that needs the fewest terms.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.basis import ORTHONORMAL, ImageWavelet, haar_areas, wavelet_rows
from prt_core.compress.base import Compressor, expect_count
from prt_core.compress.columns import TransposedFile, transpose_steps
from prt_core.compress.haar_lighting import OPPONENTS
from prt_core.compress.parallel import in_parallel
from prt_core.compress.quantise import quantise
from prt_core.errors import expect
from prt_core.progress import Progress

MODES = ("adaptive", "4d", "2d")
_COLUMNS = 16


class Wavelet4D(Compressor):
    """Sparse columns, each at its own depth, and one inverse transform a frame.

    Parameters
    ----------
    columns : ImageWavelet or PointHaar
        The transform of columns: an image's wavelet where the points are its pixels in reading
        order, the points' own hierarchy on any mesh.
    rows : {"haar", "d4", "d6", "d8"}
        The transform of rows on cube map faces.
    error : float
        Relative L2 error of the matrix that is aimed at.
    n_column_terms : int, optional
        Instead of `error`: the largest terms that each column keeps.
    mode : {"adaptive", "4d", "2d"}
        Best depth for each column; always all; never any.
    bits : int or None
        Of a quantised coefficient; None: float32.
    lift, dither : bool
        How coefficients are quantised (see `quantise`).
    n_terms : int or None
        Wavelets a light is cut to when relighting; None: all.
    memory : int
        Bytes that fitting may hold, the result apart.
    seed : int
        Of the dithering.

    Attributes
    ----------
    depths_ : list of (n_directions,) int
        For each mixed channel, the depth of each column.
    n_coefficients_ : int
    matrix_error_, quantisation_error_ : float
        Relative L2 of what was left out and of the quantiser; exact for orthonormal transforms.
    """

    def __init__(
        self,
        columns=None,
        rows="haar",
        error=0.02,
        n_column_terms=None,
        mode="adaptive",
        bits=9,
        lift=True,
        dither=True,
        n_terms=None,
        memory=1 << 29,
        seed=0,
    ):
        self.columns = columns
        self.rows = rows
        self.error = error
        self.n_column_terms = n_column_terms
        self.mode = mode
        self.bits = bits
        self.lift = lift
        self.dither = dither
        self.n_terms = n_terms
        self.memory = memory
        self.seed = seed

    def fit_steps(self, rows):
        self._check(rows)
        if hasattr(rows, "prepare_steps"):
            yield from rows.prepare_steps()
        transform = self.columns or ImageWavelet((1, rows.n_points))
        self._transform, self.resolution_ = transform, rows.resolution
        order = getattr(transform, "order", np.arange(rows.n_points))
        self._mix = OPPONENTS if rows.n_channels == 3 else np.eye(rows.n_channels)
        allowed, self.depths_, self._clusters = None, [], []
        lost = rounded = total = 0.0
        self.importance_ = np.zeros(rows.n_directions)
        for shares in self._mix:

            def encode(block, shares=shares):
                mixed = block @ shares.astype(np.float32)
                return wavelet_rows(mixed, rows.resolution, self.rows)

            with TransposedFile(rows.n_directions, rows.n_points) as file:
                yield from transpose_steps(rows, encode, file, order, self.memory)
                if allowed is None and self.n_column_terms is None:
                    allowed = self._threshold(file)
                channel = yield from self._fit_channel(file, allowed)
            depths, clusters, energy, left, rounding = channel
            self.depths_.append(depths)
            self._clusters.append(clusters)
            self.importance_ += energy
            lost, rounded, total = lost + left, rounded + rounding, total + energy.sum()
        self.importance_ = np.sqrt(self.importance_)
        self.matrix_error_ = float(np.sqrt(lost / total)) if total else 0.0
        self.quantisation_error_ = float(np.sqrt(rounded / total)) if total else 0.0
        self.n_coefficients_ = sum(m.nnz for c in self._clusters for m, _, _ in c.values())
        self._order = order
        return self._fitted(rows)

    def _check(self, rows):
        expect(
            rows.resolution is not None,
            "rows: 4D wavelets need the texels of a cube map; say its resolution",
        )
        n = getattr(self.columns, "n", rows.n_points)
        expect(
            n == rows.n_points,
            f"columns: a transform of {n} points, the rows have {rows.n_points}",
        )
        expect(self.mode in MODES, f"mode: expected one of {', '.join(MODES)}, got {self.mode!r}")
        expect(
            self.rows in ORTHONORMAL,
            f"rows: expected one of {', '.join(ORTHONORMAL)}, got {self.rows!r}",
        )
        expect(0 < self.error < 1, f"error: expected a number between 0 and 1, got {self.error}")
        expect(
            self.bits is None or 2 <= self.bits <= 16,
            f"bits: expected None or 2 to 16, got {self.bits!r}",
        )
        for name in ("n_column_terms", "n_terms"):
            if getattr(self, name) is not None:
                expect_count(name, getattr(self, name))

    def _fit_channel(self, file, threshold):
        """Depths, clusters by depth, energy of each column; squared errors of terms and bits."""
        n_columns, n_points = file.shape
        rng_seed = [self.seed, 8, len(self.depths_)]
        per = max(1, min(_COLUMNS, int(self.memory / (24 * n_points))))

        def one(first_columns):
            first, columns = first_columns
            energy = (columns.astype(np.float64) ** 2).sum(axis=1)
            found = self._best(columns, threshold)
            rng = np.random.default_rng([*rng_seed, first]) if self.dither else None
            parts = [
                (depth, left, places, *quantise(values, self._lifts(depth)[places], self.bits, rng))
                for depth, places, values, left in found
            ]
            return first, energy, parts

        def read():
            for first in range(0, n_columns, per):
                yield first, file.read(first, min(first + per, n_columns))

        depths, energies = np.zeros(n_columns, int), np.zeros(n_columns)
        by_depth, lost, rounded = {}, 0.0, 0.0
        for first, energy, parts in in_parallel(one, read()):
            energies[first : first + len(energy)] = energy
            for name, (depth, left, places, values, size, error) in enumerate(parts, first):
                depths[name] = depth
                lost, rounded = lost + left, rounded + error
                if len(places):
                    by_depth.setdefault(depth, []).append((name, places, values, size))
            yield Progress("columns", first + len(energy), n_columns)
        clusters = {d: _cluster(part, n_points) for d, part in sorted(by_depth.items())}
        return depths, clusters, energies, lost, rounded

    def _best(self, columns, threshold):
        """(depth, places, values, squared error left) of each column."""
        deepest = 0 if self.mode == "2d" else self._transform.depth
        least = deepest if self.mode == "4d" else 0
        work, best = columns.copy(), [None] * len(columns)
        costs = np.full(len(columns), np.inf)
        for depth in range(deepest + 1):
            if depth:
                self._transform.forward_step(work, depth - 1)
            if depth < least:
                continue
            for i, row in enumerate(work):
                limit = self._limit(row, threshold)
                squares = row * row
                kept = squares > limit
                rest = float(squares[~kept].sum(dtype=np.float64))
                # Every kept term costs what the smallest of them would have cost as an error.
                cost = rest + limit * int(kept.sum())
                if cost < costs[i] * (1 - 1e-6):
                    costs[i] = cost
                    places = np.flatnonzero(kept)
                    best[i] = depth, places, row[places].copy(), rest
        return best

    def _limit(self, row, threshold):
        """Square below which coefficients of a column are left out."""
        if threshold is not None:
            return threshold
        if self.n_column_terms >= len(row):
            return 0.0
        return float(np.partition(row * row, -self.n_column_terms - 1)[-self.n_column_terms - 1])

    def _threshold(self, file, most=192):
        """The squared threshold at which a sample of the columns has the error aimed at."""
        level, _ = haar_areas(self.resolution_)
        rng = np.random.default_rng([self.seed, 9])
        chosen, weights = [], []
        for value in np.unique(level):
            here = np.flatnonzero(level == value)
            some = rng.choice(here, min(len(here), most // (level.max() + 1)), replace=False)
            chosen += list(some)
            weights += [len(here) / len(some)] * len(some)
        columns = np.concatenate([file.read(c, c + 1) for c in chosen])
        weights = np.array(weights)
        total = weights @ (columns.astype(np.float64) ** 2).sum(axis=1)
        low, high = -80.0, 0.0
        for _ in range(14):
            middle = (low + high) / 2
            parts = [slice(f, f + _COLUMNS) for f in range(0, len(columns), _COLUMNS)]
            found = in_parallel(lambda p, m=middle: self._best(columns[p], total * 2.0**m), parts)
            left = weights @ np.array([rest for part in found for *_, rest in part])
            low, high = (middle, high) if left < self.error**2 * total else (low, middle)
        return total * 2.0**low

    def _lifts(self, depth):
        """(n_points,) float32 factors of the coefficients after `depth` steps."""
        if not self.lift:
            return np.ones(self._transform.n, np.float32)
        return (2.0 ** self._transform.scales(depth)).astype(np.float32)

    def choose(self, light, n_terms=None):
        """Wavelets that a light is cut to, by how much each weighs in the colours; coefficients."""
        coefficients = wavelet_rows(np.asarray(light, np.float32).T, self.resolution_, self.rows).T
        weight = (coefficients**2).sum(axis=1) * self.importance_**2
        n_terms = n_terms or self.n_terms
        if n_terms is None or n_terms >= len(weight):
            return np.flatnonzero(weight), coefficients
        return np.sort(np.argpartition(weight, -n_terms)[-n_terms:]), coefficients

    @property
    def nbytes(self):
        """Of the sparse columns: a value and a place for each coefficient, a size a column."""
        self._expect_fitted()
        arrays = [
            array
            for clusters in self._clusters
            for matrix, sizes, _ in clusters.values()
            for array in (matrix.data, matrix.indices, matrix.indptr, sizes)
        ]
        return sum(a.nbytes for a in arrays) + (0 if self.gain_ is None else self.gain_.nbytes)

    def _relight(self, light):
        chosen, coefficients = self.choose(light)
        wanted = np.zeros(self.n_directions_, bool)
        wanted[chosen] = True
        depth = max((max(c, default=0) for c in self._clusters), default=0)
        picture = np.zeros((self.n_channels_, self.n_points_), np.float32)
        # Equation 8: deepest columns first, one inverse step between two depths.
        for level in range(depth, -1, -1):
            for shares, clusters in zip(self._mix, self._clusters, strict=True):
                if level in clusters:
                    light = coefficients * shares.astype(np.float32)
                    picture += self._cluster_light(level, clusters[level], wanted, light)
            if level:
                self._transform.inverse_step(picture, level - 1)
        result = np.empty((self.n_points_, self.n_channels_), np.float32)
        result[self._order] = picture.T
        return result if self.gain_ is None else result * self.gain_

    def _cluster_light(self, depth, cluster, wanted, coefficients):
        matrix, sizes, names = cluster
        some = np.flatnonzero(wanted[names])
        values = matrix[:, some].astype(np.float32) @ (
            coefficients[names[some]] * sizes[some, None]
        )
        if self.bits is not None:
            values /= self._lifts(depth)[:, None]
        return values.T


def _cluster(parts, n_points):
    """Columns of one depth: sparse matrix, size of a unit of each column, names of columns."""
    ends = np.cumsum([0, *(len(places) for _, places, _, _ in parts)])
    values = np.concatenate([v for _, _, v, _ in parts])
    places = np.concatenate([p for _, p, _, _ in parts]).astype(np.int32)
    names = np.array([name for name, _, _, _ in parts])
    sizes = np.array([size for _, _, _, size in parts], np.float32)
    return sp.csc_matrix((values, places, ends), shape=(n_points, len(parts))), sizes, names
