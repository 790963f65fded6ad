"""Glimpses: about what lobes send, for light that one glossy surface throws on another.

One point stands for all that a reflection meets in a block, so its lobe need not be summed as for
a viewer. A few facets of it mirror the blocks that they face; the brightest texels, of which few
facets would find one, are exact.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_at, powers_used
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points, square_to_ggx_normals, tangent_frames
from prt_core.transport.lobe_values import lobe_values

# Facets of each lobe, and points worked on at once.
_FACETS, _MANY = 4, 1 << 13
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
    blocks = field.reflections.blocks
    bright = np.ascontiguousarray(field.bright_directions.T)
    n_powers = powers_used(powers)
    places = sobol_points(int(np.log2(_FACETS))).astype(np.float32)

    def one(first):
        part = slice(first, first + _MANY)
        some = rows[part]
        ways = _lifted(outgoing[part], normals[some])
        width = alpha[part] if alpha.ndim == 1 else np.sqrt(alpha[part].prod(axis=1))
        width = np.maximum(width, _LEAST)
        frames = tangent_frames(normals[some]).astype(np.float32)
        view = np.einsum("kx,kax->ka", ways, frames)
        # Each point has a shift of its own, so that errors go away in the mean.
        shift = np.arange(first, first + len(some))[:, None] * _GOLDEN % 1
        uv = (places + shift[:, None].astype(np.float32)) % np.float32(1)
        lobe = width[:, None]
        facets = square_to_ggx_normals(uv, view[:, None], lobe, lobe)
        cosine = np.einsum("ka,kfa->kf", view, facets)
        incoming = 2 * cosine[..., None] * facets - view[:, None]
        own, other = (
            np.sqrt(1 + lobe**2 * np.maximum(1 / np.maximum(z, 1e-3) ** 2 - 1, 0))
            for z in (view[:, None, 2], incoming[..., 2])
        )
        weight = np.where(incoming[..., 2] > 0, (1 + own) / (own + other), 0) / _FACETS
        world = np.matmul(incoming, frames)
        block = blocks.along(*np.moveaxis(world, -1, 0))
        light = wholes(field.values[some[:, None], :, block])
        each = np.stack(powers_at(cosine)[:n_powers], axis=2) * weight[..., None]
        factor = np.matmul(each, powers[part, :n_powers])
        result[part] = (light * np.maximum(factor, 0)).sum(axis=1)
        if bright.size:
            lobes = lobe_values(bright, normals[some], ways, width, None, n_powers)
            light = wholes(field.bright_values[some])
            terms = np.matmul(light, np.stack(lobes, axis=2))
            result[part] += np.einsum("kcp,kpc->kc", terms, powers[part, :n_powers])

    on_all_cores(one, range(0, len(rows), _MANY))
    return result


def _lifted(directions, normals):
    """Directions (k, 3) lifted to `_GRAZING` above the surface where they are below that."""
    cosine = np.einsum("kx,kx->k", directions, normals)[:, None]
    lifted = directions + np.maximum(_GRAZING - cosine, 0) * normals
    return (lifted / np.linalg.norm(lifted, axis=1, keepdims=True)).astype(np.float32)
