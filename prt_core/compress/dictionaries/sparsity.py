"""Which coefficients in an orthonormal basis are kept: so many, or those that are worth it.

In an orthonormal basis the squared error is the energy of what is left out, so the largest
coefficients are the best ones to keep, whatever their number (Gurumoorthy et al. 2010).
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_number, expect_whole


@dataclass(frozen=True)
class Sparsity:
    """A rule for what is kept of each row of coefficients.

    Parameters
    ----------
    n_coefficients : int, optional
        At most so many a row, the largest.
    threshold : float, optional
        For the whole object: what is not larger is left out. It minimises the squared error plus
        threshold^2 for each coefficient kept: one price of a number everywhere.
    error : float, optional
        For each row: the fewest whose rest is not longer (L2) than this, as published.

    Raises
    ------
    PRTError
        None of them is given, or `threshold` and `error` both.
    """

    n_coefficients: int | None = None
    threshold: float | None = None
    error: float | None = None

    def __post_init__(self):
        given = [name for name in ("n_coefficients", "threshold", "error") if self._has(name)]
        expect(given, "sparsity: give one of n_coefficients, threshold or error")
        expect(
            not (self._has("threshold") and self._has("error")),
            "sparsity: threshold is for the whole object and error for each row; give one of them",
        )
        if self._has("n_coefficients"):
            expect_whole("n_coefficients", self.n_coefficients, 0)
        if self._has("threshold"):
            expect_number("threshold", self.threshold, above=0)
        if self._has("error"):
            expect_number("error", self.error, least=0)

    def _has(self, name):
        return getattr(self, name) is not None

    def kept(self, coefficients):
        """Which coefficients are kept.

        Parameters
        ----------
        coefficients : (n, k) float32

        Returns
        -------
        (n, k) bool
            Never one that is 0.
        """
        sizes = np.abs(coefficients)
        kept = sizes > (self.threshold or 0)
        n = sizes.shape[1]
        if self._has("error"):
            kept &= sizes >= self._smallest_within(sizes)[:, None]
        if self._has("n_coefficients") and self.n_coefficients < n:
            kept &= _largest(sizes, self.n_coefficients)
        return kept

    def _smallest_within(self, sizes):
        """The smallest coefficient of each row that must stay for the row to be within `error`."""
        ascending = np.sort(sizes, axis=1)
        rest = np.cumsum(np.square(ascending, dtype=np.float64), axis=1)
        n_left_out = (rest <= self.error**2).sum(axis=1)
        # Beyond the largest where all may go.
        padded = np.append(ascending, np.full((len(sizes), 1), np.inf, sizes.dtype), axis=1)
        return np.take_along_axis(padded, n_left_out[:, None], axis=1)[:, 0]

    def cost(self, coefficients, kept):
        """What one row would rather have less of; the best of several bases has the least.

        Parameters
        ----------
        coefficients : (n, k) float32
        kept : (n, k) bool

        Returns
        -------
        (n,) float64
            The squared error, and the price of the numbers kept: threshold^2 each; where `error`
            is asked for, more than any error within it.
        """
        rest = np.where(kept, 0, coefficients)
        squared = np.einsum("nk,nk->n", rest, rest, dtype=np.float64)
        counts = kept.sum(axis=1)
        if self._has("threshold"):
            return squared + float(self.threshold) ** 2 * counts
        if self._has("error") and self.error > 0:
            # A capped row may be beyond the error: then the error decides.
            return squared + self.error**2 * counts
        return squared + (counts if self._has("error") else 0)


def _largest(sizes, count):
    """The `count` largest of each row; of equal ones those that come first."""
    if not count:
        return np.zeros(sizes.shape, bool)
    last = np.partition(sizes, sizes.shape[1] - count, axis=1)[:, -count, None]
    mask = sizes >= last
    surplus = np.flatnonzero(mask.sum(axis=1) > count)
    if len(surplus):
        # All equal, as in a constant row of a basis of texels.
        order = np.argsort(-sizes[surplus], axis=1, kind="stable")[:, :count]
        mask[surplus] = False
        mask[surplus[:, None], order] = True
    return mask
