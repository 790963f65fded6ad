"""Glimpses: about what lobes send, for light that one glossy surface throws on another.

One point stands for all that a reflection meets in a block, so its lobe need not be summed as for
a viewer. A few facets of it mirror the blocks that they face; the brightest texels, of which few
facets would find one, are exact.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_at, powers_used
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points, tangent_frames
from prt_core.transport.lobe_values import lobe_values

# Facets of each lobe, and points worked on at once.
_FACETS, _MANY = 4, 1 << 12
# Least alpha: the lobe of the one point stands for those of all that is met in a block.
_LEAST = np.float32(0.1)
# Least cosine of a view: smooth normals may face away from who sees the surface.
_GRAZING = 0.05
# Shifts of a sequence that are spread evenly, one after the other.
_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])


def glimpse(field, normals, rows, outgoing, alpha, powers):
    """About what lobes send: quick, and right in the mean over many points and directions.

    A few facets of each lobe mirror the blocks that they face; bright texels are exact.

    Parameters
    ----------
    field : IncomingField
    normals : (n, 3) float32
        Of the points of the field.
    rows, outgoing, alpha, powers
        As `GlossyView.reflected` takes them.

    Returns
    -------
    (k, 3) float32
    """
    result = np.zeros((len(rows), 3), np.float32)
    n_nodes, apart = len(field.nodes), field.merged
    bright = np.ascontiguousarray(apart.directions.T)
    values = field.values.reshape(-1)
    n_powers = powers_used(powers)
    frames = tangent_frames(normals).astype(np.float32)
    places = sobol_points(int(np.log2(_FACETS))).astype(np.float32).T[:, :, None]
    rows = np.asarray(rows, np.int64)

    def one(first):
        part = slice(first, first + _MANY)
        some = rows[part]
        frame = frames.take(some, axis=0)
        ways = _lifted(outgoing[part], frame[:, 2])
        width = alpha[part] if alpha.ndim == 1 else np.sqrt(alpha[part].prod(axis=1))
        width = np.maximum(width, _LEAST)
        view = np.einsum("kx,kax->ak", ways, frame)
        # Each point has a shift of its own, so that errors go away in the mean.
        shift = np.arange(first, first + len(some)) * _GOLDEN[:, None] % 1
        shift = shift.astype(np.float32)
        height = (places[0] + shift[0]) % np.float32(1)
        facets = _facets(view, width, height, places[1], shift[1])
        cosine = sum(a * b for a, b in zip(view, facets, strict=True))
        incoming = [2 * cosine * facet - own for facet, own in zip(facets, view, strict=True)]
        square = width * width
        own, other = (
            np.sqrt(1 - square + square / np.maximum(z, 1e-3) ** 2) for z in (view[2], incoming[2])
        )
        weight = np.where(incoming[2] > 0, (1 + own) / (own + other), 0)
        weight *= np.float32(1 / _FACETS)
        world = [sum(incoming[a] * frame[:, a, x] for a in range(3)) for x in range(3)]
        block = field.reflections.blocks.along(*world)
        each = [power * weight for power in powers_at(cosine)[:n_powers]]
        fresnel = powers[part, :n_powers].transpose(1, 2, 0)
        start = some * (3 * n_nodes) + block
        for channel in range(3):
            factor = sum(a * b[channel] for a, b in zip(each, fresnel, strict=True))
            np.maximum(factor, 0, out=factor)
            factor *= wholes(values.take(start + channel * n_nodes))
            result[part, channel] = factor.sum(axis=0)
        if bright.size:
            lobes = lobe_values(bright, frame[:, 2], ways, width, None, n_powers, apart.spread)
            light = wholes(apart.values.take(some, axis=0))
            for power, lobe in enumerate(lobes):
                brought = np.matmul(light, lobe[:, :, None])[..., 0]
                result[part] += brought * powers[part, power]

    on_all_cores(one, range(0, len(rows), _MANY))
    return result


def _facets(view, alpha, height, turn, shift):
    """Normals of GGX facets that are seen from `view` (3, k): three (n_facets, k) arrays.

    Source: Dupuy and Benyoub 2023, Sampling visible GGX normals with spherical caps.
    """
    x, y, z = view[0] * alpha, view[1] * alpha, view[2]
    length = 1 / np.sqrt(x * x + y * y + z * z)
    x, y, z = x * length, y * length, z * length
    # Of the cap that is mirrored from the stretched view, around at a turn that each has.
    up = 1 - height * (1 + z)
    aside = np.sqrt(np.maximum(1 - up * up, 0))
    (cos, sin), (c, s) = (
        (np.cos(angle), np.sin(angle)) for angle in (2 * np.pi * shift, 2 * np.pi * turn)
    )
    x = alpha * (x + aside * (cos * c - sin * s))
    y = alpha * (y + aside * (sin * c + cos * s))
    z = np.maximum(up + z, 1e-6)
    length = 1 / np.sqrt(x * x + y * y + z * z)
    return x * length, y * length, z * length


def _lifted(directions, normals):
    """Directions (k, 3) lifted to `_GRAZING` above the surface where they are below that."""
    cosine = np.einsum("kx,kx->k", directions, normals)[:, None]
    lifted = directions + np.maximum(_GRAZING - cosine, 0) * normals
    return (lifted / np.linalg.norm(lifted, axis=1, keepdims=True)).astype(np.float32)
