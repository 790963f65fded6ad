"""How far off bounced light is: as a share of all light, and in enclosed places of their own.

Two halves of the rays of each point give two pictures; a quarter of their squared difference is the
variance of the whole. As a share of all light that says nothing of a room behind a window: what
stands outside in the open outshines a room that is wrong everywhere. So points that an even sky
lights far less than the mean are put into classes, an octave each, and each class is measured
against its own light too: that of the sky which is asked about, or as much as an even sky of the
same mean would give, where that is more.
"""

from dataclasses import dataclass

import numpy as np

# Octaves below the root mean square of the light of an even sky: what is brighter than the first is
# open, and what is darker than the last is dark.
_OPEN, _DARK = 2, 9
# Errors of a class may be so many times as large as that of all light: eyes that have adapted to a
# room see grain from 2 % on.
LOCAL = 2.0
# Classes that hold a smaller share of the points are corners, not places.
_FEW = 0.02


@dataclass(frozen=True)
class BounceError:
    """Errors of outgoing radiance from two halves of the rays, under the worst light.

    Attributes
    ----------
    whole : float
        Root of the summed squares of the errors, as a share of all light.
    enclosed : float
        The same of the worst class of enclosed places, as a share of its own light; 0 where there
        are none.
    of_points : (n_points,) float32
        Of the class of each point, or of all, whichever is more, in units in which that of all
        counts 1: `max(whole, class / LOCAL)`.
    classes : (n_points,) int8
        0 where it is open, or not seen.
    """

    whole: float
    enclosed: float
    of_points: np.ndarray
    classes: np.ndarray


def bounce_error(first, second, seen, classes=None):
    """`BounceError` of two halves.

    Parameters
    ----------
    first, second : (n_points, n_lights) float32
        Radiance by either half of the rays; the first light is an even sky.
    seen : (n_points,) bool
        Points that are seen; of others nothing is said, but that they take as many rays as all.
    classes : (n_points,) int8, optional
        As they were found before: points do not change their class while rays are added.
    """
    one, two = (half[seen].astype(np.float64) for half in (first, second))
    spread, light = (one - two) ** 2 / 4, (one + two) / 2
    mean = np.sqrt((light**2).mean(axis=0))
    lit = mean > 0
    if not lit.any():
        return BounceError(0.0, 0.0, *np.zeros((2, len(seen)), np.int8))
    spread, light = spread[:, lit] / mean[lit] ** 2, light[:, lit] / mean[lit]
    whole = np.sqrt(spread.mean(axis=0)).max()
    if classes is None:
        classes = np.zeros(len(seen), np.int8)
        below = np.ceil(-np.log2(np.maximum(light[:, 0], 2.0 ** -(_DARK + 1))))
        classes[seen] = np.clip(below, _OPEN, _DARK + 1) - _OPEN
    octave = classes[seen]
    size = np.maximum(light, light[:, :1])
    count, errors = np.bincount(octave, minlength=_DARK + 2 - _OPEN), 0.0
    for column in range(light.shape[1]):
        off, of = (np.bincount(octave, v[:, column], len(count)) for v in (spread, size**2))
        errors = np.maximum(errors, np.sqrt(np.divide(off, of, out=0.0 * count, where=of > 0)))
    errors[[0, -1]] = 0
    errors[count < _FEW * len(light)] = 0
    of_points = np.full(len(seen), whole, np.float32)
    of_points[seen] = np.maximum(whole, errors / LOCAL)[octave]
    return BounceError(float(whole), float(errors.max()), of_points, classes)
