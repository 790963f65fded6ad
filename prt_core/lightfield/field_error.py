"""How far a field is from the one that it was made of."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect_array, expect_number
from prt_core.lightfield.hrdf import TO_YCBCR

_BLOCK = 1024


@dataclass(frozen=True)
class FieldError:
    """Errors of a field, in decibels below the brightest lamp.

        PSNR = 20 log10(l / sqrt(mean |H - H'|^2))                                      (5)

    of Miandji et al. 2013, the mean over HRDFs, whose norms add up all their cells.

    Attributes
    ----------
    peak : float
        l, the radiance of the brightest lamp.
    n_cells : int
    rgb : float
        Mean squared norm of the error of an HRDF, over points and the channels R, G, B.
    luma : float
        The same of the luma.
    """

    peak: float
    n_cells: int
    rgb: float
    luma: float

    @property
    def psnr(self):
        """Of R, G and B; infinite where there is no error."""
        return decibels(self.peak, self.rgb)

    @property
    def luma_psnr(self):
        """Of the luma alone: what the paper's figures and tables have."""
        return decibels(self.peak, self.luma)

    @property
    def psnr_per_sample(self):
        """`psnr` with the mean over cells as well: what the word means elsewhere."""
        return decibels(self.peak, self.rgb / self.n_cells)


def field_error(field, radiance, peak, weights=None):
    """The error of a field against the radiance that it was made of.

    Parameters
    ----------
    field : SurfaceLightField
    radiance : (n_points, m1, m2, 3) float
        Of the lights at these weights together.
    peak : float
        Radiance of the brightest lamp.
    weights : (n_lights,) or (n_lights, n_channels) float, optional

    Returns
    -------
    FieldError
    """
    shape = field.n_points_, *field.layout_.shape, 3
    radiance = expect_array("radiance", radiance, shape, np.float32)
    peak = expect_number("peak", peak, above=0)
    rgb, luma = 0.0, 0.0
    for first in range(0, shape[0], _BLOCK):
        part = np.arange(first, min(first + _BLOCK, shape[0]))
        error = field.decode(part, weights) - radiance[part]
        rgb += np.square(error, dtype=np.float64).sum()
        luma += np.square(error @ TO_YCBCR[:, 0].astype(np.float32), dtype=np.float64).sum()
    return FieldError(peak, field.layout_.n_cells, rgb / (3 * shape[0]), luma / shape[0])


def decibels(peak, squared_error):
    """20 log10(peak / sqrt(squared_error)) of two floats, a float; infinite where no error is."""
    return float(20 * np.log10(peak) - 10 * np.log10(squared_error)) if squared_error else np.inf
