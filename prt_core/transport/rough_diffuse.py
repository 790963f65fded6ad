"""What a view does to the diffuse light of rough surfaces, over the field of incoming light.

Lambert's law is right for the light that arrives; rough surfaces send more of it back to where it
came from, and more along the surface. So what a point sends evenly to all sides is multiplied with
the ratio of both lobes, summed over large blocks of the field: nothing of this is narrow.
"""

import numpy as np

from prt_core.reflectance.oren_nayar import lost_in_mean, rough_parts
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores

# Blocks along an edge of a face, at most, and points worked on at once.
_SIDE, _PART = 4, 512


def rough_share(field, rows, normals, outgoing, rough, colour):
    """How much more diffuse light comes to a viewer than evenly to all sides.

    Parameters
    ----------
    field : IncomingField
    rows : (k,) int
        Its points; one may come more than once.
    normals, outgoing : (k, 3) float32
    rough : (k,) float32
        Diffuse roughness, 0 to 1.
    colour : (k, 3) float32
        Of facets.

    Returns
    -------
    (k, 3) float32
        1 where no light arrives.
    """
    large = [index for index, side in enumerate(field.nodes.sides) if side <= _SIDE]
    size = large[0] if large else len(field.nodes.sides) - 1
    nodes = slice(*field.nodes.first[size : size + 2])
    ways = np.concatenate([field.directions[nodes], field.merged.directions]).T
    ways = np.ascontiguousarray(ways)
    angles = field.nodes.solid_angles[nodes]
    result = np.ones((len(rows), 3), np.float32)

    def one(first):
        some = slice(first, first + _PART)
        cosine = np.clip(normals[some] @ ways, 0, 1)
        height = np.einsum("kx,kx->k", normals[some], outgoing[some])[:, None]
        flat = outgoing[some] @ ways - cosine * height
        height = np.clip(height, 0, 1)
        single, further = rough_parts(cosine, height, flat, rough[some, None])
        sky = wholes(field.values[rows[some], :, nodes]) * angles
        light = np.concatenate([sky, wholes(field.merged.values[rows[some]])], axis=2)
        light *= cosine[:, None]
        even = light.sum(axis=2) * np.float32(1 / np.pi)
        once = np.matmul(light, single[..., None])[..., 0]
        again = np.matmul(light, further[..., None])[..., 0]
        # What further bounces lose depends on the colour.
        lost = 1 - lost_in_mean(rough[some, None]) * colour[some]
        sent = once + again * colour[some] ** 2 / lost
        np.divide(sent, even, out=result[some], where=even > 0)

    on_all_cores(one, range(0, len(rows), _PART))
    return result
