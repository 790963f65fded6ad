"""Visibility: one bit for each point and direction, and the light that the bits let through.

Rays are prepared point by point, in the cache, and cast in batches as large as the caster likes
them. Light is multiplied with bits unpacked in blocks: nine columns, the three channels of the
light times the three axes of the cosine.
"""

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_caster,
    expect_indices,
    expect_kind,
    shown,
)
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.scene import Scene
from prt_core.sphere import CubeMap

# Points whose bits are spread into float32 at once; 256 x 6,144 stay within the caches' reach.
_UNPACK = 256
# Components of unit vectors, with what rounding adds.
UNIT = 1.0001


def visibility_bits(scene, cube_map, caster, points, tally=None):
    """Trace every direction of the upper hemisphere of some points.

    A bit is set where the texel lies above the shading horizon (its cosine integral is positive),
    its traced direction above the geometric one, and nothing is in the way: no light comes
    through the surface, and no entry of T is negative.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    points : slice or (n,) int
    tally : callable(int), optional
        Told the number of rays of each batch.

    Returns
    -------
    (n, ceil(n_directions / 8)) uint8
        Little bit order: direction d is bit d % 8 of byte d // 8.
    """
    expect_kind("scene", scene, Scene)
    expect_kind("cube_map", cube_map, CubeMap)
    expect_caster(caster)
    points = expect_indices("points", points, len(scene.points))
    origins = scene.ray_origins[points]
    shading, geometric = scene.points.normals[points], scene.points.geometric_normals[points]
    above_horizon = _Horizon(shading, geometric, cube_map)
    directions = cube_map.samples.astype(np.float32)
    bits = np.empty((len(origins), -(-cube_map.n_directions // 8)), np.uint8)

    def one(part):
        above = above_horizon(part)
        counts = np.count_nonzero(above, axis=1)
        ends = np.cumsum(counts)
        ways = np.empty((int(ends[-1]), 3), np.float32)
        starts = np.repeat(origins[part], counts, axis=0)
        # Point by point, so that what is picked and written stays in the cache.
        for row, end, count in zip(above, ends, counts, strict=True):
            directions.compress(row, axis=0, out=ways[end - count : end])
        if len(ways):
            above[above] = ~caster.occluded(starts, ways)
        bits[part] = np.packbits(above, axis=1, bitorder="little")
        if tally is not None:
            tally(len(ways))

    step = max(1, 2 * caster.batch // cube_map.n_directions)
    parts = [slice(first, first + step) for first in range(0, len(origins), step)]
    if caster.threads > 1:
        on_all_cores(one, parts)
    else:
        for part in parts:
            one(part)
    return bits


class _Horizon:
    """(n, n_directions) bool of a part of some points: above both horizons."""

    def __init__(self, shading, geometric, cube_map):
        self._shading, self._geometric = shading, geometric
        self._vectors = np.ascontiguousarray(cube_map.vectors.T, np.float32)
        self._samples = np.ascontiguousarray(cube_map.samples.T, np.float32)

    def __call__(self, part):
        above = self._shading[part] @ self._vectors > 0
        above &= self._geometric[part] @ self._samples > 0
        return above


def horizon_bits(scene, cube_map, points):
    """The entries of some points that need a ray: all others are known to be 0.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    points : slice or (n,) int

    Returns
    -------
    (n, ceil(n_directions / 8)) uint8
        As `visibility_bits` with nothing in the way of any ray.
    """
    normals = np.hstack([scene.points.normals[points], scene.points.geometric_normals[points]])
    # Many points of flat parts share theirs.
    kinds, kind = np.unique(normals.view("V24")[:, 0], return_inverse=True)
    kinds = kinds.view(np.float32).reshape(-1, 6)
    above_horizon = _Horizon(kinds[:, :3], kinds[:, 3:], cube_map)
    bits = np.empty((len(kinds), -(-cube_map.n_directions // 8)), np.uint8)

    def one(first):
        part = slice(first, first + _UNPACK)
        bits[part] = np.packbits(above_horizon(part), axis=1, bitorder="little")

    with one_blas_thread():
        on_all_cores(one, range(0, len(kinds), _UNPACK))
    return bits[kind]


def expect_bits(name, bits, n_directions):
    """(n, ceil(n_directions / 8)) uint8, a bit for each direction."""
    n_bytes = -(-n_directions // 8)
    good = isinstance(bits, np.ndarray) and bits.dtype == np.uint8 and bits.ndim == 2
    expect(
        good and bits.shape[1] == n_bytes,
        f"{name}: expected (n, {n_bytes}) uint8, got {shown(bits)}",
    )
    return bits


def unpack(bits, n_directions, dtype=np.float32):
    """Bits (n, ceil(n_directions / 8)) uint8 as (n, n_directions) of `dtype`, 0 or 1."""
    spread = np.unpackbits(bits, axis=1, count=n_directions, bitorder="little")
    return spread if dtype == np.uint8 else spread.astype(dtype)


def received_light(bits, normals, cube_map, light):
    """Irradiance / pi at points: the light that comes straight from the sky.

    `E(x) = 1/pi sum_d L_d V_d(x) n(x) . v_d` with the exact cosine integral v_d of each texel.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
    normals : (n_points, 3) float32
    cube_map : CubeMap
    light : (n_directions, n_channels) float
        Radiance.

    Returns
    -------
    (n_points, n_channels) float32
    """
    expect_kind("cube_map", cube_map, CubeMap)
    bits = expect_bits("bits", bits, cube_map.n_directions)
    normals = expect_array("normals", normals, (len(bits), 3), None, -UNIT, UNIT)
    light = expect_array("light", light, (cube_map.n_directions, None), np.float64)
    result = np.empty((len(bits), light.shape[1]), np.float32)

    def use(part, vectors):
        result[part] = np.einsum("pa,pac->pc", normals[part], vectors)

    _each_part(bits, cube_map, light, use)
    # Rounding may leave a trace below zero where nothing is seen.
    return np.maximum(result, 0, out=result)


def vector_light(bits, cube_map, light):
    """Vector irradiance / pi at points: its product with a normal is what a surface receives.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
    cube_map : CubeMap
    light : (n_directions, n_channels) float
        Radiance.

    Returns
    -------
    (n_points, 3, n_channels) float32
        `sum_d L_d V_d(x) v_d / pi`, of which `received_light` is the part along the normal.
    """
    expect_kind("cube_map", cube_map, CubeMap)
    bits = expect_bits("bits", bits, cube_map.n_directions)
    light = expect_array("light", light, (cube_map.n_directions, None), np.float64)
    result = np.empty((len(bits), 3, light.shape[1]), np.float32)
    _each_part(bits, cube_map, light, result.__setitem__)
    return result


def _each_part(bits, cube_map, light, use):
    """`use(part, vectors)` with the vector irradiance / pi of each part of the points."""
    n_channels = light.shape[1]
    # Three vectors for each channel: the cosine is taken after the sum over directions.
    factors = cube_map.vectors[:, :, None] * light[:, None] / np.pi
    factors = factors.reshape(len(light), -1).astype(np.float32)
    # By byte: directions that no point of a part sees, as those below a floor, are left out.
    n_bytes = bits.shape[1]
    by_byte = np.zeros((n_bytes * 8, 3 * n_channels), np.float32)
    by_byte[: len(light)] = factors
    by_byte = by_byte.reshape(n_bytes, 8, -1)

    def one(first):
        part = slice(first, first + _UNPACK)
        seen = np.flatnonzero(bits[part].any(axis=0))
        weights = by_byte[seen].reshape(8 * len(seen), 3 * n_channels)
        vectors = unpack(bits[part].take(seen, axis=1), 8 * len(seen)) @ weights
        use(part, vectors.reshape(-1, 3, n_channels))

    with one_blas_thread():
        on_all_cores(one, range(0, len(bits), _UNPACK))
