"""Realised objects: the meshes that modifiers, instances and libraries give, as objects of their
own that can hold colours. The preview's copies go with it; kept ones are the user's."""

import weakref
import zlib
from itertools import chain

import bpy
import numpy as np

from prt_core.blender.carried_over import carry_over, note_rounds
from prt_core.blender.stand_ins import COPY, KEPT, ORIGINAL, is_copy, is_kept, let_go

COLLECTION, KEPT_COLLECTION = "PRT", "PRT Kept"
# Custom property of the preview's own data-blocks: True, or the attribute that they show.
PREVIEW = "PRT preview"
# Of collections: which of the two it is, whatever it is called by now.
_HOME = "prt_home"
# Of copies: what tells their mesh from that of another bake.
_MARK = "prt_mesh"
# The scene whose meshes were marked last, and their marks.
_LAST = [None, {}]
# Positions are the same within this share of the scene's size.
_SAME = 1e-6


def build_objects(
    scene, names=None, collection=COLLECTION, attribute="PRT", target=None, others=(),
    originals=None,
):  # fmt: skip
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
    others : sequence of str
        Colour attributes of other previews, whose copies stay.
    originals : dict of str -> bpy.types.Object or None, optional
        What each mesh of the bake belongs to: what was refined takes over UV maps and attributes.

    Returns
    -------
    dict of str -> bpy.types.Object
    """
    target = target or bpy.context.scene
    # Copies of an earlier run are replaced, not stacked upon.
    remove_copies(target, lambda item: not holds(item, others))
    marks = _marks(scene)
    home, material = _home(target, collection), preview_material(attribute)
    built = {}
    for item, mesh, mirrored in _meshes(scene, names):
        built[item.name] = _object(item.name, mesh, mirrored, material, home)
        built[item.name][COPY] = item.name
        built[item.name][_MARK] = marks[item.name]
        if item.refined is not None and originals:
            carry_over(mesh, item.refined, originals.get(item.name))
    return built


def copies_there(scene, names, target, others=()):
    """The realised copies of an earlier write where they are these and fit, else None.

    Those that hold a colour attribute of `others` belong to another preview.
    """
    copies = {o[COPY]: o for o in target.objects if is_copy(o) and not holds(o, others)}
    sizes = {item.name: len(item.corner_vertex) for item in scene.objects}
    fits = set(copies) == set(names) and all(
        len(copies[name].data.loops) == sizes[name] for name in names
    )
    marks = _marks(scene) if fits and copies else {}
    fits = fits and all(copies[name].get(_MARK) == marks[name] for name in names)
    return copies if fits else None


def _marks(scene):
    """What tells the meshes of a bake from those of another, by name; of the last scene at hand."""
    last, marks = _LAST
    if last is None or last() is not scene:
        first, marks = 0, {}
        for item in scene.objects:
            begin, first = first, first + item.n_vertices
            arrays = [scene.to_world(scene.vertices[begin:first]).astype(np.float32)]
            arrays += [item.corner_vertex, item.face_sizes]
            if item.parts is not None:
                arrays += [item.parts.corner_material, item.parts.matrix]
                arrays += [] if item.parts.corner_uv is None else [item.parts.corner_uv]
            mark = 0
            for array in arrays:
                mark = zlib.crc32(np.ascontiguousarray(array), mark)
            marks[item.name] = f"{mark:08x}"
        _LAST[:] = weakref.ref(scene), marks
    return marks


def kept_objects(scene, originals, attribute, target):
    """The user's realised objects that hold kept colours; those missing are made.

    Parameters
    ----------
    scene : Scene
    originals : dict of str -> bpy.types.Object or None
        What each mesh of the bake belongs to.
    attribute : str
        What their material shows; a material that the user gave them stays.
    target : bpy.types.Scene

    Returns
    -------
    dict of str -> bpy.types.Object
    list of str
        Names of earlier objects that are of another shape by now: they are left to the user,
        hidden.
    """
    by_original, by_name = {}, {}
    for item in target.objects:
        if is_kept(item):
            by_name[item[KEPT]] = item
            by_original.setdefault(item.get(ORIGINAL), []).append(item)
    material, home = kept_material(attribute), _home(target, KEPT_COLLECTION)
    by_object, used, left = {}, set(), []
    for item, mesh, mirrored in _meshes(scene, originals):
        original = originals[item.name]
        namesake = by_name.get(item.name)
        # The one of that name first: instances of one object may lie in the same place.
        earlier = chain([namesake] if namesake else [], by_original.get(original, ()))
        fits = (o for o in earlier if o not in used and _same_shape(o.data, mesh, scene.size))
        same = next(fits, None)
        if same is None:
            if namesake is not None and namesake not in used:
                left.append(namesake.name)
                let_go(namesake)
            _set_normals(mesh, scene.points.normals[item.corner_point], mirrored)
            same = _object(f"{item.name} kept", mesh, mirrored, material, home)
            if item.refined is not None:
                carry_over(mesh, item.refined, original)
        else:
            bpy.data.meshes.remove(mesh)
            slots = same.data.materials
            if len(slots) and slots[0] is not None and slots[0].get(KEPT):
                slots[0] = material
        same[KEPT] = item.name
        stand_in_for(same, original)
        by_object[item.name] = same
        used.add(same)
    return by_object, left


def stand_in_for(item, original):
    """Note what a realised object was made of; None where that is not in the file."""
    if original is not None and item.get(ORIGINAL) != original:
        item[ORIGINAL] = original


def holds(item, attributes):
    """Whether an object's mesh has one of these colour attributes: then it is of that preview."""
    colours = getattr(item.data, "color_attributes", ())
    return any(name in colours for name in attributes)


def remove_copies(target, of=None):
    """Remove the preview's copies from a scene; returns how many there were.

    Parameters
    ----------
    target : bpy.types.Scene
    of : callable(bpy.types.Object) -> bool, optional
        Which of them; default: all.
    """
    copies = [item for item in target.objects if is_copy(item) and item.library is None]
    copies = [item for item in copies if of is None or of(item)]
    meshes = {copy.data for copy in copies}
    bpy.data.batch_remove(copies)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])
    for home in [c for c in target.collection.children_recursive if _is_home(c, COLLECTION)]:
        if not home.objects and not home.children:
            bpy.data.collections.remove(home)
    return len(copies)


def _is_home(collection, name):
    """Whether that is the collection of copies or of kept objects; old files have no mark."""
    return collection.library is None and collection.get(_HOME, collection.name) == name


def _home(target, name):
    """A scene's own collection for copies or for kept objects."""
    for collection in target.collection.children_recursive:
        if _is_home(collection, name):
            return collection
    home = bpy.data.collections.new(name)
    home[_HOME] = name
    target.collection.children.link(home)
    return home


def _meshes(scene, names):
    """(SceneObject, mesh in world space, whether it is mirrored) of objects of a bake."""
    first = 0
    order = np.argsort(scene.triangle_object, kind="stable")
    ends = np.searchsorted(scene.triangle_object[order], np.arange(len(scene.objects) + 1))
    for index, item in enumerate(scene.objects):
        begin, first = first, first + item.n_vertices
        if not item.receives or (names is not None and item.name not in names):
            continue
        vertices = scene.to_world(scene.vertices[begin:first])
        triangles = scene.triangles[order[ends[index] : ends[index + 1]]] - begin
        mirrored = _is_mirrored(item, triangles)
        yield item, _mesh(item, vertices * (-1 if mirrored else 1, 1, 1)), mirrored


def _is_mirrored(item, triangles):
    """Whether faces are seen from outside with their corners clockwise."""
    start = 0
    for size in item.face_sizes:
        face = item.corner_vertex[start : start + size]
        start += size
        inside = np.flatnonzero(np.isin(triangles, face).all(axis=1))
        if len(inside):
            at = [int(np.flatnonzero(face == vertex)[0]) for vertex in triangles[inside[0]]]
            return (at[0] < at[1]) + (at[1] < at[2]) + (at[2] < at[0]) == 1
    return False


def _mesh(item, vertices):
    mesh = bpy.data.meshes.new(item.name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(len(item.corner_vertex))
    mesh.loops.foreach_set("vertex_index", item.corner_vertex)
    mesh.polygons.add(len(item.face_sizes))
    start = np.concatenate([[0], np.cumsum(item.face_sizes)[:-1]]).astype(np.int32)
    mesh.polygons.foreach_set("loop_start", start)
    mesh.update(calc_edges=True)
    if item.refined is not None:
        note_rounds(mesh, item.refined)
    return mesh


def _set_normals(mesh, normals, mirrored):
    """The corners' shading normals as they were baked: flat, smooth, or both."""
    mesh.normals_split_custom_set(normals * (-1 if mirrored else 1, 1, 1))


def _object(name, mesh, mirrored, material, home):
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    # A mirrored object's corners run the other way round; so its copy is mirrored as well.
    item.scale.x = -1 if mirrored else 1
    home.objects.link(item)
    return item


def _same_shape(one, two, size):
    """Whether two meshes have the same corners at the same places."""
    if (len(one.vertices), len(one.loops)) != (len(two.vertices), len(two.loops)):
        return False
    corners = np.empty((2, len(one.loops)), np.int32)
    places = np.empty((2, len(one.vertices) * 3), np.float32)
    for mesh, corner, place in zip((one, two), corners, places, strict=True):
        mesh.loops.foreach_get("vertex_index", corner)
        mesh.vertices.foreach_get("co", place)
    if (corners[0] != corners[1]).any():
        return False
    return np.allclose(*places, rtol=_SAME, atol=_SAME * size)


def preview_material(attribute):
    """The preview's material, which goes with it: shows the attribute in every render engine."""
    return _emission(attribute, PREVIEW, f"{attribute} colours")


def kept_material(attribute):
    """The same for what is kept, which is the user's."""
    return _emission(attribute, KEPT, f"{attribute} kept colours")


def _emission(attribute, mark, name):
    for material in bpy.data.materials:
        if material.library is None and material.get(mark) == attribute:
            return material
    material = bpy.data.materials.new(name)
    material[mark] = attribute
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
