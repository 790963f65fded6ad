"""What Blender's side refuses, reads and leaves behind."""

import resource

import bpy
import numpy as np
import OpenEXR
import pytest

import build
import prt_core
from prt_core import CubeMap, EnvironmentMap, PRTError
from prt_core.blender.colours import save_scene
from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.images import pixels_of
from prt_core.blender.world import read_world
from prt_core.cli import main
from prt_core.light import images, read_picture
from tests.blender.conftest import cube

ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)


@pytest.fixture(scope="module")
def blend(tmp_path_factory):
    return build.build("08_two_triangle_floor", tmp_path_factory.mktemp("scenes"))


def aces(path):
    """An image of 6 x 12 pixels in ACES primaries, inside of Rec.709."""
    pixels = np.random.default_rng(1).random((6, 12, 3)).astype(np.float32) * 0.1 + 0.5
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
              "chromaticities": ACES_AP0}  # fmt: skip
    with OpenEXR.File(header, {"RGB": pixels}) as file:
        file.write(str(path))
    return pixels


def test_primaries_are_converted_as_by_blender(tmp_path):
    """OpenColorIO, in Blender from 5.0 on, has the same matrix."""
    path = tmp_path / "aces.exr"
    stored = aces(path)
    ours = read_picture(path)[0]
    image = bpy.data.images.load(str(path))
    if image.colorspace_settings.name != "ACES2065-1":
        image.colorspace_settings.name = "ACES2065-1"
    np.testing.assert_allclose(pixels_of(image)[..., :3], ours, atol=1e-3)
    assert np.abs(ours - stored).max() > 0.01
    image.colorspace_settings.name = "Linear Rec.709"
    np.testing.assert_allclose(pixels_of(image)[..., :3], stored, atol=1e-6)


def test_blenders_reader_of_exr_is_given_the_same_answers(tmp_path, monkeypatch):
    from prt_core.blender.images import _read

    path = tmp_path / "aces.exr"
    aces(path)
    ours, notes = read_picture(path)
    monkeypatch.setattr(images, "_READERS", {".exr": _read})
    result, said = read_picture(path)
    np.testing.assert_allclose(result, ours, atol=1e-6)
    assert said == notes and len(said) == 1


def test_an_image_of_layers_is_said_to_be_one(tmp_path):
    layers = {f"View.{layer}.{c}": np.ones((2, 4), np.float32) for layer in ("AO", "Combined")
              for c in "RGB"}  # fmt: skip
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, layers) as file:
        file.write(str(tmp_path / "l.exr"))
    image = bpy.data.images.load(str(tmp_path / "l.exr"))
    with pytest.raises(PRTError, match="'l.exr': has several layers, .* save the Combined"):
        pixels_of(image)


def test_a_world_of_other_primaries_is_that_of_its_image(tmp_path):
    aces(tmp_path / "aces.exr")
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(tmp_path / "aces.exr"))
    texture.image.colorspace_settings.name = "ACES2065-1"
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    result = read_world(CubeMap(3))
    wanted = EnvironmentMap.read(tmp_path / "aces.exr").to_cube_map(CubeMap(3))
    np.testing.assert_allclose(result, wanted, rtol=3e-3)


def test_a_scene_on_a_full_disk_leaves_what_was_there(tmp_path):
    path = tmp_path / "o.blend"
    path.write_bytes(b"before")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(PRTError, match="o.blend: ") as caught:
            save_scene(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "\n" not in str(caught.value) and path.read_bytes() == b"before"
    assert [result.name for result in tmp_path.iterdir()] == ["o.blend"]
    save_scene(path)
    assert path.stat().st_size > 4096
    for wrong, what in (("o.png", "ends in .blend"), ("o.blend/o.blend", "in the way")):
        with pytest.raises(PRTError, match=what):
            save_scene(tmp_path / wrong)
    assert [result.name for result in tmp_path.iterdir()] == ["o.blend"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"nonsense": 3}, "nonsense: no such setting; there are resolution, bounces"),
        ({"resolution": 0}, "resolution: expected"),
        ({"objects": "floor"}, "objects: expected a list of objects' names"),
        ({"two_sided": [3]}, "two_sided: expected a list"),
        ({"restart": "all"}, "restart: expected True or False"),
        ({"camera_pixels": (9, 0)}, "camera pixels: expected a whole number from 1"),
        ({"camera_pixels": (9, 9), "pixel_samples": 0}, "pixel samples: expected"),
        ({"geometry_image": ("floor", -1)}, "geometry image: size: expected"),
        ({"parametrisation": "cube"}, "parametrisation: expected one of auto"),
        ({"output": "o.npz"}, "expected a name that ends in .prt"),
        ({"blend": "none.blend"}, "there is no such .blend file"),
    ],
)
def test_a_bake_is_refused_before_the_scene_is_opened(blend, tmp_path, monkeypatch, wrong, message):
    monkeypatch.chdir(tmp_path)

    def opened(**_):
        raise AssertionError("the scene was opened")

    monkeypatch.setattr(bpy.ops.wm, "open_mainfile", opened, raising=False)
    monkeypatch.setattr("prt_core.blender.depsgraph.read_meshes_steps", opened)
    good = {"blend": blend, "output": "a.prt", "resolution": 2}
    with pytest.raises(PRTError, match=message):
        prt_core.bake(**{**good, **wrong})
    assert not list(tmp_path.iterdir())


def test_a_bake_that_cannot_begin_leaves_nothing(blend, tmp_path, capfd):
    for words, what in (
        (["--objects", "nobody"], "nobody"),
        (["--geometry-image", "nobody", "9"], "nobody"),
    ):
        assert main(["bake", str(blend), "-o", str(tmp_path / "a.prt"), *words]) == 2
        errors = [line for line in capfd.readouterr().err.splitlines() if "prt: " in line]
        assert len(errors) == 1 and what in errors[0]
        assert not list(tmp_path.iterdir())


def test_what_is_read_is_never_written_over(blend, tmp_path, capfd):
    scene, sky = tmp_path / "scene.blend", tmp_path / "sky.exr"
    scene.write_bytes(blend.read_bytes())
    images.write_image(sky, np.ones((4, 8, 3), np.float32))
    before = scene.read_bytes(), sky.read_bytes()
    baked = str(tmp_path / "scene.prt")
    assert main(["bake", str(scene), "-o", baked, "--resolution", "4", "--quiet"]) == 0
    capfd.readouterr()
    for command in ("relight", "occlusion"):
        light = ["--light", str(sky)] if command == "relight" else []
        assert main([command, baked, *light, "--blend", str(scene)]) == 2
        assert "is the scene that was baked, and would be replaced by" in capfd.readouterr().err
    assert main(["relight", baked, "--light", str(sky), "--image", str(sky)]) == 2
    assert "sky.exr: is read, and would be written over" in capfd.readouterr().err
    assert before == (scene.read_bytes(), sky.read_bytes())
    assert main(["relight", baked, "--light", str(sky), "--blend", str(tmp_path / "o.blend")]) == 0


def test_a_uv_map_that_is_nan_somewhere_is_no_reason_not_to_bake():
    item = cube("broken", bpy.context.scene.collection)
    layer = item.data.uv_layers.new()
    layer.data[5].uv = (np.nan, 0.5)
    messages = []
    (mesh,) = read_meshes(messages=messages)
    assert [m for m in messages if "UV" in m] == [
        "broken: 1 corners of its UV map are NaN or infinite; their faces have no place in it, "
        "unwrap them"
    ]
    assert (mesh.corner_uv[4:8] == 0).all() and mesh.corner_uv[:4].any(axis=1).sum() == 3
