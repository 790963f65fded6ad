"""A small page in headless Chromium: the same colours as `relight`, no network, clear words."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

import prt_core
from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.evaluate import colour_error
from prt_core.export.web.sources import page_images
from prt_core.export.web.surface import surface_of
from prt_core.light import EnvironmentMap, Lamp, write_image
from prt_core.relight import Relighter
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from tests.chromium import Browser, chromium_or_skip
from tests.exr import exr_lines, exr_mip
from tests.meshes import glowing, plane, sphere
from tests.view_transforms import plain_view_transform
from tests.web.pages import radiance_on, radiance_picture, said_on

RESOLUTION = 8


def sky():
    """A sky with a small sun, 32 x 64."""
    pixels = np.ones((32, 64, 3), np.float32) * np.linspace(1, 0.1, 32)[:, None, None]
    pixels[6, 20] = 1e5
    pixels[:, 40:44, 0] += 2
    return pixels.astype(np.float32)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    chromium_or_skip()
    meshes = [
        plane(9, name="floor", albedo=0.6),
        sphere(7, 0.4, (0, 0, 0.5), name="ball"),
        glowing(sphere(4, 0.15, (0.6, 0.5, 0.2), name="glow"), (4, 2, 1)),
        plane(2, low=-0.3, high=0.3, z=1.2, name="tile"),
    ]
    lamp = Lamp("point", [30.0, 20, 10], position=[-0.7, -0.7, 1.5], name="lamp </script>")
    world = np.full((6 * RESOLUTION**2, 3), 0.2, np.float32)
    world[200:210] = 9
    path = tmp_path_factory.mktemp("web") / "small.prt"
    settings = BakeSettings(resolution=RESOLUTION, tolerance=0.05)
    run(bake_steps(Scene.from_meshes(meshes), path, settings, [lamp], world))
    return load(path)


@pytest.fixture(scope="module")
def shown(bake, tmp_path_factory):
    """The page in a browser, the bake's `Relighter`, and which points the page has."""
    page = tmp_path_factory.mktemp("page") / "small.html"
    prt_core.export_web(bake, page, lamp_samples=64)
    with Browser() as browser:
        browser.open(page)
        yield browser, Relighter(bake, form="exact"), surface_of(bake.scene).points


def error(shown, light, **keywords):
    browser, relighter, points = shown
    truth = relighter.radiance(light, **keywords)[points]
    return colour_error(radiance_on(browser), truth)["l2"]


def alone(browser, kind=None):
    """Let the scene's own lights of one kind shine, or none."""
    browser.run(
        f"PRT.page.strengths = PRT.page.facts.sources.map(s => +(s.kind === '{kind}'));"
        "PRT.page.mix()"
    )


def test_the_page_begins_with_the_light_of_the_scene(shown):
    browser = shown[0]
    browser.open(browser.requests[0].removeprefix("file://"))
    assert said_on(browser) == "" and not browser.errors
    assert error(shown, "world", lamps=True, lamp_samples=64) < 0.01
    assert all(url.startswith(("file:", "data:")) for url in browser.requests)
    assert browser.run("PRT.page.look.filmic")


def test_a_scene_of_the_standard_view_transform_begins_so(bake, tmp_path):
    plain = replace(bake, view_transform=plain_view_transform("Standard"))
    prt_core.export_web(plain, tmp_path / "plain.html", bits=False)
    with Browser() as browser:
        browser.open(tmp_path / "plain.html")
        assert said_on(browser) == ""
        assert browser.run("[PRT.page.look.filmic, document.getElementById('look').value]") == [
            False, "srgb"
        ]  # fmt: skip


def test_lights_of_the_scene_alone(shown):
    browser = shown[0]
    browser.run("PRT.page.choose('None')")
    alone(browser, "lamp")
    assert error(shown, None, lamps=True, lamp_samples=64, emission="none") < 2e-3
    alone(browser, "emitter")
    assert error(shown, None, emission="all") < 2e-3


def test_images_offered_and_turned(shown):
    browser = shown[0]
    alone(browser)
    errors = []
    for name, image in page_images().items():
        browser.run(f"PRT.page.choose('{name}')")
        for turn in (15, 255):
            browser.run(f"PRT.page.turn = {turn}; PRT.page.relight()")
            errors.append(error(shown, image, rotation=turn, emission="none"))
    assert np.mean(errors) < 0.01 and max(errors) < 0.02


def test_images_dropped(shown, tmp_path):
    browser = shown[0]
    alone(browser)
    browser.run("PRT.page.turn = 0")
    write_image(tmp_path / "sky.exr", sky())
    plain, back, coded, head = radiance_picture(sky())
    runs = b"".join(
        b"\2\2\0\x40" + b"".join(b"\x40" + row[:, part].tobytes() for part in range(4))
        for row in coded
    )
    halves = np.minimum(sky(), 65504)
    kinds = [(name, 1, 1, 1) for name in "RGB"]
    files = {
        "zip.exr": ((tmp_path / "sky.exr").read_bytes(), sky()),
        "rle.exr": (compressed(tmp_path / "rle.exr", OpenEXR.RLE_COMPRESSION), sky()),
        "zips.exr": (compressed(tmp_path / "zips.exr", OpenEXR.ZIPS_COMPRESSION), sky()),
        "piz.exr": (compressed(tmp_path / "piz.exr", OpenEXR.PIZ_COMPRESSION), sky()),
        "half.exr": (exr_lines(kinds, planes(halves), 64, 32), halves),
        "tiles.exr": (exr_mip(planes(sky()), 64, 32), sky()),
        "flat.hdr": (plain, back),
        "runs.hdr": (head + runs, back),
    }
    for name, (data, pixels) in files.items():
        browser.drop(name, data)
        assert said_on(browser) == "", name
        assert error(shown, EnvironmentMap(pixels), emission="none") < 0.02, name


def test_what_is_no_light_is_said(shown, tmp_path):
    browser = shown[0]
    good = exr_lines([("Y", 2, 1, 1)], {"Y": sky()[..., 0]}, 64, 32)
    plain, *_ = radiance_picture(sky())
    for name, data, words in (
        ("cat.png", b"\x89PNG\r\n", "expected an .hdr or .exr"),
        ("empty.hdr", b"", "expected an .hdr or .exr"),
        ("cut.hdr", plain[:3000], "end too early"),
        ("cut.exr", good[:3000], "cut off or is damaged"),
        ("pxr.exr", compressed(tmp_path / "a.exr", OpenEXR.PXR24_COMPRESSION), "PXR24"),
        ("dwa.exr", compressed(tmp_path / "b.exr", OpenEXR.DWAB_COMPRESSION), "DWAB"),
        ("square.hdr", radiance_picture(np.ones((4, 4, 3), np.float32))[0], "twice as wide"),
        ("black.hdr", radiance_picture(np.zeros((4, 8, 3), np.float32))[0], "is black"),
    ):
        browser.drop(name, data)
        assert words in said_on(browser) and name in said_on(browser), (name, said_on(browser))


def test_another_size_and_a_finger(shown, tmp_path):
    browser = shown[0]
    browser.resize(390, 844, True)
    wide = browser.run(
        "new Promise(done => setTimeout(() => done(document.body.scrollWidth), 300))"
    )
    assert wide == 390
    assert browser.run("PRT.page.gl.canvas.width") == 390
    before = browser.run("PRT.page.orbit.azimuth")
    for kind, points in (
        ("touchStart", [{"x": 100, "y": 200}]),
        ("touchMove", [{"x": 160, "y": 200}]),
        ("touchEnd", []),
    ):
        browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    assert browser.run("PRT.page.orbit.azimuth") != before


def test_the_picture_is_what_relight_draws(shown, bake):
    """Straight from the first view, under the scene's own light, as sRGB without a curve."""
    browser, relighter, _ = shown
    browser.resize(640, 360)
    browser.run('PRT.page.orbit.reset(); PRT.page.choose("The scene\'s world")')
    alone(browser)
    browser.run(
        "PRT.page.look = {filmic: false, exposure: 1}; PRT.page.resize(); "
        "document.getElementById('sky').checked = false; PRT.page.draw()"
    )
    pixels = browser.run(
        "(() => { const gl = PRT.page.gl, out = new Uint8Array(640 * 360 * 4);"
        "gl.readPixels(0, 0, 640, 360, gl.RGBA, gl.UNSIGNED_BYTE, out); return [...out]; })()"
    )
    drawn = np.array(pixels).reshape(360, 640, 4)[::-1, :, :3] / 255
    linear = np.where(drawn <= 0.04045, drawn / 12.92, ((drawn + 0.055) / 1.055) ** 2.4)
    radiance = relighter.radiance("world", emission="none")
    caster = bake.make_caster(rays="camera")
    truth = prt_core.evaluate.render_view(bake, radiance, caster, 640, 360)
    # Rims fall into other pixels; all else is alike.
    apart = np.abs(linear - np.clip(truth, 0, 1)).max(axis=-1)
    assert np.quantile(apart, 0.97) < 0.02 and apart.mean() < 0.01


def test_without_webgl_or_data_the_page_says_so(bake, tmp_path):
    prt_core.export_web(bake, tmp_path / "page", bits=False)
    assert {path.name for path in (tmp_path / "page").iterdir()} == {
        "index.html", "page.js", "exr.js", "style.css", "data.js"
    }  # fmt: skip
    with Browser(flags=("--disable-webgl2", "--disable-webgl")) as browser:
        browser.open(tmp_path / "page" / "index.html")
        assert "needs WebGL 2" in said_on(browser)
        (tmp_path / "page" / "data.js").unlink()
        browser.open(tmp_path / "page" / "index.html")
        assert "data.js must lie beside" in said_on(browser)


def compressed(path, method):
    """The sky as an OpenEXR file of float channels, compressed by a method of that library."""
    header = {"compression": method, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": sky()}) as file:
        file.write(str(path))
    return path.read_bytes()


def planes(pixels):
    return {name: pixels[..., k] for k, name in enumerate("RGB")}
