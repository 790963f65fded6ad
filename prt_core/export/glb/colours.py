"""COLOR_0: colours in 0 to 1, as glTF wants them, and the scale that gives them back."""

import numpy as np

from prt_core.errors import PRTError

# What whole numbers of 16 bits hold.
_MOST = (1 << 16) - 1


def scale_of(values, white=None):
    """The radiance that is 1 in COLOR_0: `white`, or the brightest, but at least 1.

    Parameters
    ----------
    values : (n, 3) float32
    white : float, optional
    """
    return white or float(max(1.0, values.max(initial=0)))


def encoded(values, scale, encoding):
    """COLOR_0 of radiance, linear.

    Parameters
    ----------
    values : (n, 3) float32
        Finite; what is negative is black.
    scale : float
    encoding : {"float", "u16"}

    Returns
    -------
    (n, 3) float32, or (n, 4) uint16
        Rows of 16 bits have a fourth number, an alpha of 1: attributes begin at four bytes.
    """
    colours = np.clip(values.astype(np.float64) / scale, 0, 1)
    if encoding == "float":
        return colours.astype(np.float32)
    whole = np.full((len(colours), 4), _MOST, np.uint16)
    whole[:, :3] = np.rint(colours * _MOST)
    return whole


def refuse(name, n_bad):
    """Raise `PRTError`: so many colours of an object are no numbers."""
    raise PRTError(
        f"{name}: {n_bad} of its colours are NaN or infinite, which a .glb cannot hold; lower "
        "strength or exposure, or bake again"
    )
