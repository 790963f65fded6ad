"""GGX lobes at many directions of many points, worked out in place.

What `reflectance.Microfacet` is for one lobe, in the world's axes and in float32: views spend their
time here. Without the factor for further bounces, which depends on the view alone.
"""

import numpy as np

# Most that light of a spread takes off a lobe, in parts of its squared alpha.
_MOST_SPREAD = 1.0


def lobe_values(directions, normals, outgoing, alpha, axes, n_powers, spread=None):
    """White lobes times the cosine, times each power of the Fresnel term.

    Parameters
    ----------
    directions : (3, m) float32
        Unit vectors towards the light.
    normals, outgoing : (p, 3) float32
    alpha : (p,) or (p, 2) float32
        Two of them along and across a tangent.
    axes : (p, 2, 3) float32, or None
        Tangents, where there are two alphas.
    n_powers : int
        The first ones of `fresnel_powers`, of the cosine between light and facet.
    spread : (m,) float32, optional
        Variance, along an axis, of the light that comes from about a direction: then values are
        means over it, to the second order.

    Returns
    -------
    list of (p, m) float32
        0 below the horizon.
    """
    cosine = normals @ directions
    np.maximum(cosine, 0, out=cosine)
    height = np.einsum("px,px->p", normals, outgoing)[:, None]
    # Squared length of the sum of both directions: 4 times the squared cosine with the facet.
    squared = outgoing @ directions
    squared += 1
    squared *= 2
    np.maximum(squared, 1e-6, out=squared)
    along = cosine + height
    along *= along
    if axes is None:
        square = (alpha * alpha)[:, None]
        # Times the squared height, which belongs in front of the root.
        stretched = cosine * cosine
        stretched *= (1 - square) * height * height
        stretched += square * height * height
        masked_own = np.sqrt(square + (1 - square) * height * height)
        along *= square - 1
        along += squared
        scale = square
    else:
        along, stretched, masked_own, scale = _stretched(
            directions, outgoing, alpha, axes, along, cosine, height
        )
    np.sqrt(stretched, out=stretched)
    masked = cosine * masked_own
    masked += stretched
    # Below the horizon, where nothing counts, it can be 0.
    np.maximum(along, 1e-12, out=along)
    if spread is None:
        along /= squared
        along *= along
    else:
        _spread_out(along, squared, spread, alpha, out=stretched)
    along *= masked
    value = np.divide(cosine, along, out=along)
    value *= scale / (2 * np.pi)
    lobes = [value]
    if n_powers > 1:
        facet = np.sqrt(squared, out=squared)
        facet *= 0.5
        rest = 1 - facet
        np.maximum(rest, 0, out=rest)
        fifth = rest * rest
        fifth *= fifth
        fifth *= rest
        fifth *= value
        lobes.append(fifth)
        if n_powers > 2:
            square = rest * rest
            square *= value
            lobes.append(square)
        if n_powers > 3:
            rest *= facet
            rest *= fifth
            lobes.append(rest)
    return lobes


def _spread_out(along, squared, spread, alpha, out):
    """Make `along` the denominator of means: of q^-2 and its second derivatives times the variance.

    Facets turn half as far as the light along the plane of the view, and further across it.
    """
    reach = np.divide(1, squared, out=out)
    along *= reach
    reach *= 4 * spread
    reach += spread
    square = (alpha * alpha)[:, None]
    if alpha.ndim == 2:
        square = alpha.prod(axis=1)[:, None]
        # The mean of the curvatures along both axes.
        reach *= (alpha * alpha).sum(axis=1)[:, None] / (2 * square)
    np.minimum(reach, _MOST_SPREAD * square, out=reach)
    less = along - reach
    along *= less
    reach *= 1.5 * square
    along += reach


def _stretched(directions, outgoing, alpha, axes, along, cosine, height):
    """What an anisotropic lobe has in place of an isotropic one's terms."""
    alpha_x, alpha_y = (a[:, None] for a in alpha.T)
    product = alpha_x * alpha_y
    stretched, own = cosine * cosine, height * height
    along *= product
    for axis, width, other in zip(axes.swapaxes(0, 1), (alpha_x, alpha_y), (alpha_y, alpha_x),
                                  strict=True):  # fmt: skip
        there, here = axis @ directions, np.einsum("px,px->p", axis, outgoing)[:, None]
        half = there + here
        half *= half
        half *= other / width
        along += half
        there *= width
        there *= there
        stretched += there
        own = own + (width * here) ** 2
    stretched *= height * height
    return along, stretched, np.sqrt(own), product
