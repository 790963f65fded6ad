"""Sums of lights: radiances add, nothing is worked out twice; lights by name in a file."""

import json

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import relight_points
from prt_core.cli import main
from prt_core.light import EnvironmentMap, Sky, write_image
from prt_core.relight import LightBlend, Lighting, Relighter, WeightedLight
from prt_core.relight.light_file import read_lights, write_lights
from prt_core.scene import Camera
from tests.meshes import plane, wall

RNG = np.random.default_rng(4)
SKY, NIGHT = (
    EnvironmentMap(RNG.random((6, 12, 3)).astype(np.float32), name) for name in ("sky", "night")
)
DESK = Lamp("point", (8, 4, 2), (0.3, 0.2, 0.7), name="Desk")
DAY = WeightedLight("day", Lighting(SKY, rotation=20), 0.25)
DUSK = WeightedLight("dusk", Lighting(NIGHT, lamps=[DESK], strength=2, lamp_strength=1), 1.5)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("blend") / "a.prt"
    scene = Scene.from_meshes([plane(3), wall(0.9, 1.0, 1.0, albedo=0.7)], max_hidden=0)
    settings = BakeSettings(resolution=2, caster="brute")
    camera = Camera(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1.0]]), 1.5)
    run(bake_steps(scene, path, settings, lamps=[DESK], camera=camera))
    return load(path)


def test_a_blend_is_the_weighted_sum(bake):
    one, two = (relight_points(bake, light.lighting, caster="brute") for light in (DAY, DUSK))
    blend = LightBlend(bake, "brute")
    mixed = blend.radiance([DAY, DUSK])
    np.testing.assert_allclose(mixed, 0.25 * one + 1.5 * two, rtol=1e-5)
    albedo = bake.transport.albedo
    np.testing.assert_allclose(blend.received * albedo, mixed, rtol=1e-4)
    alone = WeightedLight("day", DAY.lighting)
    assert (blend.radiance([alone, WeightedLight("dusk", DUSK.lighting, 0)]) == one).all()
    assert not blend.radiance([]).any()
    blend.close()


def test_a_weight_costs_a_sum_and_a_changed_light_is_worked_out_again(bake, monkeypatch):
    asked, steps = [], Relighter.steps
    monkeypatch.setattr(Relighter, "steps", lambda *a, **k: asked.append(a[1]) or steps(*a, **k))
    blend = LightBlend(bake, "brute")
    before = blend.radiance([DAY, DUSK])
    more = blend.radiance([WeightedLight("day", DAY.lighting, 2), DUSK])
    assert len(asked) == 2 and not np.allclose(before, more)
    turned = WeightedLight("day", Lighting(SKY, rotation=50), 0.25)
    assert not np.allclose(blend.radiance([turned, DUSK]), before)
    assert asked[2:] == [turned.lighting]
    # Another light of that name, and values of an array that may be others by now.
    texels = np.ones((24, 3), np.float32)
    array = WeightedLight("day", Lighting(texels), 0.5)
    dark = blend.radiance([array])
    texels *= 2
    np.testing.assert_allclose(blend.radiance([array]), 2 * dark, rtol=1e-6)
    blend.close()


def test_two_of_one_name_are_refused(bake):
    with pytest.raises(PRTError, match="lights: two are called 'day'"):
        LightBlend(bake, "brute").radiance([DAY, DAY])


def test_the_sky_behind_is_the_sum_of_the_images_and_filtered(bake):
    ways = RNG.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    blend = LightBlend(bake, "brute")
    sky = blend.sky([DAY, DUSK])(ways)
    turned = ways @ DAY.lighting.matrix
    expected = 0.25 * SKY.interpolated(turned) + 1.5 * 2 * NIGHT.interpolated(ways)
    np.testing.assert_allclose(sky, expected, rtol=1e-5)
    assert blend.sky([]) is None
    # Stripes finer than what is asked for are seen as their mean.
    stripes = np.zeros((64, 128, 3), np.float32)
    stripes[:, ::2] = 1
    fine = Sky(((EnvironmentMap(stripes), np.eye(3), 1.0),))
    level = ways * [1, 1, 0.1]
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    assert np.ptp(fine(level)) > 0.5
    np.testing.assert_allclose(fine(level, 4 * 2 * np.pi / 128), 0.5, atol=1e-6)


@pytest.fixture
def lights(tmp_path):
    for image in (SKY, NIGHT):
        write_image(tmp_path / f"{image.name}.exr", image.pixels)
    path = tmp_path / "lights.json"
    write_lights(path, {
        "day": {"environment": tmp_path / "sky.exr", "rotation": 20, "weight": 0.25},
        "dusk": {"environment": tmp_path / "night.exr", "strength": 2, "lamp_strength": 1,
                 "lamps": {"Desk": 0.5}, "weight": 1.5},
    })  # fmt: skip
    return path


def test_a_file_of_lights_is_what_was_written(bake, lights):
    assert json.loads(lights.read_text())["day"]["environment"] == "sky.exr"
    day, dusk = read_lights(lights, bake)
    assert (day.name, day.weight, day.lighting.rotation) == ("day", 0.25, 20)
    assert np.allclose(dusk.lighting.lamps[0].power, np.array(DESK.power) / 2)


def test_a_file_of_lights_that_an_editor_marked_as_unicode(bake, lights):
    plain = [light.name for light in read_lights(lights, bake)]
    lights.write_text(lights.read_text(), encoding="utf-8-sig")
    assert [light.name for light in read_lights(lights, bake)] == plain


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "expected lights by name"),
        ("{", "is no .json file"),
        ('{"day": {"lamps": true}, "day": {}}', "'day' is there twice"),
        ('{"day": {"colour": 3}}', "light 'day': has no colour; there are environment"),
        ('{"day": {}}', "light 'day': light: give an environment image"),
        ('{"day": {"lamps": {"Moon": 1}}}', "has no lamp 'Moon'; there are Desk"),
        ('{"day": {"lamps": {"Desk": -1}}}', "expected a factor of lamp 'Desk', got -1"),
        ('{"day": {"lamps": true, "weight": -1}}', "light 'day': weight: expected"),
    ],
)
def test_a_wrong_file_of_lights_is_said(bake, tmp_path, text, message):
    path = tmp_path / "wrong.json"
    path.write_text(text)
    with pytest.raises(PRTError, match=message) as raised:
        read_lights(path, bake)
    assert "\n" not in str(raised.value)


def test_the_command_line_gives_the_same(bake, lights, tmp_path, capsys):
    asked = ["relight", str(bake.path), "--lights", str(lights)]
    mixed, each = tmp_path / "mixed.npz", tmp_path / "each.npz"
    assert main([*asked, "--output", str(mixed), "--weights", "dusk=2"]) == 0
    assert main([*asked, "--output", str(each), "--png", str(tmp_path / "p.png"), "--size",
                 "16x9", "--each"]) == 0  # fmt: skip
    day, dusk = read_lights(lights, bake)
    blend = LightBlend(bake)
    shown = {
        mixed: WeightedLight("dusk", dusk.lighting, 2),
        tmp_path / "each_dusk.npz": WeightedLight("dusk", dusk.lighting),
        tmp_path / "each_day.npz": WeightedLight("day", day.lighting),
    }
    for path, light in shown.items():
        wanted = bake.colours(blend.radiance([light]))
        written = np.load(path)
        assert all((written[name] == wanted[name]).all() for name in wanted)
    assert (tmp_path / "p_day.png").is_file() and (tmp_path / "p_dusk.png").is_file()
    blend.close()
    for flags, message in (
        (["--light", "a.exr"], "--light: is for one light"),
        (["--each", "--weights", "day=1"], "--weights: each light is shown alone"),
        (["--weights", "day=1", "day=2"], "--weights: 'day' is there twice; leave one out"),
        (["--weights", "noon=1"], "has no light 'noon'; there are day, dusk"),
    ):
        assert main([*asked, "--output", str(mixed), *flags]) == 2
        assert message in capsys.readouterr().err


def test_a_light_that_cannot_be_read_is_said_before_any_is_written(bake, tmp_path, capsys):
    path = tmp_path / "lights.json"
    path.write_text('{"day": {"lamps": true}, "night": {"environment": "gone.exr"}}')
    output = ["--output", str(tmp_path / "a.npz")]
    assert main(["relight", str(bake.path), "--lights", str(path), "--each", *output]) == 2
    assert "gone.exr: there is no such image" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.npz"))
