"""Lamps against closed forms of their irradiance, by quadrature over their samples."""

import numpy as np
import pytest

from prt_core.light import Lamp, sun_light
from prt_core.light.local import lamp_samples
from prt_core.sphere import CubeMap, rotation_matrix

POWER = np.array([100.0, 50.0, 7.0])
TURNED = rotation_matrix((20.0, -35.0, 110.0))
HERE, UP = np.array([[0.3, -0.2, 0.1]]), np.array([0.0, 0.0, 1.0])


def samples(lamp, position=HERE, n=128):
    """Direction, distance and irradiance of n x n samples, spread as a grid."""
    place = (np.arange(n) + 0.5) / n
    uv = np.stack(np.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 2)
    return lamp.sample(np.repeat(np.reshape(position, (1, 3)), n * n, axis=0), uv)


def irradiance(lamp, position=HERE, normal=UP, n=128):
    direction, _, result = samples(lamp, position, n)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=1e-12)
    return (result * np.maximum(direction @ normal, 0)[:, None]).mean(axis=0)


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def around(angle, turn):
    """A direction at an angle from the z axis."""
    return np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


@pytest.mark.parametrize("distance", [0.5, 3.0])
@pytest.mark.parametrize("soft_falloff", [True, False])
def test_a_point_lamp_falls_with_the_square_of_the_distance(distance, soft_falloff):
    way = unit(0.3, -0.5, 0.8)
    lamp = Lamp("point", POWER, HERE[0] + distance * way, soft_falloff=soft_falloff)
    assert lamp.is_small
    wanted = POWER / (4 * np.pi * distance**2) * way[2]
    np.testing.assert_allclose(irradiance(lamp, n=2), wanted, rtol=1e-12)


@pytest.mark.parametrize("radius", [0.1, 0.6])
def test_the_disc_of_a_point_lamp_faces_the_receiver(radius):
    # A disc whose axis leads to the receiver gives pi L r^2 / (r^2 + d^2) along that axis (the
    # disc's form factor); its radiance is power / (4 pi^2 r^2).
    way, distance = unit(0.2, -0.1, 0.9), 0.7
    lamp = Lamp("point", POWER, HERE[0] + distance * way, radius=radius)
    wanted = POWER / (4 * np.pi * (radius**2 + distance**2)) * way[2]
    np.testing.assert_allclose(irradiance(lamp), wanted, rtol=1e-4)
    direction, length, _ = samples(lamp)
    along = length * (direction @ way)
    np.testing.assert_allclose(along, distance, rtol=1e-9)
    assert np.sqrt(length**2 - along**2).max() == pytest.approx(radius, rel=0.01)


@pytest.mark.parametrize("radius", [0.1, 0.6])
def test_a_ball_gives_what_a_point_in_its_middle_gives(radius):
    # The form factor of a sphere that is wholly above the horizon: (r / d)^2 cos.
    way, distance = unit(0.2, -0.1, 0.9), 0.7
    lamp = Lamp("point", POWER, HERE[0] + distance * way, radius=radius, soft_falloff=False)
    wanted = POWER / (4 * np.pi * distance**2) * way[2]
    np.testing.assert_allclose(irradiance(lamp), wanted, rtol=1e-4)
    # Rays end on the side of the ball that can be seen.
    direction, length, _ = samples(lamp)
    ends = HERE + length[:, None] * direction - lamp.position
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), radius, rtol=1e-9)
    assert (np.einsum("ij,ij->i", ends, direction) <= 1e-9).all()


def test_inside_a_ball_it_shines_from_everywhere():
    # pi times its radiance, however the receiver lies and looks.
    for place, normal in ((HERE[0], UP), (HERE[0] + [0.2, 0.1, 0.3], unit(0.5, -0.6, -0.2))):
        lamp = Lamp("point", POWER, place, radius=0.5, soft_falloff=False)
        wanted = POWER / (4 * np.pi * 0.5**2)
        np.testing.assert_allclose(irradiance(lamp, normal=normal), wanted, rtol=1e-3)
        direction, length, _ = samples(lamp)
        ends = HERE + length[:, None] * direction - lamp.position
        assert length.min() > 0
        np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.5, rtol=1e-9)


def test_inside_its_ball_a_spot_has_no_cone():
    # As in Cycles; with soft falloff the cone is everywhere.
    for soft_falloff in (False, True):
        lamp = Lamp(
            "spot", POWER, HERE[0] + [0, 0, 0.2], cone=0.9, radius=0.5, soft_falloff=soft_falloff
        )
        sideways = irradiance(lamp, HERE[0] + [0.3, 0, 0.1], unit(1, 0, 0))
        if soft_falloff:
            assert not sideways.any()
        else:
            np.testing.assert_allclose(sideways, POWER / (4 * np.pi * 0.5**2), rtol=1e-3)


def smoothstep(cosine, cone, blend):
    """Cycles' attenuation of a spot, from the cosine with its axis."""
    edge = np.cos(cone / 2)
    if blend == 0:
        return 1.0 if cosine >= edge else 0.0
    t = (cosine - edge) / ((1 - edge) * blend)
    return 0.0 if t <= 0 else 1.0 if t >= 1 else t * t * (3 - 2 * t)


@pytest.mark.parametrize("cone, blend", [(1.2, 0.7), (1.2, 0.0), (2.8, 1.0), (0.4, 0.15)])
def test_a_spot_fades_over_the_soft_share_of_its_cone(cone, blend):
    lamp = Lamp("spot", POWER, (1.0, 2.0, 3.0), TURNED, cone=cone, blend=blend)
    inside = 0
    for angle in np.linspace(0, 0.75 * cone, 31):
        way = TURNED @ around(angle, 5 * angle)
        # The receiver looks at the lamp from two units away.
        result = irradiance(lamp, lamp.position - 2 * way, way, n=2)
        wanted = smoothstep(np.cos(angle), cone, blend) * POWER / (4 * np.pi * 4)
        np.testing.assert_allclose(result, wanted, rtol=1e-9, atol=1e-12)
        inside += result[0] > 0
    assert 19 <= inside <= 21
    # In the middle of the soft part half of the light is left.
    edge = np.cos(cone / 2)
    half = TURNED @ around(np.arccos(edge + (1 - edge) * blend / 2), 1.0)
    if blend:
        result = irradiance(lamp, lamp.position - 2 * half, half, n=2)
        np.testing.assert_allclose(result, POWER / (32 * np.pi), rtol=1e-9)


def test_a_spot_behind_itself_is_dark():
    lamp = Lamp("spot", POWER, HERE[0] + [0, 0, 2], rotation_matrix((180.0, 0, 0)), cone=3.0)
    assert not irradiance(lamp, n=2).any()


def test_the_scale_of_its_object_stretches_the_cone_of_a_spot():
    scale, cone, blend = (0.5, 2.0, 1.5), 1.2, 0.7
    lamp = Lamp("spot", POWER, (1, 2, 3), TURNED, cone=cone, blend=blend, scale=scale)
    even = Lamp("spot", POWER, (1, 2, 3), TURNED, cone=cone, blend=blend, scale=(3, 3, 3))
    shares = []
    for turn in np.linspace(0, 6, 13):
        local = around(0.45, turn)
        # In the lamp's own space its cone is round.
        wanted = smoothstep(unit(*local / scale)[2], cone, blend)
        way = TURNED @ local
        result = irradiance(lamp, lamp.position - way, way, n=2)
        np.testing.assert_allclose(result, wanted * POWER / (4 * np.pi), rtol=1e-9, atol=1e-12)
        shares.append(wanted)
        result = irradiance(even, lamp.position - way, way, n=2)
        wanted = smoothstep(np.cos(0.45), cone, blend) * POWER / (4 * np.pi)
        np.testing.assert_allclose(result, wanted, rtol=1e-9)
    assert min(shares) == 0 and max(shares) > 0.9


@pytest.mark.parametrize("soft_falloff", [True, False])
def test_a_spot_with_a_radius_is_its_ball_seen_through_the_cone(soft_falloff):
    settings = {"radius": 0.4, "soft_falloff": soft_falloff}
    position = HERE[0] + [0.5, 0.2, 1.1]
    spot = Lamp("spot", POWER, position, TURNED, cone=1.5, blend=0.8, **settings)
    ball = Lamp("point", POWER, position, **settings)
    direction, distance, plain = samples(ball)
    wanted = [smoothstep(cosine, 1.5, 0.8) for cosine in direction @ TURNED[:, 2]]
    ways, lengths, result = samples(spot)
    np.testing.assert_allclose(ways, direction)
    np.testing.assert_allclose(lengths, distance)
    np.testing.assert_allclose(result, plain * np.array(wanted)[:, None], rtol=1e-9, atol=1e-9)
    assert 0 in wanted and max(wanted) > 0.2


@pytest.mark.parametrize("angle", [0.0, 0.009, 0.5, 2.0, 3.1])
def test_a_surface_that_faces_a_sun_gets_its_power(angle):
    sun = Lamp("sun", POWER, axes=TURNED, angle=angle)
    assert sun.is_small == (angle == 0)
    towards = TURNED[:, 2]
    np.testing.assert_allclose(irradiance(sun, normal=towards), POWER, rtol=1e-4)
    # Leaning, but with the whole disc above the horizon: the cosine of its middle.
    if angle < 1:
        leaning = TURNED @ around(1.0, 2.0)
        np.testing.assert_allclose(irradiance(sun, normal=leaning), POWER * np.cos(1.0), rtol=1e-4)
    assert np.isinf(samples(sun)[1]).all()


def test_a_sun_of_180_degrees_is_half_a_sky():
    sun = Lamp("sun", POWER, axes=TURNED, angle=np.pi)
    for lean in (0.0, 0.7, 1.9):
        result = irradiance(sun, normal=TURNED @ around(lean, 4.0))
        np.testing.assert_allclose(result, POWER * (1 + np.cos(lean)) / 2, rtol=1e-3)


@pytest.mark.parametrize("angle", [0.5, 2.0])
def test_a_sun_is_a_disc_of_even_radiance(angle):
    direction, _, result = samples(Lamp("sun", POWER, axes=TURNED, angle=angle))
    height = direction @ TURNED[:, 2]
    assert np.arccos(height.min()) == pytest.approx(angle / 2, rel=0.01)
    for part in (0.3, 0.6, 0.9):
        share = (1 - np.cos(part * angle / 2)) / (1 - np.cos(angle / 2))
        inside = height > np.cos(part * angle / 2)
        assert result[inside].sum() / result.sum() == pytest.approx(share, abs=0.01)
        assert np.linalg.norm(direction[inside].mean(axis=0) @ TURNED[:, :2]) < 1e-3


def test_a_sun_is_the_same_as_a_lamp_and_on_texels():
    cube_map = CubeMap(64)
    light = sun_light(cube_map, TURNED[:, 2], POWER, 1.3)
    sun = Lamp("sun", POWER, axes=TURNED, angle=1.3)
    for normal in (TURNED[:, 2], unit(1, 0.2, -0.3), UP):
        cosine = np.maximum(cube_map.directions @ normal, 0) * cube_map.solid_angles
        np.testing.assert_allclose(irradiance(sun, normal=normal), cosine @ light, rtol=0.01)


def polygon_irradiance(corners, position, normal):
    """Lambert's formula for a polygon of radiance 1 that lies above the horizon."""
    ways = corners - position
    ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    total = np.zeros(3)
    for p, q in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        normal_of_edge = np.cross(p, q)
        length = np.linalg.norm(normal_of_edge)
        total += np.arctan2(length, p @ q) / 2 * normal_of_edge / length
    return abs(total @ normal)


@pytest.mark.parametrize("size", [(2.0, 0.7), (0.3, 1.9)])
def test_a_rectangle_gives_what_lamberts_formula_says(size):
    # Above the receiver, turned about its own axis and leaning.
    axes = rotation_matrix((25.0, -10.0, 40.0))
    lamp = Lamp("area", POWER, HERE[0] + [0.4, -0.5, 1.5], axes, size=size)
    assert not lamp.is_small
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    corners = lamp.position + (np.array(corners) * size) @ axes[:, :2].T
    radiance = POWER / (np.pi * size[0] * size[1])
    for normal in (UP, unit(0.3, 0.2, 0.7)):
        wanted = radiance * polygon_irradiance(corners, HERE[0], normal)
        np.testing.assert_allclose(irradiance(lamp, normal=normal), wanted, rtol=1e-3)


def test_an_ellipse_is_the_part_of_its_rectangle():
    # By midpoints of a grid over the ellipse, in float64.
    size, axes = (1.6, 0.7), rotation_matrix((25.0, -10.0, 40.0))
    lamp = Lamp("area", POWER, HERE[0] + [0.2, -0.3, 0.9], axes, size=size, ellipse=True)
    x, y = np.meshgrid(*((np.arange(300) + 0.5) / 300 - 0.5,) * 2)
    inside = x**2 + y**2 <= 0.25
    places = np.stack([x[inside] * size[0], y[inside] * size[1]], axis=1)
    ways = lamp.position + places @ axes[:, :2].T - HERE
    length = np.linalg.norm(ways, axis=1)
    cosines = (ways @ UP) * (ways @ axes[:, 2]) / length**2
    radiance = POWER / (np.pi * np.pi / 4 * size[0] * size[1])
    wanted = radiance * (cosines / length**2).sum() * size[0] * size[1] / 300**2
    np.testing.assert_allclose(irradiance(lamp), wanted, rtol=1e-3)
    ends = HERE + samples(lamp)[1][:, None] * samples(lamp)[0] - lamp.position
    local = ends @ axes / (*size, 1)
    assert np.abs(local[:, 2]).max() < 1e-9
    assert np.linalg.norm(local[:, :2], axis=1).max() == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("ellipse", [True, False])
def test_an_area_lamp_shines_from_its_front_alone(ellipse):
    lamp = Lamp("area", POWER, HERE[0], TURNED, size=(0.4, 0.9), ellipse=ellipse)
    front, behind = (lamp.position + side * TURNED[:, 2] for side in (-1, 1))
    assert irradiance(lamp, front, TURNED[:, 2]).min() > 0
    assert not irradiance(lamp, behind, -TURNED[:, 2]).any()
    assert samples(lamp, behind)[2].min() == 0


@pytest.mark.parametrize(
    "lamp, share",
    [
        (Lamp("point", POWER), 1),
        (Lamp("point", POWER, radius=0.2), 1),
        (Lamp("point", POWER, radius=0.2, soft_falloff=False), 1),
        (Lamp("area", POWER, axes=TURNED, size=(0.1, 0.2)), 1),
        (Lamp("area", POWER, axes=TURNED, size=(0.1, 0.2), ellipse=True), 1),
        # The mean of the smoothstep over the sphere: half the cone's soft part, all of the rest.
        (Lamp("spot", POWER, axes=TURNED, cone=2.0, blend=0.6), 0.7 * (1 - np.cos(1.0)) / 2),
    ],
    ids=lambda value: value.kind if isinstance(value, Lamp) else "",
)
def test_all_of_a_lamps_power_arrives_somewhere(lamp, share):
    # On the inside of a large sphere around it.
    radius, n = 30.0, 2000
    height = 1 - (np.arange(n) + 0.5) * 2 / n
    turn = np.arange(n) * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - height**2)
    ways = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    place = (np.arange(8) + 0.5) / 8
    uv = np.stack(np.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 2)
    total = np.zeros(3)
    for one in uv:
        direction, _, result = lamp.sample(radius * ways, np.tile(one, (n, 1)))
        total += (result * np.maximum(-(direction * ways).sum(axis=1), 0)[:, None]).mean(axis=0)
    wanted = share * POWER / (4 * np.pi * radius**2)
    np.testing.assert_allclose(total / len(uv), wanted, rtol=2e-3)


@pytest.mark.parametrize("n", [1, 5, 64, 100])
def test_samples_are_spread_evenly_and_shifted_for_each_point(n):
    shift = np.random.default_rng(0).random((7, 2))
    result = lamp_samples(n, shift)
    assert result.shape == (7, n, 2) and result.min() >= 0 and result.max() < 1
    # The same set for every point, moved round by its shift.
    plain = lamp_samples(n, np.zeros((1, 2)))[0]
    np.testing.assert_allclose(result, (plain + shift[:, None]) % 1, atol=1e-12)
    # Each half, quarter and eighth of both sides holds its share, to within one sample or two.
    for parts in (2, 4, 8):
        for side in plain.T:
            counts = np.bincount((side * parts).astype(int), minlength=parts)
            assert np.abs(counts - n / parts).max() <= 2
