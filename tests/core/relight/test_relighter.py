"""What relighting refuses before its work, and colours that float32 cannot hold."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress, relight_points
from prt_core.light import EnvironmentMap
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from tests.meshes import plane, wall

SKY = EnvironmentMap(np.full((2, 4, 3), 7.0, np.float32), "sky")


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    scene = Scene.from_meshes([plane(3), wall(0.9, 1.0, 1.0, albedo=0.7)], max_hidden=0)
    run(bake_steps(scene, path, BakeSettings(resolution=2, caster="brute")))
    return load(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "light: give an environment image, 'world', or ask for the lamps"),
        ({"lamps": True}, "lamps: the baked scene had no lamps"),
        ({"lamps": [3]}, "lamps: expected a list of lamps, True or False"),
        ({"light": SKY, "strength": 1e15}, "times the brightest of sky, 7, is above 1e.15"),
        ({"light": np.full((24, 3), 1e14), "strength": 11}, "times the brightest of light"),
        ({"light": -np.ones((24, 3))}, "light: expected values from 0"),
        ({"light": "world"}, "the bake has none"),
        ({"lamps": [Lamp("point", (1, 1, 1))], "rotation": 3}, "rotation: turns an environment"),
        ({"light": SKY, "lamp_samples": 0}, "lamp_samples: expected a whole number from 1 to"),
        ({"light": SKY, "bounces": "all"}, "bounces: expected a whole number"),
        ({"light": SKY, "rotation": (1, 2)}, "rotation: expected an array of shape"),
    ],
)
def test_what_cannot_be_relit_is_said(bake, options, message):
    with pytest.raises(PRTError, match=message):
        relight_points(bake, caster="brute", **options)


def test_colours_beyond_float32_are_no_colours(bake):
    place = bake.scene.to_world(bake.scene.ray_origins[:1])[0] + [0, 0, 1e-13]
    lamp = Lamp("point", (1e15, 1, 1), place, radius=0.0)
    with pytest.raises(PRTError, match="received: .* values are NaN or infinite"):
        relight_points(bake, lamps=[lamp], caster="brute")


def test_no_lamps_and_no_light_are_dark(bake):
    assert not relight_points(bake, lamps=[]).any()


def test_a_progressive_form_comes_nearer_under_a_light_that_stands_still(bake):
    sky = EnvironmentMap(np.random.default_rng(2).random((8, 16, 3)).astype(np.float32) ** 9, "sky")
    exact = relight_points(bake, sky, form="exact")
    compress(bake.path, method="haar:n_terms=2,step=0.0001", tolerance=0.9, lights={"sky": sky})
    relighter = Relighter(load(bake.path), "brute", "compressed", progressive=True)
    errors = [np.linalg.norm(relighter.radiance(sky) - exact) for _ in range(13)]
    compress(bake.path, method="none")
    assert errors[12] < 5e-3 * np.linalg.norm(exact)
    assert errors[12] < 0.1 * errors[0] and errors[1] < errors[0]


def test_the_notes_of_the_last_image_are_kept(bake):
    relighter = Relighter(bake, "brute")
    relighter.radiance(EnvironmentMap(SKY.pixels, "noted", ("read is A, not B",)))
    assert relighter.notes == ("read is A, not B",)
    relighter.radiance(SKY)
    assert relighter.notes == ()


def test_lamps_that_stay_are_known(bake):
    lamp = Lamp("point", (5, 5, 5), (0.2, 0.1, 1.5), radius=0.1)
    relighter = Relighter(bake, "brute")
    lighting = Lighting(lamps=[lamp], lamp_samples=3)
    assert not relighter.has_lamps(lighting)
    relighter.radiance(lighting)
    assert relighter.has_lamps(lighting)
    # Emission, strength and exposure ask for no other rays; more of them, or a moved lamp, do.
    assert relighter.has_lamps(replace(lighting, lamp_strength=3.0, exposure=1.0))
    assert not relighter.has_lamps(replace(lighting, lamp_samples=5))
    assert not relighter.has_lamps(replace(lighting, lamps=[replace(lamp, radius=0.2)]))
    assert Relighter(bake, "brute").has_lamps(Lighting(SKY))
    assert not Relighter(bake, "brute").has_lamps(Lighting(SKY, sharp_sun=True))
