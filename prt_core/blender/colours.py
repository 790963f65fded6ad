"""Relit colours onto Blender meshes: colour attributes, and realised copies that carry them."""

from pathlib import Path

import bpy
import numpy as np

from prt_core.errors import PRTError, expect, expect_array, expect_path
from prt_core.files import written

COLLECTION = "PRT"
# Custom properties: on copies, on meshes whose active colours changed, on the preview's own blocks.
_COPY, ACTIVE_BEFORE, PREVIEW = "prt_copy", "prt_active_before", "PRT preview"
CHANNELS = "RGB"
# A whole compressed .blend ends so: the magic number of Zstandard's seek table.
_LAST_BYTES = b"\xb1\xea\x92\x8f"


def write_colours(
    target, colours, name="PRT", domain="CORNER", *, byte=False, channels=CHANNELS, active=True
):
    """Store linear colours in a colour attribute.

    Parameters
    ----------
    target : bpy.types.Object
        Of type mesh, in Object Mode.
    colours : (n_corners, 3) float32
        In loop order.
    name : str
    domain : {"CORNER", "POINT"}
        POINT stores the mean of each vertex's corners.
    byte : bool
        8 bits a channel (0 to 1, sRGB) instead of float.
    channels : str
        Those of R, G and B to write; the others of an attribute that is there stay.
    active : bool
        Make it the active and render colour; `restore` gives that back.

    Raises
    ------
    PRTError
        The mesh has another number of corners, is in Edit Mode, or the name is taken by an
        attribute that is no colour.
    """
    mesh = target.data
    expect(domain in {"CORNER", "POINT"}, f"domain: expected 'CORNER' or 'POINT', got '{domain}'")
    expect(name.strip(), "attribute: expected a name, got an empty one")
    expect(
        channels and set(channels) <= set(CHANNELS),
        f"channels: expected some of R, G and B, got '{channels}'",
    )
    expect(target.mode != "EDIT", f"{target.name}: leave Edit Mode before colours are written")
    expect(
        len(mesh.loops) == len(colours),
        f"{target.name}: has {len(mesh.loops)} corners, the bake {len(colours)}; the mesh was "
        "changed after the bake, bake again",
    )
    colours = expect_array(f"{target.name}: colours", colours, (None, 3), np.float32)
    if domain == "POINT":
        corner_vertex = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("vertex_index", corner_vertex)
        colours = corners_to_vertices(colours, corner_vertex, len(mesh.vertices))
    before = mesh.color_attributes.active_color_name
    attribute = _colour_attribute(target, name, domain, "BYTE_COLOR" if byte else "FLOAT_COLOR")
    values = np.ones((len(colours), 4), np.float32)
    if set(channels) != set(CHANNELS):
        attribute.data.foreach_get("color", values.ravel())
    for channel in channels:
        values[:, CHANNELS.index(channel)] = colours[:, CHANNELS.index(channel)]
    attribute.data.foreach_set("color", values.ravel())
    if active and before != name and ACTIVE_BEFORE not in mesh:
        mesh[ACTIVE_BEFORE] = before
    activate(mesh, name if active else before)
    mesh.update()


def activate(mesh, name):
    """Make a colour attribute the active and the render colour, where it is there."""
    names = list(mesh.color_attributes.keys())
    index = names.index(name) if name in names else -1
    if index >= 0 and mesh.color_attributes.active_color_index != index:
        mesh.color_attributes.active_color_index = index
        mesh.color_attributes.render_color_index = index


def _colour_attribute(target, name, domain, kind):
    """The attribute of that name; one of another kind or domain is replaced."""
    colours = target.data.color_attributes
    existing = target.data.attributes.get(name)
    if existing is not None and name not in colours:
        raise PRTError(
            f"{target.name}: '{name}' is an attribute that is no colour; use another name"
        )
    if existing is not None and (existing.data_type != kind or existing.domain != domain):
        colours.remove(colours[name])
        existing = None
    if existing is None:
        made = colours.new(name, kind, domain)
        expect(
            made.name == name,
            f"{target.name}: cannot make an attribute called '{name}'; use another name",
        )
    return colours[name]


def corners_to_vertices(colours, corner_vertex, n_vertices):
    """(n_vertices, 3) float32 means of (n_corners, 3) colours; 0 for a loose vertex."""
    count = np.maximum(np.bincount(corner_vertex, minlength=n_vertices), 1)[:, None]
    sums = [np.bincount(corner_vertex, column, n_vertices) for column in colours.T]
    return (np.stack(sums, axis=1) / count).astype(np.float32)


def build_objects(scene, names=None, collection=COLLECTION, attribute="PRT", target=None):
    """Realised copies of baked objects, in a collection of their own, in world space.

    Parameters
    ----------
    scene : Scene
        From a bake.
    names : sequence of str, optional
        Default: every object that receives.
    collection, attribute : str
        The collection's name; the colour attribute that the copies' material shows.
    target : bpy.types.Scene, optional
        Where a new collection goes; default: the current one.

    Returns
    -------
    dict of str -> bpy.types.Object
    """
    home = bpy.data.collections.get(collection)
    if home is None:
        home = bpy.data.collections.new(collection)
        (target or bpy.context.scene).collection.children.link(home)
    # Copies of an earlier run are replaced, not stacked upon.
    remove_copies(home)
    material = emission_material(attribute)
    made, first = {}, 0
    for item in scene.objects:
        vertices = scene.to_world(scene.vertices[first : first + item.n_vertices])
        first += item.n_vertices
        if not item.receives or (names is not None and item.name not in names):
            continue
        mesh = bpy.data.meshes.new(item.name)
        mesh.vertices.add(len(vertices))
        mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
        mesh.loops.add(len(item.corner_vertex))
        mesh.loops.foreach_set("vertex_index", item.corner_vertex)
        mesh.polygons.add(len(item.face_sizes))
        start = np.concatenate([[0], np.cumsum(item.face_sizes)[:-1]]).astype(np.int32)
        mesh.polygons.foreach_set("loop_start", start)
        mesh.update(calc_edges=True)
        mesh.materials.append(material)
        copy = bpy.data.objects.new(item.name, mesh)
        copy[_COPY] = item.name
        home.objects.link(copy)
        made[item.name] = copy
    return made


def emission_material(attribute):
    """Shows the colour attribute as it is, in every render engine."""
    name = f"{attribute} colours"
    material = bpy.data.materials.get(name)
    if material is not None and material.get(PREVIEW):
        return material
    material = bpy.data.materials.new(name)
    material[PREVIEW] = True
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    colour = tree.nodes.new("ShaderNodeVertexColor")
    colour.layer_name = attribute
    shader = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(colour.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def write_all(
    scene,
    colours,
    attribute="PRT",
    domain="CORNER",
    all_copies=False,
    renamed=None,
    target=None,
    **options,
):
    """Colours of a bake onto the open Blender scene.

    An object whose own mesh was baked gets them itself; what modifiers, curves or instances
    made gets a realised copy in a collection of its own, which is kept while it fits.

    Parameters
    ----------
    scene : Scene
    colours : dict of str -> (n_corners, 3) float32
    attribute : str
    domain : {"CORNER", "POINT"}
    all_copies : bool
        Build every object, as for an empty file.
    renamed : dict of str -> str, optional
        Objects that have another name now.
    target : bpy.types.Scene, optional
        Where copies go; default: the current one.
    **options
        Of `write_colours`: byte, channels, active.

    Returns
    -------
    list of str
        Names of the realised copies.
    """
    renamed = renamed or {}
    own = [] if all_copies else [o for o in scene.objects if o.own_mesh and o.name in colours]
    for item in own:
        check_target(item, renamed)
    copies = [name for name in colours if name not in {item.name for item in own}]
    made = _copies_there(scene, copies)
    if copies and made is None:
        made = build_objects(scene, copies, attribute=attribute, target=target)
    for item in own:
        there = bpy.data.objects[renamed.get(item.name, item.name)]
        write_colours(there, colours[item.name], attribute, domain, **options)
    for name in copies:
        write_colours(made[name], colours[name], attribute, domain, **options)
    return copies


def check_target(item, renamed=None):
    """Raise `PRTError` unless the object that a `SceneObject` was made from can be coloured."""
    name = (renamed or {}).get(item.name, item.name)
    there = bpy.data.objects.get(name)
    expect(
        there is not None and there.type == "MESH",
        f"{name}: the open scene has no such mesh object; was it renamed or deleted?",
    )
    expect(there.mode != "EDIT", f"{name}: leave Edit Mode before colours are written")
    expect(
        len(there.data.loops) == len(item.corner_vertex),
        f"{name}: has {len(there.data.loops)} corners, the bake "
        f"{len(item.corner_vertex)}; the mesh was changed after the bake, bake again",
    )


def _copies_there(scene, names):
    """The realised copies of an earlier write where they are these and fit, else None."""
    home = bpy.data.collections.get(COLLECTION)
    found = {o.get(_COPY): o for o in home.objects if is_copy(o)} if home else {}
    sizes = {item.name: len(item.corner_vertex) for item in scene.objects}
    fits = set(found) == set(names) and all(
        len(found[name].data.loops) == sizes[name] for name in names
    )
    return found if fits else None


def remove_copies(home):
    """Remove the realised copies of a collection; how many there were."""
    copies = [item for item in home.objects if is_copy(item)]
    for copy in copies:
        mesh = copy.data
        bpy.data.objects.remove(copy)
        if mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    return len(copies)


def is_copy(item):
    """Whether an object is a realised copy that `build_objects` made."""
    return bool(item.get(_COPY))


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
