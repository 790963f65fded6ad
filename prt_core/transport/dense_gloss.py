"""The dense sum: what glossy surfaces reflect of the light that the visibility lets through.

`B(x, o) = sum_d f(d, o) cos_x(d) V_d(x) L_d`, over all texels of a cube map, and nothing left out:
what every quicker form of view-dependent transport is measured against. Pairs of a point and a
texel that it sees are worked through in blocks; what is hidden costs nothing.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_flag, expect_kind
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap, tangent_frames
from prt_core.transport.visibility import UNIT, expect_bits, unpack

# Pairs of a point and a texel at once: some ten arrays of them stay within a core's cache.
_PAIRS = 1 << 16


def dense_reflection(
    bits, normals, cube_map, light, reflectance_eval, outgoing, frames=None, per_point=False
):
    """Radiance that points reflect towards a view, summed over all texels that they see.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
    light : (n_directions, n_channels) float
        Radiance of the texels.
    reflectance_eval : callable
        `reflectance_eval(incoming, outgoing)` gives (m, 1) or (m, n_channels) float, the reflected
        share a steradian without the cosine, of (m, 3) unit vectors in the frame of the surface
        whose z is the normal. It is 0 where one of them is below the horizon.
    outgoing : (n_points, 3) float
        Unit vectors from the points to the viewer, in the world (see `View.outgoing`).
    frames : (n_points, 3, 3) float, optional
        Tangent, bitangent and normal of each point, as rows; default: `tangent_frames(normals)`,
        good for what is isotropic.
    per_point : bool
        Whether `reflectance_eval` takes as a third argument the (m,) index of each pair's point.

    Returns
    -------
    (n_points, n_channels) float32
        Of the channels of the light or of the reflectance, whichever has more.

    Raises
    ------
    PRTError
        Shapes that do not fit each other.
    """
    expect_kind("cube_map", cube_map, CubeMap)
    bits = expect_bits("bits", bits, cube_map.n_directions)
    n_points = len(bits)
    normals = expect_array("normals", normals, (n_points, 3), np.float64, -UNIT, UNIT)
    light = expect_array("light", light, (cube_map.n_directions, None), np.float64)
    outgoing = expect_array("outgoing", outgoing, (n_points, 3), np.float64, -UNIT, UNIT)
    expect(callable(reflectance_eval), "reflectance_eval: expected a callable of two directions")
    expect_flag("per_point", per_point)
    if frames is None:
        frames = tangent_frames(normals)
    frames = expect_array("frames", frames, (n_points, 3, 3), np.float64, -UNIT, UNIT)
    up = np.array([[0.0, 0.0, 1.0]])
    asked = (up, up, np.zeros(1, np.int64)) if per_point else (up, up)
    n_channels = max(light.shape[1], reflectance_eval(*asked).shape[1] if n_points else 1)
    result = np.zeros((n_points, n_channels), np.float32)
    facing = np.flatnonzero(np.einsum("ni,ni->n", normals, outgoing) > 0)

    def one(points):
        point, texel = np.nonzero(unpack(bits[points], cube_map.n_directions, np.uint8))
        if not len(point):
            return
        which = points[point]
        cosine = np.einsum("mi,mi->m", normals[which], cube_map.vectors[texel])
        incoming = np.einsum("mi,mji->mj", cube_map.directions[texel], frames[which])
        local = np.einsum("ni,nji->nj", outgoing[points], frames[points])[point]
        given = (incoming, local, which) if per_point else (incoming, local)
        weight = np.maximum(cosine, 0)[:, None] * reflectance_eval(*given)
        starts = np.flatnonzero(np.diff(point, prepend=-1))
        result[points[point[starts]]] = np.add.reduceat(weight * light[texel], starts, axis=0)

    step = max(1, _PAIRS // cube_map.n_directions)
    on_all_cores(one, [facing[first : first + step] for first in range(0, len(facing), step)])
    return result


def lobe_visibility(bits, normals, cube_map, reflectance_eval, outgoing):
    """How much of the lobe of each point is not hidden, by its weight.

    Parameters
    ----------
    bits, normals, cube_map, reflectance_eval, outgoing
        See `dense_reflection`.

    Returns
    -------
    (n_points,) float32
        0 to 1; 1 where the lobe is black.
    """
    normals = expect_array("normals", normals, (len(bits), 3), np.float64, -UNIT, UNIT)
    white = np.ones((cube_map.n_directions, 1))
    above = np.packbits(normals @ cube_map.vectors.T > 0, axis=1, bitorder="little")
    rest = cube_map, white, reflectance_eval, outgoing
    seen, whole = (dense_reflection(b, normals, *rest).sum(axis=1) for b in (bits, above))
    return np.where(whole > 0, np.minimum(seen / np.where(whole > 0, whole, 1), 1), 1)
