"""What a point sees of its own surface: horizons entry by entry, rays below them, and backs."""

import numpy as np
import pytest

from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import (
    gather_hits,
    gather_operator,
    gather_parts,
    received_light,
    visibility_bits,
)
from prt_core.transport.gather import DARK, MISS, ROUND
from prt_core.transport.visibility import horizon_bits, unpack
from tests.meshes import caster_of, plane, sphere


def leaning(lean, n=3, **settings):
    """A plane whose shading normals lean."""
    mesh = plane(n, **settings)
    normal = [np.sin(lean), 0, np.cos(lean)]
    mesh.corner_normal = np.broadcast_to(normal, mesh.corner_normal.shape).copy()
    return mesh


def test_a_bit_needs_both_horizons():
    # Shading normals are shared by points whose geometric ones differ, and the other way round.
    scene = Scene.from_meshes([leaning(0.7, 5), sphere(5, 0.3, (0, 0, 3))], max_hidden=0)
    points = scene.points
    points.normals[:4] = points.normals[30:34]
    points.geometric_normals[4:8] = points.geometric_normals[30:34]
    cube_map = CubeMap(5)
    subset = np.array([2, 3, 5, 6, 11, 20, 40])
    wanted = np.zeros((len(subset), cube_map.n_directions), bool)
    sure = np.ones_like(wanted)
    for row, point in enumerate(subset):
        for d in range(cube_map.n_directions):
            shading = points.normals[point].astype(np.float64) @ cube_map.vectors[d]
            geometric = points.geometric_normals[point].astype(np.float64) @ cube_map.samples[d]
            wanted[row, d] = shading > 0 and geometric > 0
            # On a horizon rounding decides.
            sure[row, d] = min(abs(shading), abs(geometric)) > 1e-6
    result = unpack(horizon_bits(scene, cube_map, subset), cube_map.n_directions) > 0
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(result[sure], wanted[sure])

    class Nothing:
        batch, threads = 1 << 16, 1

        def occluded(self, origins, directions, limit=None):
            return np.zeros(len(origins), bool)

    traced = visibility_bits(scene, cube_map, Nothing(), subset)
    np.testing.assert_array_equal(traced, horizon_bits(scene, cube_map, subset))


def test_light_along_the_horizon_is_never_below_zero():
    # Normals at right angles to a texel: its cosine is a rounding error of either sign.
    rng, cube_map = np.random.default_rng(0), CubeMap(7)
    n = 3000
    texel = rng.integers(0, cube_map.n_directions, n)
    normals = np.cross(cube_map.vectors[texel], rng.standard_normal((n, 3)))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    bits = np.zeros((n, cube_map.n_directions), bool)
    bits[np.arange(n), texel] = True
    light = np.full((cube_map.n_directions, 1), 1e5, np.float32)
    packed = np.packbits(bits, axis=1, bitorder="little")
    assert received_light(packed, normals, cube_map, light).min() == 0


@pytest.mark.parametrize("lean", [0.0, 0.5, 1.2])
def test_rays_below_the_surface_are_dark(lean):
    # Of cosine-distributed rays about a normal that leans the share (1 - cos) / 2 is below.
    scene = Scene.from_meshes([leaning(lean)], max_hidden=0)
    every, caster = slice(0, len(scene.points)), caster_of(scene)
    result = [gather_hits(scene, caster, every, 0, turn) for turn in range(24)]
    hits = np.concatenate([one.hits for one in result], axis=1)
    share = (1 - np.cos(lean)) / 2
    assert set(np.unique(hits)) <= {MISS, DARK}
    assert (hits == DARK).mean() == pytest.approx(share, abs=4 * 0.5 / np.sqrt(hits.size))
    assert sum(one.n_rays for one in result) == (hits == MISS).sum()


@pytest.mark.parametrize("two_sided", [False, True])
def test_hits_on_backs_are_dark_and_counted(two_sided):
    # A floor below a sheet that looks up: of the floor's middle a disc of the same size would
    # hide sin^2 of its half angle; the square, by Lambert's formula, four times one edge's part.
    floor = plane(3, -0.01, 0.01, name="floor")
    sheet = plane(2, -1, 1, z=0.5, name="sheet", two_sided=two_sided)
    scene = Scene.from_meshes([floor, sheet], max_hidden=0)
    mine = slice(0, 9)
    result = [gather_hits(scene, caster_of(scene), mine, 5, turn) for turn in range(40)]
    hits = np.concatenate([one.hits for one in result], axis=1)
    corners = np.array([(-1, -1, 0.5), (1, -1, 0.5), (1, 1, 0.5), (-1, 1, 0.5)])
    hidden = 0.0
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        across = np.cross(p, q)
        angle = np.arctan2(np.linalg.norm(across), p @ q)
        hidden += angle * across[2] / np.linalg.norm(across) / (2 * np.pi)
    backs = sum(one.n_back for one in result)
    met = (hits != MISS).mean()
    assert met == pytest.approx(abs(hidden), abs=4 * 0.5 / np.sqrt(hits.size))
    gather = gather_operator(hits, len(scene.points))
    if two_sided:
        assert not backs.any() and not (hits == DARK).any()
        assert gather.sum(axis=1).mean() == pytest.approx(met)
        assert (scene.points.normals[np.unique(hits[hits >= 0]), 2] < 0).all()
    else:
        assert backs.tolist() == [0, (hits == DARK).sum()] and not (hits >= 0).any()
        assert gather.nnz == 0


class Recorder:
    """A caster that meets nothing and keeps the rays."""

    batch, threads = 1 << 16, 1

    def __init__(self, caster):
        self._caster, self.directions = caster, []

    def intersect(self, origins, directions):
        self.directions.append(directions)
        return self._caster.intersect(origins, directions)


def test_blocks_rounds_and_seeds_have_random_numbers_of_their_own():
    scene = Scene.from_meshes([plane(4)], max_hidden=0)
    sets = []
    for block, seed, turn in ((0, 0, 0), (8, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)):
        caster = Recorder(caster_of(scene))
        gather_hits(scene, caster, slice(block, block + 8), seed, turn)
        ways = np.concatenate(caster.directions)
        assert ways.shape == (8 * ROUND, 3)
        sets.append(ways[np.lexsort(ways.T)])
    np.testing.assert_array_equal(sets[0], sets[4])
    for other in sets[1:4]:
        assert np.abs(other - sets[0]).max() > 1e-3


def test_no_ray_is_cast_where_none_can_meet_anything():
    scene = Scene.from_meshes([leaning(0.5, 4)], max_hidden=0)
    every, caster = slice(0, 16), caster_of(scene)
    spared = np.arange(16) % 3 == 0
    (plain,) = gather_parts(scene, caster, [(every, 0)], 0)
    (result,) = gather_parts(scene, caster, [(every, 0)], 0, spared)
    np.testing.assert_array_equal(result.hits, plain.hits)
    assert result.n_rays == (plain.hits[~spared] == MISS).sum() < plain.n_rays
