"""A BRDF as a sum of products: what it does with light, times what it does for viewers.

rho(in, out) cos(in) is about sum_k F_k(in) G_k(out). Light then meets the factors F_k once, and any
view weighs the results by G_k. No other factors of this number are closer: they are the singular
vectors of the BRDF over a grid of directions of the hemisphere, each with the same solid angle.
Azimuth is part of the grid, so that anisotropic lobes and highlights keep their place.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.errors import expect, expect_kind, expect_numbers, expect_seed, expect_whole
from prt_core.reflectance.arrays import expect_directions
from prt_core.reflectance.brdf import Reflectance
from prt_core.sphere import hemisphere_directions, hemisphere_square

# Below this slider of roughness there are too many terms to be of use.
LEAST_ROUGHNESS = 0.45
# Vectors besides those asked for, and rounds, of the search for singular vectors.
_MORE, _ROUNDS = 16, 4
# Light directions whose BRDF is evaluated at once.
_AT_ONCE = 64


class InOutFactors:
    """Factors of a BRDF, from `in_out_factors`.

    Parameters
    ----------
    incoming : (size, size, n_terms) float32
        By the square of the hemisphere, see `hemisphere_directions`; without the cosine.
    outgoing : (size, size, n_terms, n_channels) float32
    values : (n_terms,) float64
        What each term has of the BRDF, falling: singular values.
    norm : float
        Of the whole BRDF, root of the sum of the squares of all values.
    warning : str or None
        A line for people, where the lobe is too narrow for terms.

    Attributes
    ----------
    n_terms, n_channels : int
    """

    def __init__(self, incoming, outgoing, values, norm, warning=None):
        self.incoming, self.outgoing = incoming, outgoing
        self.values, self.norm, self.warning = values, norm, warning
        self.n_terms, self.n_channels = outgoing.shape[2:]

    @property
    def error(self):
        """What the terms leave of the BRDF and the cosine: relative L2 over pairs of directions."""
        if not self.norm:
            return 0.0
        return float(np.sqrt(max(1 - (self.values**2).sum() / self.norm**2, 0)))

    def incoming_factor(self, k, directions):
        """What term k takes of light, with the cosine, between the nearest directions of the grid.

        Parameters
        ----------
        k : int or slice
            Term, from 0 on; a slice for several.
        directions : (..., 3) float
            Unit vectors in the local frame, from the surface to the light.

        Returns
        -------
        (...) or (..., n) float32
            0 below the horizon.
        """
        factor = self.incoming_between(k, directions)
        cosine = np.maximum(np.asarray(directions, np.float32)[..., 2], 0)
        return factor * cosine.reshape(*cosine.shape, *(1,) * (factor.ndim - cosine.ndim))

    def incoming_between(self, k, directions):
        """`incoming_factor` without the cosine: of what has a cosine of its own, as texels have."""
        return _between(self.incoming[:, :, self._expect_term(k)], directions)

    def outgoing_factor(self, k, directions):
        """What term k sends to viewers, between the nearest directions of the grid.

        Parameters
        ----------
        k : int or slice
            See `incoming_factor`.
        directions : (..., 3) float
            Unit vectors in the local frame, from the surface to the viewer.

        Returns
        -------
        (..., n_channels) or (..., n, n_channels) float32
            0 below the horizon.
        """
        return _between(self.outgoing[:, :, self._expect_term(k)], directions)

    def received(self, rows, directions, arriving, n_rows):
        """What each term takes of light from directions, summed for the points that it reaches.

        The light is spread over the grid once, between the directions that `incoming_factor` reads
        the factors between, so that more terms cost next to nothing.

        Parameters
        ----------
        rows : (m,) int
            Which point each light arrives at, 0 to n_rows - 1.
        directions : (m, 3) float
            Unit vectors in the frames of these points; from below the horizon nothing is taken.
        arriving : (m, n_channels) float
            Radiance times solid angle and cosine.
        n_rows : int

        Returns
        -------
        (n_rows, n_terms, n_channels) float32
        """
        size, n_lights = len(self.incoming), len(rows)
        arriving = np.where(directions[:, 2:] > 0, arriving, 0).astype(np.float32)
        # A column of four weights for each light.
        place = np.empty((n_lights, 4), np.int32)
        weights = np.empty((n_lights, 4), np.float32)
        for corner, (row, column, weight) in enumerate(_corners(directions, size)):
            place[:, corner] = (rows * size + row) * size + column
            weights[:, corner] = weight
        starts = np.arange(0, 4 * n_lights + 1, 4, dtype=np.int32)
        shape = n_rows * size * size, n_lights
        spread = sp.csc_matrix((weights.ravel(), place.ravel(), starts), shape) @ arriving
        spread = spread.reshape(n_rows, size * size, -1).transpose(0, 2, 1)
        taken = np.ascontiguousarray(spread) @ self.incoming.reshape(size * size, -1)
        return taken.transpose(0, 2, 1)

    def first(self, n_terms):
        """`InOutFactors` of the first `n_terms` alone; `error` says what these leave."""
        n = expect_whole("n_terms", n_terms, 1, self.n_terms)
        tables = (table[:, :, :n] for table in (self.incoming, self.outgoing))
        return InOutFactors(*tables, self.values[:n], self.norm, self.warning)

    def only(self, k):
        """`InOutFactors` of term k alone."""
        k = expect_whole("k", k, 0, self.n_terms - 1)
        parts = self.incoming[:, :, k : k + 1], self.outgoing[:, :, k : k + 1]
        return InOutFactors(*parts, self.values[k : k + 1], self.norm, self.warning)

    def _expect_term(self, k):
        return k if isinstance(k, slice) else expect_whole("k", k, 0, self.n_terms - 1)


def in_out_factors(reflectance, n_terms, size=48, seed=0):
    """Factor a BRDF into terms of light and view.

    Parameters
    ----------
    reflectance : Reflectance
        Whose parameters are one number each: of one point, or of many that are alike.
    n_terms : int
    size : int
        Directions along an edge of the grid, 4 to 96; size^2 of light and of view.
    seed : int

    Returns
    -------
    InOutFactors

    Raises
    ------
    PRTError
        Not a BRDF, one of several points, or more terms than the grid has directions.
    """
    expect_kind("reflectance", reflectance, Reflectance, "a BRDF")
    size = expect_whole("size", size, 4, 96)
    n_terms = expect_whole("n_terms", n_terms, 1, size * size)
    directions = _grid(size)
    matrix = _matrix(reflectance, directions)
    left, values, right = _leading(matrix, n_terms, expect_seed(seed))
    root = np.sqrt(values)
    # With the cosine of the very direction that is asked for, terms are exact to the horizon.
    incoming = (left * root / directions[:, 2:]).reshape(size, size, n_terms)
    outgoing = (right.T * root).reshape(size, size, reflectance.n_channels, n_terms)
    factors = InOutFactors(
        incoming.astype(np.float32),
        np.ascontiguousarray(outgoing.swapaxes(2, 3), np.float32),
        values,
        float(np.linalg.norm(matrix.astype(np.float64))),
    )
    factors.warning = _warning(reflectance, factors)
    return factors


def _grid(size):
    """(size^2, 3) float32 directions of the middles of the texels of the hemisphere's square."""
    middles = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(middles, middles, indexing="ij")
    return hemisphere_directions(u, v).reshape(-1, 3).astype(np.float32)


def _matrix(reflectance, directions):
    """(n, n n_channels) float32 of the BRDF times the cosine: light by views and their channels."""
    blocks = []
    for first in range(0, len(directions), _AT_ONCE):
        incoming = directions[first : first + _AT_ONCE, None]
        values = reflectance.eval(incoming, directions[None])
        shape = (len(incoming), len(directions), reflectance.n_channels)
        expect(
            values.shape == shape,
            f"reflectance: expected one point, whose parameters are numbers; its values are of "
            f"shape {values.shape}, expected {shape}",
        )
        blocks.append((values * incoming[..., 2:]).reshape(len(incoming), -1).astype(np.float32))
    return np.concatenate(blocks)


def _leading(matrix, n_terms, seed):
    """Leading singular vectors and values: (n, n_terms), (n_terms,), (n_terms, n) float64.

    Source: Halko, Martinsson and Tropp 2011, algorithm 4.4, subspace iteration.
    """
    width = min(n_terms + _MORE, *matrix.shape)
    basis = np.random.default_rng(seed).normal(size=(matrix.shape[1], width)).astype(np.float32)
    for _ in range(_ROUNDS):
        basis = np.linalg.qr(matrix @ basis)[0]
        basis = np.linalg.qr(matrix.T @ basis)[0]
    small = (matrix @ basis).astype(np.float64)
    left, values, right = np.linalg.svd(small, full_matrices=False)
    right = right @ basis.T
    return left[:, :n_terms], values[:n_terms], right[:n_terms]


def _warning(reflectance, factors):
    roughness = getattr(reflectance, "roughness", None)
    least = None if roughness is None else float(np.min(expect_numbers("roughness", roughness)))
    if least is None or least >= LEAST_ROUGHNESS:
        return None
    return (
        f"roughness {least:.2f}: {factors.n_terms} terms are {factors.error:.0%} off the "
        f"reflectance; below {LEAST_ROUGHNESS:.2f} lobes are too narrow for terms, evaluate them "
        "instead"
    )


def _between(table, directions):
    """A table (size, size, ...) at directions (m..., 3), linearly between texels; 0 below."""
    directions = expect_directions("directions", directions)
    shape, flat = directions.shape[:-1], directions.reshape(-1, 3)
    trailing = (1,) * (table.ndim - 2)
    result = 0.0
    for row, column, weight in _corners(flat, len(table)):
        result = result + weight.reshape(-1, *trailing) * table[row, column]
    result = result * (flat[:, 2] > 0).astype(np.float32).reshape(-1, *trailing)
    return result.reshape(*shape, *table.shape[2:])


def _corners(directions, size):
    """Rows, columns and weights (m,) of each of the four texels around directions (m, 3)."""
    places = np.stack(hemisphere_square(np.maximum(directions, [-1, -1, 0]))) * size - 0.5
    places = np.clip(places, 0, size - 1)
    low = np.minimum(places.astype(np.int64), size - 2)
    share = (places - low).astype(np.float32)
    for i in range(2):
        for j in range(2):
            weight = (share[0] if i else 1 - share[0]) * (share[1] if j else 1 - share[1])
            yield low[0] + i, low[1] + j, weight
