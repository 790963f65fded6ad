"""The demo's bake as a page in headless Chromium, against exact relighting (make test-web)."""

import sys
from pathlib import Path

import numpy as np
import pytest

import prt_core
from prt_core.blender_access import studio_lights
from prt_core.evaluate import colour_error
from prt_core.export.web.surface import surface_of
from prt_core.light import EnvironmentMap, write_image
from prt_core.relight import Relighter
from tests.chromium import Browser, chromium_or_skip
from tests.web.pages import milliseconds, radiance_on, said_on

ROOT = Path(__file__).resolve().parents[2]
TURNS = 15, 135, 255


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The demo's bake, once made for all of these tests."""
    pytest.importorskip("bpy")
    chromium_or_skip()
    sys.path.insert(0, str(ROOT / "blend_scenes"))
    import build

    folder = tmp_path_factory.mktemp("demo")
    build.build("01_model_on_ground", folder)
    prt_core.bake(folder / "01_model_on_ground.blend", folder / "demo.prt")
    return prt_core.load(folder / "demo.prt")


def test_as_a_folder_it_is_near_quick_and_small(demo, tmp_path):
    report = prt_core.export_web(demo, tmp_path / "page")
    script = (tmp_path / "page" / "page.js").stat().st_size
    print({**report, "script": script})
    assert report["bytes"] < 7e6
    relighter, points = Relighter(demo, form="exact"), surface_of(demo.scene).points
    errors = {}
    with Browser() as browser:
        browser.open(tmp_path / "page" / "index.html")
        for name, image in studio_lights().items():
            write_image(tmp_path / f"{name}.exr", image.pixels)
            browser.drop(f"{name}.exr", (tmp_path / f"{name}.exr").read_bytes())
            assert said_on(browser) == ""
            for turn in TURNS:
                browser.run(f"PRT.page.turn = {turn}; PRT.page.relight()")
                truth = relighter.radiance(EnvironmentMap(image.pixels), rotation=turn)[points]
                errors[name, turn] = colour_error(radiance_on(browser), truth)["l2"]
        spent = milliseconds(browser, 20)
        assert not browser.errors
        assert all(url.startswith(("file:", "data:")) for url in browser.requests)
    worst = max(errors, key=errors.get)
    mean = np.mean(list(errors.values()))
    print(f"mean {mean:.4f}, worst {errors[worst]:.4f} {worst}, {spent:.1f} ms a turned light")
    assert mean < 0.010 and errors[worst] < 0.020


def test_one_file_and_without_bits(demo, tmp_path):
    one = prt_core.export_web(demo, tmp_path / "page.html")
    small = prt_core.export_web(demo, tmp_path / "small.html", bits=False)
    print(one["bytes"], small["bytes"], small["error"], small["worst"])
    assert one["bytes"] < 9e6 and small["bytes"] < 5e6
    with Browser() as browser:
        browser.open(tmp_path / "small.html")
        assert "suns are soft" in browser.run("document.getElementById('about').textContent")
