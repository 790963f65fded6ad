"""Relit colours onto Blender meshes: FLOAT_COLOR attributes, and realised copies."""

from pathlib import Path

import bpy
import numpy as np

from prt_core.errors import PRTError, expect, expect_array

COLLECTION = "PRT"


def write_colours(target, colours, name="PRT", domain="CORNER"):
    """Store linear colours in a colour attribute and make it the active and render colour.

    Parameters
    ----------
    target : bpy.types.Object
        Of type mesh, in Object Mode.
    colours : (n_corners, 3) float32
        In loop order.
    name : str
    domain : {"CORNER", "POINT"}
        POINT stores the mean of each vertex's corners.

    Raises
    ------
    PRTError
        The mesh has another number of corners, is in Edit Mode, or the name is taken by an
        attribute that is no colour.
    """
    mesh = target.data
    expect(domain in {"CORNER", "POINT"}, f"domain: expected 'CORNER' or 'POINT', got '{domain}'")
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
    existing = mesh.attributes.get(name)
    if existing is not None and name not in mesh.color_attributes:
        raise PRTError(
            f"{target.name}: '{name}' is an attribute that is no colour; use another name"
        )
    if existing is not None and (existing.data_type != "FLOAT_COLOR" or existing.domain != domain):
        mesh.color_attributes.remove(mesh.color_attributes[name])
        existing = None
    if existing is None:
        mesh.color_attributes.new(name, "FLOAT_COLOR", domain)
    attribute = mesh.color_attributes[name]
    values = np.ones((len(colours), 4), np.float32)
    values[:, :3] = colours
    attribute.data.foreach_set("color", values.ravel())
    index = list(mesh.color_attributes.keys()).index(name)
    mesh.color_attributes.active_color_index = index
    mesh.color_attributes.render_color_index = index
    mesh.update()


def corners_to_vertices(colours, corner_vertex, n_vertices):
    """(n_vertices, 3) float32 means of (n_corners, 3) colours; 0 for a loose vertex."""
    count = np.maximum(np.bincount(corner_vertex, minlength=n_vertices), 1)[:, None]
    sums = [np.bincount(corner_vertex, column, n_vertices) for column in colours.T]
    return (np.stack(sums, axis=1) / count).astype(np.float32)


def build_objects(scene, names=None, collection=COLLECTION, attribute="PRT"):
    """Realised copies of baked objects, in a collection of their own, in world space.

    Parameters
    ----------
    scene : Scene
        From a bake.
    names : sequence of str, optional
        Default: every object that receives.
    collection, attribute : str
        The collection's name; the colour attribute that the copies' material shows.

    Returns
    -------
    dict of str -> bpy.types.Object
    """
    home = bpy.data.collections.get(collection)
    if home is None:
        home = bpy.data.collections.new(collection)
        bpy.context.scene.collection.children.link(home)
    # Copies of an earlier run are replaced, not stacked upon.
    for old in [o for o in home.objects if o.get("prt_copy")]:
        mesh = old.data
        bpy.data.objects.remove(old)
        if mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    material = _emission_material(attribute)
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
        copy["prt_copy"] = True
        home.objects.link(copy)
        made[item.name] = copy
    return made


def _emission_material(attribute):
    """Shows the colour attribute as it is, in every render engine."""
    name = f"{attribute} colours"
    material = bpy.data.materials.get(name)
    if material is not None:
        return material
    material = bpy.data.materials.new(name)
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


def write_all(scene, colours, attribute="PRT", domain="CORNER", all_copies=False):
    """Colours of a bake onto the open Blender scene.

    An object whose own mesh was baked gets them itself; what modifiers, curves or instances
    made gets a realised copy in a collection of its own.

    Parameters
    ----------
    scene : Scene
    colours : dict of str -> (n_corners, 3) float32
    attribute : str
    domain : {"CORNER", "POINT"}
    all_copies : bool
        Build every object, as for an empty file.

    Returns
    -------
    list of str
        Names of the realised copies.
    """
    own = [] if all_copies else [o for o in scene.objects if o.own_mesh and o.name in colours]
    for item in own:
        target = bpy.data.objects.get(item.name)
        expect(
            target is not None and target.type == "MESH",
            f"{item.name}: the open scene has no such mesh object; give the baked .blend",
        )
        expect(
            len(target.data.loops) == len(item.corner_vertex),
            f"{item.name}: has {len(target.data.loops)} corners, the bake "
            f"{len(item.corner_vertex)}; the mesh was changed after the bake, bake again",
        )
    copies = [name for name in colours if name not in {item.name for item in own}]
    made = build_objects(scene, copies, attribute=attribute) if copies else {}
    for item in own:
        write_colours(bpy.data.objects[item.name], colours[item.name], attribute, domain)
    for name, copy in made.items():
        write_colours(copy, colours[name], attribute, domain)
    return copies


def save_scene(path):
    """Save the open file under a name, through a temporary one; never half."""
    path = Path(path).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.stem + ".part.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(temporary), copy=True, compress=True)
    temporary.replace(path)
