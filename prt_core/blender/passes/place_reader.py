"""Reads surfaces at many places of triangles from Cycles, and checks that it saw these places."""

from contextlib import ExitStack
from copy import copy

import bpy
import numpy as np

from prt_core.blender.identity import by_uid
from prt_core.blender.passes.cryptomatte import name_number
from prt_core.blender.passes.gloss import with_gloss
from prt_core.blender.passes.gloss_copies import telling_gloss
from prt_core.blender.passes.graphs import graph_of
from prt_core.blender.passes.light_paths import answering
from prt_core.blender.passes.probe import MOST_PLACES, probe
from prt_core.blender.passes.quantities import (
    COLUMNS,
    DIRECTIONS,
    N_COLUMNS,
    N_GLOSSY_COLUMNS,
    columns_of,
    quantities_of,
)
from prt_core.blender.passes.traces import switched
from prt_core.blender.render_scene import rendered_layer
from prt_core.errors import PRTError
from prt_core.runtime.progress import Progress

# How far a place is pulled inwards, one try after the other.
_PULLS = (1e-3, 0.04, 0.3)
# How many surfaces may lie in one place.
_LAYERS = 4
# How much light must go straight through for what lies behind to show.
_CLEAR = 1e-4
_NOISY_SAMPLES = 64
# The name of what is shown where there is no material.
_DEFAULT = "default_surface"


class PlaceReader:
    """Reads the surfaces of some triangles.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene.
    triangles : Triangles
    records : list of SurfaceRecord
        By the mesh of the triangles.
    all_records : list of SurfaceRecord
        Of everything that may stand in the way.
    graph_of_uid : function
        `Graph` of a material by its `session_uid`.
    ray : {"camera", "diffuse", "shadow"}
        To which kind of ray Light Path nodes answer.
    gloss : bool
        Whether gloss is read as well.
    """

    def __init__(self, uid, triangles, records, all_records, graph_of_uid, ray, gloss=False):
        self._uid, self._records, self._ray, self._gloss = uid, records, ray, gloss
        self._n_columns = N_GLOSSY_COLUMNS if gloss else N_COLUMNS
        self._triangles, self._turns = _before_simulation(uid, triangles, records)
        triangles = self._triangles
        self._all, self._graph = all_records, graph_of_uid
        self._names = np.array([name_number(r.source_name) for r in records], np.uint32)
        others = np.array([name_number(r.source_name) for r in all_records], np.uint32)
        self._others, first = np.unique(others, return_index=True)
        self._owner_of_name = np.array([r.owner for r in all_records])[first]
        self._materials = np.zeros(len(triangles.mesh), np.uint32)
        for mesh, slot in np.unique(np.stack([triangles.mesh, triangles.slot], axis=1), axis=0):
            mine = (triangles.mesh == mesh) & (triangles.slot == slot)
            name = graph_of_uid(records[mesh].slot(slot)).name
            self._materials[mine] = name_number(name or _DEFAULT)
        self._owners = np.array([r.owner for r in records], np.int64)
        self._against = {}
        corners = triangles.corners.reshape(-1, 3)
        # Meshes that are scaled to nothing have no triangle.
        bounded = corners if len(corners) else np.zeros((1, 3))
        self._low, self._high = bounded.min(axis=0), bounded.max(axis=0)
        # What float32 can tell apart out here.
        self._grain = 4e-6 * float(np.abs(corners).max(initial=0)) + 1e-12

    def values(self, triangle, weights):
        """What is at places, as a generator of `Progress`.

        Parameters
        ----------
        triangle : (n,) int
        weights : (n, 3) float

        Returns
        -------
        values : (n, n_columns) float32
            See `COLUMNS`; NaN where Cycles did not see the place.
        signs : dict of str -> (n,) bool
        """
        values = np.full((len(triangle), self._n_columns), np.nan, np.float32)
        signs = {}
        for first in range(0, len(triangle), MOST_PLACES):
            yield Progress("materials", first, len(triangle))
            part = slice(first, first + MOST_PLACES)
            values[part], more = self._some(triangle[part], weights[part])
            for name, where in more.items():
                signs.setdefault(name, np.zeros(len(triangle), bool))[part] = where
        return values, signs

    def _some(self, triangle, weights):
        """Those of as many places as one render has."""
        values = np.full((len(triangle), self._n_columns), np.nan, np.float32)
        signs = {}
        left = np.arange(len(triangle))
        with self._open() as look:
            for pull in _PULLS:
                if len(left):
                    left = self._try(look, triangle, weights, left, pull, values, signs)
            # Something else lies in the same place: each is looked at without the other. Behind it
            # a third may come to light, so that takes more than one time.
            for _ in range(_LAYERS):
                rest = [
                    self._try(look.show(owners), triangle, weights, mine, _PULLS[1], values, signs)
                    for owners, mine in self._apart(triangle, left)
                ]
                left = np.concatenate([*rest, np.zeros(0, np.int64)])
        for mesh, turn in self._turns.items():
            mine = self._triangles.mesh[triangle] == mesh
            for name in DIRECTIONS & set(columns_of(self._n_columns)):
                values[mine, COLUMNS[name]] = values[mine, COLUMNS[name]] @ turn
        return values, signs

    def _try(self, look, triangle, weights, which, pull, values, signs):
        """Look at some places; the numbers of those that were not seen."""
        mine = triangle[which]
        triangles = self._triangles
        lift = np.maximum(0.3 * pull * triangles.radius[mine], self._grain)
        start, target = triangles.places(mine, weights[which], pull, lift)
        passes = look(start, -triangles.facing[mine])
        near = np.linalg.norm(passes["position"] - target, axis=1)
        near = near <= np.maximum(4 * lift, 0.02 * triangles.radius[mine])
        own = passes["name"] == self._names[triangles.mesh[mine]]
        other = ~own & np.isin(passes["name"], self._others) & (passes["share"] > _CLEAR)
        row = np.searchsorted(self._others, passes["name"][other])
        mine_of = self._owners[triangles.mesh[mine[other]]]
        pairs = np.stack([mine_of, self._owner_of_name[row]], axis=1)
        for one, two in np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0).tolist():
            self._against.setdefault(one, set()).add(two)
            self._against.setdefault(two, set()).add(one)
        # Rays that go on pass on what lies behind: emission is asked for once more.
        clear = np.flatnonzero(passes["share"] < 1 - _CLEAR)
        empty = np.zeros(len(which), bool)
        if len(clear):
            first = look(start[clear], -triangles.facing[mine[clear]], True)
            passes["emission"][clear] = first["emission"]
            empty[clear] = first["met"] & (passes["share"][clear] <= _CLEAR)
        # Faces of one mesh may lie in one place as well.
        expected = self._materials[mine]
        strange = np.isin(passes["material"], self._materials) & (passes["share"] > _CLEAR)
        good = (near & ~other & ~(strange & (passes["material"] != expected))) | empty
        for name in ("diffuse", "glossy", "transmission"):
            passes[name][empty & ~near] = 0
        for plane in passes.get("gloss", {}).values():
            plane[empty & ~near] = 0
        plain = self._without_translucent(look, mine, start, good, passes["diffuse"])
        evaluated, more = quantities_of(passes, plain)
        if self._gloss:
            evaluated, also = with_gloss(evaluated, passes)
            more |= also
        values[which[good]] = evaluated[good]
        for name, where in more.items():
            signs.setdefault(name, np.zeros(len(triangle), bool))[which[good]] = where[good]
        return which[~good]

    def _without_translucent(self, look, triangle, start, good, diffuse):
        """The diffuse pass without translucent shaders, where there are some; else None."""
        triangles, nodes = self._triangles, {}
        letting = np.zeros(len(triangle), bool)
        pairs = np.stack([triangles.mesh[triangle], triangles.slot[triangle]], axis=1)
        for mesh, slot in np.unique(pairs, axis=0):
            nodes_here = look.translucent(self._records[mesh].slot(slot))
            if nodes_here:
                letting |= (pairs == [mesh, slot]).all(axis=1)
                nodes |= {node.as_pointer(): node for node in nodes_here}
        letting = np.flatnonzero(letting & good)
        if not len(letting):
            return None
        plain = diffuse.copy()
        with ExitStack() as stack:
            for node in nodes.values():
                stack.enter_context(switched(node, "mute", True))
            plain[letting] = look(start[letting], -triangles.facing[triangle[letting]])["diffuse"]
        return plain

    def _apart(self, triangle, left):
        """Which objects to show together, and which places to look at then."""
        owner = self._owners[self._triangles.mesh[triangle[left]]]
        groups = []
        for uid in sorted(self._against):
            group = next((g for g in groups if not self._against[uid] & g), None)
            if group is None:
                groups.append({uid})
            else:
                group.add(uid)
        for group in groups:
            mine = left[np.isin(owner, sorted(group))]
            if len(mine):
                yield group, mine

    def _open(self):
        """A `_Look` into the scene as it is now."""
        scene = by_uid(bpy.data.scenes, self._uid)
        if scene is None:
            raise PRTError("scene: it was removed while its materials were read")
        every = {item.session_uid: item for item in bpy.data.objects}
        owners = {r.owner for r in self._all}
        wanted = owners | {r.source for r in self._all}
        if wanted - set(every):
            raise PRTError("scene: objects were removed while their materials were read")
        # What is instanced on vertices and faces must be there as well; it shows there only.
        on_mesh = {
            r.source for r in self._all if every[r.owner].instance_type in {"VERTS", "FACES"}
        }
        objects = {every[uid]: uid in owners | on_mesh for uid in sorted(wanted)}
        uids = {uid for r in self._all for uid in r.slots}
        materials = {m.session_uid: m for m in bpy.data.materials if m.session_uid in uids}
        noisy = any(self._graph(uid).noisy for uid in uids)
        centre = (self._low + self._high) / 2
        size = float(np.max(self._high - self._low))
        stack = ExitStack()
        for uid in materials:
            graph = self._graph(uid)
            for link in graph.displaced:
                stack.enter_context(switched(link, "is_muted", True))
            for node in graph.paths if self._ray != "camera" else ():
                stack.enter_context(answering(node, self._ray))
            for node in graph.holdouts:
                stack.enter_context(switched(node, "mute", True))
            for node in graph.bumps:
                strength = node.inputs["Strength"]
                if strength.is_linked:
                    stack.enter_context(switched(node, "mute", True))
                else:
                    stack.enter_context(switched(strength, "default_value", 0.0))
        samples = _NOISY_SAMPLES if noisy else 1
        override = rendered_layer(scene)[0].material_override
        told = [] if override is not None or not self._gloss else materials.values()
        copies = stack.enter_context(telling_gloss(told))
        built = stack.enter_context(probe(scene, objects, centre, size, samples))
        if self._gloss:
            built.tell_gloss(copies.planes)
        return _Look(stack, built, every, copies, self._graph)


def _before_simulation(uid, triangles, records):
    """Triangles where a copy of the scene has them, and the rotations that bring them there.

    In a copy Blender begins the simulation of rigid bodies anew.
    """
    scene = by_uid(bpy.data.scenes, uid)
    if scene is None or scene.rigidbody_world is None:
        return triangles, {}
    items = {
        item.session_uid: item for item in scene.objects if item.rigid_body and not item.parent
    }
    moved, turns = copy(triangles), {}
    moved.corners, moved.normal = triangles.corners.copy(), triangles.normal.copy()
    for index, record in enumerate(records):
        item = items.get(record.owner)
        if item is None or record.owner != record.source or not np.linalg.det(record.matrix):
            continue
        matrix = np.array(item.matrix_basis, np.float64) @ np.linalg.inv(record.matrix)
        mine, turn = triangles.mesh == index, matrix[:3, :3]
        moved.corners[mine] = triangles.corners[mine] @ turn.T + matrix[:3, 3]
        moved.normal[mine] = triangles.normal[mine] @ turn.T
        turns[index] = turn
    return moved, turns


class _Look:
    """An open probe."""

    def __init__(self, stack, built, every, copies, graph):
        self._stack, self._probe, self._every = stack, built, every
        self._copies, self._graph = copies, graph
        self._numbers = np.array(sorted(copies.number), np.uint32)
        self._own = np.array([copies.number[int(n)] for n in self._numbers], np.uint32)

    def __enter__(self):
        return self

    def __exit__(self, *raised):
        return self._stack.__exit__(*raised)

    def __call__(self, places, directions, first_only=False):
        passes = self._probe.look(places, directions, first_only)
        if len(self._numbers):
            row = np.searchsorted(self._numbers, passes["material"])
            row = np.minimum(row, len(self._numbers) - 1)
            copied = self._numbers[row] == passes["material"]
            passes["material"] = np.where(copied, self._own[row], passes["material"])
        return passes

    def translucent(self, uid):
        """The translucent nodes of a material as it is looked at, by its `session_uid`."""
        own, copy = self._graph(uid).translucent, self._copies.material.get(uid)
        return graph_of(copy).translucent if own and copy is not None else own

    def show(self, owners):
        """Only these objects, by their `session_uid`."""
        self._probe.show_only([self._every[uid] for uid in sorted(owners)])
        return self
