import numpy as np
import pytest

from prt_core import PRTError
from prt_core.light import Lamp
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import (
    Transport,
    all_bounces,
    gather_directions,
    gather_hits,
    gather_operator,
    gather_parts,
    lamp_light,
    ray_ends,
    received_light,
    reference_rows,
    visibility_bits,
)
from prt_core.transport.gather import DARK, MISS, REPRESENTED, ROUND, cosine_directions
from tests.meshes import caster_of, plane, sphere


def gathered(scene, rounds=4, seed=0):
    caster = caster_of(scene)
    every = slice(0, len(scene.points))
    hits = [gather_hits(scene, caster, every, seed, r).hits for r in range(rounds)]
    return gather_operator(np.concatenate(hits, axis=1), len(scene.points))


def transport_of(scene, resolution=4, rounds=4):
    cube_map = CubeMap(resolution)
    caster = caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    return Transport(
        cube_map, bits, gathered(scene, rounds), scene.points.normals, scene.points.albedo, 1e-6
    )


@pytest.fixture(scope="module")
def bench():
    """A red ball over a floor, every side by which they see each other."""
    ball = sphere(8, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    return Scene.from_meshes([ball, plane(9, albedo=0.7)])


@pytest.mark.parametrize("albedo", [0.3, 0.8])
def test_inside_a_closed_ball_light_adds_up_to_the_series(albedo):
    scene = Scene.from_meshes([sphere(12, inside=True, albedo=albedo)])
    gather = gathered(scene, 16)
    share = gather.sum(axis=1).A1 if hasattr(gather.sum(axis=1), "A1") else gather.sum(axis=1)
    assert np.min(share) > 0.97
    emitted = np.ones((len(scene.points), 3), np.float32)
    radiance, _ = all_bounces(gather, scene.points.albedo, emitted, 1e-5)
    # A faceted ball loses the few rays between its shading and geometric horizon.
    np.testing.assert_allclose(radiance, albedo / (1 - albedo), rtol=0.02)


def test_gather_rays_are_cosine_distributed():
    rng = np.random.default_rng(0)
    normals = np.tile(np.float32([[0.6, 0, 0.8]]), (400, 1))
    directions = cosine_directions(normals, rng.random((400, 2)).astype(np.float32))
    assert directions.shape == (400, ROUND, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-5)
    cosine = (directions @ np.float32([0.6, 0, 0.8])).ravel()
    # The squared cosine of Malley's method is uniform: chi-squared over 20 bins.
    result, _ = np.histogram(cosine**2, 20, (0, 1))
    expected = len(cosine) / 20
    assert ((result - expected) ** 2 / expected).sum() < 45.3  # 99.9 % of 20 - 1 degrees


def test_the_back_of_a_face_returns_nothing():
    # Points of a floor under a sheet that faces up see only its back.
    floor, sheet = plane(5, name="floor"), plane(5, -30, 30, name="sheet", z=0.5)
    one = Scene.from_meshes([floor, sheet], max_hidden=0)
    assert gathered(one, 2)[:25].nnz == 0
    sheet.two_sided = True
    two = Scene.from_meshes([floor, sheet], max_hidden=0)
    seen = gathered(two, 2)[:25]
    assert seen.nnz > 0
    assert (two.points.normals[np.unique(seen.indices), 2] < 0).all()


def test_rows_columns_and_relighting_are_one_matrix(bench):
    transport = transport_of(bench)
    every = np.arange(len(bench.points))
    rows, columns = transport.rows(every), transport.columns(np.arange(transport.n_directions))
    scale = np.abs(rows).max()
    np.testing.assert_allclose(rows, columns, atol=2e-5 * scale)
    light = np.random.default_rng(0).random((transport.n_directions, 3)).astype(np.float32)
    np.testing.assert_allclose(
        np.einsum("pdc,dc->pc", rows, light), transport.radiance(light), rtol=2e-4, atol=1e-5
    )
    direct = np.einsum("pdc,dc->pc", transport.rows(every, indirect=False), light)
    np.testing.assert_allclose(direct, transport.radiance(light, bounces=0), rtol=2e-4, atol=1e-5)


def test_two_bounces_are_the_first_terms_of_the_series(bench):
    transport = transport_of(bench)
    received = transport.received(np.ones((transport.n_directions, 3), np.float32))
    a = bench.points.albedo
    zero = a * received
    one = a * (transport.gather @ zero)
    two = a * (transport.gather @ one)
    result = all_bounces(transport.gather, a, received, bounces=2)[0]
    np.testing.assert_allclose(result, zero + one + two, rtol=1e-6)


def test_rows_agree_with_path_tracing():
    """Indirect rows of a fine mesh, within the noise of both."""
    ball = sphere(20, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(41, albedo=0.7)])
    cube_map, caster = CubeMap(4), caster_of(scene)
    places = np.array([(0.25, 0, 0), (0.2, 0.1, -0.26), (-0.3, 0.1, -0.26)])
    points = [int(np.linalg.norm(scene.points.positions - p, axis=1).argmin()) for p in places]
    truth, error = reference_rows(scene, cube_map, caster, points, n_paths=3200, max_bounces=12)
    rows = [transport_of_seed(scene, seed).rows(points) for seed in (0, 1, 2, 3)]
    mean, spread = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / 2
    # Entry by entry; half a per cent of the largest is the mesh: radiosity between its points.
    sigma = np.hypot(error, spread)
    assert (np.abs(mean - truth) < 4 * sigma + 0.005 * truth.max()).all()
    # Of whole rows: a path adds to all directions, so their errors go together.
    result, wanted = mean.sum(axis=1), truth.sum(axis=1)
    bound = 4 * np.hypot(error.sum(axis=1), spread.sum(axis=1))
    assert (np.abs(result - wanted) < bound).all()
    # The test can fail: without bounces both do.
    direct = transport_of_seed(scene, 0).rows(points, indirect=False)
    assert (np.abs(direct - truth) > 4 * sigma + 0.005 * truth.max()).any()
    assert (np.abs(direct.sum(axis=1) - wanted) > bound).any()


def transport_of_seed(scene, seed):
    transport = transport_of(scene, rounds=1)
    transport.gather = gathered(scene, 6, seed)
    return transport


def test_light_that_never_settles_is_said():
    scene = Scene.from_meshes([sphere(6, inside=True, albedo=1.0)])
    gather = gathered(scene, 1)
    full = gather.multiply(1 / np.asarray(gather.sum(axis=1))).tocsr()
    with pytest.raises(PRTError, match="not settled"):
        all_bounces(full, scene.points.albedo, np.ones((len(scene.points), 3), np.float32))


def test_lamps_follow_closed_forms():
    scene = Scene.from_meshes([plane(3, -0.01, 0.01)])
    caster = caster_of(scene)
    middle = np.argmin(np.linalg.norm(scene.points.positions, axis=1))

    def lit(lamp):
        return lamp_light(scene, caster, [lamp], 256)[middle] * np.pi

    up, power = (0, 0, 2.0), (100.0, 50.0, 10.0)
    np.testing.assert_allclose(
        lit(Lamp("point", power, up)), np.array(power) / (4 * np.pi * 4), rtol=1e-5
    )
    # A spot straight above shines as the point lamp does, and not outside its cone.
    np.testing.assert_allclose(
        lit(Lamp("spot", power, up)), np.array(power) / (4 * np.pi * 4), rtol=1e-5
    )
    assert not lit(Lamp("spot", power, (2.0, 0, 2.0))).any()
    np.testing.assert_allclose(lit(Lamp("sun", power)), power, rtol=1e-6)
    # A disc of radius r at height h: radiance P / (pi A) times pi sin^2 of its half angle.
    disc = Lamp("area", power, up, size=(2.0, 2.0), ellipse=True)
    wanted = np.array(power) / (np.pi * np.pi) * np.pi * (1 / (1 + 4))
    np.testing.assert_allclose(lit(disc), wanted, rtol=0.01)


def test_lamps_cast_shadows_only_up_to_themselves():
    # A lid above the lamp casts no shadow; one below it does.
    floor = plane(3, -0.1, 0.1, name="floor")
    lamp = Lamp("point", (10, 10, 10), (0, 0, 1.0))
    for height, shaded in ((1.5, False), (0.5, True)):
        scene = Scene.from_meshes([floor, plane(3, -1, 1, name="lid", z=height)], max_hidden=0)
        caster = caster_of(scene)
        lit = lamp_light(scene, caster, [lamp])[:9]
        assert lit.any() != shaded


def test_a_sharp_sun_shades_as_the_image_says():
    """A lid over a floor: the sun's shadow falls where the pixel is, not where its texel's is."""
    from prt_core import Bake, EnvironmentMap
    from prt_core.api import relight_points

    floor = plane(41, name="floor", albedo=1.0)
    scene = Scene.from_meshes([floor, plane(3, -0.2, 0.2, name="lid", z=0.5)], max_hidden=0)
    pixels = np.full((128, 256, 3), 0.01, np.float32)
    pixels[40, 77] = 5e4
    environment = EnvironmentMap(pixels)
    transport = transport_of(scene, resolution=8, rounds=1)
    bake = Bake(scene, transport, [], None, None, {}, {})
    relit = relight_points(bake, environment, sharp_sun=True, bounces=0)[:1681, 0]
    u, v = (77.5 / 256, 1 - 40.5 / 128)
    angle, height = 2 * np.pi * (0.5 - u), np.pi * (v - 0.5)
    towards = [np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)]
    ground = scene.to_world(scene.points.positions[:1681])
    above = ground + np.outer(np.full(1681, 0.5), towards) / towards[2]
    inside = np.abs(above[:, :2]).max(axis=1)
    shaded, lit = inside < 0.19, inside > 0.21
    assert shaded.sum() > 30
    sun = 5e4 * towards[2] / np.pi * 2 * np.pi / 256 * np.cos(height) * np.pi / 128
    np.testing.assert_allclose(relit[lit], sun, rtol=0.01)
    assert relit[shaded].max() < 0.05 * sun


def blocked_share(scene, cube_map):
    """Of the cosine-weighted hemisphere, as a bake finds it."""
    caster = caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    sky = np.ones((cube_map.n_directions, 1), np.float32)
    return bits, 1 - received_light(bits, scene.points.normals, cube_map, sky)[:, 0]


def test_rows_meet_as_much_as_is_blocked(bench):
    every, caster = slice(0, len(bench.points)), caster_of(bench)
    _, blocked = blocked_share(bench, CubeMap(16))
    hits = gather_hits(bench, caster, every, 0, 0).hits
    raw = gather_operator(hits, len(bench.points))
    scaled = gather_operator(hits, len(bench.points), blocked)
    lit, lost = np.asarray(raw.sum(axis=1)).ravel(), (ray_ends(hits) == DARK).mean(axis=1)
    enough = (blocked * ROUND >= 2) & (lit + lost > 0)
    assert 20 < enough.sum() < len(enough)
    result = np.asarray(scaled.sum(axis=1)).ravel()
    np.testing.assert_allclose(
        result[enough], (lit * blocked / np.maximum(lit + lost, 1e-9))[enough], rtol=1e-5
    )
    np.testing.assert_array_equal(result[~enough], lit[~enough])


def test_scaled_rows_are_nearer_to_the_truth(bench):
    """Radiosity of many rays against few, scaled and not, under a sky from one side."""
    every, caster, n_points = slice(0, len(bench.points)), caster_of(bench), len(bench.points)
    bits, blocked = blocked_share(bench, CubeMap(16))
    sky = np.maximum(CubeMap(16).directions[:, :1], 0).astype(np.float32)
    light = received_light(bits, bench.points.normals, CubeMap(16), sky)
    hits = [gather_hits(bench, caster, every, 0, turn).hits for turn in range(72)]
    truth = gather_operator(np.hstack(hits[8:]), n_points) @ light

    def error(*blocked):
        result = [gather_operator(subset, n_points, *blocked) @ light for subset in hits[:8]]
        return np.linalg.norm(np.array(result) - truth)

    assert error(blocked) < 0.8 * error()


def test_a_ray_towards_the_open_sky_stands_for_others(bench):
    """As many hits on average, though a sixteenth of the rays is cast; whole groups are alike."""
    every, caster = slice(0, len(bench.points)), caster_of(bench)
    parts = [(every, turn) for turn in range(60)]

    def everything_is_clear(points, directions):
        return np.ones(directions.shape[:2], bool)

    subset = gather_parts(bench, caster, parts, 0, None, everything_is_clear)
    whole = gather_parts(bench, caster, parts, 0)
    n_some, n_whole = (sum(one.n_rays for one in result) for result in (subset, whole))
    assert n_whole / 16 <= n_some < n_whole / 10
    share = [np.mean([(ray_ends(one.hits) >= 0).mean(axis=1) for one in result], axis=0)
             for result in (subset, whole)]  # fmt: skip
    # Two representatives a row and round: a standard deviation of at most 0.5 / sqrt(2 x 60).
    assert np.abs(share[0] - share[1]).max() < 5 * 0.5 / np.sqrt(120)
    assert abs(share[0].mean() - share[1].mean()) < 0.01
    counts = np.unique((ray_ends(subset[0].hits) == MISS).sum(axis=1))
    assert len(counts) < len(np.unique((ray_ends(whole[0].hits) == MISS).sum(axis=1)))


def test_every_ray_of_a_round_keeps_its_direction(bench):
    """Cast again along `gather_directions`, each ray ends where its slot says."""
    every, caster = slice(0, len(bench.points)), caster_of(bench)

    def some_are_clear(points, directions):
        return directions[:, :, 0] > 0.3

    result = gather_parts(bench, caster, [(every, 3)], 5, None, some_are_clear)[0]
    ways = gather_directions(bench, every, 5, 3)
    assert ways.shape == (len(bench.points), ROUND, 3)
    origins = np.repeat(bench.ray_origins, ROUND, axis=0)
    met = caster.intersect(origins, ways.reshape(-1, 3))
    met = (met.triangle >= 0).reshape(-1, ROUND)
    above = np.einsum("nrx,nx->nr", ways, bench.points.geometric_normals) > 0
    cast = (result.hits > REPRESENTED) & above
    assert cast.sum() == result.n_rays < 0.8 * above.sum()
    np.testing.assert_array_equal((result.hits == MISS)[cast], ~met[cast])
    # Those that were not cast name one of their own kind that was, and end as it does.
    row, slot = np.nonzero(result.hits <= REPRESENTED)
    representative = REPRESENTED - result.hits[row, slot]
    assert (ways[row, slot, 0] > 0.3).all() and (ways[row, representative, 0] > 0.3).all()
    assert (result.hits[row, representative] > REPRESENTED).all() and (representative != slot).all()
    ends = ray_ends(result.hits)
    np.testing.assert_array_equal(ends[row, slot], result.hits[row, representative])
    np.testing.assert_array_equal(
        ends[result.hits > REPRESENTED], result.hits[result.hits > REPRESENTED]
    )
