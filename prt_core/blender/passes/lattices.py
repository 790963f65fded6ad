"""Where materials are sampled: at corners that differ, and on lattices in triangles that may.

Triangles that show the same part of the same images are sampled once. Large triangles begin with
finer lattices than small ones; where samples differ from what lies between their neighbours the
lattice is made twice as fine, a few times.
"""

import numpy as np

from prt_core.blender.passes.quantities import COLUMNS, DIRECTIONS, columns_of, compared
from prt_core.scene.lattice import lattice_coordinates, lattice_of_hits, lattice_size
from prt_core.scene.lattice_paint import lattice_starts

# Samples of the first lattices, and of all; the finest lattice; and how often they are refined.
FIRST, MOST = 20_000, 250_000
_FINEST, ROUNDS = 256, 3
# The longest edge without a lattice, in units of the receivers' size: from, to.
_TARGET, _LEAST_TARGET = 1 / 24, 1 / 400
# The finest lattice where there are fewer texels than triangles.
_BETWEEN = 4
# Values that differ by less are taken to be the same.
TOLERANCE = 1 / 96
# And normals that differ by less.
_BENT = 0.1


class Triangles:
    """The triangles of some meshes, one after the other.

    Parameters
    ----------
    meshes : list of Mesh
    records : list of SurfaceRecord
    graph : function
        `Graph` of a material by its `session_uid`.
    back : bool
        Whether their backs are looked at.

    Attributes
    ----------
    corners : (n, 3, 3) float64
        Positions.
    corner : (n, 3) int
        Corners of its mesh.
    normal : (n, 3) float64
        Of the front.
    side : int
        1 where fronts are looked at, -1 for backs.
    radius : (n,) float64
        Of the inscribed circle.
    mesh, slot : (n,) int
    even, flat, smooth : (n,) bool
        Whether its material is the same everywhere; whether it depends on UV maps alone; whether it
        has no corners of its own, as a chequer has.
    """

    def __init__(self, meshes, records, graph, back=False):
        self.side = -1 if back else 1
        corner = [mesh.solid_triangles() for mesh in meshes]
        self.mesh = np.repeat(np.arange(len(meshes)), [len(c) for c in corner])
        self.corner = np.concatenate(corner) if corner else np.zeros((0, 3), np.int64)
        self.corners = np.concatenate(
            [m.vertices[m.corner_vertex[c]] for m, c in zip(meshes, corner, strict=True)]
        )
        a, b, c = np.moveaxis(self.corners, 1, 0)
        cross = np.cross(b - a, c - a)
        doubled = np.linalg.norm(cross, axis=1)
        self.normal = cross / np.maximum(doubled, 1e-300)[:, None]
        edges = np.stack([np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))])
        self.edge, self.area = edges.max(axis=0), doubled / 2
        self.radius = doubled / edges.sum(axis=0)
        self.slot = np.concatenate(
            [r.slot_of_corner[c[:, 0]] for r, c in zip(records, corner, strict=True)]
        )
        self.even, self.smooth = np.ones((2, len(self.mesh)), bool)
        self.flat = np.zeros(len(self.mesh), bool)
        self.texels = np.full(len(self.mesh), np.inf)
        self._family = np.zeros(len(self.mesh), np.uint64)
        for index, record in enumerate(records):
            mine = np.flatnonzero(self.mesh == index)
            for slot in np.unique(self.slot[mine]):
                of_slot = mine[self.slot[mine] == slot]
                behind = graph(record.slot(slot))
                self.even[of_slot], self.smooth[of_slot] = behind.even, behind.smooth
                if not behind.even and behind.flat and record.uv:
                    self._lay_out(of_slot, record, behind, record.slot(slot))

    def _lay_out(self, of_slot, record, graph, uid):
        """How many texels lie in triangles that show images alone, and which show the same."""
        self.flat[of_slot] = True
        sizes = [max(1, image.size[0]) * max(1, image.size[1]) for image in graph.images]
        uv = [layer[self.corner[of_slot]].astype(np.float64) for layer in record.uv]
        share = np.zeros(len(of_slot))
        for layer in uv:
            (bx, by), (cx, cy) = ((layer[:, k] - layer[:, 0]).T for k in (1, 2))
            share = np.maximum(share, np.abs(bx * cy - by * cx) / 2)
        self.texels[of_slot] = share * max(sizes, default=1)
        self._family[of_slot] = np.uint64(uid + 1)
        with np.errstate(over="ignore"):
            for column in np.concatenate(
                [layer.reshape(len(of_slot), 6) for layer in uv], axis=1
            ).T:
                key = np.rint(column * 65536).astype(np.int64).astype(np.uint64)
                key = (self._family[of_slot] ^ key) * np.uint64(0xBF58476D1CE4E5B9)
                self._family[of_slot] = key ^ (key >> np.uint64(29))

    @property
    def facing(self):
        """(n, 3) float64: normals of the side that is looked at."""
        return self.side * self.normal

    def families(self):
        """(n,) int of those that vary: which have the same samples; -1 for the others."""
        family = np.full(len(self.mesh), -1, np.int64)
        alone = np.flatnonzero(~self.even & ~self.flat)
        shared = np.flatnonzero(~self.even & self.flat)
        _, which = np.unique(self._family[shared], return_inverse=True)
        family[shared] = which
        family[alone] = (which.max() + 1 if len(which) else 0) + np.arange(len(alone))
        return family

    def places(self, triangle, weights, pull, lift):
        """World positions a little inside triangles and above them, and where they should meet.

        Parameters
        ----------
        triangle : (m,) int
        weights : (m, 3) float
        pull : float
            How far towards the middle, as a share of the way.
        lift : (m,) float

        Returns
        -------
        start, target : (m, 3) float64
        """
        weights = (1 - pull) * np.asarray(weights) + pull / 3
        target = np.einsum("mk,mkx->mx", weights, self.corners[triangle])
        return target + lift[:, None] * self.facing[triangle], target


def first_levels(triangles, family, size):
    """(n,) int64: the level of the first lattice of each triangle; 1 is none.

    Parameters
    ----------
    triangles : Triangles
    family : (n,) int
    size : float
        Of what receives light.
    """
    levels = np.ones(len(family), np.int64)
    varying = np.flatnonzero(family >= 0)
    if not len(varying):
        return levels
    member = family[varying]
    n = member.max() + 1
    together = np.bincount(member, triangles.area[varying], n)
    longest = np.zeros(n)
    np.maximum.at(longest, member, triangles.edge[varying])
    texels = np.full(n, np.inf)
    np.minimum.at(texels, member, triangles.texels[varying])
    # Many that show the same count as one of all their area.
    edge = np.maximum(longest, np.sqrt(2 * together))
    # Between the texels of an image colours change as its file encodes them, not evenly.
    finest = np.clip(np.ceil(2 * np.sqrt(2 * texels)), 2, _FINEST)
    target = _TARGET * max(size, 1e-9)
    chosen = np.ones(n)
    coarsest = None
    while True:
        wanted = np.minimum(np.clip(np.ceil(edge / target), 1, _FINEST), finest)
        # Texels of most images are met evenly.
        wanted = 2 ** np.ceil(np.log2(wanted))
        cost = np.where(wanted > 1, (wanted + 1) * (wanted + 2) / 2, 0).sum()
        if cost <= FIRST:
            chosen = wanted
            if coarsest or target <= _LEAST_TARGET * size:
                break
            target /= 1.3
        elif (chosen > 1).any():
            break
        else:
            coarsest = True
            target *= 1.3
    levels[varying] = chosen[member].astype(np.int64)
    return levels


def lattice_weights(level):
    """(m, 3) float64: weights of the three corners at each place of a lattice."""
    uv = lattice_coordinates(int(level)) / level
    return np.column_stack([1 - uv.sum(axis=1), uv])


def unlike(level, values, step=2):
    """(n,) float: how far values on lattices are from what some of them say in between.

    Parameters
    ----------
    level : int
    values : (n, lattice_size, n_columns) array
    step : int
        A divisor of the level: every second, ... one of them.
    """
    coarse = np.flatnonzero((lattice_coordinates(level) % step == 0).all(axis=1))
    weights = lattice_weights(level)
    cell, shares = lattice_of_hits(np.full(len(weights), level // step), weights[:, 1:])
    between = np.einsum("mk,nmkc->nmc", shares, values[:, coarse][:, cell])
    return np.abs(values - between).max(axis=(1, 2))


class Lattices:
    """The samples of families of triangles.

    Attributes
    ----------
    blocks : list of (level, families, triangles, values)
        triangles (n_families,) int: one of each family; values (n_families, lattice_size,
        n_columns) float32.
    cut : (n,) int
        Triangles whose lattices were to be finer, for which there was no room.
    """

    def __init__(self):
        self.blocks = []
        self._waiting, self.cut = [], np.zeros(0, np.int64)

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
            block = values[first : first + n].reshape(len(families), -1, values.shape[1])
            self.blocks.append((level, families, triangles, block))
            first += n
        self._waiting = []

    def finer(self, triangles, total):
        """Places of lattices twice as fine where samples differ, and the samples there are then."""
        more, kept = [], []
        for level, families, first, values in self.blocks:
            looks = _scaled(values)
            differ = unlike(level, looks) > TOLERANCE
            # A texel is seen by four samples along its side, and no more are needed.
            enough = level >= np.maximum(4 * np.sqrt(2 * triangles.texels[first]), _BETWEEN)
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
                more.append(self.add(2 * level, families[fine], first[fine]))
        self.blocks = kept
        return more, total

    def drop_even(self):
        """Leave out lattices that say no more than their corners."""
        kept = []
        for level, families, first, values in self.blocks:
            differ = unlike(level, _scaled(values), level) > TOLERANCE / 2
            for name in DIRECTIONS & set(columns_of(values.shape[-1])):
                differ |= unlike(level, values[..., COLUMNS[name]], level) > _BENT
            if differ.any():
                kept.append((level, families[differ], first[differ], values[differ]))
        self.blocks = kept

    def packed(self, family):
        """Levels and starts of triangles' families, and all samples of these, one after another.

        Parameters
        ----------
        family : (n,) int

        Returns
        -------
        levels, starts : (n,) int64
            Level 1 where a family has no lattice.
        samples : (m, n_columns) float32
        """
        wanted = np.unique(family)
        level_of = np.ones(len(wanted), np.int64)
        parts = {}
        for level, families, _, values in self.blocks:
            _, mine, theirs = np.intersect1d(wanted, families, return_indices=True)
            level_of[mine] = level
            parts |= {int(m): values[t] for m, t in zip(mine, theirs, strict=True)}
        own = np.array(sorted(parts), np.int64)
        start_of = np.zeros(len(wanted), np.int64)
        start_of[own] = lattice_starts(level_of[own])
        samples = [parts[int(k)] for k in own]
        at = np.searchsorted(wanted, family)
        n_columns = samples[0].shape[1] if samples else 0
        joined = np.concatenate(samples) if samples else np.zeros((0, n_columns), np.float32)
        return level_of[at], start_of[at], joined


def _scaled(values):
    """Samples as they are compared: emission by its largest value."""
    looks = compared(values)
    emission = looks[..., COLUMNS["emission"]]
    emission /= max(1.0, float(emission.max(initial=0)))
    return looks


def n_samples(level, count):
    """How many samples lattices have."""
    return int(lattice_size(int(level))) * int(count)
