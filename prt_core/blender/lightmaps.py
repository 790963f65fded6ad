"""Lightmaps in Blender: images that are loaded, and the UV maps by which objects wear them."""

from contextlib import suppress

import bpy
import numpy as np

from prt_core.blender.colours import places_of
from prt_core.blender.covers import cover
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import kept_objects
from prt_core.blender.stand_ins import COPY, KEPT, arrange, is_copy
from prt_core.errors import expect, expect_path

UV_MAP = "PRT Lightmap"


def load_lightmap(path, name=None):
    """A lightmap as an image of the open file, in the colour space of its format.

    Parameters
    ----------
    path : str or Path
        `.exr`: linear Rec.709; `.png`: sRGB.
    name : str, optional
        Of the image; default: that of the file.

    Returns
    -------
    bpy.types.Image
        That of an earlier call where it shows the same file, read again.
    """
    path = expect_path("lightmap", path).resolve()
    same = [i for i in bpy.data.images if i.filepath and bpy.path.abspath(i.filepath) == str(path)]
    if same:
        image = same[0]
        image.reload()
    else:
        image = bpy.data.images.load(str(path))
        image.name = name or path.stem
    space = "Linear Rec.709" if path.suffix.lower() == ".exr" else "sRGB"
    # Where a colour management of the user's own has neither, Blender has chosen by its rules.
    with suppress(TypeError):
        image.colorspace_settings.name = space
    if bpy.data.filepath:
        image.filepath = bpy.path.relpath(str(path))
    return image


def wear_lightmap(scene, image, places=None, target=None, kept=True, show=False):
    """UV maps of an atlas on the objects that are in it, and a material that shows the image.

    Objects whose own mesh was baked get a UV map `PRT Lightmap`, beside those that they have. What
    modifiers, instances or libraries made gets a realised object, as `keep_all` makes them. Objects
    that are in the atlas by their own UV maps are left as they are.

    Parameters
    ----------
    scene : Scene
        Of a bake whose image has an atlas.
    image : bpy.types.Image
    places : dict of str -> (str, str), optional
        Name and library of the object that a mesh belongs to now; default: as baked.
    target : bpy.types.Scene, optional
        Default: the current one.
    kept : bool
        Whether realised objects are the user's, as those of `keep_all`; else the copies that
        `write_all` has made wear it.
    show : bool
        Whether objects with a mesh of their own show it too, over their materials (see `covers`).

    Returns
    -------
    list of str
        Names of the meshes that have a realised object.

    Raises
    ------
    PRTError
        The bake has no atlas, or an object cannot take its UV map.
    """
    atlas = getattr(scene.image, "atlas", None)
    expect(atlas is not None, "lightmap: this bake holds no atlas; bake with one")
    target = target or bpy.context.scene
    material = _material(image, None if atlas.own else UV_MAP)
    places, objects = places_of(scene, places), objects_by_place()
    if atlas.own:
        for item in scene.objects if show else ():
            present = objects.get(places[item.name]) if item.name in atlas.corner_uv else None
            if present is not None and present.type == "MESH" and present.library is None:
                cover(present, material)
        return []
    own, realised = {}, {}
    for item in scene.objects:
        if item.name in atlas.corner_uv:
            present = objects.get(places[item.name])
            (own if item.own_mesh else realised)[item.name] = present
    for name, present in own.items():
        _expect_same(name, present, atlas.corner_uv[name])
    # Objects of the atlas that receive no colours are not built.
    receiving = {item.name for item in scene.objects if item.receives}
    realised = {name: present for name, present in realised.items() if name in receiving}
    for name, present in own.items():
        _set_uv(present, atlas.corner_uv[name])
        if show:
            cover(present, material)
    if realised:
        built = {item[COPY]: item for item in target.objects if is_copy(item)}
        if kept:
            built, _ = kept_objects(scene, realised, material[KEPT], target)
        for name in built.keys() & realised.keys():
            _expect_same(name, built[name], atlas.corner_uv[name])
            _set_uv(built[name], atlas.corner_uv[name])
        arrange(target)
    return list(realised)


def _expect_same(name, present, uv):
    expect(
        present is not None and present.type == "MESH",
        f"{name}: the open scene has no such mesh object; was it renamed or deleted?",
    )
    expect(present.mode != "EDIT", f"{name}: leave Edit Mode before UV maps are written")
    expect(
        len(present.data.loops) == len(uv),
        f"{name}: has {len(present.data.loops)} corners, the bake {len(uv)}; the mesh was changed "
        "after the bake, bake again",
    )
    layers = present.data.uv_layers
    expect(
        UV_MAP in layers or len(layers) < 8,
        f"{name}: has eight UV maps, the most there can be; remove one",
    )


def _set_uv(present, uv):
    layers = present.data.uv_layers
    layer = layers.get(UV_MAP)
    if layer is None:
        layer = layers.new(name=UV_MAP, do_init=False)
        expect(layer is not None, f"{present.name}: Blender makes no UV map '{UV_MAP}' on it")
    layer.data.foreach_set("uv", np.ascontiguousarray(uv, np.float32).ravel())
    present.data.update()


def _material(image, uv_map):
    """A material that shows an image as light, by a UV map; None: the active one."""
    mark = f"{image.name} lightmap"
    for material in bpy.data.materials:
        if material.library is None and material.get(KEPT) == mark:
            break
    else:
        material = bpy.data.materials.new(mark)
        material[KEPT] = mark
    if material.node_tree is None:
        material.use_nodes = True
    material.use_fake_user = True
    tree = material.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if uv_map is not None:
        place = tree.nodes.new("ShaderNodeUVMap")
        place.uv_map = uv_map
        tree.links.new(place.outputs["UV"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material
