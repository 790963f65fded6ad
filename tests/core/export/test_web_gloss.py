"""Gloss on a page in headless Chromium: what `relight` gives for the same view."""

import base64
import json
import zlib
from dataclasses import replace

import numpy as np
import pytest

import prt_core
from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.evaluate import colour_error
from prt_core.export.web.gloss import Tree, mirrored_points, pack_gloss
from prt_core.export.web.pack import Pack
from prt_core.export.web.sources import page_images
from prt_core.export.web.surface import surface_of
from prt_core.light import Lamp
from prt_core.relight import Relighter
from prt_core.relight.glossy_points import GlossyPoints
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from prt_core.sphere import Blocks, CubeMap
from prt_core.transport import View
from tests.chromium import Browser, chromium_or_skip
from tests.meshes import caster_of, plane, sphere
from tests.web.pages import eye_on, radiance_on, said_on

GOLD = {"metal": (0.9, 0.6, 0.25), "stand_in": (0.9, 0.6, 0.25), "roughness": 0.3}
FLOOR = {"dielectric": 1.0, "roughness": 0.5}
LACQUER = {"coat": 1.0, "coat_roughness": 0.2, "coat_ior": 1.5, "dielectric": 1.0,
           "roughness": 0.6}  # fmt: skip
MIRROR = {"metal": (1.0, 1.0, 1.0), "stand_in": (1.0, 1.0, 1.0), "roughness": 0.02}


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


def baked(path, meshes, lamps=(), resolution=16):
    scene = Scene.from_meshes(meshes)
    caster = "embree" if type(caster_of(scene)).__name__ == "EmbreeCaster" else "brute"
    settings = BakeSettings(resolution=resolution, tolerance=0.05, caster=caster, gloss=True)
    run(bake_steps(scene, path, settings, list(lamps)))
    return load(path)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    meshes = [
        of(plane(11, name="floor", albedo=0.5), **FLOOR),
        of(sphere(9, 0.4, (-0.4, 0, 0.42), name="gold", albedo=(0.9, 0.6, 0.25)), **GOLD),
        of(sphere(8, 0.35, (0.5, -0.1, 0.37), name="lacquer", albedo=(0.5, 0.1, 0.1)), **LACQUER),
    ]
    lamp = Lamp("point", [30.0, 20, 10], position=[-0.7, -0.9, 1.5], radius=0.02, name="lamp")
    return baked(tmp_path_factory.mktemp("gloss") / "a.prt", meshes, [lamp])


@pytest.fixture(scope="module")
def shown(bake, tmp_path_factory):
    """The page in a browser, and the bake's `Relighter`."""
    chromium_or_skip()
    page = tmp_path_factory.mktemp("page") / "page"
    report = prt_core.export_web(bake, page, lamp_samples=64)
    assert "gloss.js" in report["files"]
    assert report["notes"] == ["metal that is seen in metal reflects no lamps on the page"]
    with Browser(480, 270) as browser:
        browser.open(page / "index.html")
        assert said_on(browser) == "" and not browser.errors
        yield browser, Relighter(bake, form="exact")


def error(bake, shown, light, **keywords):
    """Relative L2 of what faces the page's eye, not at its rims; that of colours without gloss."""
    browser, relighter = shown
    points = surface_of(bake.scene, mirrored_points(bake)).points
    world = bake.scene.to_world(bake.scene.points.positions)
    view = View(position=bake.scene.to_world(eye_on(browser)[None])[0])
    facing = np.einsum("nx,nx->n", view.outgoing(world), bake.scene.points.normals)[points] > 0.2
    truth = relighter.radiance(light, view=view, **keywords)[points][facing]
    plain = relighter.radiance(light, **keywords)[points][facing]
    return (
        colour_error(radiance_on(browser)[facing], truth)["l2"],
        colour_error(plain, truth)["l2"],
    )


def test_gloss_under_images_from_two_sides(bake, shown):
    browser, errors = shown[0], []
    browser.run("PRT.page.strengths = [0]")
    for name, image in page_images().items():
        browser.run(f"PRT.page.choose('{name}')")
        for turn, azimuth in ((0, 0.4), (115, -1.5)):
            browser.run(f"PRT.page.orbit.azimuth = {azimuth}; PRT.page.turn = {turn};"
                        "PRT.page.relight()")  # fmt: skip
            near, plain = error(bake, shown, image, rotation=turn)
            assert near < 0.5 * plain, (name, turn, near)
            errors.append(near)
    # A sun that the coat mirrors is all that is further off.
    *rest, worst = sorted(errors)
    assert max(rest) < 0.015 and worst < 0.025, errors
    assert not browser.errors


def test_highlights_of_a_lamp(bake, shown, monkeypatch):
    """Without what the page says that it leaves out: lamps in metal that is seen in metal."""
    monkeypatch.setattr(GlossyPoints, "glimpsed_highlights", lambda *_: np.float32(0))
    browser = shown[0]
    browser.run("PRT.page.strengths = [1]; PRT.page.choose('None')")
    near, plain = error(bake, shown, None, lamps=True, lamp_samples=64)
    assert near < 0.02 < plain, near


def test_an_orbit_shows_other_highlights_under_the_same_light(bake, shown):
    browser = shown[0]
    before = radiance_on(browser)
    browser.run("PRT.page.orbit.turn(1, 0); PRT.page.draw()")
    assert colour_error(radiance_on(browser), before)["l2"] > 0.02


def test_metal_has_the_number_that_a_relighter_has(bake):
    points = surface_of(bake.scene, mirrored_points(bake)).points
    assert np.isin(mirrored_points(bake), points).all()
    pack = Pack({})
    pack_gloss(pack, bake, points)
    packed = json.loads(pack.script("X").removeprefix("window.X=").rstrip(";\n"))["arrays"]["dice"]
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), np.uint8)
    dice = np.cumsum(np.ascontiguousarray(planes.reshape(4, -1).T).view(np.uint32))
    # All that glossy points see is on the page, so nothing is left out.
    gold = bake.scene.points.object_index == 1
    seen = [
        np.unique(np.column_stack([part.met, part.block])[gold[part.met] & (part.met >= 0)], axis=0)
        for part in bake.reflections
    ]
    assert len(dice) == sum(map(len, seen)) > 0
    np.testing.assert_array_equal(dice, np.arange(len(dice)))


def test_quarters_follow_their_blocks():
    tree = Tree.of(CubeMap(24))
    assert (tree.top, tree.levels, tree.cells) == (2, 3, 1)
    order = tree.order()
    assert sorted(order) == list(range(384))
    larger = Blocks(CubeMap(8), 4).of_texel[order].reshape(-1, 4)
    assert (larger == larger[:, :1]).all()


def test_what_a_page_does_not_show_is_said(tmp_path):
    meshes = [of(plane(4, name="pool"), **MIRROR), plane(2, z=2, name="roof")]
    bake = baked(tmp_path / "a.prt", meshes, resolution=8)
    notes = prt_core.export_web(bake, tmp_path / "page")["notes"]
    assert len(notes) == 1 and notes[0].startswith("pool: sharp mirrors are shown as rough as 0.2")
    notes = prt_core.export_web(bake, tmp_path / "small", bits=False)["notes"]
    assert "an even colour" in json.dumps(notes)
    assert not (tmp_path / "small" / "gloss.js").exists()


@pytest.mark.parametrize(("roughness", "said"), [(0.2, True), (0.6, False)])
def test_a_lamp_that_looks_wider_than_lobes_is_said(tmp_path, roughness, said):
    lamp = Lamp("point", [30.0, 20, 10], position=[0, 0, 1.2], radius=0.15, name="bulb")
    bake = baked(tmp_path / "a.prt", [of(plane(4), **GOLD | {"roughness": roughness})], [lamp], 8)
    notes = prt_core.export_web(bake, tmp_path / "page", lamp_samples=4)["notes"]
    assert any("'bulb': look large" in note for note in notes) == said, notes
