"""`Lighting`: one value that panel, command and call fill in, and what it does to colours."""

import os
from dataclasses import fields, replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, Lighting, PRTError, Scene, bake_steps, load, run
from prt_core.api import environment_light, relight, relight_points
from prt_core.light import EnvironmentMap, split_sun
from prt_core.relight import Relighter
from prt_core.relight.lighting import lighting_of
from tests.meshes import plane, wall

RNG = np.random.default_rng(7)
SKY = EnvironmentMap((1 + RNG.random((5, 10, 3))).astype(np.float32), "sky")
LAMP = Lamp("point", (30.0, 20.0, 10.0), (0.2, 0.1, 2.0), radius=0.1)
SUN = Lamp("sun", (1.0, 2.0, 3.0))
WORLD = (1 + RNG.random((24, 3))).astype(np.float32)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    scene = Scene.from_meshes([plane(3), wall(0.9, 1.0, 1.0, albedo=0.7)], max_hidden=0)
    run(bake_steps(scene, path, BakeSettings(resolution=2, caster="brute"), [LAMP, SUN], WORLD))
    return load(path)


def lit(bake, light=None, **keywords):
    return relight_points(bake, light, caster="brute", **keywords)


def test_keywords_and_the_value_give_the_same_colours(bake):
    keywords = {"rotation": 30, "strength": 3, "lamps": True, "lamp_samples": 5, "bounces": 1}
    lighting = Lighting(SKY, **keywords)
    by_value = lit(bake, lighting)
    np.testing.assert_array_equal(by_value, lit(bake, SKY, **keywords))
    relighter = Relighter(bake, "brute")
    np.testing.assert_array_equal(by_value, relighter.radiance(SKY, **keywords))
    np.testing.assert_array_equal(by_value, run(relighter.steps(lighting, pace=0.01)))
    colours = relight(bake, lighting, caster="brute")
    for name, values in bake.colours(by_value).items():
        np.testing.assert_array_equal(colours[name], values)


def test_strength_is_of_all_light_unless_lamps_have_their_own(bake):
    # So many bounces are linear; all of them end where the rest does not matter.
    lamps = {"lamps": [LAMP], "lamp_samples": 5, "bounces": 2}
    sky, lamp = lit(bake, SKY, bounces=2), lit(bake, **lamps)
    np.testing.assert_allclose(lit(bake, SKY, strength=3, **lamps), 3 * sky + 3 * lamp, rtol=1e-5)
    result = lit(bake, SKY, strength=3, lamp_strength=2, **lamps)
    np.testing.assert_allclose(result, 3 * sky + 2 * lamp, rtol=1e-5)
    # A strength that is changed later is that of the lamps as well.
    again = lit(bake, replace(Lighting(SKY, **lamps), strength=3))
    np.testing.assert_allclose(again, 3 * sky + 3 * lamp, rtol=1e-5)


def test_a_sharp_sun_has_the_strength_of_its_image(bake):
    pixels = np.ones((40, 80, 3), np.float32)
    pixels[9, 20] = 1e4
    image = EnvironmentMap(pixels)
    assert split_sun(image)[1] is not None
    sharp = Lighting(image, sharp_sun=True, lamp_samples=5, bounces=2)
    colours = lit(bake, sharp)
    result = lit(bake, replace(sharp, strength=3, lamp_strength=1))
    np.testing.assert_allclose(result, 3 * colours, rtol=1e-5)


def test_an_array_that_was_changed_is_another_light(bake):
    relighter, light = Relighter(bake, "brute"), WORLD.copy()
    before = relighter.radiance(light)
    light *= 2
    np.testing.assert_allclose(relighter.radiance(light), 2 * before, rtol=1e-6)


def test_exposure_is_a_factor_on_what_comes_out(bake):
    lighting = Lighting(SKY, lamps=[LAMP], lamp_samples=5)
    colours = lit(bake, lighting)
    for stops in (2, -1.5):
        result = lit(bake, replace(lighting, exposure=stops))
        np.testing.assert_array_equal(result, colours * np.float32(2.0**stops))
    near = bake.scene.to_world(bake.scene.ray_origins[:1])[0] + [0, 0, 1e-4]
    with pytest.raises(PRTError, match="exposure: 64 stops take the colours beyond"):
        lit(bake, lamps=[Lamp("point", (1e15, 1, 1), near)], exposure=64)


def test_the_world_has_its_suns_and_the_lamps_have_them_else(bake):
    np.testing.assert_allclose(lit(bake, "world"), lit(bake, WORLD), rtol=1e-6)
    with_world = lit(bake, "world", lamps=True, lamp_samples=5)
    wanted = lit(bake, WORLD, lamps=[LAMP], lamp_samples=5)
    np.testing.assert_allclose(with_world, wanted, rtol=1e-6)
    assert (lit(bake, WORLD, lamps=True, lamp_samples=5) > with_world).any()
    relighter = Relighter(bake, "brute")
    before = relighter.radiance("world")
    kept, bake.world = bake.world, 2 * bake.world
    try:
        np.testing.assert_allclose(relighter.radiance("world"), 2 * before, rtol=1e-6)
    finally:
        bake.world = kept


def test_the_sun_of_a_sky_shines_with_the_world_and_with_its_strength(bake):
    sky_sun = Lamp("sun", (5.0, 4.0, 3.0), of_world=True)
    linked = Lamp("sun", (1.0, 2.0, 3.0), receivers=["nothing"])

    def seen(light=None, **keywords):
        return lit(bake, light, lamp_samples=5, bounces=0, **keywords)

    world, with_lamps, lamps = seen("world"), seen("world", lamps=True), seen(lamps=True)
    bake.lamps += [sky_sun, linked]
    try:
        alone = seen(WORLD, lamps=[sky_sun]) - seen(WORLD)
        assert alone.max() > 0.1
        np.testing.assert_allclose(seen("world"), world + alone, rtol=1e-5)
        # A sun that the texels of the world cannot hold is a lamp, and gives nothing here.
        np.testing.assert_allclose(seen("world", lamps=True), with_lamps + alone, rtol=1e-5)
        twice = seen("world", strength=2, lamps=True, lamp_strength=0)
        np.testing.assert_allclose(twice, 2 * (world + alone), rtol=1e-5)
        np.testing.assert_allclose(seen(lamps=True), lamps, rtol=1e-6)
    finally:
        del bake.lamps[-2:]


def test_the_sky_behind_a_picture_is_the_light_that_was_asked_for(bake):
    lighting = Lighting(SKY, rotation=90, strength=3, exposure=1)
    relighter = Relighter(bake, "brute")
    ways = bake.cube_map.directions[:7]
    turned = ways[:, [1, 0, 2]] * [1, -1, 1]  # where the light of each came from
    shown = 6 * SKY.interpolated(turned)
    np.testing.assert_allclose(relighter.sky(lighting)(ways), shown, rtol=1e-6)
    assert relighter.sky(Lighting(WORLD)) is None
    # Of the baked world there are texels only: smoothed, they are what they are in their middles.
    world = relighter.sky(Lighting("world", strength=2))(bake.cube_map.directions)
    assert np.corrcoef(world.ravel(), 2 * bake.world.ravel())[0, 1] > 0.8
    weighed = bake.cube_map.solid_angles @ (world / 2 - bake.world)
    assert np.abs(weighed).max() < 0.05 * (bake.cube_map.solid_angles @ bake.world).max()
    result = environment_light(bake, SKY, 90, 3)
    np.testing.assert_array_equal(result, SKY.to_cube_map(bake.cube_map, 90) * np.float32(3))


OTHER = {
    "environment": EnvironmentMap(SKY.pixels),
    "rotation": 5.0,
    "strength": 2.0,
    "sharp_sun": True,
    "lamps": [replace(LAMP, radius=0.2)],
    "lamp_strength": 2.0,
    "lamp_samples": 3,
    "bounces": 3,
    "exposure": 1.0,
    "emission": {"neon": 2.0},
}


@pytest.mark.parametrize("name", [field.name for field in fields(Lighting)])
def test_every_field_is_part_of_the_key(name):
    lighting = Lighting(SKY, lamps=[LAMP])
    assert lighting.key == Lighting(SKY, rotation=np.eye(3), lamps=(replace(LAMP, name="b"),)).key
    assert replace(lighting, **{name: OTHER[name]}).key != lighting.key


def test_samples_that_change_nothing_are_no_part_of_the_key():
    small = Lighting(SKY, lamps=[replace(LAMP, radius=0.0)])
    assert replace(small, lamp_samples=3).key == small.key
    sharp = replace(small, sharp_sun=True)
    assert replace(sharp, lamp_samples=3).key != sharp.key
    every = replace(small, lamps=True)
    assert replace(every, lamp_samples=3).key != every.key


def test_an_image_that_was_written_anew_has_another_key(tmp_path):
    lighting = Lighting(tmp_path / "sky.exr")
    missing = lighting.key
    lighting.environment.write_bytes(b"some")
    first = lighting.key
    os.utime(lighting.environment, ns=(1, 1))
    assert len({missing, first, lighting.key}) == 3


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"light": Lighting(SKY), "rotation": 3}, "rotation: belongs into the Lighting that"),
        ({"light": SKY, "gamma": 3}, "gamma: there is no such keyword; there are rotation, str"),
        ({"light": SKY, "environment": SKY}, "environment: there is no such keyword"),
        ({"light": "world", "rotation": 3}, "rotation: the world's light is fixed"),
        ({"light": WORLD, "rotation": 3}, "rotation: turns an environment image, not a light on"),
        ({"light": "world", "sharp_sun": True}, "sharp_sun: needs an environment image, not"),
        ({"lamps": True, "sharp_sun": True}, "sharp_sun: needs an environment image, not"),
        ({"light": SKY, "lamp_strength": -1}, "lamp_strength: expected a number from 0 to"),
        ({"light": SKY, "exposure": 65}, "exposure: expected a number from -64 to 64, got 65"),
        ({"light": {"a": 1}}, "light: expected an array of numbers, got"),
    ],
)
def test_what_cannot_be_asked_for_is_said(keywords, message):
    with pytest.raises(PRTError, match=message):
        lighting_of(**keywords)
