"""Bakes with an atlas: kept and read back, relit by every door, with albedo and without."""

import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest

from prt_core import (
    BakeSettings,
    Lamp,
    Lighting,
    PRTError,
    Relighter,
    bake_steps,
    load,
    occlusion,
    run,
)
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.cli import main
from prt_core.compress.subject import Subject
from prt_core.evaluate import to_srgb
from prt_core.light import read_image, write_image
from prt_core.rays.caster import known_casters
from prt_core.relight.lights_apart import lights_apart
from prt_core.scene import Scene
from tests.meshes import glowing, plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"
LAMPS = [Lamp("point", (9, 9, 9), (0, 0, 3), name=name) for name in ("key/1", "fill")]


def meshes():
    floor = plane(7, name="floor", albedo=(0.5, 0.25, 0.1))
    ball = glowing(sphere(6, 0.4, (0, 0, 0.6), name="ball"), (0.3, 0.1, 0.0))
    floor.corner_uv = 0.05 + 0.425 * (floor.vertices[floor.corner_vertex][:, :2] / 2 + 0.5)
    places = (ball.vertices[ball.corner_vertex] - [0, 0, 0.6]) / 0.4
    upper = np.repeat(places.reshape(-1, 3, 3)[..., 2].mean(axis=1) > 0, 3)
    ball.corner_uv = np.where(upper[:, None], [0.75, 0.3], [0.75, 0.75]) + 0.2 * places[:, :2]
    return [floor, ball]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("atlas")
    parts = meshes()
    asked = ImageSettings(atlas=(48, 32), atlas_uv="own")
    scene = run(image_steps(Scene.from_meshes(parts), parts, None, CASTER, asked))
    settings = BakeSettings(resolution=4, tolerance=0.05, caster=CASTER)
    run(bake_steps(scene, folder / "a.prt", settings, LAMPS))
    for name, value in (("day", 1.0), ("night", 0.1)):
        light = np.full((4, 8, 3), value, np.float32)
        light[0] *= [1, 2, 3]
        write_image(folder / f"{name}.exr", light)
    return folder


@pytest.fixture
def inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def prt(line, capfd):
    capfd.readouterr()
    code = main(line.split())
    printed = capfd.readouterr()
    return code, printed.out, printed.err


def png(path):
    """(pixels of a PNG of ours, its chunks)."""
    data, at, chunks = path.read_bytes(), 8, {}
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunks[data[at + 4 : at + 8]] = data[at + 8 : at + 8 + length]
        at += 12 + length
    width, height, bits = struct.unpack(">IIB", chunks[b"IHDR"][:9])
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, -1)
    whole = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    return whole.view(f">u{bits // 8}").reshape(height, width, 3), chunks


def test_what_is_kept_is_read_back(folder):
    image = load(folder / "a.prt").scene.image
    parts = meshes()
    assert (image.width, image.height, image.atlas.own) == (48, 32, True)
    assert list(image.atlas.corner_uv) == ["floor", "ball"]
    for mesh in parts:
        np.testing.assert_array_equal(
            image.atlas.corner_uv[mesh.name], mesh.corner_uv.astype(np.float32)
        )
    assert len(np.unique(image.atlas.seams.edge)) == 12


def test_damaged_seams_are_said(folder, tmp_path):
    parts = meshes()
    asked = ImageSettings(atlas=(12, 12), atlas_uv="own")
    scene = run(image_steps(Scene.from_meshes(parts), parts, None, CASTER, asked))
    seams = scene.image.atlas.seams
    wrong = replace(scene.image.atlas, seams=replace(seams, texel=seams.texel + 1000))
    scene = replace(scene, image=replace(scene.image, atlas=wrong))
    run(bake_steps(scene, tmp_path / "a.prt", BakeSettings(2, 0, caster=CASTER)))
    with pytest.raises(PRTError, match="seams of its atlas are damaged"):
        load(tmp_path / "a.prt")


def test_seams_are_mended_by_every_way_to_the_image(folder):
    bake = load(folder / "a.prt")
    relighter = Relighter(bake)
    radiance = relighter.radiance(folder / "day.exr")
    image = bake.image(radiance)
    assert bake.scene.image.atlas.seams.error(image)[1] < 0.01
    np.testing.assert_allclose(relighter.radiance(folder / "day.exr", of="image"), image, atol=1e-6)
    rows = Subject.of_bake(bake, "image")
    plain = bake.scene.image.pixels(radiance).reshape(-1, 3)
    np.testing.assert_allclose(rows.shaped(plain), image, atol=1e-6)


def test_light_alone_times_albedo_is_what_is_seen(folder, inside, capfd):
    assert prt("relight a.prt --light day.exr --emission none --image seen.exr", capfd)[0] == 0
    line = "relight a.prt --light day.exr --emission none --image light.exr --light-only"
    assert prt(line, capfd)[0] == 0
    seen, light = read_image("seen.exr"), read_image("light.exr")
    bake = load(folder / "a.prt")
    owner = bake.scene.points.object_index[bake.scene.image.point].reshape(32, 48)
    albedo = np.where((owner == 0)[..., None], [0.5, 0.25, 0.1], 0.5)
    np.testing.assert_allclose(light * albedo, seen, rtol=2e-3, atol=1e-4)
    code, _, says = prt(
        "relight a.prt --light day.exr --image l.exr --light-only --view 1,2,3", capfd
    )
    assert code == 2 and "--light-only" in says


def test_each_light_has_an_image_and_their_sum_is_the_light(folder, inside, capfd):
    code, printed, _ = prt("relight a.prt --light day.exr night.exr --image map.exr", capfd)
    assert code == 0 and "map_day.exr" in printed and "map_night.exr" in printed
    assert prt("relight a.prt --light night.exr --image one.exr", capfd)[0] == 0
    np.testing.assert_array_equal(read_image("map_night.exr"), read_image("one.exr"))
    line = "relight a.prt --light day.exr --lamps --emission all --lamp-samples 4 --image {}"
    assert prt(line.format("whole.exr"), capfd)[0] == 0
    assert prt(line.format("part.exr") + " --apart", capfd)[0] == 0
    names = "day", "key_1", "fill", "emission"
    total = sum(read_image(f"part_{name}.exr") for name in names)
    # But for what mending of seams cuts at black.
    np.testing.assert_allclose(total, read_image("whole.exr"), rtol=1e-3, atol=5e-3)


def test_of_several_lights_all_are_read_before_anything_is_written(folder, inside, capfd):
    (folder / "cut.exr").write_bytes((folder / "day.exr").read_bytes()[:200])
    for wrong in ("cut.exr", "gone.exr"):
        code, _, said = prt(f"relight a.prt --light day.exr {wrong} --image early.exr", capfd)
        assert code == 2 and wrong in said
        assert not list(folder.glob("early*"))


def test_the_same_parts_by_call(folder):
    bake = load(folder / "a.prt")
    lighting = Lighting(folder / "day.exr", lamps=True, lamp_samples=4)
    parts = lights_apart(bake, lighting)
    assert [name for name, _ in parts] == ["environment", "key/1", "fill", "emission"]
    relighter = Relighter(bake)
    total = sum(relighter.radiance(part) for _, part in parts)
    np.testing.assert_allclose(total, relighter.radiance(lighting), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("bits", [8, 16])
def test_pngs_of_both_depths(folder, inside, capfd, bits):
    assert prt("relight a.prt --light day.exr --image l.exr", capfd)[0] == 0
    assert prt(f"relight a.prt --light day.exr --image l.png --bits {bits}", capfd)[0] == 0
    pixels, chunks = png(folder / "l.png")
    assert b"sRGB" in chunks
    np.testing.assert_array_equal(pixels, to_srgb(read_image("l.exr"), bits=bits))


def test_occlusion_by_call_and_line(folder, inside, capfd):
    bake = load(folder / "a.prt")
    ambient = occlusion(bake)
    assert ambient["floor"].shape == (len(bake.scene.objects[0].corner_point),)
    assert prt("occlusion a.prt --output o.npz --image o.png --bits 16", capfd)[0] == 0
    with np.load("o.npz") as file:
        np.testing.assert_array_equal(file["floor"], ambient["floor"])
    pixels, chunks = png(folder / "o.png")
    assert b"sRGB" not in chunks and pixels.max() > 0.9 * 65535
    near = occlusion(bake, distance=0.3, caster=CASTER)
    assert near["floor"].mean() > ambient["floor"].mean()
    bent = occlusion(bake, "bent-normal")["ball"]
    np.testing.assert_allclose(np.linalg.norm(bent, axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("line, says", [
    ("relight a.prt --light day.exr --image l.exr --bits 16", "--bits"),
    ("relight a.prt --light day.exr --output l.npz --bits 16", "--image"),
    ("relight a.prt --light x/day.exr day.exr --image l.exr", "day: the name of several"),
    ("relight a.prt --light day.exr no.exr --image l.exr --rotate x", ""),
    ("occlusion a.prt", "nothing to write"),
    ("occlusion a.prt --output o.npz --falloff linear", "--distance"),
    ("occlusion a.prt --output o.npz --distance -1", "distance"),
    ("occlusion a.prt --output o.npz --kind sky --vector", "--blend"),
    ("occlusion a.prt --output o.npz --caster embree", "--caster"),
    ("occlusion a.prt --blend o.blend --kind bent-normal --channel R", "--channel"),
    ("occlusion a.prt --output o.txt", ".npz"),
    ("bake a.blend --atlas-margin 3", "--atlas"),
    ("bake a.blend --atlas 0", "expected WIDTHxHEIGHT"),
    ("bake a.blend --atlas 64 --geometry-image floor 32", "not both"),
])  # fmt: skip
def test_bad_lines(inside, capfd, line, says):
    try:
        code = main(line.split())
    except SystemExit as end:
        code = end.code
    error = capfd.readouterr().err
    assert code == 2 and says in error and len(error.strip().splitlines()) == 1


def test_a_full_disk_leaves_the_image_that_was(folder, inside, capfd, monkeypatch):
    assert prt("relight a.prt --light day.exr --image full.png --bits 16", capfd)[0] == 0
    before = (folder / "full.png").read_bytes()

    def full(_path, _data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    code, _, says = prt("relight a.prt --light night.exr --image full.png --bits 16", capfd)
    assert code == 2 and "no space left" in says
    monkeypatch.undo()
    assert (folder / "full.png").read_bytes() == before
    assert not list(folder.glob("*.part*"))


@pytest.mark.parametrize("wrong, says", [
    ({"atlas": (64, 0)}, "atlas"),
    ({"atlas": 64}, "atlas"),
    ({"atlas": (64, 64), "atlas_uv": "old"}, "new, packed, own"),
    ({"atlas": (64, 64), "atlas_margin": -1}, "margin"),
    ({"atlas": (64, 64), "atlas_objects": []}, "at least one"),
    ({"atlas": (64, 64), "camera_pixels": (4, 4)}, "not both"),
])  # fmt: skip
def test_wrong_settings(wrong, says):
    with pytest.raises(PRTError, match=says):
        ImageSettings(**wrong)


@pytest.mark.parametrize("change, asked, says", [
    (None, {"atlas_objects": ["nobody"]}, "no object 'nobody'"),
    ("uv", {}, "ball: no UV map"),
    (None, {"atlas_uv": "new"}, "Blender"),
])  # fmt: skip
def test_what_no_atlas_is_made_of(change, asked, says):
    parts = meshes()
    if change == "uv":
        parts[1].corner_uv = None
    settings = ImageSettings(**{"atlas": (8, 8), "atlas_uv": "own", **asked})
    with pytest.raises(PRTError, match=says):
        run(image_steps(Scene.from_meshes(parts), parts, None, CASTER, settings))
