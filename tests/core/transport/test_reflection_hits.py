import numpy as np
import pytest

from prt_core.scene import Scene
from prt_core.sphere import Blocks, CubeMap
from prt_core.transport import Reflections, Sharing, reflection_hits, visibility_bits
from prt_core.transport.reflections import _Neighbours
from prt_core.transport.sharing import DARK, MISS
from tests.meshes import caster_of, plane, sphere, wall


def seen_from(meshes, resolution=16, side=8, **options):
    scene = Scene.from_meshes(meshes, max_hidden=0)
    cube_map, caster = CubeMap(resolution), caster_of(scene)
    points = np.arange(len(scene.points))
    bits = visibility_bits(scene, cube_map, caster, points)
    blocks = Blocks(cube_map, side)
    given = options.get("bits")
    given = bits if given is None else given
    metal = np.full(len(points), options.get("metal", False))
    work = scene, caster, Sharing(scene), blocks, points, given, 0, 0, metal
    seen = reflection_hits(*work)
    return scene, blocks, bits, seen


def test_a_wall_is_seen_where_it_stands():
    scene, blocks, _, seen = seen_from([plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5)])
    floor = np.flatnonzero(
        (scene.points.object_index == 0) & (scene.to_world(scene.points.positions)[:, 0] < 0.85)
    )
    is_wall = scene.points.object_index == 1
    met = seen.met[floor]
    assert is_wall[met[met >= 0]].all()
    # In the direction from which the ray came.
    rows, columns = np.nonzero(met >= 0)
    ways = scene.points.positions[met[rows, columns]] - scene.points.positions[floor[rows]]
    length = np.linalg.norm(ways, axis=1)
    cosine = np.einsum("mx,mx->m", ways, blocks.directions[columns]) / np.maximum(length, 1e-9)
    assert np.median(cosine[length > 0.3]) > 0.95
    assert (seen.met[floor][:, blocks.directions[:, 0] < -0.3] == MISS).all()


def test_shares_are_what_is_hidden_above_the_horizon():
    scene, blocks, bits, seen = seen_from([plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5)])
    spread = np.unpackbits(bits, axis=1, count=6 * 16**2, bitorder="little")
    above = scene.points.normals @ blocks.cube_map.vectors.T > 0
    angles = blocks.cube_map.solid_angles
    hidden = ((above & (spread == 0)) * angles).sum(axis=1)
    found = (seen.share / 255 * blocks.solid_angles).sum(axis=1)
    np.testing.assert_allclose(found, hidden, atol=0.02)


def test_an_open_plate_casts_no_ray():
    _, _, _, seen = seen_from([plane(4)])
    assert seen.n_rays == 0 and not seen.share.any() and (seen.met == MISS).all()


def test_where_visibility_errs_the_next_block_stands_in():
    meshes = [plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5)]
    _, _, bits, _ = seen_from(meshes)
    wrong = bits.copy()
    wrong[:] = 0
    scene, _, _, seen = seen_from(meshes, bits=wrong)
    assert seen.n_lost > 0
    known = seen.share > 0
    assert not (seen.met[known] == MISS).any()


def test_where_nothing_is_met_at_all_no_light_comes():
    scene, _, bits, seen = seen_from([plane(4)], bits=None)
    assert not (seen.share > 0).any()
    scene, _, _, seen = seen_from([plane(4)], bits=np.zeros_like(bits))
    assert seen.n_lost == seen.n_rays > 0
    assert (seen.met[seen.share > 0] == DARK).all()


def test_the_inside_of_a_ball_sees_itself_all_around():
    scene, blocks, _, seen = seen_from([sphere(8, inside=True)])
    share = (seen.share / 255 * blocks.solid_angles).sum(axis=1)
    np.testing.assert_allclose(share, 2 * np.pi, rtol=0.08)
    assert ((seen.met >= 0) == (seen.share > 0)).mean() > 0.99


@pytest.mark.parametrize("cut", [7, 1000])
def test_tables_become_entries_and_back(cut):
    scene, blocks, _, seen = seen_from([plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5)])
    n = len(scene.points)
    parts = [slice(f, min(f + cut, n)) for f in range(0, n, cut)]
    tables = ((seen.met[part], seen.share[part]) for part in parts)
    reflections = Reflections.of_tables(np.arange(n), blocks, tables)
    share = np.zeros((n, len(blocks)), np.uint8)
    for part in parts:
        places, entries = reflections.places(part)
        share[part].reshape(-1)[places] = reflections.share[entries]
    np.testing.assert_array_equal(share, seen.share)
    assert reflections.nbytes < seen.met.nbytes / 2


def test_the_same_seed_sees_the_same():
    meshes = [plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5)]
    one, two = (seen_from(meshes)[3] for _ in range(2))
    np.testing.assert_array_equal(one.met, two.met)


def test_of_small_blocks_every_other_one_sees_for_its_neighbour():
    scene, blocks, _, seen = seen_from([sphere(8, inside=True)], resolution=32, side=16)
    hidden = seen.share > 0
    assert 0.5 <= seen.n_rays / hidden.sum() < 0.53
    assert not (seen.met[hidden] == MISS).any() and (seen.met[~hidden] == MISS).all()
    rows, columns = np.nonzero(seen.met >= 0)
    ways = scene.points.positions[seen.met[rows, columns]] - scene.points.positions[rows]
    length = np.linalg.norm(ways, axis=1)
    cosine = np.einsum("mx,mx->m", ways, blocks.directions[columns]) / np.maximum(length, 1e-9)
    # Bake points lie a few blocks apart, seen from the other side.
    assert np.quantile(cosine[length > 0.5], 0.05) > 0.95


def test_a_small_block_by_itself_is_cast():
    neighbours = _Neighbours(np.eye(3, 6 * 16**2, dtype=np.uint8), 16, np.random.default_rng(0))
    np.testing.assert_array_equal(neighbours.cast, np.eye(3, 6 * 16**2, dtype=bool))


def test_neighbours_are_of_the_same_face_and_of_all_four_sides():
    side, n = 16, 200
    share = np.ones((n, 6 * side**2), np.uint8)
    neighbours = _Neighbours(share, side, np.random.default_rng(0))
    met = np.where(neighbours.cast, np.arange(share.shape[1]), MISS)
    neighbours.fill(met)
    taken = ~neighbours.cast
    here, there = np.broadcast_to(np.arange(share.shape[1]), met.shape)[taken], met[taken]
    assert (here // side**2 == there // side**2).all()
    steps, counts = np.unique(there - here, return_counts=True)
    assert steps.tolist() == [-side, -1, 1, side]
    np.testing.assert_allclose(counts / taken.sum(), 0.25, atol=0.01)


def test_of_curved_metal_each_small_block_is_cast_and_of_flat_metal_every_other_one():
    rays = {}
    for name, meshes in {
        "curved": [sphere(8, inside=True)],
        "flat": [plane(9, name="floor"), wall(0.9, 2.0, 1.0, n=9)],
    }.items():
        for metal in (False, True):
            _, _, _, seen = seen_from(meshes, resolution=32, side=16, metal=metal)
            rays[name, metal] = seen.n_rays / (seen.share > 0).sum()
    assert rays["curved", False] < 0.53 and rays["curved", True] > 0.9
    assert rays["flat", True] == rays["flat", False] < 0.53
