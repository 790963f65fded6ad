"""Rows of the transport matrix by path tracing: slow, plain, and what K is checked against.

Every vertex of a path is connected to every direction of the cube map, at the surface that was
really hit, so no bake point, no gather operator and no interpolated radiosity is involved; only
the albedo and normals of the mesh are.
"""

import numpy as np

from prt_core.errors import (
    expect_caster,
    expect_indices,
    expect_kind,
    expect_seed,
    expect_whole,
)
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import Scene
from prt_core.sphere import CubeMap, square_to_cosine, tangent_frames


def reference_rows(scene, cube_map, caster, points, n_paths=256, max_bounces=8, seed=0):
    """Unbiased estimates of rows of T for up to `max_bounces` bounces.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    points : sequence of int
    n_paths, max_bounces, seed : int

    Returns
    -------
    rows : (n, n_directions, 3) float64
        T[x, d]: outgoing radiance at x for unit radiance from texel d.
    errors : (n, n_directions, 3) float64
        Standard error of the indirect part; the direct part is exact.
    """
    expect_kind("scene", scene, Scene)
    expect_kind("cube_map", cube_map, CubeMap)
    expect_caster(caster)
    points = expect_indices("points", points, len(scene.points))
    n_paths = expect_whole("n_paths", n_paths, 2, 1 << 20)
    max_bounces = expect_whole("max_bounces", max_bounces, 0, 10_000)
    rng = generator(expect_seed(seed), Stage.REFERENCE)
    rows, errors = [], []
    for point in points:
        normals = scene.points.normals[[point]]
        geometric = scene.points.geometric_normals[[point]]
        origins = scene.ray_origins[[point]]
        albedo = scene.points.albedo[[point]].astype(np.float64)
        direct = albedo[:, None] * _direct(cube_map, caster, origins, normals, geometric)[..., None]
        paths = np.zeros((n_paths, cube_map.n_directions, 3))
        state = [np.repeat(x, n_paths, axis=0) for x in (origins, normals, geometric, albedo)]
        alive = np.arange(n_paths)
        for _ in range(max_bounces):
            alive, state = _bounce(scene, caster, alive, state, rng)
            if not len(alive):
                break
            origins, normals, geometric, weight = state
            light = _direct(cube_map, caster, origins, normals, geometric)
            paths[alive] += weight[:, None] * light[..., None]
        rows.append(direct[0] + paths.mean(axis=0))
        errors.append(paths.std(axis=0, ddof=1) / np.sqrt(n_paths))
    return np.array(rows), np.array(errors)


def _direct(cube_map, caster, origins, normals, geometric):
    """(m, n_directions) float64: irradiance / pi for unit radiance from each texel."""
    directions = cube_map.samples.astype(np.float32)
    cosine = normals @ cube_map.vectors.T.astype(np.float32)
    above = (cosine > 0) & (geometric @ directions.T > 0)
    vertex, direction = np.nonzero(above)
    free = np.zeros(above.shape, bool)
    if len(vertex):
        free[vertex, direction] = ~caster.occluded(origins[vertex], directions[direction])
    return np.where(free, cosine, 0) / np.pi


def _bounce(scene, caster, alive, state, rng):
    """Continue each path by one cosine-distributed ray; paths that meet no lit side end."""
    origins, normals, geometric, weight = state
    local = square_to_cosine(rng.random((2, len(alive))).T)
    directions = np.einsum("ij,ijk->ik", local, tangent_frames(normals)).astype(np.float32)
    hits = caster.intersect(origins, directions)
    usable = (hits.triangle >= 0) & ((directions * geometric).sum(axis=1) > 0)
    alive, directions, weight = alive[usable], directions[usable], weight[usable]
    triangle, barycentric = hits.triangle[usable], hits.barycentric[usable].astype(np.float64)
    flat = scene.triangle_normals[triangle]
    back = (directions * flat).sum(axis=1) > 0
    around, share = scene.hit_points(triangle, barycentric, back)
    lit = (around >= 0).all(axis=1)
    around, share, back, flat = around[lit], share[lit], back[lit], flat[lit]
    weights = np.column_stack([1 - barycentric.sum(axis=1), barycentric])[lit]
    corners = scene.vertices[scene.triangles[triangle[lit]]]
    position = np.einsum("ij,ijk->ik", weights, corners)
    normal = np.einsum("ij,ijk->ik", share, scene.points.normals[around])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    side = np.where(back[:, None], -flat, flat)
    albedo = scene.materials_at(triangle[lit], barycentric[lit], back).albedo
    state = (
        position + scene.triangle_lifts[triangle[lit], None] * side,
        normal.astype(np.float32),
        side.astype(np.float32),
        weight[lit] * albedo,
    )
    return alive[lit], state
