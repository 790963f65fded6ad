"""What surfaces look like between their corners, and what a bake point stands for.

An image on a face of two triangles may differ everywhere from the colours of its four corners.
Bake points inside a face take the materials of their own place; and any point bounces by the mean
over the area around it, weighted as K shares it out, for light that meets the face does so
everywhere.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse

from prt_core.reflectance import QUANTITIES, Materials
from prt_core.scene.lattice import lattice_coordinates, lattice_of_hits, lattice_size

# Samples along an edge of a lattice cell, and of all cells together, at most.
_ALONG, _ALL = 32, 1 << 23
_BLOCK = 1 << 19


class Paint(Protocol):
    """The materials of a mesh anywhere on its faces; `Mesh.paint`, where corners do not tell."""

    def at(self, corners, weights):
        """Name -> (m, n_channels) float64 of what is painted, at places.

        Parameters
        ----------
        corners : (m, 3) int
            Of a face.
        weights : (m, 3) float
        """

    def alike(self, corners):
        """(m,) int: equal where what is painted between three corners follows from the weights
        alike."""

    def texels(self, corners):
        """(m,) float: about how many different colours lie between each three corners."""

    def digest(self):
        """bytes that tell equal paints from others."""


@dataclass(frozen=True)
class Look:
    """What one kind of rays sees of one side of a mesh.

    Attributes
    ----------
    materials : Materials
        Of the corners.
    paint : Paint or None
        The materials between the corners; None: as they say, in between.
    """

    materials: Materials
    paint: Paint | None = None


# The looks that a mesh may have besides what is shown of its front, and which each is where a mesh
# does not say: what diffuse rays meet of its front, and of its back, and what is in the way of
# shadow rays, whose opacity alone counts.
LOOKS = {"bounced": "shown", "back": "bounced", "shadow": "bounced"}


def look_of(mesh, name):
    """The `Look` of a mesh: "shown", or one of `LOOKS`."""
    if name == "shown":
        return Look(mesh.materials, mesh.paint)
    return getattr(mesh, name) or look_of(mesh, LOOKS[name])


def surfaces_of(meshes, stack):
    """The `Surfaces` that meshes show, with those of their other looks.

    Parameters
    ----------
    meshes : sequence of Mesh
    stack : Stack
    """
    kinds = {}
    for name in ("shown", *LOOKS):
        if name in LOOKS and all(getattr(mesh, name) is None for mesh in meshes):
            kinds[name] = kinds[LOOKS[name]]
            continue
        kinds[name] = Surfaces(stack, [look_of(mesh, name) for mesh in meshes])
    for surfaces in kinds.values():
        for name in LOOKS:
            setattr(surfaces, name, kinds[name])
    return kinds["shown"]


class Surfaces:
    """The materials of a scene's meshes, anywhere on their triangles.

    Parameters
    ----------
    stack : Stack
    looks : list of Look
        Of each mesh.

    Attributes
    ----------
    corner_materials : Materials
        Of the corners of all meshes, each that is known but once (see `_held_once`).
    bounced, back, shadow : Surfaces
        What diffuse rays meet of fronts and of backs, and what shadow rays meet; the same where
        that is no other.
    """

    def __init__(self, stack, looks):
        self._corners, self._object = stack.corners, stack.triangle_object
        self.bounced = self.back = self.shadow = self
        self.corner_materials, self._first, self._step = _held_once(
            [look.materials for look in looks]
        )
        paints = [look.paint for look in looks]
        # Instances have one paint.
        known = {id(paint): paint for paint in paints if paint is not None}
        self._paints, number = list(known.values()), {name: i for i, name in enumerate(known)}
        self._paint_of = np.array([number.get(id(paint), -1) for paint in paints], np.int64)

    def at(self, triangle, barycentric):
        """`Materials` at places: (m,) triangles, (m, 2) weights of the 2nd and 3rd corner."""
        second, third = np.asarray(barycentric, np.float64).T
        weights = np.stack([1 - second - third, second, third], axis=1)
        materials = self.corner_materials.between(self._rows(triangle), weights)
        paints = self._paints_on(triangle)
        for paint in np.unique(paints[paints >= 0]):
            mine = np.flatnonzero(paints == paint)
            painted = self._paints[paint].at(self._local(triangle[mine]), weights[mine])
            settled = {name: QUANTITIES[name].settled(each) for name, each in painted.items()}
            materials.put(mine, materials[mine].replaced(**settled))
        return materials

    def quantity_at(self, name, triangle, barycentric):
        """(m, n_channels) float64: one quantity of the materials at places (see `at`)."""
        if (self._paints_on(triangle) >= 0).any():
            return getattr(self.at(triangle, barycentric), name)
        second, third = np.asarray(barycentric, np.float64).T
        weights = np.stack([1 - second - third, second, third], axis=1)
        values = getattr(self.corner_materials, name)[self._rows(triangle)]
        return QUANTITIES[name].settled(np.einsum("mk,mkc->mc", weights, values))

    def seen(self, triangle, barycentric, back, shown):
        """`Materials` at places of fronts, which may be as they are shown, and of backs."""
        materials = (self if shown else self.bounced).at(triangle, barycentric)
        behind = np.flatnonzero(back)
        if len(behind) and self.back is not self:
            materials.put(behind, self.back.at(triangle[behind], barycentric[behind]))
        return materials

    def emission_at(self, triangle, barycentric, back):
        """(m, 3) float64: radiance of places, by their backs where `back` (m,) says so."""
        emission = self.bounced.quantity_at("emission", triangle, barycentric)
        behind = np.flatnonzero(back)
        if len(behind) and self.back is not self.bounced:
            part = triangle[behind], barycentric[behind]
            emission[behind] = self.back.quantity_at("emission", *part)
        return emission

    def of_points(self, levels, lattice_start, lattice, points):
        """`Materials` of bake points, at one place of each, in float64.

        Parameters
        ----------
        levels, lattice_start : (n_triangles,) int
        lattice : (n,) int
        points : (m,) int
            That are in the lattice.
        """
        known, first = np.unique(lattice, return_index=True)
        slot = first[np.searchsorted(known, points)]
        triangle = np.searchsorted(lattice_start, slot, side="right") - 1
        places = np.zeros((len(slot), 2))
        for level in np.unique(levels[triangle]):
            mine = np.flatnonzero(levels[triangle] == level)
            which = slot[mine] - lattice_start[triangle[mine]]
            places[mine] = lattice_coordinates(int(level))[which] / level
        return self.at(triangle, places)

    def mean(self, levels, lattice_start, lattice, materials):
        """What each bake point stands for.

        Parameters
        ----------
        levels, lattice_start : (n_triangles,) int
        lattice : (n,) int
        materials : Materials
            Of the points; what is taken where no painted triangle is around one.

        Returns
        -------
        Materials
        """
        if not self._paints:
            return materials
        painted = np.flatnonzero(self._paint_of[self._object] >= 0)
        along = self._samples_along(painted, levels[painted])
        total = np.zeros(len(materials))
        sums = {}
        groups = np.stack([self._paints_on(painted), levels[painted], along], axis=1)
        for group in np.unique(groups, axis=0):
            mine = painted[(groups == group).all(axis=1)]
            grid = _Grid(int(group[1]), int(group[2]))
            points = lattice[lattice_start[mine][:, None] + np.arange(len(grid.share))].ravel()
            total += np.bincount(points, np.tile(grid.share, len(mine)), len(total))
            for name, values in self._sums(mine, grid):
                own = sums.setdefault(name, np.zeros((len(total), values.shape[-1])))
                for channel, column in enumerate(values.reshape(len(points), -1).T):
                    own[:, channel] += np.bincount(points, column, len(total))
        counted, total = total[:, None] > 0, np.maximum(total, 1e-30)[:, None]
        means = {name: QUANTITIES[name].settled(summed / total) for name, summed in sums.items()}
        return materials.replaced(
            **{
                name: np.where(counted, mean, getattr(materials, name))
                for name, mean in means.items()
            }
        )

    def alike(self, triangles):
        """(n,) int64: equal for painted triangles that look alike at equal weights."""
        paints = self._paints_on(triangles)
        numbers = np.arange(len(triangles))
        for paint in np.unique(paints[paints >= 0]):
            mine = np.flatnonzero(paints == paint)
            kinds = self._paints[paint].alike(self._local(triangles[mine]))
            _, first, kind = np.unique(kinds, return_index=True, return_inverse=True)
            numbers[mine] = mine[first[kind.ravel()]]
        return numbers

    def _local(self, triangles):
        """(n, 3) int64 corners of triangles as their own mesh counts them."""
        return self._corners[triangles].astype(np.int64)

    def _rows(self, triangles):
        """(n, 3) int64 corners of triangles in `corner_materials`."""
        owner = self._object[triangles]
        return self._corners[triangles] * self._step[owner, None] + self._first[owner, None]

    def _paints_on(self, triangles):
        """(n,) int64: number of the paint of each triangle; -1 where it has none."""
        return self._paint_of[self._object[triangles]]

    def _sums(self, triangles, grid):
        """Each quantity's name and (n, n_nodes, n_channels) sums, of triangles of one paint."""
        _, first, kind = np.unique(self.alike(triangles), return_index=True, return_inverse=True)
        painted, each = {}, max(1, _BLOCK // len(grid.places))
        for start in range(0, len(first), each):
            corners = self._local(triangles[first[start : start + each]])
            weights = np.tile(grid.weights, (len(corners), 1))
            values = self._paints[self._paints_on(triangles[:1])[0]].at(
                np.repeat(corners, len(grid.places), axis=0), weights
            )
            for name, column in values.items():
                settled = QUANTITIES[name].settled(column)
                painted.setdefault(name, []).append(grid.sums(settled, len(corners)))
        differing = self.corner_materials.differing()
        for name, values in self.corner_materials.arrays().items():
            if name in painted:
                yield name, np.concatenate(painted[name])[kind.ravel()]
            elif name in differing:
                yield (
                    name,
                    np.einsum("sk,nkc->nsc", grid.of_corners, values[self._rows(triangles)]),
                )

    def opacity_cells(self, sloping):
        """Into how many cells along an edge opacity asks triangles to be cut.

        Parameters
        ----------
        sloping : int
            Where corners differ.

        Returns
        -------
        (n_triangles,) int64
            0 where a triangle is known to be opaque.
        """
        opacity = self.corner_materials.opacity[:, 0]
        every = slice(None)
        corners = opacity[self._rows(every)] if (opacity < 1).any() else np.ones((1, 3))
        even, clear = np.ptp(corners, axis=1) == 0, (corners < 1).any(axis=1)
        cells = np.where(clear, np.where(even, 1, sloping), 0)
        cells = np.array(np.broadcast_to(cells, len(self._corners)))
        for number, paint in enumerate(self._paints):
            mine = np.flatnonzero(self._paint_of[self._object] == number)
            # What paint does not say of one place it says of none.
            if len(mine) and "opacity" in paint.at(self._local(mine[:1]), np.full((1, 3), 1 / 3)):
                cells[mine] = np.ceil(np.sqrt(2 * np.maximum(self._texels(mine), 1)))
        return cells

    def _texels(self, triangles):
        """(n,) float: about how many colours lie in each painted triangle."""
        texels = np.zeros(len(triangles))
        paints = self._paints_on(triangles)
        for paint in np.unique(paints):
            mine = paints == paint
            texels[mine] = self._paints[paint].texels(self._local(triangles[mine]))
        return texels

    def _samples_along(self, triangles, levels):
        """(n,) int: samples along an edge of each triangle's cells, as its texels ask for."""
        texels = self._texels(triangles)
        # Twice as many each way as there are texels, in a triangle that is half their square.
        along = 2 * np.sqrt(2 * np.maximum(texels, 0)) / levels
        fewer = np.sqrt(max(1.0, float(((levels * np.minimum(along, _ALONG)) ** 2).sum()) / _ALL))
        return np.clip(np.ceil(along / fewer), 1, _ALONG).astype(np.int64)


def _held_once(materials):
    """`Materials` of all meshes' corners, without those that are there already.

    Instances have one set of materials, and many a mesh has one material all over.

    Parameters
    ----------
    materials : list of Materials
        Of each mesh.

    Returns
    -------
    Materials
    first, step : (n_meshes,) int64
        A mesh's corner n is number `first + n * step` of them.
    """
    known = {id(each): each for each in materials}
    one = {key: len(each) > 0 and not each.differing() for key, each in known.items()}
    whole = Materials.joined([each[:1] if one[key] else each for key, each in known.items()])
    ends = np.cumsum([1 if one[key] else len(each) for key, each in known.items()])
    first = dict(zip(known, [0, *ends], strict=False))
    return (
        whole,
        np.array([first[id(each)] for each in materials], np.int64),
        np.array([not one[id(each)] for each in materials], np.int64),
    )


class _Grid:
    """Places that cover a triangle evenly, and how they share themselves out to its lattice.

    Parameters
    ----------
    level : int
        Of the triangle.
    count : int
        Places along an edge of a cell of its lattice.
    """

    def __init__(self, level, count):
        self.places = centroids(level * count)
        self.weights = np.column_stack([1 - self.places.sum(axis=1), self.places])
        cell, shares = lattice_of_hits(np.full(len(self.places), level), self.places)
        columns = np.repeat(np.arange(len(self.places)), 3)
        shares = shares.ravel().astype(np.float64)
        shape = lattice_size(level), len(self.places)
        self._to_nodes = sparse.csr_array((shares, (cell.ravel(), columns)), shape)
        self.share = self._to_nodes.sum(axis=1)
        self.of_corners = self._to_nodes @ self.weights

    def sums(self, values, n):
        """(n, n_nodes, n_channels) of values (n n_places, n_channels), a triangle at a time."""
        values = values.reshape(n, len(self.places), -1)
        flat = np.moveaxis(values, 0, 1).reshape(len(self.places), -1)
        return np.moveaxis((self._to_nodes @ flat).reshape(len(self.share), n, -1), 1, 0)


def centroids(count):
    """(count^2, 2) barycentric places that cover a triangle evenly."""
    i, j = np.indices((count, count)).reshape(2, -1)
    upright = i + j < count
    turned = i + j < count - 1
    places = np.concatenate(
        [
            np.stack([i[upright] + 1 / 3, j[upright] + 1 / 3], axis=1),
            np.stack([i[turned] + 2 / 3, j[turned] + 2 / 3], axis=1),
        ]
    )
    return places / count
