"""Pictures of a bake look as renders of its scene do: through its view transform."""

import json

import bpy
import numpy as np
import pytest
from PIL import Image

import build
import prt_core
from prt_core.blender.view_transform import FILES, view_transform_of
from prt_core.evaluate import render_view, to_display, to_srgb, write_png
from tests.blender.conftest import prt

SIZE = 96, 64


@pytest.fixture
def blend(tmp_path):
    path = build.build("08_two_triangle_floor", tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    settings = bpy.context.scene.view_settings
    settings.view_transform, settings.exposure = "AgX", 0.7
    settings.look = "AgX - Punchy"
    bpy.ops.wm.save_mainfile()
    return path


@pytest.fixture
def baked(blend):
    path = blend.with_suffix(".prt")
    report = prt_core.bake(blend, path, resolution=8, tolerance=0.02)
    assert report["rays"] > 0
    return path


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def saved_by_blender(picture, path):
    """A linear picture as the open scene's own colour management writes it."""
    height, width, _ = picture.shape
    image = bpy.data.images.new("picture", width, height, float_buffer=True)
    colours = np.ones((height, width, 4), np.float32)
    colours[..., :3] = picture[::-1]
    image.pixels.foreach_set(colours.ravel())
    scene = bpy.context.scene
    scene.render.image_settings.file_format = "PNG"
    image.save_render(str(path), scene=scene)
    return pixels(path)


def test_a_picture_is_what_blender_makes_of_it(baked, hdri, tmp_path):
    asked = "relight", baked, "--light", hdri("courtyard"), "--size", "96x64"
    prt(*asked, "--png", tmp_path / "scene.png")
    prt(*asked, "--png", tmp_path / "plain.png", "--view-transform", "standard")
    bake = prt_core.load(baked)
    assert "AgX - Punchy at +0.7 stops" in prt("info", baked).stdout
    light = prt_core.Lighting(hdri("courtyard"))
    relighter, caster = prt_core.Relighter(bake), bake.make_caster(rays="camera")
    picture = render_view(bake, relighter.radiance(light), caster, *SIZE, relighter.sky(light))
    relighter.close()
    caster.close()
    wanted = saved_by_blender(picture, tmp_path / "blender.png")
    off = np.abs(pixels(tmp_path / "scene.png") - wanted)
    assert off.max() <= 3 and off.mean() < 0.3
    plain = pixels(tmp_path / "plain.png")
    assert np.abs(plain - to_srgb(picture).astype(int)).max() <= 1
    assert np.abs(plain - wanted).mean() > 5
    # The library does the same.
    write_png(tmp_path / "own.png", to_display(picture, bake.view_transform))
    assert np.abs(pixels(tmp_path / "own.png") - pixels(tmp_path / "scene.png")).max() <= 1


def test_every_door_shows_it(baked, blend, hdri, tmp_path):
    (tmp_path / "lights.json").write_text(json.dumps({"day": {"environment": str(hdri("city"))}}))
    prt("relight", baked, "--lights", tmp_path / "lights.json", "--png", tmp_path / "a.png")
    prt("relight", baked, "--light", hdri("city"), "--turn", 2, "--png", tmp_path / "t.png")
    prt("relight", baked, "--light", hdri("city"), "--png", tmp_path / "b.png")
    one = pixels(tmp_path / "b.png")
    assert np.abs(one - pixels(tmp_path / "a.png")).max() <= 1
    assert np.abs(one - pixels(tmp_path / "t_0001.png")).max() <= 1
    again = "bake", blend, "-o", tmp_path / "seen.prt", "--resolution", 4, "--camera-pixels"
    prt(*again, "24x16", "--show-png", tmp_path / "show.png", "--show-light", hdri("city"))
    asked = "relight", tmp_path / "seen.prt", "--light", hdri("city"), "--image"
    prt(*asked, tmp_path / "i.png", "--bits", 16)
    prt(*asked, tmp_path / "p.png", "--view-transform", "standard")
    assert np.abs(pixels(tmp_path / "i.png") - pixels(tmp_path / "p.png")).mean() > 5
    assert pixels(tmp_path / "show.png").std() > 1


def test_what_surfaces_wear_stays_srgb(blend, hdri, tmp_path):
    prt("bake", blend, "-o", tmp_path / "w.prt", "--resolution", 4, "--geometry-image", "ball", 16)
    asked = "relight", tmp_path / "w.prt", "--light", hdri("city"), "--image"
    prt(*asked, tmp_path / "w.png")
    prt(*asked, tmp_path / "w.exr")
    from prt_core.light.images import read_image

    linear = read_image(tmp_path / "w.exr")
    assert np.abs(pixels(tmp_path / "w.png") - to_srgb(linear).astype(int)).max() <= 1
    said = prt(*asked, tmp_path / "x.png", "--view-transform", "scene", code=2).stderr
    assert "surfaces wear" in said and not (tmp_path / "x.png").exists()


def test_another_look_costs_no_ray(baked, blend):
    before = prt_core.load(baked)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    settings = bpy.context.scene.view_settings
    settings.look, settings.view_transform, settings.exposure = "None", "Standard", -1
    bpy.ops.wm.save_mainfile()
    prt("bake", blend, "-o", baked, "--resolution", 8, "--tolerance", 0.02)
    bake = prt_core.load(baked)
    assert bake.report == before.report
    assert (bake.view_transform.name, bake.view_transform.exposure) == ("Standard", -1)
    assert [p.name for p in baked.glob("view_transform*")] == ["view_transform2"]
    colours = np.random.default_rng(0).random((1, 50, 3)).astype(np.float32)
    off = to_display(colours, bake.view_transform).astype(int) - to_srgb(colours, -1)
    assert np.abs(off).max() <= 1


def test_bakes_that_do_not_know_it_are_srgb(tmp_path, hdri):
    from prt_core.scene import Scene
    from tests.meshes import plane

    scene = Scene.from_meshes([plane(5)])
    prt_core.run(
        prt_core.bake_steps(scene, tmp_path / "a.prt", prt_core.BakeSettings(resolution=4))
    )
    assert prt_core.load(tmp_path / "a.prt").view_transform is None
    asked = "relight", tmp_path / "a.prt", "--light", hdri("city"), "--png"
    prt(*asked, tmp_path / "a.png")
    prt(*asked, tmp_path / "b.png", "--view-transform", "standard")
    assert (pixels(tmp_path / "a.png") == pixels(tmp_path / "b.png")).all()
    said = prt(*asked, tmp_path / "c.png", "--view-transform", "scene", code=2).stderr
    assert "does not say how its scene shows colours" in said


def test_files_are_for_an_srgb_display_whatever_the_scenes_is():
    scene = bpy.context.scene
    scene.view_settings.view_transform = "AgX"
    mine = view_transform_of(scene)
    scene.display_settings.display_device = "Display P3"
    scene.view_settings.view_transform = "AgX"
    assert (view_transform_of(scene).table != mine.table).any()
    assert (view_transform_of(scene, FILES).table == mine.table).all()
    assert scene.display_settings.display_device == "Display P3"
