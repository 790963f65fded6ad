"""The materials of meshes, evaluated by Cycles: at their corners, and between them where they vary.

Everything is asked for in a few renders of all objects together. What was asked is kept, so that a
scene that has not changed is not rendered again.
"""

import hashlib
import time
from collections import OrderedDict
from functools import partial

import bpy
import numpy as np

from prt_core.blender.identity import by_uid
from prt_core.blender.passes.digests import MaterialDigests
from prt_core.blender.passes.evaluation import Evaluation
from prt_core.blender.passes.graphs import graph_of
from prt_core.blender.passes.lattices import Triangles, first_levels
from prt_core.blender.passes.quantities import COLUMNS, GLOSS, columns_of, lines_of
from prt_core.errors import PRTError
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.runtime.array_parts import held_once
from prt_core.runtime.progress import Progress
from prt_core.scene.paint import LOOKS, Look, look_of

_KEPT, _MOST_BYTES = OrderedDict(), 256 << 20
# Corners of meshes that Cycles is asked for together: what it says of each takes a hundred bytes.
_TOGETHER = 1 << 20
# What less of a coat takes from emission nobody sees.
_THIN_COAT = 0.1


def evaluate_surfaces(uid, meshes, records, messages, pace=None, gloss=False):
    """Give meshes their materials, as a generator of `Progress`.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene.
    meshes : list of Mesh
        `materials`, `paint`, the other `LOOKS` and, where a material bends them, `corner_normal`
        are set.
    records : list of SurfaceRecord
        Of the meshes; those with None keep the materials that they have.
    messages : list of str
        Told what was left out.
    pace : float, optional
        Seconds a step may take where a window waits; a render of a second or so cannot be cut. It
        comes after steps of the stage `materials` that are as long as two of these together, so
        that the window can say what it will wait for.
    gloss : bool
        Whether the quantities of gloss are evaluated as well.

    Raises
    ------
    PRTError
        Cycles is not there, or cannot render now.
    """
    scene = by_uid(bpy.data.scenes, uid)
    if scene is None:
        raise PRTError("scene: it was removed while it was read")
    known = [i for i, record in enumerate(records) if record is not None]
    meshes, records = [meshes[i] for i in known], [records[i] for i in known]
    if not meshes:
        return
    materials = _Materials(scene, gloss)
    levels = _first_levels_of(meshes, records, materials)
    surfaces = {"shown": {}}
    ask = partial(_evaluated, uid, meshes, records, materials, levels, pace)
    surfaces["shown"] = yield from ask("shown", range(len(meshes)))
    asking = [materials.asked(record) for record in records]
    for look in LOOKS:
        surfaces[look] = yield from ask(look, [i for i, a in enumerate(asking) if look in a])
    notes = []
    for index, mesh in enumerate(meshes):
        looks = {look: known[index] for look, known in surfaces.items() if index in known}
        notes += [note for surface in looks.values() for note in surface.notes]
        notes += _glows_below(records[index], looks["shown"], materials)
        notes += _mixed_emission(records[index], looks, materials)
        notes += _mixed_sides(records[index], looks, materials)
        _apply(mesh, looks)
    messages += [line for line in lines_of(notes, gloss) if line not in messages]


def _evaluated(uid, meshes, records, materials, levels, pace, look, wanted):
    """Index -> `Surface` of some meshes, as a generator of `Progress`."""
    keys = {i: _key(meshes[i], records[i], levels[i], materials, look) for i in wanted}
    surfaces = {i: _KEPT[key] for i, key in keys.items() if key in _KEPT}
    for missing in _batches([i for i in wanted if i not in surfaces], meshes):
        start = time.perf_counter()
        while pace is not None and time.perf_counter() - start < 2 * pace:
            yield Progress("materials", 0, 0)
        evaluation = Evaluation(
            uid, [meshes[n] for n in missing], [records[n] for n in missing],
            records, materials, np.concatenate([levels[n] for n in missing]), look,
        )  # fmt: skip
        surfaces |= dict(zip(missing, (yield from evaluation.surfaces()), strict=True))
    for index, key in keys.items():
        _keep(key, surfaces[index])
    return surfaces


def _batches(indices, meshes):
    """Lists of the meshes that Cycles is asked for together: of so many corners at most."""
    batch, held = [], 0
    for index in indices:
        count = len(meshes[index].corner_vertex)
        if batch and held + count > _TOGETHER:
            yield batch
            batch, held = [], 0
        batch.append(index)
        held += count
    if batch:
        yield batch


def _first_levels_of(meshes, records, materials):
    """The level of the first lattice of each triangle: (n,) int64 of each mesh; 1 is none."""
    levels = [np.broadcast_to(np.int64(1), int(mesh.is_solid().sum())) for mesh in meshes]
    graphs = [[materials.graph(r.slot(n)) for n in np.unique(r.slot_of_corner)] for r in records]
    varying = [i for i, of_mesh in enumerate(graphs) if not all(graph.even for graph in of_mesh)]
    if varying:
        some = [meshes[i] for i in varying], [records[i] for i in varying]
        triangles = Triangles(*some, materials.graph)
        found = first_levels(triangles, triangles.families(), _size_of(meshes))
        for number, index in enumerate(varying):
            levels[index] = found[triangles.mesh == number]
    return levels


class _Materials:
    """The graphs and digests of a scene's materials, each worked out once."""

    def __init__(self, scene, gloss):
        self.gloss = gloss
        self._by_uid = {m.session_uid: m for m in bpy.data.materials}
        self._graphs, self._digests = {}, MaterialDigests(scene.frame_current)
        self.look = str(getattr(getattr(scene, "cycles", None), "shading_system", ""))

    def graph(self, uid):
        """The `Graph` of a material by its `session_uid`."""
        if uid not in self._graphs:
            self._graphs[uid] = graph_of(self._by_uid.get(uid), self.gloss)
        return self._graphs[uid]

    def asked(self, record):
        """Which looks besides what is shown are to be evaluated of a mesh: names of `LOOKS`."""
        graphs = [self.graph(record.slot(slot)) for slot in np.unique(record.slot_of_corner)]
        asked = {"bounced": "paths", "back": "backs", "shadow": "shadows"}
        return {look for look, kind in asked.items() if any(getattr(g, kind) for g in graphs)}

    def digest(self, record):
        """bytes: of all materials of a mesh."""
        return b"".join(self._digests.of(self._by_uid.get(uid)) for uid in record.slots)


def _size_of(meshes):
    seen = [m.vertices for m in meshes if m.receives and len(m.vertices)]
    seen = seen or [m.vertices for m in meshes if len(m.vertices)]
    if not seen:
        return 1.0
    low = np.min([v.min(axis=0) for v in seen], axis=0)
    return float(np.max(np.max([v.max(axis=0) for v in seen], axis=0) - low))


def _key(mesh, record, levels, materials, look):
    digest = hashlib.blake2b(digest_size=16)
    for array in (mesh.vertices, mesh.corner_vertex, mesh.corner_normal, mesh.triangle_corners,
                  record.slot_of_corner, record.key_of_corner, levels):  # fmt: skip
        digest.update(np.ascontiguousarray(array))
    digest.update(record.digest + materials.digest(record) + materials.look.encode())
    digest.update(f"{record.name}\0{look}\0{'gloss' if materials.gloss else ''}".encode())
    return digest.digest()


def _keep(key, surface):
    _KEPT[key] = surface
    _KEPT.move_to_end(key)
    size = sum(kept.nbytes for kept in _KEPT.values())
    while size > _MOST_BYTES and len(_KEPT) > 1:
        size -= _KEPT.popitem(last=False)[1].nbytes


def _glows_below(record, shown, materials):
    """Notes on materials that emit light below a coat."""
    corners = shown.corners
    if "coat" not in columns_of(corners.shape[1]):
        return []
    glows = (corners[:, COLUMNS["emission"]] > 0).any(axis=1)
    slots = record.slot_of_corner[glows & (corners[:, COLUMNS["coat"]] > _THIN_COAT).any(axis=1)]
    return [("glows below", materials.graph(record.slot(slot)).name) for slot in np.unique(slots)]


def _mixed_emission(record, looks, materials):
    """Notes on materials that emit otherwise for diffuse rays than for those cast to an emitter."""
    if not {"bounced", "shadow"} <= set(looks):
        return []
    met, aimed = (looks[name].corners[:, COLUMNS["emission"]] for name in ("bounced", "shadow"))
    slots = record.slot_of_corner[(abs(met - aimed) > 1e-3 * np.maximum(met, aimed)).any(axis=1)]
    return [("sampled", materials.graph(record.slot(slot)).name) for slot in np.unique(slots)]


def _mixed_sides(record, looks, materials):
    """Notes on materials that shadow rays may tell the sides of, and do not."""
    if not {"back", "shadow"} <= set(looks):
        return []
    clear = [looks[name].corners[:, COLUMNS["opacity"]] < 1 for name in ("back", "shadow")]
    slots = np.unique(record.slot_of_corner[np.any(clear, axis=0)[:, 0]])
    graphs = [materials.graph(record.slot(slot)) for slot in slots]
    return [("sides", graph.name) for graph in graphs if graph.backs and graph.shadows]


def _apply(mesh, looks):
    """Give a mesh what each look is, where that is another than what stands for it else."""
    mesh.materials, mesh.paint = _materials(looks["shown"]), looks["shown"].paint
    for name in LOOKS:
        setattr(mesh, name, None)
        if name in looks:
            look = Look(_materials(looks[name]), looks[name].paint)
            setattr(mesh, name, None if _same(look, look_of(mesh, LOOKS[name])) else look)
    if looks["shown"].normals is not None:
        mesh.corner_normal, mesh.flat = looks["shown"].normals, False


def _materials(surface):
    values = {}
    for name, columns in columns_of(surface.corners.shape[1]).items():
        # Gloss that is nowhere is left out: it takes no room then.
        if name in QUANTITIES and not (name in GLOSS and _is_default(surface, name)):
            one = held_once(surface.corners[:, columns])
            few = one[:1] if one.strides[0] == 0 else one
            values[name] = np.broadcast_to(few.astype(np.float64), one.shape)
    return Materials(**values)


def _is_default(surface, name):
    return (surface.corners[:, COLUMNS[name]] == np.float32(QUANTITIES[name].default)).all()


def _same(one, two):
    paints = [look.paint.digest() if look.paint is not None else b"" for look in (one, two)]
    return one.materials.equals(two.materials) and paints[0] == paints[1]
