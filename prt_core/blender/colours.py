"""Relit colours onto Blender meshes, as colour attributes of their own or of realised objects."""

from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.covers import cover
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import (
    build_objects,
    copies_there,
    kept_material,
    kept_objects,
    stand_in_for,
)
from prt_core.blender.stand_ins import arrange
from prt_core.errors import PRTError, expect, expect_array, expect_path
from prt_core.runtime.files import written

# Custom property of meshes whose active colours changed: what they were.
ACTIVE_BEFORE = "prt_active_before"
# Of those that show a preview: the colour attribute that it is of.
PREVIEW_COLOURS = "prt_preview_colours"
# And of meshes with kept colours: which are those for renders, where exporters look for them.
KEPT_COLOURS = "prt_kept_colours"
CHANNELS = "RGB"
_ALL_CHANNELS = "RGBA"
# What Blender takes of an attribute's name.
_NAME_BYTES = 67
# A whole compressed .blend ends so: the magic number of Zstandard's seek table.
_LAST_BYTES = b"\xb1\xea\x92\x8f"


def solid_name(attribute):
    """Name of the colour attribute that Solid mode shows, of the preview of an attribute."""
    return f"{attribute} Solid"


def light_name(attribute):
    """Name of the colour attribute of the light on the user's own materials."""
    return f"{attribute} Light"


def names_of_preview(attribute):
    """Names of all colour attributes that the preview of an attribute may write."""
    return attribute, solid_name(attribute), light_name(attribute)


def write_colours(
    target,
    colours,
    name="PRT",
    domain="CORNER",
    *,
    byte=False,
    channels=CHANNELS,
    active=True,
    vector=False,
):
    """Store linear colours in a colour attribute.

    Parameters
    ----------
    target : bpy.types.Object
        Of type mesh, in Object Mode.
    colours : (n_corners, 3) or (n_corners, 4) float32
        In loop order; with alpha where that is written.
    name : str
    domain : {"CORNER", "POINT"}
        POINT stores the mean of each vertex's corners.
    byte : bool
        8 bits a channel (0 to 1, sRGB) instead of float.
    channels : str
        Those of R, G, B and A to write. The others of an attribute that is there stay, and so
        does what it is: of which domain and type. Without A alpha is 1.
    active : bool
        Make it the active and render colour; `restore` gives that back.
    vector : bool
        Store vectors, not colours.

    Raises
    ------
    PRTError
        The mesh has another number of corners, is in Edit Mode, or cannot hold an attribute of
        that name.
    """
    mesh = target.data
    expect(domain in {"CORNER", "POINT"}, f"domain: expected 'CORNER' or 'POINT', got '{domain}'")
    expect_free(target, name, vector)
    expect(
        channels and set(channels) <= set(_ALL_CHANNELS),
        f"channels: expected some of R, G, B and A, got '{channels}'",
    )
    expect(target.mode != "EDIT", f"{target.name}: leave Edit Mode before colours are written")
    expect(
        len(mesh.loops) == len(colours),
        f"{target.name}: has {len(mesh.loops)} corners, the bake {len(colours)}; the mesh was "
        "changed after the bake, bake again",
    )
    width = 4 if "A" in channels else 3
    colours = expect_array(f"{target.name}: colours", colours, (None, width), np.float32)
    partly, kind = not set(CHANNELS) <= set(channels), "BYTE_COLOR" if byte else "FLOAT_COLOR"
    existing = mesh.color_attributes.get(name)
    if partly and existing is not None:
        domain, kind = existing.domain, existing.data_type
    if domain == "POINT":
        corner_vertex = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("vertex_index", corner_vertex)
        colours = corners_to_vertices(colours, corner_vertex, len(mesh.vertices))
    if vector:
        _vector_attribute(target, name, domain).data.foreach_set("vector", colours.ravel())
        mesh.update()
        return
    before, rendered = mesh.color_attributes.active_color_name, _rendered(mesh)
    attribute = _colour_attribute(target, name, domain, kind)
    values = np.ones((len(colours), 4), np.float32)
    if partly:
        attribute.data.foreach_get("color", values.ravel())
    for channel in channels:
        place = _ALL_CHANNELS.index(channel)
        values[:, place] = colours[:, place]
    attribute.data.foreach_set("color", values.ravel())
    if active and before != name and ACTIVE_BEFORE not in mesh:
        mesh[ACTIVE_BEFORE] = before
    if active:
        mesh[PREVIEW_COLOURS] = name
    activate(mesh, *((name, name) if active else (before, rendered)))
    mesh.update()


def expect_name(name):
    """Raise `PRTError` unless an attribute can be called that."""
    expect(name.strip(), "attribute: expected a name, got an empty one")
    expect(
        len(name.encode()) <= _NAME_BYTES,
        f"attribute: '{name}' is longer than the {_NAME_BYTES} bytes that Blender takes; use a "
        "shorter name",
    )


def expect_free(target, name, vector=False):
    """Raise `PRTError` unless a mesh object can hold colours, or vectors, by that name."""
    expect_name(name)
    existing = target.data.attributes.get(name)
    if vector:
        good = existing is None or (
            existing.data_type == "FLOAT_VECTOR" and not existing.is_required
        )
    else:
        good = existing is None or name in target.data.color_attributes
    what = "holds no vectors of yours" if vector else "is no colour"
    expect(good, f"{target.name}: '{name}' is an attribute that {what}; use another name")
    expect(
        name not in target.vertex_groups,
        f"{target.name}: '{name}' is one of its vertex groups; use another name",
    )


def activate(mesh, name, rendered=None):
    """Make a colour attribute the active and the render colour, where it is there.

    The render colour of a mesh with kept colours is these.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    name : str
    rendered : str, optional
        The render colour, where that is another.
    """
    attributes = mesh.color_attributes
    index, kept = attributes.find(name), attributes.find(mesh.get(KEPT_COLOURS) or "")
    render = kept if kept >= 0 else attributes.find(rendered or name)
    if index >= 0 and attributes.active_color_index != index:
        attributes.active_color_index = index
    if render >= 0 and attributes.render_color_index != render:
        attributes.render_color_index = render


def _rendered(mesh):
    """Name of the render colour of a mesh, empty where it has none."""
    index, attributes = mesh.color_attributes.render_color_index, mesh.color_attributes
    return attributes[index].name if 0 <= index < len(attributes) else ""


def _colour_attribute(target, name, domain, kind):
    """The attribute of that name; one of another kind or domain is replaced."""
    colours = target.data.color_attributes
    existing = colours.get(name)
    if existing is not None and (existing.data_type != kind or existing.domain != domain):
        colours.remove(existing)
        existing = None
    if existing is None:
        colours.new(name, kind, domain)
    expect(
        name in colours,
        f"{target.name}: cannot make an attribute called '{name}'; use another name",
    )
    return colours[name]


def _vector_attribute(target, name, domain):
    """The vector attribute of that name; one of another domain is replaced."""
    attributes = target.data.attributes
    existing = attributes.get(name)
    if existing is not None and existing.domain != domain:
        attributes.remove(existing)
        existing = None
    if existing is None:
        attributes.new(name, "FLOAT_VECTOR", domain)
    expect(name in attributes, f"{target.name}: cannot make an attribute called '{name}'")
    return attributes[name]


def corners_to_vertices(colours, corner_vertex, n_vertices):
    """(n_vertices, n) float32 means of (n_corners, n) colours; 0 for a loose vertex."""
    count = np.maximum(np.bincount(corner_vertex, minlength=n_vertices), 1)[:, None]
    sums = [np.bincount(corner_vertex, column, n_vertices) for column in colours.T]
    return (np.stack(sums, axis=1) / count).astype(np.float32)


def write_all(
    scene,
    colours,
    attribute="PRT",
    domain="CORNER",
    all_copies=False,
    places=None,
    target=None,
    others=(),
    layers=None,
    solid=None,
    **options,
):
    """Colours of a bake onto the open Blender scene.

    An object whose own mesh was baked gets them itself; what modifiers, curves, instances or
    libraries made gets a realised copy in a collection of its own, which is kept while it fits
    and hides what it was made of.

    Parameters
    ----------
    scene : Scene
    colours : dict of str -> (n_corners, 3) float32
    attribute : str
    domain : {"CORNER", "POINT"}
    all_copies : bool
        Build every object, as for an empty file.
    places : dict of str -> (str, str), optional
        Name and library of the object that a mesh belongs to now; default: as baked.
    target : bpy.types.Scene, optional
        Where copies go; default: the current one.
    others : sequence of str
        Colour attributes of other previews of the scene, whose copies stay.
    layers : dict of str -> dict, optional
        More attributes by their names, each of colours of the same objects.
    solid : str, optional
        Which of them 3D views show in Solid mode; default: the attribute itself. Renders use that.
    **options
        Of `write_colours`: byte, channels, active, vector.

    Returns
    -------
    list of str
        Names of the realised copies.
    """
    target = target or bpy.context.scene
    places = places_of(scene, places)
    objects = objects_by_place()
    names, vector = (attribute, *(layers or {})), options.get("vector", False)
    own = {} if all_copies else _own(scene, colours, places, objects, names, vector)
    copies = [name for name in colours if name not in own]
    built = copies_there(scene, copies, target, others)
    if copies and built is None:
        originals = {name: objects.get(places[name]) for name in copies}
        built = build_objects(
            scene, copies, attribute=attribute, target=target, others=others, originals=originals
        )
    for name, present in (own | {name: built[name] for name in copies}).items():
        write_colours(present, colours[name], attribute, domain, **options)
        for layer, values in (layers or {}).items():
            write_colours(present, values[name], layer, domain, active=False)
        if solid is not None:
            attributes = present.data.color_attributes
            attributes.active_color_index = attributes.find(solid)
    for name in copies:
        stand_in_for(built[name], objects.get(places[name]))
    if copies:
        arrange(target)
    return copies


def keep_all(
    scene, colours, attribute, domain="CORNER", places=None, target=None, byte=False,
    channels=CHANNELS, vector=False, show=False,
):  # fmt: skip
    """Colours of a bake as an attribute that stays when the preview goes.

    As `write_all`, but what has no mesh of its own gets a realised object that is the user's: it
    shows the attribute, lies in the collection `PRT Kept` and stands in for what it was made of.

    Parameters
    ----------
    scene, colours, attribute, domain, places, target, byte, channels, vector
        As those of `write_all` and `write_colours`.
    show : bool
        Whether the other objects show it as well, over their own materials (see `covers`).

    Returns
    -------
    list of str
        Names of the meshes that have such an object.
    list of str
        Names of objects that were kept earlier and are of another shape: they are hidden now.
    """
    target = target or bpy.context.scene
    places = places_of(scene, places)
    options = {"byte": byte, "channels": channels, "active": False, "vector": vector}
    objects = objects_by_place()
    own = _own(scene, colours, places, objects, [attribute], vector)
    realised = [name for name in colours if name not in own]
    for name, present in own.items():
        write_colours(present, colours[name], attribute, domain, **options)
        if show:
            cover(present, kept_material(attribute))
    if not realised:
        return [], []
    originals = {name: objects.get(places[name]) for name in realised}
    built, left = kept_objects(scene, originals, attribute, target)
    for name, present in built.items():
        write_colours(present, colours[name], attribute, domain, **options)
        activate(present.data, attribute)
    arrange(target)
    return realised, left


def places_of(scene, places=None):
    """Name and library of the object that each mesh of a bake belongs to: {name: (str, str)}."""
    return {item.name: (item.owner, item.library) for item in scene.objects} | (places or {})


def _own(scene, colours, places, objects, names, vector):
    """The objects whose own meshes get the colours, all looked at before any is written."""
    own = {}
    for item in scene.objects:
        if item.own_mesh and item.name in colours:
            own[item.name] = present = objects.get(places[item.name])
            name = places[item.name][0]
            expect(
                present is not None and present.type == "MESH",
                f"{name}: the open scene has no such mesh object; was it renamed or deleted?",
            )
            expect(present.mode != "EDIT", f"{name}: leave Edit Mode before colours are written")
            expect(
                len(present.data.loops) == len(item.corner_vertex),
                f"{name}: has {len(present.data.loops)} corners, the bake "
                f"{len(item.corner_vertex)}; the mesh was changed after the bake, bake again",
            )
            for each in names:
                expect_free(present, each, vector)
    return own


def save_scene(path):
    """Save the open file under a name, through a temporary one; never half."""
    path = expect_path("scene", path).resolve()
    expect(path.suffix == ".blend", f"{path}: expected a name that ends in .blend")
    with written(path) as part:
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(part), copy=True, compress=True)
        except RuntimeError as error:
            reason = " ".join(str(error).split())
            raise PRTError(f"{path}: Blender cannot save it ({reason})") from error
        else:
            # Blender says that it has saved a compressed file also where the disk was full.
            with part.open("rb") as file:
                file.seek(-len(_LAST_BYTES), 2)
                whole = file.read() == _LAST_BYTES
            expect(
                whole,
                f"{path}: was cut off while Blender wrote it; free some space there, or choose "
                "another disk",
            )
        finally:
            # Blender's own temporary file, where it fails.
            Path(f"{part}@").unlink(missing_ok=True)
