"""Light on normals that a material bends: less of it near the surface's own horizon.

Where a normal map lets a surface look at light that is nearly below it, its shadow would end in a
hard line. Cycles dims such light by a microfacet shadowing term of the angle between the light and
the unbent normal. Source: A. Conty Estevez, P. Lecocq, C. Stein, "A Microfacet-Based Shadowing
Function to Solve the Bump Terminator Problem", Ray Tracing Gems, 2019.
"""

from functools import cache

import numpy as np

# Strengths, and what share of the light of an even sky they leave.
_STRENGTHS = 65


def bump_strength(cosine):
    """(n,) float64 in [0, 1]: alpha squared, from the cosine of the bend."""
    squared = np.clip(np.asarray(cosine, np.float64), 1e-3, 1) ** 2
    return np.minimum(0.125 * (1 - squared) / squared, 1)


def bump_shadowing(strength, cosine):
    """(n,) float64 in [0, 1]: what is left of light whose cosine to the unbent normal is given."""
    squared = np.maximum(np.asarray(cosine, np.float64), 1e-6) ** 2
    return 2 / (1 + np.sqrt(1 + strength * (1 - squared) / squared))


def bump_mean(strength):
    """(n,) float64: what is left of even light from all sides above the surface.

    It goes into the albedo of bent points, so that light from the sky and from other surfaces is
    right on the whole; light of lamps is dimmed by `bump_shadowing` over it.
    """
    return np.interp(strength, np.linspace(0, 1, _STRENGTHS), _means())


@cache
def _means():
    # Directions that cover the hemisphere evenly, around a normal bent in the plane of x and z.
    n = 4096
    z = (np.arange(n) + 0.5) / n
    x = np.sqrt(1 - z * z) * np.cos(np.arange(n) * (np.pi * (3 - np.sqrt(5))))
    strength = np.linspace(0, 1, _STRENGTHS)[:, None]
    tangent = np.sqrt(strength / 0.125)
    bent = np.maximum((x * tangent + z) / np.sqrt(1 + tangent**2), 0)
    return (bent * bump_shadowing(strength, z)).sum(axis=1) / bent.sum(axis=1)
