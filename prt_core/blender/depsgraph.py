"""What renders of a scene, as `Mesh`es: modifiers, curves, hair, instances, normals, materials."""

import time
from dataclasses import dataclass, field
from types import SimpleNamespace

import bpy
import numpy as np

from prt_core.blender.covers import covers_of
from prt_core.blender.glossy_rays import glossy_remarks
from prt_core.blender.identity import display_names, place_of, scene_of
from prt_core.blender.left_out import (
    NO_MATERIAL,
    holdout_remarks,
    material_remarks,
    plain_colour,
    say_copies,
    scene_remarks,
    surface_kind,
)
from prt_core.blender.passes import SurfaceRecord, evaluate_surfaces, surface_of, weights_of
from prt_core.blender.raw_mesh import RawMesh, one_colour
from prt_core.blender.ray_visibility import ray_visibility
from prt_core.blender.render_scene import as_rendered
from prt_core.blender.stand_ins import rendered_objects, stands_in
from prt_core.blender.strands import curve_strands, particle_strands, point_octahedra, tubes
from prt_core.errors import PRTError
from prt_core.runtime.progress import Progress, run
from prt_core.scene import Scene

_MESHES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
_GEOMETRY = _MESHES | {"CURVES", "POINTCLOUD", "VOLUME"}


def read_meshes(scene=None, receivers=None, two_sided=(), messages=None, strict=True, gloss=False):
    """Every mesh that renders, in world space.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        Default: the current one.
    receivers : sequence of str, optional
        Names of the objects that receive colours (see `display_names`), or of one instance, as
        bakes call it; default all. Others cast and bounce; so do hair and point clouds.
    two_sided : sequence of str
        Objects whose back sides receive and bounce as well.
    messages : list of str, optional
        Told what was ignored or replaced.
    strict : bool
        Whether a name that renders nothing is an error.
    gloss : bool
        Whether materials have their gloss as well.

    Returns
    -------
    list of Mesh

    Raises
    ------
    PRTError
        A name belongs to no object that renders, or nothing renders.
    """
    uid = (scene or bpy.context.scene).session_uid
    return run(read_meshes_steps(uid, receivers, two_sided, messages, strict, gloss=gloss))


def read_meshes_steps(
    uid,
    receivers=None,
    two_sided=(),
    messages=None,
    strict=True,
    pace=None,
    read_too=None,
    materials=True,
    gloss=False,
):
    """`read_meshes` as a generator of `Progress`.

    One step, of the stage `evaluate`, is as long as Blender takes to evaluate the scene for a
    render, and to copy the arrays of each mesh once however many instances it has: some 0.1 s a
    million corners. It cannot be cut. All others keep to the pace.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene: references to Blender's data do not last from one step to the
        next, and names may change.
    pace : float, optional
        Seconds a step may take; an object is never cut.
    read_too : callable(depsgraph), optional
        Reads more from the same evaluation (see `as_rendered`).
    materials : bool
        Whether Cycles is asked for materials; else all have that of surfaces without one.
    gloss : bool
        Whether it is asked for their gloss as well.
    """
    messages = [] if messages is None else messages
    start = time.perf_counter()
    yield Progress("evaluate", 0, 0)
    while pace is not None and time.perf_counter() - start < 2 * pace:
        # So long that the window can say what it will wait for.
        yield Progress("evaluate", 0, 0)
    scene = scene_of(uid)
    reading = _Reading(scene, receivers, two_sided, messages)

    def read(depsgraph):
        reading.copy(depsgraph)
        if read_too is not None:
            read_too(depsgraph)

    as_rendered(scene, read)
    known = reading.asked | {part.name for part in reading.parts if part.record is not None}
    for wanted in (receivers, two_sided):
        missing = sorted(set(wanted or ()) - known)
        if missing and strict:
            raise PRTError(
                f"objects: no geometry that renders is called {', '.join(map(repr, missing))}; "
                f"there are {', '.join(sorted(reading.asked)) or 'none'}"
            )
    if not reading.parts:
        raise PRTError(
            f"scene '{scene.name}': nothing that renders has faces; add a mesh, "
            "or show its collection in renders"
        )
    messages += scene_remarks(scene, _GEOMETRY)
    messages += glossy_remarks(scene) if gloss else []
    start = time.perf_counter()
    for number in range(len(reading.parts)):
        if pace is not None and time.perf_counter() - start > pace:
            yield Progress("scene", number, len(reading.parts))
            start = time.perf_counter()
        reading.place(number)
    if materials:
        records = reading.records()
        yield from evaluate_surfaces(uid, reading.meshes, records, messages, pace, gloss)
    return reading.whole()


@dataclass
class _Part:
    """One mesh that is to be placed in the world."""

    name: str
    raw: RawMesh
    matrix: np.ndarray
    receives: bool = False
    two_sided: bool = False
    own_mesh: bool = False
    place: tuple = ("", "")
    source: str = ""
    record: SurfaceRecord | None = None
    # Whether rays of some kinds meet it (see `Mesh`).
    rays: dict = field(default_factory=dict)
    # Of strands and points, which have no materials yet: a colour, or the mesh to take it from.
    colour: tuple | None = None
    emitter: str | None = None


class _Reading:
    """The meshes of a scene: copied while it is evaluated, then placed one by one."""

    def __init__(self, scene, receivers, two_sided, messages):
        self.receivers = None if receivers is None else set(receivers)
        self.two_sided, self.messages = set(two_sided), messages
        self.rendered = rendered_objects(scene)
        originals = [item for item in scene.objects if not stands_in(item, self.rendered)]
        self.display, self.names = display_names(originals)
        self.local = {item.name for item in originals if item.library is None}
        self.parts, self.meshes, self.asked = [], [], set()
        self.named, self.instancers, self.raw = set(), set(), {}

    def copy(self, depsgraph):
        """Copy all that renders, while Blender has it evaluated (see `as_rendered`)."""
        view_layer = depsgraph.view_layer
        # A curve or text comes twice: as itself, and as the mesh that it evaluates to.
        as_mesh = {
            _key(i) for i in depsgraph.object_instances
            if i.object.type == "MESH" and i.object.original.type != "MESH"
        }  # fmt: skip
        for instance in depsgraph.object_instances:
            source = instance.object
            if source.type not in _GEOMETRY:
                continue
            owner = (instance.parent or source).original
            if stands_in(owner, self.rendered) or stands_in(source.original, self.rendered):
                continue
            for line in holdout_remarks(source, instance.parent or source, view_layer):
                self.messages += [line] if line not in self.messages else []
            if instance.show_self and source.type in _MESHES and view_layer.use_solid:
                if source.type == "MESH" or _key(instance) not in as_mesh:
                    self._copy_mesh(instance, view_layer)
            elif instance.show_self and source.type not in _MESHES:
                self._copy_other(instance, view_layer)
            if instance.show_particles and source.type == "MESH" and view_layer.use_strand:
                self._copy_hair(instance, view_layer)

    def place(self, number):
        """Place a part in the world."""
        part = self.parts[number]
        part.raw.materials = one_colour(NO_MATERIAL, len(part.raw.corner_slot))
        mesh = part.raw.placed(part.name, part.matrix, self.messages)
        mesh.receives, mesh.two_sided, mesh.own_mesh = part.receives, part.two_sided, part.own_mesh
        mesh.owner, mesh.library = part.place
        mesh.source = part.source
        for flag, is_met in part.rays.items():
            setattr(mesh, flag, is_met)
        self.meshes.append(mesh)

    def records(self):
        """The `SurfaceRecord` of each mesh; None of strands and points."""
        return [part.record for part in self.parts]

    def whole(self):
        """All meshes, when all are placed and have their materials."""
        for part, mesh in zip(self.parts, self.meshes, strict=True):
            if part.record is None:
                mesh.materials = self._strand_materials(part)
            if np.linalg.det(part.matrix[:3, :3]) == 0:
                mesh.materials, mesh.paint = one_colour((0.0, 0, 0), len(mesh.materials)), None
                mesh.bounced = mesh.back = mesh.shadow = None
            # It hides behind the realised copies of what it instances, and its own part with it.
            if (mesh.owner, mesh.library) in self.instancers:
                mesh.own_mesh = False
        return self.meshes

    def _copy_mesh(self, instance, view_layer):
        source, parent = instance.object, instance.parent
        owner = (parent or source).original
        if source.type == "MESH":
            key = source.data.as_pointer()
        else:
            # The mesh that a curve evaluates to lasts for this call only.
            key = source.original.session_uid, source.type
        slots = [s.material for s in _slots(source, view_layer)]
        key = key, tuple(m.as_pointer() if m else 0 for m in slots)
        if key not in self.raw:
            self.raw[key] = self._raw_mesh(source, view_layer)
        raw, kind = self.raw[key]
        if raw is None:
            return
        called = self._called(owner) | self._called(source.original)
        self.asked |= called
        if kind == "volume":
            return
        part = _Part(self._name(owner, source.original), raw, _matrix(instance))
        called.add(part.name)
        part.receives = self.receivers is None or bool(called & self.receivers)
        part.two_sided = bool(called & self.two_sided)
        part.place = place_of(owner)
        part.source = source.original.name if owner != source.original else ""
        part.own_mesh = parent is None and raw.is_own_of(source)
        part.rays = ray_visibility(source, parent or source, view_layer)
        random_id = 0 if parent is None else instance.random_id
        part.record = raw.surface.placed(part.name, owner, source, part.matrix, random_id)
        if parent is not None and part.receives:
            self.instancers.add(part.place)
        self.parts.append(part)

    def _raw_mesh(self, source, view_layer):
        """The `RawMesh` of an object and what is special about it; None where it has no faces."""
        data = source.data if source.type == "MESH" else source.to_mesh()
        try:
            if data is None or not len(data.polygons):
                return None, None
            slotted, slots_of = source, data
            # Under the material of a preview, or of what was kept, the object still has its own.
            if covers_of(source.original):
                original = source.original
                if len(original.data.polygons) == len(data.polygons):
                    slotted, slots_of = original, original.data
            raw = RawMesh.of(data, slots_of)
            slots = _slots(slotted, view_layer)
            used = np.unique(raw.corner_slot)
            of_slot = {n: slots[min(n, len(slots) - 1)].material if slots else None for n in used}
            self.messages += material_remarks(source.name, of_slot.values())
            clear = [n for n, material in of_slot.items() if not surface_kind(material)[0]]
            if clear:
                raw = raw.without_slots(clear)
                if not len(raw.triangles):
                    return raw, "volume"
                slots = [
                    SimpleNamespace(material=None if n in clear else s.material)
                    for n, s in enumerate(slots)
                ]
            raw.material_names = tuple(s.material.name if s.material else "" for s in slots)
            of_slot = [s.material.original.session_uid if s.material else 0 for s in slots]
            weights = weights_of(data, slotted.vertex_groups, (s.material for s in slots))
            raw.surface = surface_of(data, source.original.data, of_slot, raw, weights)
            return raw, None
        finally:
            if source.type != "MESH":
                source.to_mesh_clear()

    def _copy_hair(self, instance, view_layer):
        source = instance.object
        for modifier in source.modifiers:
            if modifier.type != "PARTICLE_SYSTEM" or not modifier.show_render:
                continue
            system = modifier.particle_system
            if system.settings.type != "HAIR" or system.settings.render_type != "PATH":
                continue
            key = source.original.session_uid, system.name
            if key not in self.raw:
                strands = particle_strands(source, system)
                self.raw[key] = tubes(strands) if len(strands) else (None, 1)
            self._copy_strands(instance, view_layer, "particle hair", *self.raw[key])

    def _copy_other(self, instance, view_layer):
        source, name = instance.object, instance.object.name
        if source.type == "VOLUME":
            self.asked |= self._called(source.original)
            self.messages.append(f"{name}: volume is not baked")
            return
        key = source.data.as_pointer()
        if source.type == "CURVES":
            if not view_layer.use_strand:
                return
            if key not in self.raw:
                strands = curve_strands(source.data)
                self.raw[key] = tubes(strands) if len(strands) else (None, 1)
            self._copy_strands(instance, view_layer, "hair", *self.raw[key])
        elif view_layer.use_solid:
            if key not in self.raw:
                self.raw[key] = point_octahedra(source.data)
            self._copy_strands(instance, view_layer, "point cloud", *self.raw[key])

    def _copy_strands(self, instance, view_layer, kind, raw, share):
        """Note what casts and bounces only, and say so."""
        if raw is None or not len(raw.triangles):
            return
        source, owner = instance.object, (instance.parent or instance.object).original
        slots = _slots(source, view_layer)
        slot = int(raw.corner_slot[0])
        material = slots[min(slot, len(slots) - 1)].material if slots else None
        place = place_of(owner)
        emitter = next((p.name for p in reversed(self.parts) if p.place == place), None)
        name = self.names.give(f"{self.display.get(owner.session_uid, owner.name)}/{kind}")
        part = _Part(name, raw, _matrix(instance), place=place, emitter=emitter)
        raw.material_names = tuple(s.material.name if s.material else "" for s in slots)
        part.colour = plain_colour(material)
        part.rays = ray_visibility(source, instance.parent or source, view_layer)
        part.source = source.original.name if instance.parent else ""
        self.parts.append(part)
        many = "" if share == 1 else f", one of each {share} and so much wider,"
        self.messages.append(
            f"{source.name}: its {kind} casts shadows and bounces light{many} in one colour; it "
            "receives no colours itself"
        )

    def _strand_materials(self, part):
        """`Materials` of strands or points: their material's colour, or that of the emitter."""
        colour = part.colour
        if colour is None:
            emitter = next((m for m in self.meshes if m.name == part.emitter), None)
            slot = int(part.raw.corner_slot[0])
            mine = emitter.corner_material == slot if emitter is not None else np.zeros(0, bool)
            colour = emitter.materials.albedo[mine].mean(axis=0) if mine.any() else NO_MATERIAL
        return one_colour(colour, len(part.raw.corner_slot))

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


def _matrix(instance):
    return np.array(instance.matrix_world, np.float64)


def _slots(source, view_layer):
    """The material slots of an object; a view layer may override all of them."""
    override = view_layer.material_override
    if override is not None:
        return [SimpleNamespace(material=override)]
    return list(source.material_slots)


def read_scene(scene=None, receivers=None, two_sided=(), messages=None):
    """The current Blender scene as a `Scene` (see `read_meshes`)."""
    messages = [] if messages is None else messages
    meshes = read_meshes(scene, receivers, two_sided, messages)
    say_copies(meshes, messages)
    return Scene.from_meshes(meshes)
