"""The materials of meshes, evaluated by Cycles: at their corners, and between them where they vary.

Everything is asked for in a few renders of all objects together. What was asked is kept, so that a
scene that has not changed is not rendered again.
"""

import hashlib
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.identity import by_uid
from prt_core.blender.passes.asking import Asking
from prt_core.blender.passes.corners import CornerGroups
from prt_core.blender.passes.digests import MaterialDigests
from prt_core.blender.passes.graphs import graph_of
from prt_core.blender.passes.lattices import (
    MOST,
    ROUNDS,
    TOLERANCE,
    Lattices,
    Triangles,
    first_levels,
    lattice_weights,
    n_samples,
    rough_ones,
    unlike,
)
from prt_core.blender.passes.quantities import COLUMNS, N_COLUMNS, lines_of, settled
from prt_core.errors import PRTError
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.scene.lattice_paint import LatticePaint

_KEPT, _MOST_BYTES = OrderedDict(), 256 << 20
_GREY = 0.8
# Normals between points may differ by this cosine from what the points show.
_FINE_NORMALS = np.cos(np.radians(8))


@dataclass
class _Surface:
    """What is known of one mesh's surface."""

    corners: np.ndarray
    paint: LatticePaint | None = None
    normals: np.ndarray | None = None
    notes: list = field(default_factory=list)

    @property
    def nbytes(self):
        arrays = [self.corners, self.normals]
        return sum(a.nbytes for a in arrays if a is not None) + (
            self.paint.nbytes if self.paint else 0
        )


def evaluate_surfaces(uid, meshes, records, messages):
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
    surfaces = {}
    if missing:
        some = [meshes[i] for i in missing], [records[i] for i in missing]
        chosen = np.isin(triangles.mesh, missing)
        asked = _Evaluation(uid, *some, records, materials, levels[chosen])
        surfaces = dict(zip(missing, (yield from asked.surfaces()), strict=True))
    notes = []
    for index, (mesh, key) in enumerate(zip(meshes, keys, strict=True)):
        surface = surfaces[index] if index in surfaces else _KEPT[key]
        _keep(key, surface)
        _apply(mesh, surface)
        notes += surface.notes
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


class _Evaluation:
    """Asks for the surfaces of meshes that are not known yet."""

    def __init__(self, uid, meshes, records, all_records, materials, levels):
        self._meshes, self._records, self._materials = meshes, records, materials
        self._triangles = Triangles(meshes, records, materials.graph)
        self._family = self._triangles.families()
        self._levels = levels
        self._asking = Asking(uid, self._triangles, records, all_records, materials.graph)
        self._signs = [set() for _ in meshes]
        self._unseen = np.zeros(len(meshes), np.int64)

    def surfaces(self):
        """List of `_Surface`, as a generator of `Progress`."""
        if not len(self._triangles.mesh):
            return [self._surface(i, None, None, None) for i in range(len(self._meshes))]
        corners = CornerGroups(self._triangles, self._meshes, self._records)
        lattices, more = self._first_lattices()
        more = [corners.places(), *more]
        values = yield from self._ask(more)
        n = len(more[0][0])
        lattices.take(values[n:])
        split = corners.split(values[:n])
        of_split = (yield from self._ask([split])) if len(split[0]) else values[:0]
        yield from self._refine(lattices)
        of_corner = corners.values(values[:n], of_split)
        return [self._surface(i, *of_corner[i], lattices) for i in range(len(self._meshes))]

    def _ask(self, places):
        """(n, 13) values at a list of places (triangles, weights), whole and noted."""
        triangle = np.concatenate([t for t, _ in places])
        weights = np.concatenate([w for _, w in places])
        values, signs = yield from self._asking.values(triangle, weights)
        self._note(triangle, values, signs)
        return self._whole(triangle, values)

    def _first_lattices(self):
        lattices, more = _Growing(), []
        families, of = np.unique(self._family, return_index=True)
        for level in np.unique(self._levels[of]):
            if level > 1:
                which = (self._levels[of] == level) & (families >= 0)
                more.append(lattices.add(int(level), families[which], of[which]))
        return lattices, more

    def _refine(self, lattices):
        """Make lattices finer where their samples differ, a few times."""
        total = sum(n_samples(level, len(f)) for level, f, _, _ in lattices.blocks)
        for _ in range(ROUNDS):
            more, total = lattices.finer(self._triangles, total)
            if not more:
                return
            lattices.take((yield from self._ask(more)))
        for owner in np.unique(self._triangles.mesh[lattices.cut]) if len(lattices.cut) else ():
            self._signs[owner].add(("coarse", self._name_of(lattices.cut, owner)))

    def _name_of(self, triangles, mesh):
        some = triangles[self._triangles.mesh[triangles] == mesh]
        return self._graph_of(mesh, self._triangles.slot[some[0]]).name

    def _graph_of(self, mesh, slot):
        return self._materials.graph(self._records[mesh].slot(slot))

    def _note(self, triangle, values, signs):
        """Remember of which materials there is something to say."""
        triangles = self._triangles
        for kind, where in signs.items():
            pairs = np.stack([triangles.mesh[triangle], triangles.slot[triangle]], axis=1)[where]
            for mesh, slot in np.unique(pairs, axis=0):
                self._signs[mesh].add((kind, self._graph_of(mesh, slot).name))
        unseen = np.isnan(values[:, 0])
        self._unseen += np.bincount(triangles.mesh[triangle[unseen]], minlength=len(self._unseen))

    def _whole(self, triangle, values):
        """`values`, those that were not seen being the mean of the same material's on the mesh."""
        unseen = np.flatnonzero(np.isnan(values[:, 0]))
        if not len(unseen):
            return values
        pairs = self._triangles.mesh[triangle] * 65536 + self._triangles.slot[triangle]
        default = np.zeros(N_COLUMNS, np.float32)
        default[COLUMNS["albedo"]], default[COLUMNS["opacity"]] = _GREY, 1
        for pair in np.unique(pairs[unseen]):
            mine = pairs == pair
            seen = mine & ~np.isnan(values[:, 0])
            mean = values[seen].mean(axis=0) if seen.any() else default
            values[unseen[pairs[unseen] == pair]] = mean
        return values

    def _surface(self, index, used, values, lattices):
        """The `_Surface` of a mesh from the values (n, 13) of its used corners."""
        mesh, record = self._meshes[index], self._records[index]
        corners = np.zeros((len(mesh.corner_vertex), N_COLUMNS), np.float32)
        corners[:, COLUMNS["albedo"]], corners[:, COLUMNS["opacity"]] = _GREY, 1
        notes = self._notes_of(index)
        if used is None or not len(used):
            return _Surface(corners, notes=notes)
        corners[used] = values
        corners, cut = settled(corners)
        normals = self._normals(record, mesh, used, corners)
        mine = np.flatnonzero(self._triangles.mesh == index)
        paint = None
        mine = mine[self._family[mine] >= 0]
        if len(mine):
            levels, starts, samples = lattices.packed(self._family[mine])
            own = levels > 1
            if own.any():
                samples, also = settled(samples)
                cut |= also
                corner = self._triangles.corner[mine[own]]
                if normals is not None and _finer(levels[own], starts[own], samples):
                    notes.append(("fine normals", self._name_of(mine[own], index)))
                paint = _paint(corners, corner, levels[own], starts[own], samples)
        if cut:
            notes.append(("line", f"{mesh.name}: albedo outside 0..1 was cut to it"))
        return _Surface(corners, paint, normals, notes)

    def _normals(self, record, mesh, used, corners):
        """Corner normals as materials bend them; None where none does."""
        bent, known = np.zeros((2, len(corners)), bool)
        known[used] = True
        for slot in np.unique(record.slot_of_corner):
            if self._materials.graph(record.slot(slot)).bends:
                bent |= record.slot_of_corner == slot
        normal = corners[:, COLUMNS["normal"]].astype(np.float64)
        length = np.linalg.norm(normal, axis=1)
        bent &= known & (length > 0.5)
        if not bent.any():
            return None
        normals = mesh.corner_normal.copy()
        normals[bent] = normal[bent] / length[bent][:, None]
        return normals

    def _notes_of(self, index):
        record, notes = self._records[index], sorted(self._signs[index])
        for slot in np.unique(record.slot_of_corner):
            graph = self._materials.graph(record.slot(slot))
            kinds = ("rough", "scatters", "tinted", "paths", "backs")
            notes += [(kind, graph.name) for kind in kinds if getattr(graph, kind)]
            notes += [("line", line) for line in _missing_images(graph)]
        if self._unseen[index]:
            notes.append(
                ("line", f"{record.name}: Cycles did not see {self._unseen[index]} places; they "
                         "have the mean of the others; is something in the same place?")
            )  # fmt: skip
        return notes


def _missing_images(graph):
    for image in graph.images:
        if image.packed_files or image.source not in {"FILE", "TILED"}:
            continue
        path = bpy.path.abspath(image.filepath, library=image.library)
        lost = not image.size[0]
        if image.source == "TILED" and "<UDIM>" in path and not image.is_dirty:
            files = [path.replace("<UDIM>", str(tile.number)) for tile in image.tiles]
            lost = not all(Path(file).is_file() for file in files)
        if lost:
            yield (
                f"image '{image.name}': no pixels; its file '{path}' is missing or unreadable; "
                f"material '{graph.name}' shows what Cycles shows then"
            )
    for node in graph.without_image:
        yield f"material '{graph.name}': node '{node}' has no image; Cycles decides what is shown"


def _finer(levels, starts, samples):
    """Whether normals between the corners differ from those in the corners."""
    normal = samples[:, COLUMNS["normal"]]
    for level, start in {(int(a), int(b)) for a, b in zip(levels, starts, strict=True)}:
        own = normal[start : start + n_samples(level, 1)]
        weights = lattice_weights(level)
        corner = own[np.argmax(weights, axis=0)]
        between = weights @ corner
        length = np.linalg.norm(between, axis=1) * np.linalg.norm(own, axis=1)
        if (np.einsum("mx,mx->m", between, own) < _FINE_NORMALS * length).any():
            return True
    return False


def _paint(corners, triangle_corners, levels, starts, samples):
    """The `LatticePaint` of what is not its default."""
    names = []
    for name, quantity in QUANTITIES.items():
        columns = COLUMNS[name]
        both = corners[:, columns], samples[:, columns]
        if quantity.default is None or any((v != np.float32(quantity.default)).any() for v in both):
            names.append(name)
    return LatticePaint(
        {name: corners[:, COLUMNS[name]] for name in names},
        triangle_corners,
        levels,
        starts,
        {name: np.ascontiguousarray(samples[:, COLUMNS[name]]) for name in names},
    )


class _Growing(Lattices):
    """Lattices while they are sampled: blocks of (level, families, triangles, values)."""

    def __init__(self):
        super().__init__()
        self._waiting, self._before, self.cut = [], {}, np.zeros(0, np.int64)

    def add(self, level, families, triangles):
        """Places of new lattices: triangles and weights."""
        self._waiting.append((level, families, triangles))
        weights = lattice_weights(level)
        return np.repeat(triangles, len(weights)), np.tile(weights, (len(triangles), 1))

    def take(self, values):
        """The values of all places that were added, in order."""
        first = 0
        for level, families, triangles in self._waiting:
            n = n_samples(level, len(families))
            block = values[first : first + n].reshape(len(families), -1, N_COLUMNS)
            self.blocks.append((level, families, triangles, block))
            first += n
        self._waiting = []

    def finer(self, triangles, total):
        """Places of lattices twice as fine where samples differ, and the samples there are then."""
        more, kept = [], []
        for level, families, first, values in self.blocks:
            looks = _scaled(values)
            differ = rough_ones(level, looks) > TOLERANCE
            for number in np.flatnonzero(differ):
                before = self._before.get(int(families[number]))
                if before is not None:
                    coarse_level, coarse = before
                    off = unlike(level, looks[number][None], coarse_level, coarse[None])
                    differ[number] = off[0] > TOLERANCE
            # A texel is seen by four samples along its side, and no more are needed.
            enough = level >= 4 * np.sqrt(2 * triangles.texels[first])
            differ &= ~enough & (2 * level <= 256)
            fine = np.flatnonzero(differ)
            room = (MOST - total) // max(1, n_samples(2 * level, 1) - n_samples(level, 1))
            if len(fine) > room:
                self.cut = np.concatenate([self.cut, first[fine[max(0, room) :]]])
                fine = fine[: max(0, room)]
            total += (n_samples(2 * level, 1) - n_samples(level, 1)) * len(fine)
            rest = np.setdiff1d(np.arange(len(families)), fine)
            if len(rest):
                kept.append((level, families[rest], first[rest], values[rest]))
            if len(fine):
                for number in fine:
                    self._before[int(families[number])] = level, looks[number]
                more.append(self.add(2 * level, families[fine], first[fine]))
        self.blocks = kept
        return more, total

    def packed(self, family):
        """See `Lattices`."""
        whole = Lattices()
        whole.blocks = [(level, families, values) for level, families, _, values in self.blocks]
        return whole.packed(family)


def _scaled(values):
    """Samples as they are compared: emission by its largest value, normals by a quarter."""
    looks = values.copy()
    emission = looks[..., COLUMNS["emission"]]
    emission /= max(1.0, float(emission.max(initial=0)))
    looks[..., COLUMNS["normal"]] = 0
    return looks
