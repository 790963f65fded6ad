"""Lightmaps in Blender: UV maps made for them, images that are loaded, the panel's button."""

import bpy
import numpy as np
import pytest

import prt_core
from prt_core.bake.images import ImageSettings
from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.lightmaps import UV_MAP
from prt_core.blender.unwrap import lightmap_uvs
from prt_core.light import read_image
from prt_core.scene.images.seams import bilinear
from tests.blender.conftest import cube


@pytest.fixture
def scene(floor_scene):
    """A floor, a ball, a bevelled cube, and one with negative scale that shares its mesh."""
    bevelled = cube("bevelled", floor_scene.collection, 0.2, (0.8, 0.5, 0.5))
    bevelled.modifiers.new("Bevel", "BEVEL").width = 0.03
    twin = bpy.data.objects.new("twin", bevelled.data)
    twin.scale, twin.location = (-1, 1, 1), (-0.8, 0.5, 0.5)
    floor_scene.collection.objects.link(twin)
    flat = bpy.data.meshes.new("sliver")
    flat.from_pydata([(0, 0, 1), (1, 0, 1), (2, 0, 1), (0, 1, 1)], [], [(0, 1, 2), (0, 1, 3)])
    floor_scene.collection.objects.link(bpy.data.objects.new("sliver", flat))
    floor_scene.world = floor_scene.world or bpy.data.worlds.new("World")
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    return floor_scene


def texel_areas(mesh, uv, size):
    """(n,) area in the image and on the surface of each triangle."""
    corners = mesh.solid_triangles()
    a, b, c = np.moveaxis(np.pad(uv[corners] * size, ((0, 0), (0, 0), (0, 1))), 1, 0)
    flat = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    a, b, c = np.moveaxis(mesh.vertices[mesh.corner_vertex[corners]], 1, 0)
    return flat, np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize("how, size", [("new", (64, 64)), ("packed", (96, 48)), ("new", (40, 100))])
@pytest.mark.parametrize("scale", [1e-3, 1e5])
def test_charts_are_as_large_as_their_surface_and_lie_apart(scene, how, size, scale):
    meshes = read_meshes()
    for mesh in meshes:
        mesh.vertices = mesh.vertices * scale
    state = [len(kind) for kind in (bpy.data.objects, bpy.data.meshes, bpy.data.scenes)]
    maps = lightmap_uvs(meshes, ImageSettings(atlas=size, atlas_uv=how, atlas_margin=2))
    assert state == [len(kind) for kind in (bpy.data.objects, bpy.data.meshes, bpy.data.scenes)]
    density = []
    for mesh in meshes:
        uv = maps[mesh.name]
        assert uv.shape == (len(mesh.corner_vertex), 2) and uv.min() > 0 and uv.max() < 1
        flat, surface = texel_areas(mesh, uv, size)
        density.append(flat.sum() / surface.sum())
    np.testing.assert_allclose(density, density[0], rtol=0.2)
    again = lightmap_uvs(meshes, ImageSettings(atlas=size, atlas_uv=how, atlas_margin=2))
    assert all((again[name] == uv).all() for name, uv in maps.items())


def test_the_button_is_the_call(scene, tmp_path):
    names = {image.name for image in bpy.data.images}
    assert bpy.ops.prt.lightmap(
        filepath=str(tmp_path / "map"), size=(64, 64), light_only=False, format="EXR"
    ) == {"FINISHED"}
    (image,) = (i for i in bpy.data.images if i.name not in names)
    assert image.colorspace_settings.name == "Linear Rec.709" and tuple(image.size) == (64, 64)
    path = next((tmp_path / "prt").glob("*lightmap.prt"))
    baked = prt_core.load(path)
    world = prt_core.Relighter(baked).radiance("world")
    np.testing.assert_allclose(read_image(tmp_path / "map.exr"), baked.image(world), rtol=2e-2,
                               atol=2e-3)  # fmt: skip
    atlas = baked.scene.image.atlas
    for name in ("floor", "ball"):
        layer = scene.objects[name].data.uv_layers[UV_MAP]
        uv = np.empty(2 * len(layer.data), np.float32)
        layer.data.foreach_get("uv", uv)
        np.testing.assert_array_equal(uv.reshape(-1, 2), atlas.corner_uv[name])
    kept = {item["prt_kept"]: item for item in scene.objects if item.get("prt_kept")}
    assert {"bevelled", "twin"} <= set(kept)
    assert all(UV_MAP in item.data.uv_layers for item in kept.values())
    # What is looked up is what the corners have.
    colours = baked.colours(world)
    pixels = baked.image(world).reshape(-1, 3)
    for name in ("floor", "bevelled"):
        uv = atlas.corner_uv[name] * [64, -64] + [0, 64]
        texel, weight = bilinear(uv, 64, 64)
        got = np.einsum("mk,mkc->mc", weight, pixels[texel])
        off = np.linalg.norm(got - colours[name]) / np.linalg.norm(colours[name])
        assert off < 0.13, (name, off)


def test_another_light_bakes_nothing_again_and_the_image_follows(scene, tmp_path):
    ask = {"filepath": str(tmp_path / "map"), "size": (32, 32), "margin": 1, "format": "PNG"}
    assert bpy.ops.prt.lightmap(**ask) == {"FINISHED"}
    path = next((tmp_path / "prt").glob("*lightmap.prt"))
    seconds = prt_core.BakeStore(path).attributes["seconds"]
    image = bpy.data.images["map"]
    assert image.colorspace_settings.name == "sRGB"
    before = np.array(image.pixels[:])
    scene.prt.exposure = -1.0
    assert bpy.ops.prt.lightmap(**ask) == {"FINISHED"}
    assert prt_core.BakeStore(path).attributes["seconds"] == seconds
    assert [i.name for i in bpy.data.images if i.name.startswith("map")] == ["map"]
    assert np.array(image.pixels[:]).sum() < before.sum()


def test_own_maps_are_left_as_they_are_and_selected_objects_only(scene, tmp_path):
    floor = scene.objects["floor"]
    for item in scene.objects:
        item.select_set(item == floor)
    while floor.data.uv_layers:
        floor.data.uv_layers.remove(floor.data.uv_layers[0])
    ask = {"filepath": str(tmp_path / "own"), "size": (16, 16), "uv": "own", "selected": True}
    with pytest.raises(RuntimeError, match="floor: no UV map"):
        bpy.ops.prt.lightmap(**ask)
    layer = floor.data.uv_layers.new(name="mine")
    assert bpy.ops.prt.lightmap(**ask) == {"FINISHED"}
    assert [each.name for each in floor.data.uv_layers] == ["mine"] and len(layer.data)
    baked = prt_core.load(next((tmp_path / "prt").glob("*lightmap.prt")))
    assert list(baked.scene.image.atlas.corner_uv) == ["floor"]


def test_what_is_wrong_is_said_before_the_work(scene, tmp_path):
    for item in scene.objects:
        item.select_set(False)
    with pytest.raises(RuntimeError, match="nothing is selected"):
        bpy.ops.prt.lightmap(filepath=str(tmp_path / "map"), selected=True)
    (tmp_path / "taken.exr").mkdir()
    with pytest.raises(RuntimeError, match="taken.exr"):
        bpy.ops.prt.lightmap(filepath=str(tmp_path / "taken"))
    assert not list(tmp_path.glob("prt/*.prt"))


def test_an_image_keeps_its_name_and_each_light_its_own(floor_scene, tmp_path):
    ask = {"size": (16, 16), "margin": 1, "format": "PNG"}
    for name in ("room.v1", "room.v2.exr"):
        assert bpy.ops.prt.lightmap(filepath=str(tmp_path / "maps" / name), **ask) == {"FINISHED"}
    assert {p.name for p in (tmp_path / "maps").iterdir()} == {"room.v1.png", "room.v2.png"}
    for name in ("Environment", "key"):
        lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        floor_scene.collection.objects.link(lamp)
    floor_scene.prt.use_lamps = True
    with pytest.raises(RuntimeError, match="of two lights, 'environment' and 'Environment'"):
        bpy.ops.prt.lightmap(filepath=str(tmp_path / "each" / "map"), apart=True, **ask)
    assert not (tmp_path / "each").exists()
