"""Lights by name as buttons of a page."""

import json

import numpy as np
import pytest

import prt_core
from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.errors import PRTError
from prt_core.evaluate import colour_error
from prt_core.export.web.light_sets import image_paths, page_sets, read_sets
from prt_core.export.web.sources import shrunk
from prt_core.export.web.surface import surface_of
from prt_core.light import EnvironmentMap, Lamp, write_image
from prt_core.relight import Relighter
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from tests.chromium import Browser, chromium_or_skip
from tests.meshes import plane, sphere
from tests.web.pages import radiance_on


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    meshes = [plane(7, name="floor", albedo=0.6), sphere(6, 0.4, (0, 0, 0.5), name="ball")]
    lamps = [
        Lamp("point", [30.0, 20, 10], position=[-0.7, -0.7, 1.5], name="desk"),
        Lamp("point", [5.0, 5, 20], position=[0.9, 0.2, 1.0], name="neon"),
    ]
    path = tmp_path_factory.mktemp("sets") / "a.prt"
    settings = BakeSettings(resolution=8, tolerance=0.1)
    run(bake_steps(Scene.from_meshes(meshes), path, settings, lamps))
    return load(path)


@pytest.fixture
def image(tmp_path):
    pixels = np.ones((16, 32, 3), np.float32) * np.linspace(2, 0.1, 16)[:, None, None]
    pixels[4:6, 10:14, 0] = 9
    write_image(tmp_path / "noon.exr", pixels.astype(np.float32))
    return EnvironmentMap.read(tmp_path / "noon.exr")


def test_a_button_shows_its_light_alone(bake, image, tmp_path):
    chromium_or_skip()
    lights = {
        "day": {"environment": "noon.exr", "rotation": 30, "strength": 2.0, "weight": 0},
        "night": {"lamps": {"desk": 0.5, "neon": 2.0}, "lamp_strength": 3.0},
    }
    (tmp_path / "sets.json").write_text(json.dumps(lights))
    prt_core.export_web(
        bake, tmp_path / "page", sets=[tmp_path / "sets.json"], lamp_samples=64
    )  # fmt: skip
    relighter, points = Relighter(bake, form="exact"), surface_of(bake.scene).points
    desk, neon = (
        relighter.radiance(None, lamps=[lamp], lamp_samples=64)[points] for lamp in bake.lamps
    )
    truth = {
        "day": relighter.radiance(shrunk(image), rotation=30, strength=2.0)[points],
        "night": 1.5 * desk + 6 * neon,
    }
    with Browser(480, 270) as browser:
        browser.open(tmp_path / "page" / "index.html")
        for name in ("day", "night", "day"):
            browser.run(
                "[...document.querySelectorAll('.sets button')].find(b => b.textContent === "
                f"'{name}').click()"
            )
            assert colour_error(radiance_on(browser), truth[name])["l2"] < 0.01, name
            pressed = "document.querySelector('.sets [aria-pressed=true]').textContent"
            assert browser.run(pressed) == name
        assert browser.run("+document.getElementById('turn').value") == 30
        assert not browser.errors


def test_an_image_that_is_named_twice_is_there_once(bake, image, tmp_path):
    noon = tmp_path / "noon.exr"
    lights = {"day": {"environment": noon}, "low": {"environment": str(noon), "strength": 0.5}}
    sets = read_sets(lights, bake)
    paths = image_paths(sets, [tmp_path / "x" / ".." / "noon.exr"])
    assert list(paths) == [noon.resolve()]
    assert [each["light"] for each in page_sets(sets, bake, [], paths)] == [0, 0]


def test_what_a_page_cannot_show_is_said(bake, image, tmp_path):
    for values, words in (
        ({"environment": "noon.exr", "rotation": [30, 0, 0]}, "other axes than z"),
        ({"lamps": True, "emission": {"*": "#ff0000"}}, "another colour"),
        ({"environment": "world"}, "no light of its world"),
    ):
        (tmp_path / "sets.json").write_text(json.dumps({"day": values}))
        in_full = {"environment": tmp_path / "noon.exr"} if "rotation" in values else {}
        for sets in ([tmp_path / "sets.json"], {"day": values | in_full}):
            with pytest.raises(PRTError, match=words):
                prt_core.export_web(bake, tmp_path / "page", sets=sets)
    (tmp_path / "sets.json").write_text(json.dumps({"day": {"lamps": True}}))
    twice = [tmp_path / "sets.json"] * 2
    with pytest.raises(PRTError, match="two are called 'day'"):
        prt_core.export_web(bake, tmp_path / "page", sets=twice)
    assert not (tmp_path / "page").exists()
