"""The materials of meshes, evaluated by Cycles: at their corners, and between them where they vary.

Everything is asked for in a few renders of all objects together. What was asked is kept, so that a
scene that has not changed is not rendered again.
"""

import hashlib
import time
from collections import OrderedDict

import bpy
import numpy as np

from prt_core.blender.identity import by_uid
from prt_core.blender.passes.digests import MaterialDigests
from prt_core.blender.passes.evaluation import Evaluation
from prt_core.blender.passes.graphs import graph_of
from prt_core.blender.passes.lattices import Triangles, first_levels
from prt_core.blender.passes.quantities import COLUMNS, lines_of
from prt_core.errors import PRTError
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.runtime.progress import Progress

_KEPT, _MOST_BYTES = OrderedDict(), 256 << 20


def evaluate_surfaces(uid, meshes, records, messages, pace=None):
    """Give meshes their materials, as a generator of `Progress`.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene.
    meshes : list of Mesh
        `materials`, `paint` and, where a material bends them, `corner_normal` are set.
    records : list of SurfaceRecord
        Of the meshes; those with None keep the materials that they have.
    messages : list of str
        Told what was left out.
    pace : float, optional
        Seconds a step may take where a window waits; a render of a second or so cannot be cut. It
        comes after steps of the stage `materials` that are as long as two of these together, so
        that the window can say what it will wait for.

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
    materials = _Materials(scene)
    triangles = Triangles(meshes, records, materials.graph)
    family = triangles.families()
    levels = first_levels(triangles, family, _size_of(meshes))
    keys = []
    for index, (mesh, record) in enumerate(zip(meshes, records, strict=True)):
        mine = levels[triangles.mesh == index]
        keys.append(_key(mesh, record, mine, materials))
    missing = [i for i, key in enumerate(keys) if key not in _KEPT]
    surfaces = {i: _KEPT[key] for i, key in enumerate(keys) if key in _KEPT}
    if missing:
        start = time.perf_counter()
        while pace is not None and time.perf_counter() - start < 2 * pace:
            yield Progress("materials", 0, 0)
        chosen = np.isin(triangles.mesh, missing)
        evaluation = Evaluation(
            uid, [meshes[n] for n in missing], [records[n] for n in missing],
            records, materials, levels[chosen],
        )  # fmt: skip
        surfaces |= dict(zip(missing, (yield from evaluation.surfaces()), strict=True))
    notes = []
    for index, (mesh, key) in enumerate(zip(meshes, keys, strict=True)):
        _keep(key, surfaces[index])
        _apply(mesh, surfaces[index])
        notes += surfaces[index].notes
    messages += [line for line in lines_of(notes) if line not in messages]


class _Materials:
    """The graphs and digests of a scene's materials, each worked out once."""

    def __init__(self, scene):
        self._by_uid = {m.session_uid: m for m in bpy.data.materials}
        self._graphs, self._digests = {}, MaterialDigests(scene.frame_current)
        self.look = str(getattr(getattr(scene, "cycles", None), "shading_system", ""))

    def graph(self, uid):
        """The `Graph` of a material by its `session_uid`."""
        if uid not in self._graphs:
            self._graphs[uid] = graph_of(self._by_uid.get(uid))
        return self._graphs[uid]

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


def _key(mesh, record, levels, materials):
    digest = hashlib.blake2b(digest_size=16)
    for array in (mesh.vertices, mesh.corner_vertex, mesh.corner_normal, mesh.triangle_corners,
                  record.slot_of_corner, record.key_of_corner, levels):  # fmt: skip
        digest.update(np.ascontiguousarray(array))
    digest.update(record.digest + materials.digest(record) + materials.look.encode())
    digest.update(record.name.encode())
    return digest.digest()


def _keep(key, surface):
    _KEPT[key] = surface
    _KEPT.move_to_end(key)
    size = sum(kept.nbytes for kept in _KEPT.values())
    while size > _MOST_BYTES and len(_KEPT) > 1:
        size -= _KEPT.popitem(last=False)[1].nbytes


def _apply(mesh, surface):
    mesh.materials = Materials(
        **{
            name: surface.corners[:, COLUMNS[name]].astype(np.float64)
            for name in COLUMNS
            if name in QUANTITIES
        }
    )
    mesh.paint = surface.paint
    if surface.normals is not None:
        mesh.corner_normal = surface.normals
