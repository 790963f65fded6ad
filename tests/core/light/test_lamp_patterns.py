"""What a lamp sends out by direction, place and distance, and through a grid of slats."""

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.light import Lamp
from prt_core.light.environment import equirectangular
from prt_core.sphere import sobol_points

POWER = np.array([30.0, 20.0, 5.0])
# z turned into x, as the lamps below have it.
TURNED = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
UV = sobol_points(14)


def table(height, width):
    """A pattern by direction that is 2 + the direction itself, at the pixels' middles."""
    above = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    along = np.pi * (1 - 2 * (np.arange(width) + 0.5) / width)
    ways = [np.cos(above) * np.cos(along), np.cos(above) * np.sin(along), np.sin(above)]
    ways[2] = np.broadcast_to(ways[2], ways[0].shape)
    return 2 + np.stack(ways, axis=-1)


@pytest.mark.parametrize("kind", ["point", "spot", "area"])
def test_a_pattern_follows_the_direction_in_the_lamps_axes(kind):
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(7, 3)) + [-2, 0, 0]
    lamp = Lamp(kind, POWER, (0.1, 0.2, 0.3), TURNED, size=(1e-6, 1e-6), cone=3.0)
    plain = lamp.sample(positions, np.full((7, 2), 0.5))
    lamp.pattern = table(90, 180)
    way, away, light = lamp.sample(positions, np.full((7, 2), 0.5))
    factor = 2 + (-way) @ TURNED
    np.testing.assert_allclose(light, plain[2] * factor, rtol=2e-3, atol=1e-9)
    np.testing.assert_array_equal(away, plain[1])
    assert light.any() and np.ptp(factor) > 0.5


def test_a_pattern_is_an_equirectangular_image():
    pattern = np.ones((5, 7, 3))
    pattern[1, 2] = 9
    ways = np.random.default_rng(0).normal(size=(4000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    _, _, light = Lamp("point", np.ones(3), pattern=pattern).sample(-ways, np.zeros((4000, 2)))
    brightest = ways[light[:, 0].argmax()]
    u, v = equirectangular(-brightest[None])
    assert (int((1 - v[0]) * 5), int(u[0] * 7)) == (1, 2)


def test_a_texture_lies_on_an_area_lamp_as_it_looks_from_behind_it():
    # The first row at the greatest y, the first column at the smallest x.
    texture = np.zeros((2, 3, 3))
    texture[0, 0] = 1
    lamp = Lamp("area", POWER, size=(3, 2), texture=texture)
    positions = np.tile([[0.0, 0, -1]], (len(UV), 1))
    way, away, light = lamp.sample(positions, UV)
    place = positions + way * away[:, None]
    lit = light[:, 0] > 0.9 * light[:, 0].max()
    assert (place[lit, 0] < -0.4).all() and (place[lit, 1] > 0).all()
    dark = (place[:, 0] > 0.01) | (place[:, 1] < -0.51)
    assert not light[dark].any() and dark.any()


@pytest.mark.parametrize("power", [0, 1, 2])
def test_a_falloff_between_its_distances_and_beyond(power):
    known = 10.0 ** np.arange(-1, 1.1, 0.5)
    lamp = Lamp("point", POWER, falloff=np.stack([known, 3 * known**power], axis=1))
    places = np.array([0.01, 0.3, 2.0, 70.0])
    positions = np.stack([places, 0 * places, 0 * places], axis=1)
    plain = Lamp("point", POWER).sample(positions, np.zeros((4, 2)))[2]
    light = lamp.sample(positions, np.zeros((4, 2)))[2]
    np.testing.assert_allclose(light, plain * 3 * places[:, None] ** power, rtol=1e-9)


def test_a_falloff_that_bends_is_smooth():
    known = 10.0 ** np.arange(-2, 3.01, 0.25)
    lamp = Lamp("point", POWER, falloff=np.stack([known, known**2 / (2 + known**2)], axis=1))
    places = np.geomspace(0.05, 50, 97)
    positions = np.stack([places, 0 * places, 0 * places], axis=1)
    uv = np.zeros((97, 2))
    plain, light = (item.sample(positions, uv)[2] for item in (Lamp("point", POWER), lamp))
    wanted = plain * (places**2 / (2 + places**2))[:, None]
    np.testing.assert_allclose(light, wanted, rtol=5e-3)


@pytest.mark.parametrize("ellipse", [False, True])
@pytest.mark.parametrize("spread", [2.8, 2.2, 0.9, 0.04, 0.0])
def test_spread_keeps_the_power(spread, ellipse):
    """All that goes through a plane close in front of the lamp is its power."""
    size, distance = np.array([1.3, 0.7]), 0.5
    lamp = Lamp("area", POWER, size=tuple(size), ellipse=ellipse, spread=spread)
    reach = size / 2 + distance * min(np.tan(spread / 2), 60) + 1e-2
    x, y = (np.linspace(-r, r, 121)[:-1] + r / 120 for r in reach)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    positions = np.concatenate([places, np.full((len(places), 1), -distance)], axis=1)
    total, rng = np.zeros(3), np.random.default_rng(5)
    n_samples = 8
    for _ in range(n_samples):
        way, _, light = lamp.sample(positions, rng.random((len(positions), 2)))
        total += (light * way[:, 2:]).sum(axis=0)
    total *= 4 * reach.prod() / len(positions) / n_samples
    np.testing.assert_allclose(total, POWER, rtol=0.06 if ellipse or spread > 2.5 else 0.02)


def test_a_narrow_lamp_lights_what_is_in_front_alone():
    lamp = Lamp("area", POWER, size=(1, 1), spread=0.5)
    aside, front = np.tile([[1.2, 0, -1.0]], (4, 1)), np.tile([[0.1, 0, -1.0]], (4, 1))
    assert not lamp.sample(aside, UV[:4])[2].any()
    assert (lamp.sample(front, UV[:4])[2] > 0).any()
    assert not Lamp("area", POWER, size=(0, 1)).sample(front, UV[:4])[2].any()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"pattern": np.ones((2, 3))}, "lamp: pattern: expected an array of shape"),
        ({"texture": np.ones((0, 3, 3))}, "lamp: texture expected at least one row and column"),
        ({"falloff": [(1, 1), (1, 2)]}, "distances that rise from above 0"),
        ({"falloff": [(1, 1)]}, "two or more distances"),
        ({"spread": -1}, "lamp: spread: expected a number"),
        ({"receivers": [3]}, "lamp: receivers: expected a list of objects' names"),
        ({"casts_shadow": 1.5}, "lamp: casts_shadow: expected"),
    ],
)
def test_what_is_no_lamp_is_said(settings, message):
    with pytest.raises(PRTError, match=message):
        Lamp("area", POWER, **settings)
