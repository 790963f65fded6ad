"""Meshes whose edges are split, without gaps: what carries colours there is made finer.

An edge is known by the places of its ends, not by its numbers: whatever shares it, faces along a
seam, three faces on one edge, or another object that was built against it, is split with it. So
borders stay closed. A triangle with one, two or three split edges becomes two, three or four.

New vertices lie in the middle of their edges, so on the flat faces that rays meet: nothing that
was baked of other meshes changes, and one caster serves all rounds. What corners hold (normals,
UVs, materials) is interpolated in the face that they came from, as renders do; a corner knows the
three corners there and their weights, so that anything else can be carried over as well (see
`Refined`).
"""

from dataclasses import replace

import numpy as np

from prt_core.errors import expect, expect_all, expect_mask
from prt_core.scene.mesh import Mesh
from prt_core.scene.paint import LOOKS, Look
from prt_core.scene.refined import Refined, RefinedPaint

# Ends of edges of different objects are one place within this share of the size of all.
_SAME = 2.0**-20
# Local places of a triangle: its corners 0, 1, 2 and the middles 3, 4, 5 of the edges that leave
# them. Children by which edges are split, a bit each; of two split edges the quadrangle that is
# left is cut along either diagonal.
_ONE = {1: [(0, 3, 2), (3, 1, 2)], 2: [(1, 4, 0), (4, 2, 0)], 4: [(2, 5, 1), (5, 0, 1)]}
_TWO = {
    3: ([(3, 1, 4), (0, 3, 4), (0, 4, 2)], [(3, 1, 4), (0, 3, 2), (3, 4, 2)], (0, 4), (3, 2)),
    6: ([(4, 2, 5), (1, 4, 5), (1, 5, 0)], [(4, 2, 5), (1, 4, 0), (4, 5, 0)], (1, 5), (4, 0)),
    5: ([(5, 0, 3), (2, 5, 3), (2, 3, 1)], [(5, 0, 3), (2, 5, 1), (5, 3, 1)], (2, 3), (5, 1)),
}
_THREE = [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]
# What the six local places are of the three corners.
LOCAL = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]], np.float64
)


class SplitMeshes:
    """The triangles of meshes while their edges are split.

    Parameters
    ----------
    meshes : sequence of Mesh

    Attributes
    ----------
    vertices : (n_vertices, 3) float64
        In the world; new ones come last.
    triangles : (n, 3) int64
        By vertices, whether they have an area or not.
    parent : (n,) int64
        Of each triangle the one that it was at first, those of all meshes one after another.
    barycentric : (n, 3, 3) float64
        Weights of that one's corners at each of its own.
    mesh_of_triangle : (n_at_first,) int64
    vertex_mesh : (n_vertices,) int64
    vertex_round : (n_vertices,) int64
        The round in which it was made, from 1 on; 0 for those that were there.
    edges : (n, 3) int64
        Number of the edge that leaves each corner; ascending by the places of their ends.
    n_edges : int
    """

    def __init__(self, meshes):
        self._meshes = meshes = expect_all("meshes", meshes, Mesh, "meshes")
        expect(meshes, "meshes: expected at least one")
        counts = [len(mesh.vertices) for mesh in meshes]
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._first = first
        self.vertices = np.concatenate([mesh.vertices for mesh in meshes])
        self.vertex_mesh = np.repeat(np.arange(len(meshes)), counts)
        self.vertex_round = np.zeros(len(self.vertices), np.int64)
        self.triangles = np.concatenate(
            [m.corner_vertex[m.triangle_corners] + f for m, f in zip(meshes, first, strict=False)]
        )
        sizes = [len(mesh.triangle_corners) for mesh in meshes]
        self.mesh_of_triangle = np.repeat(np.arange(len(meshes)), sizes)
        self.parent = np.arange(len(self.triangles))
        self.barycentric = np.tile(np.eye(3), (len(self.triangles), 1, 1))
        self._place = _places(self.vertices, self.vertex_mesh)
        self._round = 0
        self._number_edges()

    def _number_edges(self):
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1)
        places = np.sort(self._place[ends], axis=-1).reshape(-1, 2)
        key = places[:, 0] * (int(self._place.max(initial=0)) + 1) + places[:, 1]
        _, number = np.unique(key, return_inverse=True)
        self.edges = number.reshape(-1, 3)
        self.n_edges = int(number.max(initial=-1)) + 1

    @property
    def lengths(self):
        """(n, 3) float64: of the edges that leave each corner."""
        corners = self.vertices[self.triangles]
        return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)

    def split_vertices(self, marked, counted=None):
        """(n_edges,) int: how many vertices each marked edge would get, one for each mesh it is of.

        Parameters
        ----------
        marked : (n_edges,) bool
        counted : (n_meshes,) bool, optional
            Whose vertices count; default: all.
        """
        pairs, edge, _ = self._halves(marked)
        if counted is not None:
            edge = edge[counted[self.vertex_mesh[pairs[:, 0]]]]
        return np.bincount(edge, minlength=self.n_edges)

    def _halves(self, marked):
        """Ends of new vertices by vertices, their edges; and which each split side has."""
        side = np.flatnonzero(marked[self.edges].ravel())
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1)
        pairs = np.sort(ends.reshape(-1, 2)[side], axis=1)
        pairs, first, which = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
        new = np.full(self.edges.size, -1, np.int64)
        new[side] = which.reshape(-1)
        return pairs, self.edges.ravel()[side[first]], new.reshape(-1, 3)

    def split(self, marked):
        """Split marked edges in their middles, in all triangles that have them.

        Parameters
        ----------
        marked : (n_edges,) bool

        Returns
        -------
        of : (n_new,) int64
            What each triangle that there is now was part of.
        template : (n_new, 3) int64
            Its corners in that one: 0, 1, 2 its corners, 3, 4, 5 the middles of the edges that
            leave them (see `LOCAL`).
        """
        marked = expect_mask("marked", marked, self.n_edges)
        self._round += 1
        pairs, edge, new = self._halves(marked)
        # What is one place stays one: the middle of ends that are.
        _, place = np.unique(edge, return_inverse=True)
        place = place.reshape(-1) + int(self._place.max(initial=-1)) + 1
        count = len(self.vertices)
        middles = self.vertices[pairs].mean(axis=1)
        self.vertices = np.concatenate([self.vertices, middles])
        self.vertex_mesh = np.append(self.vertex_mesh, self.vertex_mesh[pairs[:, 0]])
        self.vertex_round = np.append(self.vertex_round, np.full(len(pairs), self._round))
        self._place = np.append(self._place, place)
        corners = np.concatenate([self.triangles, count + new], axis=1)
        of, template = _children(marked[self.edges], self.vertices[corners])
        self.triangles = np.take_along_axis(corners[of], template, axis=1)
        self.parent = self.parent[of]
        self.barycentric = np.einsum("nij,njk->nik", LOCAL[template], self.barycentric[of])
        self._number_edges()
        return of, template

    def meshes(self):
        """A list of `Mesh`: those that were split anew, the others as they were given."""
        result, first = [], 0
        for number, mesh in enumerate(self._meshes):
            count = len(mesh.triangle_corners)
            mine = np.flatnonzero((self.parent >= first) & (self.parent < first + count))
            mine = mine[np.argsort(self.parent[mine], kind="stable")]
            if len(mine) > count:
                result.append(self._refined(number, mesh, mine, first))
            else:
                result.append(mesh)
            first += count
        return result

    def _refined(self, number, mesh, mine, first):
        """One mesh of its triangles `mine`, which are in the order of those they came from."""
        parent = self.parent[mine] - first
        is_split = (np.bincount(parent, minlength=len(mesh.triangle_corners)) > 1)[parent]
        face_of_corner = np.repeat(np.arange(len(mesh.face_sizes)), mesh.face_sizes)
        face = face_of_corner[mesh.triangle_corners[:, 0]]
        opened = np.zeros(len(mesh.face_sizes), bool)
        opened[face[parent[is_split]]] = True
        # Faces that are whole keep their corners; of the others each triangle has its own, which
        # run the way the face's own do: they differ where an object is mirrored.
        kept = np.flatnonzero(~opened[face_of_corner])
        own = np.flatnonzero(opened[face[parent]])
        of = mesh.triangle_corners[parent[own]]
        turned = ((of < np.roll(of, -1, axis=1)).sum(axis=1) == 1)[:, None]
        order = np.where(turned, [0, 2, 1], [0, 1, 2])
        around = np.concatenate([np.repeat(kept[:, None], 3, axis=1), np.repeat(of, 3, axis=0)])
        weights = np.take_along_axis(self.barycentric[mine[own]], order[:, :, None], axis=1)
        whole = np.tile([1.0, 0, 0], (len(kept), 1))
        weights = np.concatenate([whole, weights.reshape(-1, 3)])
        vertex, vertices, rounds = self._numbered(number)
        corner_vertex = np.concatenate(
            [
                mesh.corner_vertex[kept],
                vertex[np.take_along_axis(self.triangles[mine[own]], order, axis=1)].ravel(),
            ]
        )
        now = np.full(len(face_of_corner), -1)
        now[kept] = np.arange(len(kept))
        corners = len(kept) + 3 * np.arange(len(own))[:, None] + order
        whole_triangles = now[mesh.triangle_corners[~opened[face]]]
        refined = Refined(
            around.astype(np.int32),
            weights.astype(np.float32),
            rounds.astype(np.int32),
            len(mesh.corner_vertex),
        )
        changed = {
            "vertices": vertices,
            "corner_vertex": corner_vertex,
            "corner_normal": _unit(_between(mesh.corner_normal, around, weights)),
            "triangle_corners": np.concatenate([whole_triangles, corners]),
            "corner_material": mesh.corner_material[around[:, 0]],
            "face_sizes": np.append(mesh.face_sizes[~opened], np.full(len(own), 3)),
            "own_mesh": False,
            "refined": refined,
        }
        if mesh.corner_uv is not None:
            changed["corner_uv"] = _between(mesh.corner_uv, around, weights)
        paints = {}
        changed["materials"], changed["paint"] = _look(
            Look(mesh.materials, mesh.paint), around, weights, paints
        )
        for name in LOOKS:
            if getattr(mesh, name) is not None:
                changed[name] = Look(*_look(getattr(mesh, name), around, weights, paints))
        return replace(mesh, **changed)

    def _numbered(self, number):
        """Numbers of vertices in one mesh, and its vertices: the old ones first."""
        begin, end = self._first[number], self._first[number + 1]
        n_old = self._first[-1]
        new = n_old + np.flatnonzero(self.vertex_mesh[n_old:] == number)
        mine = np.concatenate([np.arange(begin, end), new])
        vertex = np.full(len(self.vertices), -1)
        vertex[mine] = np.arange(len(mine))
        return vertex, self.vertices[mine], self.vertex_round[mine]


def _children(marked, places):
    """Which triangle each child is of, and its corners by local places, (n, 3)."""
    kinds = marked @ np.array([1, 2, 4])
    of, template = [np.flatnonzero(kinds == 0)], [np.tile([0, 1, 2], ((kinds == 0).sum(), 1))]

    def add(chosen, children):
        for child in children:
            of.append(chosen)
            template.append(np.tile(child, (len(chosen), 1)))

    for kind, children in _ONE.items():
        add(np.flatnonzero(kinds == kind), children)
    for kind, (one, other, across, over) in _TWO.items():
        chosen = np.flatnonzero(kinds == kind)
        lengths = [
            np.linalg.norm(places[chosen, a] - places[chosen, b], axis=1) for a, b in (across, over)
        ]
        shorter = lengths[0] <= lengths[1]
        add(chosen[shorter], one)
        add(chosen[~shorter], other)
    add(np.flatnonzero(kinds == 7), _THREE)
    of, template = np.concatenate(of), np.concatenate(template)
    order = np.argsort(of, kind="stable")
    return of[order], template[order]


def _places(vertices, mesh):
    """(n,) int: equal for vertices that are one place.

    Within a mesh only what has the very same coordinates is; between meshes what rounding may have
    moved apart as well.
    """
    if not len(vertices):
        return np.zeros(0, np.int64)
    _, exact = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    exact = exact.reshape(-1)
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-300)
    cells = np.rint((vertices - vertices.min(axis=0)) / (size * _SAME))
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    # A cell in which a mesh has several places is too coarse for that mesh.
    several = np.unique(np.stack([cell, mesh, exact], axis=1), axis=0)
    group, counts = np.unique(several[:, :2], axis=0, return_counts=True)
    crowded = np.zeros(int(cell.max(initial=-1)) + 1, bool)
    crowded[group[counts > 1, 0]] = True
    place = np.where(crowded[cell], exact + len(crowded), cell)
    return np.unique(place, return_inverse=True)[1].reshape(-1)


def _between(values, around, weights):
    return np.einsum("mk,mkc->mc", weights, values[around])


def _unit(vectors):
    """Unit vectors; those without a length stay so: their faces have the normals."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-6, vectors / np.maximum(length, 1e-30), 0)


def _look(look, around, weights, known):
    """Materials of corners between others, and the paint between them."""
    materials = look.materials.between(around, weights)
    if look.paint is None:
        return materials, None
    if id(look.paint) not in known:
        known[id(look.paint)] = RefinedPaint(look.paint, around, weights)
    painted = look.paint.at(around, weights)
    return materials.replaced(**painted), known[id(look.paint)]


def split_evenly(meshes):
    """Meshes all of whose edges are split once: four triangles of each.

    Parameters
    ----------
    meshes : sequence of Mesh

    Returns
    -------
    list of Mesh
    """
    state = SplitMeshes(meshes)
    state.split(np.ones(state.n_edges, bool))
    return state.meshes()
