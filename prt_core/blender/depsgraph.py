"""What Blender evaluates, as `Mesh`es: modifiers, curves, instances, normals and materials."""

import math
import time
from itertools import islice

import bpy
import numpy as np

from prt_core.blender.compat import view_layer_of
from prt_core.blender.identity import by_uid, display_names, place_of
from prt_core.blender.materials import corner_materials
from prt_core.blender.preview_look import is_shaded
from prt_core.blender.stand_ins import (
    hidden_in,
    hides_originals,
    is_copy,
    originals_shown,
    renders,
    stands_in,
)
from prt_core.errors import PRTError
from prt_core.runtime.progress import Progress, run
from prt_core.scene import Camera, Mesh, Scene

_GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


def read_meshes(scene=None, receivers=None, two_sided=(), messages=None, strict=True):
    """Every mesh that renders, in world space.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        Default: the current one.
    receivers : sequence of str, optional
        Names of the objects that receive colours (see `display_names`); default all. Others cast
        and bounce.
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
    uid = (scene or bpy.context.scene).session_uid
    return run(read_meshes_steps(uid, receivers, two_sided, messages, strict))


def read_meshes_steps(uid, receivers=None, two_sided=(), messages=None, strict=True, pace=None):
    """`read_meshes` as a generator of `Progress`.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene: references to Blender's data do not last from one step to the
        next, and names may change.
    pace : float, optional
        Seconds a step may take; an object is never cut. What is changed between two steps may be
        read half old and half new: compare digests (`mesh_digests`) where that matters.
    """
    messages = [] if messages is None else messages
    reading = None
    while True:
        scene = by_uid(bpy.data.scenes, uid)
        if scene is None:
            raise PRTError("scene: it was removed while it was read")
        if reading is None:
            reading = _Reading(scene, receivers, two_sided, messages)
        if hides_originals(scene):
            # They are shown while they are read; nobody shall see that.
            pace = None
        if reading.some(scene, pace):
            break
        yield Progress("scene", 0, 0)
    for wanted in (receivers, two_sided):
        missing = sorted(set(wanted or ()) - reading.asked)
        if missing and strict:
            raise PRTError(
                f"objects: no geometry that renders is called {', '.join(map(repr, missing))}; "
                f"there are {', '.join(sorted(reading.asked)) or 'none'}"
            )
    if not reading.meshes:
        raise PRTError(
            f"scene '{scene.name}': nothing that renders has faces; add a mesh, "
            "or show its collection in renders"
        )
    _say_left_out(scene, messages)
    return reading.whole()


def _say_left_out(scene, messages):
    rendered, view_layer = _rendered_objects(scene), view_layer_of(scene)
    kept = []
    for item in scene.objects:
        if item.type not in _GEOMETRY or item.session_uid not in rendered or is_copy(item):
            continue
        if stands_in(item, rendered):
            kept.append(item.name)
        elif not hidden_in(item, view_layer) and not item.visible_get(view_layer=view_layer):
            messages.append(f"{item.name}: hidden in the viewport, so it was not baked")
    if kept:
        some = ", ".join(kept[:4]) + (" …" if len(kept) > 4 else "")
        messages.append(
            f"{len(kept)} objects hold kept colours ({some}); not they, but the objects that "
            "they were made of are baked"
        )


class _Reading:
    """The meshes of a scene, read in several steps."""

    def __init__(self, scene, receivers, two_sided, messages):
        self.receivers = None if receivers is None else set(receivers)
        self.two_sided, self.messages = set(two_sided), messages
        rendered = _rendered_objects(scene)
        there = [item for item in scene.objects if not stands_in(item, rendered)]
        self.display, self.names = display_names(there)
        self.local = {item.name for item in there if item.library is None}
        self.meshes, self.asked, self.read = [], set(), 0
        self.named, self.instancers = set(), set()
        self.pictures = {}

    def some(self, scene, pace):
        """Read on until `pace` is spent; whether that was to the end.

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
            # As long again as it took to get here, or many instances would never be read.
            ready, first = time.perf_counter(), self.read
            end = math.inf if pace is None else ready + max(pace, ready - start)
            for instance in islice(depsgraph.object_instances, first, None):
                if self.read > first and time.perf_counter() > end:
                    return False
                self.read += 1
                if instance.object.type == "MESH" or _key(instance) not in as_mesh:
                    self._read(instance, rendered)
        return True

    def whole(self):
        """All meshes, when the end is reached."""
        for mesh in self.meshes:
            # It hides behind the realised copies of what it instances, and its own part with it.
            if (mesh.owner, mesh.library) in self.instancers:
                mesh.own_mesh = False
        return self.meshes

    def _read(self, instance, rendered):
        source, parent = instance.object, instance.parent
        owner = (parent or source).original
        hidden = owner.session_uid not in rendered or not renders(source.original)
        hidden = hidden or stands_in(source.original, rendered)
        if hidden or not instance.show_self or source.type not in _GEOMETRY:
            return
        data = source.data if source.type == "MESH" else source.to_mesh()
        try:
            if data is None or not len(data.polygons):
                return
            name = self._name(owner, source.original)
            matrix = np.array(instance.matrix_world)
            mesh = _to_mesh(name, source, data, matrix, self.messages, self.pictures)
        finally:
            if source.type != "MESH":
                source.to_mesh_clear()
        called = self._called(owner) | self._called(source.original)
        self.asked |= called
        mesh.receives = self.receivers is None or bool(called & self.receivers)
        mesh.two_sided = bool(called & self.two_sided)
        mesh.owner, mesh.library = place_of(owner)
        mesh.own_mesh = parent is None and _own_mesh(source, mesh)
        if parent is not None and mesh.receives:
            self.instancers.add((mesh.owner, mesh.library))
        self.meshes.append(mesh)

    def _called(self, item):
        """What a person may call an object; a name that the file has as well is the file's."""
        if item.library is None:
            return {item.name}
        return {item.name_full} if item.name in self.local else {item.name, item.name_full}

    def _name(self, owner, source):
        """A name of its own for the mesh of an object, or of an instance."""
        shown = self.display.get(owner.session_uid, owner.name)
        if owner != source:
            return self.names.give(f"{shown}/{source.name}")
        if owner.session_uid not in self.display or owner.session_uid in self.named:
            return self.names.give(shown)
        self.named.add(owner.session_uid)
        return shown


def _key(instance):
    return instance.object.original.session_uid, np.array(instance.matrix_world).tobytes()


def _rendered_objects(scene):
    """`session_uid` of the objects whose collections and own switch let them render."""
    found = set()

    def visit(collection):
        if not collection.hide_render:
            found.update(o.session_uid for o in collection.objects if renders(o))
            for child in collection.children:
                visit(child)

    visit(scene.collection)
    return found


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


def _to_mesh(name, source, data, matrix, messages, pictures):
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
    slotted, faces = source, data
    if is_shaded(source.original):
        slotted, faces = source.original, source.original.data
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
    materials, paint = corner_materials(
        slotted, data, corner_slot, corner_vertex, messages, pictures
    )
    return Mesh(
        name=name,
        vertices=world,
        corner_vertex=corner_vertex,
        corner_normal=turned,
        material_names=tuple(
            slot.material.name if slot.material else "" for slot in slotted.material_slots
        ),
        triangle_corners=triangles,
        materials=materials,
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
            f"{len(copies)} objects are made by modifiers, curves, instances or libraries ({some});"
            " their colours go to realised copies in the collection 'PRT'"
        )


def read_camera(scene=None):
    """The `Camera` of a scene; None where it has none of perspective."""
    scene = scene or bpy.context.scene
    if scene.camera is None or scene.camera.data.type != "PERSP":
        return None
    data = scene.camera.data
    return Camera(np.array(scene.camera.matrix_world, np.float64), np.tan(data.angle / 2))
