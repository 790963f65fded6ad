"""Colours of other primaries as linear Rec.709.

Images may say which colours their channels are, by CIE x, y of red, green, blue and white. A white
that is not Rec.709's (D65) is adapted by Bradford's cone responses (Lam 1985), as ICC profiles,
ACES and OpenColorIO do: what is white in the image stays white.
"""

import numpy as np

from prt_core.errors import expect

# x, y of red, green, blue, white (ITU-R BT.709).
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
# A matrix so near to one that changes nothing is none: writers round, and some say Rec.709 as an
# ICC profile does, adapted to D50.
_SAME = 5e-3
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def to_rec709(name, chromaticities):
    """The matrix that turns colours of some primaries into Rec.709; None where they are it.

    Parameters
    ----------
    name : str
        The image, for messages.
    chromaticities : (8,) float
        x, y of red, green, blue and white.

    Returns
    -------
    (3, 3) float64, or None
        `rec709 = colour @ matrix.T`.

    Raises
    ------
    PRTError
        They are no primaries: on one line, or with a white that is none of their mixtures.
    """
    given = np.asarray(chromaticities, np.float64)
    # Zeros say nothing: many Radiance files have them.
    if not given.any():
        return None
    good = np.isfinite(given).all() and (given[1::2] != 0).all()
    if good:
        primaries = _xyz(given[:6])
        good = abs(np.linalg.det(primaries)) > 1e-6
    expect(
        good,
        f"{name}: its primaries {', '.join(f'{v:g}' for v in given)} are none; "
        "save it as linear Rec.709",
    )
    white, wanted = _xyz(given[6:])[:, 0], _xyz(REC709[6:])[:, 0]
    scale = (_BRADFORD @ wanted) / (_BRADFORD @ white)
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(scale) @ _BRADFORD
    matrix = np.linalg.inv(_from_rgb(REC709)) @ adapted @ _from_rgb(given)
    return None if np.abs(matrix - np.eye(3)).max() < _SAME else matrix


def _xyz(places):
    """(3, n) XYZ of places x, y, at a luminance of 1."""
    x, y = np.reshape(places, (-1, 2)).T
    return np.stack([x / y, np.ones_like(x), (1 - x - y) / y])


def _from_rgb(chromaticities):
    """(3, 3): from the colours of some primaries to XYZ; (1, 1, 1) is their white."""
    primaries = _xyz(chromaticities[:6])
    white = _xyz(chromaticities[6:])[:, 0]
    return primaries * np.linalg.solve(primaries, white)
