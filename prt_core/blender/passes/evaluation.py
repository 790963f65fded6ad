"""Evaluates the surfaces of some meshes: corners, lattices between, and what there is to say."""

from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.passes.closures import LEFT_OUT
from prt_core.blender.passes.corners import CornerGroups
from prt_core.blender.passes.lattices import (
    ROUNDS,
    Lattices,
    Triangles,
    lattice_weights,
    n_samples,
)
from prt_core.blender.passes.place_reader import PlaceReader
from prt_core.blender.passes.quantities import (
    COLUMNS,
    N_COLUMNS,
    N_GLOSSY_COLUMNS,
    columns_of,
    default_columns,
    settled,
)
from prt_core.reflectance import QUANTITIES
from prt_core.reflectance.bump import bump_mean, bump_strength
from prt_core.runtime.array_parts import held_once
from prt_core.scene.lattice_paint import LatticePaint

# Which rays see each look.
_RAYS = {"shown": "camera", "bounced": "diffuse", "back": "diffuse", "shadow": "shadow"}
# Normals between points may differ by this cosine from what the points show.
_FINE_NORMALS = np.cos(np.radians(8))


@dataclass
class Surface:
    """What is known of one mesh's surface."""

    corners: np.ndarray
    paint: LatticePaint | None = None
    normals: np.ndarray | None = None
    notes: list = field(default_factory=list)

    @property
    def nbytes(self):
        arrays = [self.corners if self.corners.strides[0] else self.corners[:1], self.normals]
        return sum(a.nbytes for a in arrays if a is not None) + (
            self.paint.nbytes if self.paint else 0
        )


class Evaluation:
    """Asks for the surfaces of meshes that are not known yet.

    `look`: "shown", as rays of the camera see fronts; "bounced", as diffuse rays meet them; "back",
    as these meet backs; "shadow", as shadow rays meet fronts. Gloss is evaluated where `materials`
    are glossy.
    """

    def __init__(self, uid, meshes, records, all_records, materials, levels, look):
        self._meshes, self._records, self._materials = meshes, records, materials
        self._triangles = Triangles(meshes, records, materials.graph, look == "back")
        self._family = self._triangles.families()
        self._levels = levels
        self._reader = PlaceReader(
            uid, self._triangles, records, all_records, materials.graph, _RAYS[look],
            materials.gloss,
        )  # fmt: skip
        self._default = default_columns(N_GLOSSY_COLUMNS if materials.gloss else N_COLUMNS)
        self._signs = [set() for _ in meshes]
        self._unseen = np.zeros(len(meshes), np.int64)

    def surfaces(self):
        """List of `Surface`, as a generator of `Progress`."""
        if not len(self._triangles.mesh):
            return [self._surface(i, None, None, None) for i in range(len(self._meshes))]
        corners = CornerGroups(self._triangles, self._meshes, self._records)
        lattices, more = self._first_lattices()
        more = [corners.places(), *more]
        values = yield from self._read(more)
        n = len(more[0][0])
        lattices.take(values[n:])
        split = corners.split(values[:n])
        of_split = (yield from self._read([split])) if len(split[0]) else values[:0]
        yield from self._refine(lattices)
        of_corner = corners.values(values[:n], of_split)
        return [self._surface(i, *of_corner[i], lattices) for i in range(len(self._meshes))]

    def _read(self, places):
        """(n, n_columns) values at a list of places (triangles, weights), whole and noted."""
        triangle = np.concatenate([t for t, _ in places])
        weights = np.concatenate([w for _, w in places])
        values, signs = yield from self._reader.values(triangle, weights)
        # Normals are those of the front, whichever side was looked at.
        values[:, COLUMNS["normal"]] *= self._triangles.side
        self._note(triangle, values, signs)
        return self._whole(triangle, values)

    def _first_lattices(self):
        lattices, more = Lattices(), []
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
                break
            lattices.take((yield from self._read(more)))
        lattices.drop_even()
        for owner in np.unique(self._triangles.mesh[lattices.cut]) if len(lattices.cut) else ():
            self._signs[owner].add(("coarse", self._name_of(lattices.cut, owner)))

    def _name_of(self, triangles, mesh):
        of_mesh = triangles[self._triangles.mesh[triangles] == mesh]
        return self._graph_of(mesh, self._triangles.slot[of_mesh[0]]).name

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
        for pair in np.unique(pairs[unseen]):
            mine = pairs == pair
            seen = mine & ~np.isnan(values[:, 0])
            mean = values[seen].mean(axis=0) if seen.any() else self._default
            values[unseen[pairs[unseen] == pair]] = mean
        return values

    def _surface(self, index, used, values, lattices):
        """The `Surface` of a mesh from the values (n, n_columns) of its used corners."""
        mesh, record = self._meshes[index], self._records[index]
        corners = np.tile(self._default, (len(mesh.corner_vertex), 1))
        notes = self._notes_of(index)
        if used is None or not len(used):
            return Surface(held_once(corners), notes=notes)
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
                self._dim(record, mine[own], levels[own], starts[own], samples)
                if normals is not None and _finer(levels[own], starts[own], samples):
                    notes.append(("fine normals", self._name_of(mine[own], index)))
                paint = _paint(corners, corner, levels[own], starts[own], samples)
        if cut:
            most = QUANTITIES["albedo"].most
            notes.append(("line", f"{mesh.name}: albedo outside 0..{most} was cut to it"))
        # The normals are known by now, and most meshes are of one material all over.
        corners[:, COLUMNS["normal"]] = 0
        return Surface(held_once(corners), paint, normals, notes)

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
        softens = np.array([self._materials.graph(uid).softens for uid in record.slots])
        dimmed = bent & softens[np.minimum(record.slot_of_corner, len(softens) - 1)]
        cosine = np.einsum("nx,nx->n", normals[dimmed], mesh.corner_normal[dimmed])
        strength = np.float32(bump_strength(cosine))
        corners[dimmed, COLUMNS["bump"].start] = strength
        for name in _evenly(corners):
            corners[dimmed, COLUMNS[name]] *= bump_mean(strength)[:, None]
        return normals

    def _dim(self, record, triangles, levels, starts, samples):
        """Albedo of samples on bent normals is what is left of even light (see `bump_mean`)."""
        for level, start, triangle in zip(levels, starts, triangles, strict=True):
            graph = self._materials.graph(record.slot(self._triangles.slot[triangle]))
            if graph.bends and graph.softens:
                part = samples[start : start + n_samples(level, 1)]
                cosine = part[:, COLUMNS["normal"]] @ self._triangles.normal[triangle]
                for name in _evenly(part):
                    part[:, COLUMNS[name]] *= bump_mean(bump_strength(cosine))[:, None]

    def _notes_of(self, index):
        record, notes = self._records[index], []
        for kind, name in sorted(self._signs[index]):
            line = kind in LEFT_OUT and ("line", _left_out(record, name, kind))
            notes.append(line or (kind, name))
        for slot in np.unique(record.slot_of_corner):
            graph = self._materials.graph(record.slot(slot))
            kinds = "rough scatters tinted bumpy toon portals lengths views holdouts".split()
            notes += [(kind, graph.name) for kind in kinds if getattr(graph, kind)]
            notes += [("line", line) for line in _missing_images(graph)]
            notes += [("line", _left_out(record, graph.name, k)) for k in sorted(graph.left_out)]
        if self._unseen[index]:
            notes.append(
                ("line", f"{record.name}: Cycles did not see {self._unseen[index]} places; they "
                         "have the mean of the others; is something in the same place?")
            )  # fmt: skip
        return notes


def _left_out(record, material, kind):
    return f"material '{material}' on {record.name}: {LEFT_OUT[kind]}"


def _evenly(values):
    """Names of what leaves evenly to all sides."""
    return {"albedo", "stand_in"} & set(columns_of(values.shape[1]))


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
    """The `LatticePaint` of what is not its default.

    Normals between the corners are means of theirs, and so is what belongs to bent ones.
    """
    names = []
    known = columns_of(corners.shape[1])
    for name in QUANTITIES:
        if name not in known:
            continue
        quantity, columns = QUANTITIES[name], COLUMNS[name]
        both = corners[:, columns], samples[:, columns]
        if name == "bump":
            continue
        if quantity.default is None or any((v != np.float32(quantity.default)).any() for v in both):
            names.append(name)
    return LatticePaint(
        {name: corners[:, COLUMNS[name]] for name in names},
        triangle_corners,
        levels,
        starts,
        {name: np.ascontiguousarray(samples[:, COLUMNS[name]]) for name in names},
    )
