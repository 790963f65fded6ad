"""Rays a second of every back-end, and what the visibility stage adds to the bare caster."""

import time

import numpy as np

from prt_core.errors import expect_kind, expect_seed, expect_whole
from prt_core.rays.caster import known_casters
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits

# One ray a call: a smaller share of the rays is enough to know its speed.
_SLOW = {"bvhtree": 32, "brute": 4096}


def bench_rays(scene, resolution=32, n_points=2048, repeats=3, seed=0):
    """Time the visibility stage and the bare caster on the same rays, in turn.

    Parameters
    ----------
    scene : Scene
    resolution, n_points, repeats, seed : int

    Returns
    -------
    dict
        points, directions, rays, and `back_ends`: for each its rays a second (stage, bare,
        incoherent), `overhead` (stage time / bare time) and `disagree`, the rays on which it
        differs from the first back-end.
    """
    expect_kind("scene", scene, Scene)
    cube_map = CubeMap(resolution)
    n_points = expect_whole("points", n_points, 1)
    expect_whole("repeats", repeats, 1)
    expect_seed(seed)
    rng = np.random.default_rng(seed)
    n_points = min(n_points, len(scene.points))
    points = np.sort(rng.choice(len(scene.points), n_points, replace=False))
    origins, directions = _rays(scene, cube_map, points)
    rows, truth = [], None
    for name in [n for n in ("embree", "blender", "bvhtree") if n in known_casters()]:
        caster = scene.make_caster(name)
        share = _SLOW.get(name, 1)
        few = points[: max(1, len(points) // share)]
        some_origins, some_directions = _rays(scene, cube_map, few)
        caster.occluded(origins[:1000], directions[:1000])
        stage, bare = [], []
        for _ in range(repeats):
            start = time.perf_counter()
            visibility_bits(scene, cube_map, caster, few)
            stage.append(time.perf_counter() - start)
            start = time.perf_counter()
            seconds = _bare(caster, some_origins, some_directions)
            bare.append(time.perf_counter() - start)
        mixed = rng.permutation(len(some_origins))[: 1 << 19]
        start = time.perf_counter()
        _bare(caster, some_origins[mixed], some_directions[mixed])
        incoherent = len(mixed) / (time.perf_counter() - start)
        truth = seconds if truth is None else truth
        rows.append(
            {
                "back_end": name,
                "rays": len(some_origins),
                "stage_rays_per_second": len(some_origins) / min(stage),
                "bare_rays_per_second": len(some_origins) / min(bare),
                "overhead": min(stage) / min(bare),
                "incoherent_rays_per_second": incoherent,
                "disagree": int((seconds != truth[: len(seconds)]).sum()),
            }
        )
        caster.close()
    return {
        "points": n_points,
        "directions": cube_map.n_directions,
        "rays": len(origins),
        "back_ends": rows,
    }


def _rays(scene, cube_map, points):
    """Every ray of the visibility stage for some points."""
    directions = cube_map.samples.astype(np.float32)
    above = scene.points.normals[points] @ cube_map.vectors.T.astype(np.float32) > 0
    above &= scene.points.geometric_normals[points] @ directions.T > 0
    point, direction = np.nonzero(above)
    return scene.ray_origins[points][point], directions[direction]


def _bare(caster, origins, directions):
    """The rays alone, given as the caster likes them best."""
    size = max(caster.batch * caster.threads, 1)
    if caster.threads > 1:
        return caster.occluded(origins, directions)
    return np.concatenate(
        [
            caster.occluded(origins[f : f + size], directions[f : f + size])
            for f in range(0, len(origins), size)
        ]
    )
