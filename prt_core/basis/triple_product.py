"""Triple products of Haar wavelets: integrals of three functions, and products of two.

A tripling coefficient is `C_ijk = sum over texels of psi_i psi_j psi_k`. On squares of s x s
texels of a face it is not zero in three cases only (Ng et al. 2004, the Haar tripling coefficient
theorem):

1. all three are the scaling function of one coarsest square: 1 / s;
2. all three are the different wavelets of one square: 1 / s;
3. two are the same wavelet, and the third is the scaling function of its square, or a wavelet or
   scaling function of a larger square around it: plus or minus 1 / s of the third.

So multiplication by a function f is a sparse matrix. It scales each wavelet by the mean of f over
its square (rule 3: all that is larger adds up to that mean), mixes the wavelets of a square (rule
2), and sends each coefficient of f to the wavelets of larger squares around it (rule 3, the other
way round). Where all functions have few coefficients, so has the work.

Coefficients are those of `haar_rows`.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.basis.haar import expect_rows, haar_levels, haar_rows
from prt_core.errors import expect, expect_array, expect_whole

# Which two of a square's three wavelets (along columns, along rows, both) are not this one.
_OTHERS = np.array([[1, 2], [0, 2], [0, 1]])
_MOST_RESOLUTION = 1024


class HaarSquares:
    """Where each coefficient of a cube map stands: its square, and which wavelet of it.

    Parameters
    ----------
    resolution : int

    Attributes
    ----------
    grid : (n_directions,) int32
        Squares along an edge of the face, among which that of the coefficient is.
    side : (n_directions,) int32
        Texels along an edge of the square.
    kind : (n_directions,) int8
        0 differences along columns, 1 along rows, 2 both; -1 the scaling function.
    row, column, face : (n_directions,) int32
        Of the square in its grid.
    """

    def __init__(self, resolution):
        n = self.resolution = expect_whole("resolution", resolution, 1, _MOST_RESOLUTION)
        self.coarsest = n >> haar_levels(n)
        face, row, column = np.unravel_index(np.arange(6 * n * n, dtype=np.int32), (6, n, n))
        grid = np.full(6 * n * n, self.coarsest)
        largest = np.maximum(row, column)
        for _ in range(haar_levels(n) - 1):
            grid = np.where(largest >= 2 * grid, 2 * grid, grid)
        kind = (column >= grid) + 2 * (row >= grid) - 1
        self.grid, self.kind = grid.astype(np.int32), kind.astype(np.int8)
        self.row, self.column = (row % grid).astype(np.int32), (column % grid).astype(np.int32)
        self.face, self.side = face.astype(np.int32), (n // grid).astype(np.int32)

    def place(self, grid, face, row, column, kind):
        """(m,) int64 places of coefficients of squares; arguments that broadcast."""
        n = self.resolution
        row = row + np.where((kind == 1) | (kind == 2), grid, 0)
        column = column + np.where((kind == 0) | (kind == 2), grid, 0)
        return (np.int64(face) * n + row) * n + column

    def around(self, places):
        """Larger squares' wavelets and scaling functions over those of (m,) `places`.

        Yields
        ------
        places : (k,) int64
            Of those around, one kind and one size of squares a time.
        values : (k,) float64
            Theirs on the squares inside.
        which : (k,) int
            Of the m places; those that have a square so much larger.
        """
        which = np.flatnonzero(self.kind[places] >= 0)
        inside = places[which]
        grid, face = self.grid[inside], self.face[inside]
        row, column = self.row[inside], self.column[inside]
        while len(which):
            last = grid == self.coarsest
            if last.any():
                at = face[last], row[last], column[last], -1
                yield (
                    self.place(grid[last], *at),
                    np.full(last.sum(), self.coarsest / self.resolution),
                    which[last],
                )
            which, grid, face, row, column = (
                a[~last] for a in (which, grid, face, row, column)
            )  # fmt: skip
            across, down = 1 - 2 * (column & 1), 1 - 2 * (row & 1)
            grid, row, column = grid >> 1, row >> 1, column >> 1
            for kind, sign in enumerate((across, down, across * down)):
                value = sign * (grid / self.resolution)
                yield self.place(grid, face, row, column, kind), value, which


def tripling_coefficients(i, j, k, resolution):
    """C_ijk of wavelets at places i, j and k of a cube map's coefficients, by the three rules.

    Parameters
    ----------
    i, j, k : (m,) int
    resolution : int

    Returns
    -------
    (m,) float64
    """
    squares = HaarSquares(resolution)
    last = len(squares.kind) - 1
    i = expect_array("i", i, (None,), np.int64, 0, last)
    j = expect_array("j", j, (len(i),), np.int64, 0, last)
    k = expect_array("k", k, (len(i),), np.int64, 0, last)
    result = np.zeros(len(i))
    same = np.ones(len(i), bool)
    for name in ("grid", "face", "row", "column"):
        value = getattr(squares, name)
        same &= (value[i] == value[j]) & (value[j] == value[k])
    kinds = np.sort(np.stack([squares.kind[x] for x in (i, j, k)]), axis=0).T
    scaling, wavelets = (kinds == -1).all(axis=1), (kinds == [0, 1, 2]).all(axis=1)
    rule = same & (scaling | wavelets)
    result[rule] = 1 / squares.side[i[rule]]
    # A pair, and one around it.
    for pair, partner, third in ((i, j, k), (i, k, j), (j, k, i)):
        for places, values, which in squares.around(pair):
            match = (pair[which] == partner[which]) & (third[which] == places)
            result[which[match]] = values[match]
    return result


def multiplication_matrix(coefficients, resolution):
    """Multiplication by a function on a cube map, in wavelets.

    Parameters
    ----------
    coefficients : (6 resolution^2,) float
        Of the function; those that are 0 cost nothing.
    resolution : int

    Returns
    -------
    (6 resolution^2, 6 resolution^2) CSR float64
        Symmetric: times the coefficients of g it gives those of the product with g.
    """
    row = expect_rows(np.asarray(coefficients, np.float64), resolution)
    expect(row.ndim == 1, f"coefficients: expected a row of one function, got {row.shape}")
    squares = HaarSquares(resolution)
    n = len(row)
    kept = np.flatnonzero(row)
    wavelets = kept[squares.kind[kept] >= 0]
    rows, columns, values = [np.arange(n)], [np.arange(n)], [square_means(row, resolution)]
    # Rule 2: a wavelet of f turns the second of its square into the third.
    kind = squares.kind[wavelets]
    at = [getattr(squares, name)[wavelets] for name in ("grid", "face", "row", "column")]
    one, other = (squares.place(*at, _OTHERS[kind, which]) for which in (0, 1))
    mixed = row[wavelets] / squares.side[wavelets]
    pairs = [(one, other, mixed)]
    # Rule 3: it goes to what is around it.
    for places, around, which in squares.around(wavelets):
        pairs.append((wavelets[which], places, row[wavelets[which]] * around))
    for a, b, value in pairs:
        rows += [a, b]
        columns += [b, a]
        values += [value, value]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    result = sp.csr_matrix(entries, shape=(n, n))
    result.eliminate_zeros()
    return result


def square_means(coefficients, resolution):
    """Mean of a function over the square of each coefficient, (6 resolution^2,) float64."""
    row = expect_rows(np.asarray(coefficients, np.float64), resolution)
    n = resolution
    faces = haar_rows(row, n, inverse=True).reshape(6, n, n)
    squares = HaarSquares(n)
    result = np.empty(row.shape)
    grid = n
    while True:
        here = squares.grid == grid
        at = squares.face[here], squares.row[here], squares.column[here]
        result[here] = faces[at]
        if grid == squares.coarsest:
            return result
        grid //= 2
        faces = faces.reshape(6, grid, 2, grid, 2).mean(axis=(2, 4))


def triple_product(first, second, third, resolution):
    """The sum over texels of three functions, from their wavelets.

    Parameters
    ----------
    first, second, third : (6 resolution^2,) float
        Coefficients; most of them 0.
    resolution : int

    Returns
    -------
    float
    """
    second = expect_rows(np.asarray(second, np.float64), resolution)
    third = expect_rows(np.asarray(third, np.float64), resolution)
    kept, others = np.flatnonzero(third), np.flatnonzero(second)
    matrix = multiplication_matrix(first, resolution)[kept][:, others]
    return float(third[kept] @ (matrix @ second[others]))
