"""What Blender evaluates, as `Mesh`es: modifiers, curves, instances, normals and materials."""

import time
from itertools import islice

import bpy
import numpy as np

from prt_core.blender.colours import is_copy
from prt_core.blender.compat import view_layer_of
from prt_core.blender.materials import corner_albedo
from prt_core.blender.preview_look import hides_originals, is_shaded, originals_shown, renders
from prt_core.errors import PRTError
from prt_core.progress import Progress, run
from prt_core.scene.scene import Mesh, Scene

_GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


def read_meshes(scene=None, receivers=None, two_sided=(), messages=None, strict=True):
    """Every mesh that renders, in world space.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        Default: the current one.
    receivers : sequence of str, optional
        Names of the objects that receive colours; default all. Others cast and bounce.
    two_sided : sequence of str
        Objects whose back sides receive and bounce as well.
    messages : list of str, optional
        Told what was ignored or replaced.
    strict : bool
        Whether a name that renders nothing is an error.

    Returns
    -------
    list of Mesh

    Raises
    ------
    PRTError
        A name belongs to no object that renders, or nothing renders.
    """
    name = (scene or bpy.context.scene).name
    return run(read_meshes_steps(name, receivers, two_sided, messages, strict))


def read_meshes_steps(name, receivers=None, two_sided=(), messages=None, strict=True, pace=None):
    """`read_meshes` as a generator of `Progress`.

    Parameters
    ----------
    name : str
        Of the scene: references to Blender's data do not last from one step to the next.
    pace : float, optional
        Seconds a step may take; an object is never cut. What is changed between two steps may be
        read half old and half new: compare digests (`mesh_digests`) where that matters.
    """
    messages = [] if messages is None else messages
    meshes, asked, read = [], set(), 0
    while True:
        scene = bpy.data.scenes.get(name)
        if scene is None:
            raise PRTError(f"scene '{name}': was removed or renamed while it was read")
        if hides_originals(scene):
            # They are shown while they are read; nobody shall see that.
            pace = None
        read, ended = _read_some(
            scene, receivers, set(two_sided), messages, meshes, asked, read, pace
        )
        if ended:
            break
        yield Progress("scene", 0, 0)
    for wanted in (receivers, two_sided):
        missing = sorted(set(wanted or ()) - asked)
        if missing and strict:
            raise PRTError(
                f"objects: no geometry that renders is called {', '.join(map(repr, missing))}; "
                f"there are {', '.join(sorted(asked)) or 'none'}"
            )
    if not meshes:
        raise PRTError(
            f"scene '{scene.name}': nothing that renders has faces; add a mesh, "
            "or show its collection in renders"
        )
    rendered = _rendered_objects(scene)
    for item in scene.objects:
        if item.type in _GEOMETRY and item.name in rendered and not _visible(item, scene):
            messages.append(f"{item.name}: hidden in the viewport, so it was not baked")
    return meshes


def _visible(item, scene):
    return item.visible_get(view_layer=view_layer_of(scene))


def _read_some(scene, receivers, two_sided, messages, meshes, asked, read, pace):
    """Read instances from number `read` on until `pace` is spent; how far, and whether to the end.

    The evaluated scene is asked for anew each time: nothing of it may be kept between steps.
    """
    start = time.perf_counter()
    view_layer = view_layer_of(scene)
    with (
        bpy.context.temp_override(scene=scene, view_layer=view_layer),
        originals_shown(scene, view_layer),
    ):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        rendered = _rendered_objects(scene)
        # A curve or text comes twice: as itself, and as the mesh that it evaluates to.
        as_mesh = {_key(i) for i in depsgraph.object_instances if i.object.type == "MESH"}
        for instance in islice(depsgraph.object_instances, read, None):
            if read and pace is not None and time.perf_counter() - start > pace:
                return read, False
            read += 1
            if instance.object.type != "MESH" and _key(instance) in as_mesh:
                continue
            mesh, owners = _read_instance(
                instance, rendered, receivers, two_sided, messages, meshes
            )
            asked |= owners
            if mesh is not None:
                meshes.append(mesh)
    return read, True


def _key(instance):
    return instance.object.original.name, np.array(instance.matrix_world).tobytes()


def _rendered_objects(scene):
    """Names of the objects whose collections and own switch let them render."""
    names = set()

    def visit(collection):
        if not collection.hide_render:
            names.update(o.name for o in collection.objects if renders(o))
            for child in collection.children:
                visit(child)

    visit(scene.collection)
    return names


def _read_instance(instance, rendered, receivers, two_sided, messages, meshes):
    """One `Mesh` (or None), and the names by which the user may call it."""
    source = instance.object
    parent = instance.parent
    hidden = (parent or source).original.name not in rendered or not renders(source.original)
    hidden = hidden or is_copy(source.original)
    if hidden or not instance.show_self or source.type not in _GEOMETRY:
        return None, set()
    owner = source.original.name if parent is None else parent.original.name
    owners = {owner, source.original.name}
    data = source.data if source.type == "MESH" else source.to_mesh()
    try:
        if data is None or not len(data.polygons):
            return None, set()
        name = owner
        if parent is not None and owner != source.original.name:
            name = f"{owner}/{source.original.name}"
        taken = {mesh.name for mesh in meshes}
        if name in taken:
            count = 1
            while f"{name}.{count:03d}" in taken:
                count += 1
            name = f"{name}.{count:03d}"
        mesh = _to_mesh(name, source, data, np.array(instance.matrix_world), messages)
    finally:
        if source.type != "MESH":
            source.to_mesh_clear()
    mesh.receives = receivers is None or bool(owners & set(receivers))
    mesh.two_sided = bool(owners & two_sided)
    mesh.owner = owner
    mesh.own_mesh = parent is None and _own_mesh(source, mesh)
    return mesh, owners


def _own_mesh(evaluated, mesh):
    """Whether the object's own mesh has the corners that were evaluated, and nobody shares it."""
    original = evaluated.original
    if original.type != "MESH" or original.data.users > 1 or original.data.library:
        return False
    if len(original.data.loops) != len(mesh.corner_vertex):
        return False
    own = np.empty(len(original.data.loops), np.int32)
    original.data.loops.foreach_get("vertex_index", own)
    return len(original.data.vertices) == len(mesh.vertices) and bool(
        (own == mesh.corner_vertex).all()
    )


def _to_mesh(name, source, data, matrix, messages):
    n_corners = len(data.loops)
    vertices = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", vertices)
    corner_vertex = np.empty(n_corners, np.int32)
    data.loops.foreach_get("vertex_index", corner_vertex)
    normals = np.empty(n_corners * 3, np.float32)
    data.corner_normals.foreach_get("vector", normals)
    data.calc_loop_triangles()
    triangles = np.empty(len(data.loop_triangles) * 3, np.int32)
    data.loop_triangles.foreach_get("loops", triangles)
    sizes = np.empty(len(data.polygons), np.int32)
    data.polygons.foreach_get("loop_total", sizes)
    # Under the preview's material the object still has its own.
    materials, faces = source, data
    if is_shaded(source.original):
        materials, faces = source.original, source.original.data
    slots = np.empty(len(data.polygons), np.int32)
    faces.polygons.foreach_get("material_index", slots)

    matrix = matrix.astype(np.float64)
    linear = matrix[:3, :3]
    world = vertices.reshape(-1, 3).astype(np.float64) @ linear.T + matrix[:3, 3]
    bad = ~np.isfinite(world).all(axis=1)
    triangles = triangles.reshape(-1, 3)
    if bad.any():
        messages.append(f"{name}: {int(bad.sum())} vertices are NaN or infinite; faces ignored")
        triangles = triangles[~bad[corner_vertex[triangles]].any(axis=1)]
        world[bad] = 0
    determinant = np.linalg.det(linear)
    if determinant == 0:
        messages.append(f"{name}: scaled to nothing in one direction; faces ignored")
        triangles = triangles[:0]
        turned = np.zeros((n_corners, 3))
    else:
        turned = normals.reshape(-1, 3).astype(np.float64) @ np.linalg.inv(linear)
        lengths = np.sqrt(np.einsum("ij,ij->i", turned, turned))[:, None]
        turned /= np.maximum(lengths, 1e-30)
        if not np.isfinite(turned).all():
            turned = np.where(np.isfinite(turned).all(axis=1)[:, None], turned, 0.0)
    if determinant < 0:
        # A mirror turns the winding round, not the side that is the front.
        triangles = triangles[:, ::-1]
    uv = None
    if data.uv_layers.active is not None:
        uv = np.empty(n_corners * 2, np.float32)
        data.uv_layers.active.data.foreach_get("uv", uv)
        uv = uv.reshape(-1, 2)
    corner_slot = np.repeat(slots, sizes)
    albedo, paint = corner_albedo(materials, data, corner_slot, corner_vertex, messages)
    return Mesh(
        name=name,
        vertices=world,
        corner_vertex=corner_vertex,
        corner_normal=turned,
        triangle_corners=triangles,
        corner_albedo=albedo,
        corner_material=corner_slot,
        face_sizes=sizes,
        corner_uv=uv,
        paint=paint,
    )


def read_scene(scene=None, receivers=None, two_sided=(), messages=None):
    """The current Blender scene as a `Scene` (see `read_meshes`)."""
    messages = [] if messages is None else messages
    meshes = read_meshes(scene, receivers, two_sided, messages)
    say_copies(meshes, messages)
    return Scene.from_meshes(meshes)


def say_copies(meshes, messages):
    """Say which objects' colours cannot go to their own meshes."""
    copies = [mesh.name for mesh in meshes if mesh.receives and not mesh.own_mesh]
    if copies:
        some = ", ".join(copies[:4]) + (" …" if len(copies) > 4 else "")
        messages.append(
            f"{len(copies)} objects are made by modifiers, curves or instances ({some}); "
            "their colours go to realised copies in the collection 'PRT'"
        )


def read_camera(scene=None):
    """The scene's camera as `evaluate.view` takes it, or None."""
    scene = scene or bpy.context.scene
    if scene.camera is None or scene.camera.data.type != "PERSP":
        return None
    data = scene.camera.data
    return {
        "matrix": np.array(scene.camera.matrix_world, np.float64).tolist(),
        "tangent": float(np.tan(data.angle / 2)),
    }
