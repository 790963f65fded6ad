"""A light field on a page in headless Chromium: what `lightfield show` draws from the same side."""

import numpy as np
import pytest

import prt_core
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_view import field_toward
from prt_core.cli import main
from prt_core.errors import PRTError
from prt_core.evaluate import colour_error
from prt_core.export.web.surface import surface_of
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.rays import BruteForceCaster
from prt_core.runtime.progress import run
from prt_core.scene import Scene, geometry_layout, with_geometry_image
from prt_core.transport import View
from tests.chromium import Browser, chromium_or_skip
from tests.meshes import plane, sphere
from tests.web.pages import eye_on, radiance_on, said_on


class Shiny:
    """A camera of two lights with a highlight each, of odd numbers of directions."""

    name, lights, most_points = "shiny", ("key", "fill"), 1 << 20

    def shoot(self, points, angles, samples, seed):
        local = HRDFLayout(*angles).directions.reshape(*angles, 3)
        ways = np.einsum("ijk,nkx->nijx", local, points.frames)
        parts = []
        for way, colour in (((0.6, -0.7, 0.4), (1, 0.8, 0.5)), ((-0.8, 0.1, 0.6), (0.2, 0.5, 1))):
            mirrored = np.maximum(ways @ (np.array(way) / np.linalg.norm(way)), 0)
            parts.append((0.1 + 3 * mirrored**12)[..., None] * np.array(colour))
        return np.stack(parts).astype(np.float32), np.zeros(len(points), np.float32), 0.0


def captured(path, scene):
    run(capture_light_field(scene, Shiny(), path, LightFieldSettings((15, 12), samples=1)))
    return load_light_field(path)


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    meshes = [sphere(9, 0.5, (0.1, 0, 0.5), name="ball"), plane(3, receives=False, name="table")]
    return captured(tmp_path_factory.mktemp("field") / "a.slf", Scene.from_meshes(meshes, 0))


def truth_of(field, browser, strengths=None):
    """What faces the page's eye, and its radiance."""
    points = surface_of(field.scene).points
    view = View(position=field.scene.to_world(eye_on(browser)[None])[0])
    ways = view.outgoing(field.scene.to_world(field.scene.points.positions))
    facing = np.einsum("nx,nx->n", ways, field.scene.points.normals) > 0
    facing &= np.isin(np.arange(len(facing)), field.point)
    return facing[points], field_toward(field, view, strengths)[0][points]


def error(field, browser, strengths=None):
    facing, truth = truth_of(field, browser, strengths)
    return colour_error(radiance_on(browser)[facing], truth[facing])["l2"]


def test_a_light_field_from_any_side_with_lamps_of_any_colour(field, tmp_path):
    chromium_or_skip()
    report = prt_core.export_web(field.store.path, tmp_path / "page")
    assert 0 < report["error"] < 0.01 and report["notes"] == [
        "table: no points of the light field, shown grey"
    ]
    assert "gloss.js" not in report["files"] and "exr.js" not in report["files"]
    with Browser(480, 270) as browser:
        browser.open(tmp_path / "page" / "index.html")
        assert said_on(browser) == "" and not browser.errors
        for azimuth in (0.3, 2.5, -1.8):
            browser.run(f"PRT.page.orbit.azimuth = {azimuth}; PRT.page.draw()")
            assert error(field, browser) < 0.02, azimuth
        # The slider and the colour of the second lamp, as someone moves them.
        browser.run(
            "(() => { const inputs = [...document.querySelectorAll('fieldset:not([hidden]) input')]"
            "; for (const [k, value] of [[0, 0], [2, 2], [3, '#ff0000']])"
            " { inputs[k].value = value; inputs[k].dispatchEvent(new Event('input')); } })()"
        )
        browser.run("PRT.page.draw()")
        assert error(field, browser, {"key": 0.0, "fill": (2.0, 0, 0)}) < 0.02
        browser.drop("sky.hdr", b"#?")
        assert "lights of its own" in said_on(browser)
        assert not browser.errors
        assert all(url.startswith(("file:", "data:")) for url in browser.requests)


def test_beside_a_bake_on_one_page(field, tmp_path):
    chromium_or_skip()
    bake = tmp_path / "a.prt"
    scene = Scene.from_meshes([sphere(5, 0.5, (0.1, 0, 0.5), name="ball")], 0)
    run(prt_core.bake_steps(scene, bake, prt_core.BakeSettings(resolution=8, tolerance=0.1)))
    page = tmp_path / "both.html"
    line = ["export", "web", str(bake), "-o", str(page), "--light-field", str(field.store.path)]
    assert main([*line, "--quiet"]) == 0
    with Browser(480, 270) as browser:
        browser.open(page)
        own = radiance_on(browser)
        browser.run("PRT.page.choose('Light field')")
        assert error(field, browser) < 0.02
        browser.run("PRT.page.choose([...PRT.page.images.keys()][0])")
        assert np.allclose(radiance_on(browser), own, rtol=1e-5)
        assert not browser.errors


def test_what_is_wrong_is_said(field, tmp_path):
    path = field.store.path
    with pytest.raises(PRTError, match="is one already"):
        prt_core.export_web(path, tmp_path / "page", light_field=path)
    with pytest.raises(PRTError, match="missing.slf"):
        prt_core.export_web(tmp_path / "missing.slf", tmp_path / "page")
    mesh = plane(3, name="sheet")
    mesh.corner_uv = mesh.vertices[mesh.corner_vertex, :2] / 2 + 0.5
    layout = geometry_layout(mesh, "uv")
    tracer = BruteForceCaster(layout.vertices, layout.triangles)
    flat = with_geometry_image(Scene.from_meshes([mesh], 0), tracer, layout, 4)
    texels = captured(tmp_path / "grid.slf", flat)
    with pytest.raises(PRTError, match="grid.slf: its points are texels"):
        prt_core.export_web(texels, tmp_path / "page")
    assert not (tmp_path / "page").exists()
