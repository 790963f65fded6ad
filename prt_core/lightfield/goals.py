"""What a light field is compressed to: a number, a threshold, an error or a size.

An error or a size is reached by one threshold for all channels, points and lights, a price of a
number in squared error of R, G and B (see `Sparsity`).
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_number, expect_whole

GOALS = ("n_coefficients", "threshold", "psnr", "megabytes")
# The first steps of a search and how many there are at most, and how near in the logarithm it ends.
_STRIDE, _STRIDES, _NEAR = np.log(8), 8, 5e-3


@dataclass(frozen=True)
class Goal:
    """One of the goals; the others are None.

    Parameters
    ----------
    n_coefficients : int, optional
        Of an HRDF's luma; its two chroma channels have half of them each.
    threshold : float, optional
    psnr : float, optional
        Of R, G and B (`FieldError.psnr`), in decibels, at least.
    megabytes : float, optional
        Of the entropy-coded field, in 10^6 bytes, at most.
    """

    n_coefficients: int | None = None
    threshold: float | None = None
    psnr: float | None = None
    megabytes: float | None = None

    def __post_init__(self):
        given = [name for name in GOALS if getattr(self, name) is not None]
        expect(
            len(given) == 1,
            f"light field: give one of {', '.join(GOALS)}; got {', '.join(given) or 'none'}",
        )
        if self.n_coefficients is not None:
            expect_whole("n_coefficients", self.n_coefficients, 1)
        for name in ("threshold", "megabytes"):
            if getattr(self, name) is not None:
                expect_number(name, getattr(self, name), above=0)
        if self.psnr is not None:
            expect_number("psnr", self.psnr, -200, 200)

    @property
    def is_searched(self):
        """Whether a threshold has to be found."""
        return self.psnr is not None or self.megabytes is not None

    def reached(self, psnr, nbytes):
        """Whether a field with so many decibels `psnr` and `nbytes` is good enough, a bool."""
        if self.psnr is not None:
            return psnr >= self.psnr
        return nbytes <= 1e6 * self.megabytes


def last_that_holds_steps(holds_steps, first, rising=True):
    """Where a condition ends to hold; a generator of `Progress`.

    Parameters
    ----------
    holds_steps : callable(float)
        Of a threshold: a generator of `Progress` that returns whether it holds.
    first : float
        The first threshold that is tried.
    rising : bool
        The condition holds up to some threshold, and the largest is looked for; else it holds
        from one on, and the smallest is.

    Returns
    -------
    float or None
        One for which it holds, within half a per cent of the last; None where it holds for none
        of those that were tried, over seven powers of ten.
    """
    # Always as if the largest were looked for.
    sign = 1 if rising else -1
    good = bad = None
    value, n_strides = sign * np.log(first), 0
    while True:
        if (yield from holds_steps(float(np.exp(sign * value)))):
            good = value
        else:
            bad = value
        if good is not None and bad is not None:
            if bad - good < _NEAR:
                break
            value = (good + bad) / 2
        elif n_strides == _STRIDES:
            break
        else:
            value += _STRIDE if bad is None else -_STRIDE
            n_strides += 1
    return None if good is None else float(np.exp(sign * good))
