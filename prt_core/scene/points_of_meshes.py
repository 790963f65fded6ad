"""Points of meshes: where light is received, one per distinct corner normal and material.

A bent quad that is shaded flat has two normals, those of its triangles. The corners that both have
show the first, as they do in Cycles' bakes, whose rays start there a little inside of the face;
the second triangle has points of its own there, which only bounce.
"""

from types import SimpleNamespace

import numpy as np

from prt_core.reflectance import Materials
from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.scene.lattice import lattice_coordinates, lattice_size
from prt_core.scene.paint import look_of
from prt_core.scene.points import BakePoints, joined_arrays
from prt_core.scene.ray_offset import ray_lifts

# Corners of one vertex share a point when normals agree to this step (and see `Quantity.step`).
NORMAL_STEP = 1e-3
# Cosine between face normals above which the surface around a point counts as flat.
_FLAT = 0.9999
# And below which a triangle does not share the point of its corner: 10 degrees.
_BENT = 0.985


def make_points(meshes, stack, levels, frames, surfaces):
    """Bake points of meshes, and the lattice of points of each triangle.

    Meshes share no point. So points are made of some meshes at a time, and numbered as if they had
    been made of all at once: those that are shown, those of bent faces, then hidden ones by level.

    Parameters
    ----------
    meshes : sequence of Mesh
    stack : Stack
        Of them, in the scene's frame.
    levels : (n_triangles,) int
    frames : Frames
    surfaces : Surfaces

    Returns
    -------
    SimpleNamespace
        points : BakePoints; corner_point (n_corners,) int32; lattice_start (n_triangles,) int64;
        lattice (sum of lattice sizes,) int32.
    """
    lifts_at, parts = _lifts_beside(stack, frames), []
    for batch in stack.batches():
        parts.append(_points_of(meshes, batch, stack, levels, frames, surfaces, lifts_at))
    numbers = _numbered([part.counts for part in parts])
    for part, number in zip(parts, numbers, strict=True):
        part.lattice = number[part.lattice]
        # The last is of corners without a point.
        part.corner_point = np.append(number, np.int32(-1))[part.corner_point]
    order, points = np.concatenate(numbers), {}
    moved = not (order[1:] > order[:-1]).all()
    order = np.argsort(order) if moved else order
    for key in list(parts[0].points):
        points[key] = joined_arrays([part.points.pop(key) for part in parts])
        points[key] = points[key][order] if moved else points[key]
    lattice = np.concatenate([part.lattice for part in parts])
    start = np.cumsum(lattice_size(levels.astype(np.int64)))
    start = np.concatenate([[0], start[:-1]])
    met = points["materials"]
    if surfaces.bounced is not surfaces:
        every = np.arange(len(points["positions"]))
        met = surfaces.bounced.of_points(levels, start, lattice, every)
    means = with_mean_gloss(surfaces.bounced.mean(levels, start, lattice, met)).of_what_is_met()
    own = points["materials"].stored()
    points["mean_materials"] = own if means is points["materials"] else means.stored()
    points["materials"] = own
    return SimpleNamespace(
        points=BakePoints(**points, emitter=np.broadcast_to(np.int32(-1), len(order))),
        corner_point=np.concatenate([part.corner_point for part in parts]),
        lattice_start=start,
        lattice=lattice,
    )


def _numbered(counts):
    """Number of each point in the scene, of batches that have so many of each kind.

    `counts` : list of dict of kind -> int, in the order in which a batch has them; kinds come in
    ascending order.

    Returns a list of (n,) int32.
    """
    first, begins = 0, [{} for _ in counts]
    for kind in sorted({kind for each in counts for kind in each}):
        for each, begin in zip(counts, begins, strict=True):
            begin[kind] = first
            first += each.get(kind, 0)
    return [
        np.concatenate([begin[kind] + np.arange(n, dtype=np.int32) for kind, n in each.items()])
        for each, begin in zip(counts, begins, strict=True)
    ]


def _points_of(meshes, batch, stack, levels, frames, surfaces, lifts_at):
    """Points of some meshes: `points`, dict of arrays in the types that are kept but for those of
    `materials`; `corner_point`, `lattice`, by their own numbers; `counts`, how many of each kind.
    """
    first_corner, inside = (
        stack.first_corner,
        slice(*stack.first_triangle[[batch.start, batch.stop]]),
    )
    owner = stack.triangle_object[inside].astype(np.int64)
    corners = stack.corners[inside] + (first_corner[owner] - first_corner[batch.start])[:, None]
    meshes = meshes[batch]
    triangles = stack.triangles[inside].astype(np.int64)
    levels = levels[inside].astype(np.int64)
    # Of scenes of millions of points this function takes most memory of all: what is not needed
    # any more goes, and what is the same for corners of a triangle is repeated axis by axis.
    placed = stack.vertices[triangles]
    a, b, c = np.moveaxis(placed, 1, 0)
    face_normal = np.cross(b - a, c - a)
    doubled = np.linalg.norm(face_normal, axis=1, keepdims=True)
    face_normal /= doubled
    corner_normal = np.concatenate([mesh.corner_normal for mesh in meshes])
    normal = _usable_normals(corner_normal, corners, face_normal)
    del corner_normal
    flat = stack.flat[owner]
    # The first triangle that has a corner comes last.
    normal[corners[flat][::-1]] = face_normal[flat][::-1, None]
    shading = normal[corners]
    shading[flat] = face_normal[flat][:, None]

    corner_point, n_shown = _merge_corners(meshes, corners, normal, surfaces)
    alike = np.einsum("tkx,tkx->tk", shading, normal[corners])
    del normal
    columns, n_points = _bent_apart(corner_point[corners], n_shown, shading, alike)
    leads = ((alike > _FLAT) | (alike < _BENT)).ravel()
    share = np.repeat(doubled / 6, 3, axis=1)
    summed = _Sums(n_points, columns.ravel())
    weight = np.where(leads, np.maximum(_corner_angles(a, b, c), 1e-9).ravel(), 0)
    of_corner = corners.ravel()
    positions = summed.mean(placed.reshape(-1, 3), weight)
    normals = _unit(summed.mean(shading.reshape(-1, 3), weight))
    geometric = summed.mean(face_normal, weight, 3)
    geometric = _unit(
        np.where(np.linalg.norm(geometric, axis=1, keepdims=True) > 1e-6, geometric, normals)
    )
    middle = summed.mean((a + b + c) / 3, share.ravel() * leads, 3)
    del placed, a, b, c
    bend = np.full(n_points, 1.0)
    along = np.einsum("tx,tkx->tk", face_normal, geometric[columns])
    np.minimum.at(bend, columns.ravel(), np.where(leads, along.ravel(), 1))
    inward = np.where((bend > _FLAT)[:, None], middle - positions, 0)
    lifts = _lifts(stack, frames, inside, face_normal)
    lift, sideways = np.empty((2, n_points))
    if lifts_at is None:
        lift[columns], sideways[columns] = (_largest(each, columns)[columns] for each in lifts)
    else:
        lift[columns], sideways[columns] = (each[triangles] for each in lifts_at)
    materials = Materials.joined([mesh.materials for mesh in meshes])[of_corner]
    points = {
        "positions": positions,
        "normals": normals,
        "geometric_normals": geometric,
        "ray_offset": _ray_offset(geometric, inward, lift, sideways),
        "areas": np.bincount(columns.ravel(), share.ravel(), n_points),
        "materials": materials.gathered(
            n_points, lambda quantity, values: quantity.settled(summed.mean(values, weight))
        ),
        "object_index": np.zeros(n_points, np.int64),
        "visible": np.zeros(n_points, bool),
    }
    points["object_index"][columns] = owner[:, None]
    points["visible"][:n_shown] = stack.receives[points["object_index"][:n_shown]]

    lattice, hidden, n_hidden = _lattices(
        columns, levels, face_normal, doubled[:, 0], points, surfaces, shading, lifts, inside.start
    )
    kinds = {"positions": np.float64, "object_index": np.int32, "visible": bool, "materials": None}
    kept = {}
    for key, values in hidden.items():
        whole, kind = joined_arrays([points.pop(key), *values]), kinds.get(key, np.float32)
        kept[key] = whole if kind is None else np.asarray(whole, kind)
    return SimpleNamespace(
        points=kept,
        corner_point=corner_point.astype(np.int32),
        lattice=lattice,
        counts={-1: n_shown, 0: n_points - n_shown, **n_hidden},
    )


def _lifts(stack, frames, part, normals):
    """Start of rays above some triangles, and how far inside of their rim (see `ray_lifts`)."""
    return ray_lifts(frames.local(stack.vertices, stack.triangles, part), normals)


def _lifts_beside(stack, frames):
    """The largest `_lifts` of the triangles at the place of each vertex: (2, n_vertices) float64.

    Beside a point's own faces may be others of a coarser frame; None where there is one frame.
    """
    if len(frames) == 1:
        return None
    _, place = np.unique(stack.vertices, axis=0, return_inverse=True)
    place = place.reshape(-1)
    largest = np.zeros((2, len(place)))
    for part in stack.parts():
        triangles = stack.triangles[part]
        a, b, c = np.moveaxis(stack.vertices[triangles], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        for most, values in zip(largest, _lifts(stack, frames, part, normals), strict=True):
            np.maximum.at(most, place[triangles].ravel(), np.repeat(values, 3))
    return largest[:, place]


def _largest(of_triangle, columns):
    """(n,) the largest value of the triangles that have each number in their `columns`."""
    result = np.zeros(columns.max(initial=-1) + 1)
    np.maximum.at(result, columns.ravel(), np.repeat(of_triangle, 3))
    return result


def _ray_offset(normals, inward, lift, sideways):
    # Along the surface alone: where it curves the middle of its triangles lies below the point.
    inward = inward - normals * np.einsum("nx,nx->n", normals, inward)[:, None]
    length = np.linalg.norm(inward, axis=1)
    share = np.minimum(0.25, sideways / np.maximum(length, 1e-30))
    return lift[:, None] * normals + share[:, None] * inward


def _usable_normals(corner_normal, corners, face_normal):
    """Unit corner normals; where one is missing (zero), the normal of its face."""
    normal = np.array(corner_normal, np.float64)
    length = np.linalg.norm(normal, axis=1)
    of_face = np.zeros_like(normal)
    of_face[corners] = face_normal[:, None]
    normal = np.where(length[:, None] > 1e-6, normal / np.maximum(length, 1e-30)[:, None], of_face)
    return normal


def _merge_corners(meshes, corners, normal, surfaces):
    """Point of each corner (-1 where no triangle uses it) and the number of points."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertex = np.concatenate([m.corner_vertex + n for m, n in zip(meshes, first, strict=False)])
    material = np.concatenate([mesh.corner_material for mesh in meshes])
    used = np.unique(corners)
    # A column after the other: rows of few numbers are sorted and compared much more slowly.
    key = [vertex[used], material[used]]
    key += list(np.rint(normal[used].T / NORMAL_STEP))
    sides = {id(surfaces): "shown", id(surfaces.bounced): "bounced", id(surfaces.back): "back"}
    for name in sides.values():
        look = Materials.joined([look_of(mesh, name).materials for mesh in meshes])
        key += list(look[used].in_steps().T)
    key = [column for column in key if (column != column[:1]).any()] or key[:1]
    order = np.lexsort(key[::-1])
    new = np.zeros(len(order), bool)
    new[:1] = True
    for column in key:
        column = column[order]
        new[1:] |= column[1:] != column[:-1]
    corner_point = np.full(len(vertex), -1, np.int64)
    corner_point[used[order]] = np.cumsum(new) - 1
    return corner_point, int(new.sum())


def _bent_apart(columns, n_points, shading, alike):
    """Points of the corners of triangles, with more where one is shaded unlike its point.

    Parameters
    ----------
    columns : (n_triangles, 3) int64
    n_points : int
    shading : (n_triangles, 3, 3) float64
        Normals of the triangles' corners.
    alike : (n_triangles, 3) float64
        Cosines between these and the normals of the points.

    Returns
    -------
    columns : (n_triangles, 3) int64
    n_points : int
    """
    apart = alike < _BENT
    if apart.any():
        key = np.column_stack([columns[apart], np.rint(shading[apart] / NORMAL_STEP)])
        new, which = np.unique(key, axis=0, return_inverse=True)
        columns = columns.copy()
        columns[apart] = n_points + which.reshape(-1)
        n_points += len(new)
    return columns, n_points


class _Sums:
    """Weighted means over groups, in float64."""

    def __init__(self, n_groups, group):
        self.n_groups, self.group = n_groups, group

    def mean(self, values, weight, times=1):
        """Of values (n, k), each of which counts for so many entries that follow each other."""
        total = np.bincount(self.group, weight, self.n_groups)
        sums = [
            np.bincount(self.group, weight * np.repeat(column, times), self.n_groups)
            for column in values.T
        ]
        return np.stack(sums, axis=1) / total[:, None]


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)


def _corner_angles(a, b, c):
    """(n_triangles, 3) float64: the angle of each corner, by atan2 (stable for slivers)."""

    def angle(p, q, r):
        u, v = q - p, r - p
        return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))

    return np.stack([angle(a, b, c), angle(b, c, a), angle(c, a, b)], axis=1)


def _lattices(columns, levels, face_normal, doubled, points, surfaces, shading, lifts, first):
    """Lattice point indices of every triangle, the hidden points they need, by key, and how many
    there are of each level; `first` is the scene's number of the first triangle."""
    sizes = lattice_size(levels)
    start = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    lattice = np.empty(int(sizes.sum()), np.int64)
    n_points = len(points["positions"])
    hidden, n_hidden = {key: [] for key in points}, {}
    for level in np.unique(levels):
        which = np.flatnonzero(levels == level)
        coordinates = lattice_coordinates(int(level))
        corner_slots = [
            int(np.flatnonzero((coordinates == target).all(axis=1))[0])
            for target in ((0, 0), (level, 0), (0, level))
        ]
        ids = np.empty((len(which), len(coordinates)), np.int64)
        ids[:, corner_slots] = columns[which]
        inner = np.setdiff1d(np.arange(len(coordinates)), corner_slots)
        if len(inner):
            ids[:, inner] = n_points + np.arange(len(which) * len(inner)).reshape(len(which), -1)
            n_points += len(which) * len(inner)
            uv = coordinates[inner] / level
            weights = np.column_stack([1 - uv.sum(axis=1), uv])
            triangle = columns[which]
            n_new = n_hidden[int(level)] = len(which) * len(inner)
            # Each hidden point takes an equal share of its triangle from the corners.
            cell = doubled[which] / 2 / len(coordinates)
            np.subtract.at(
                points["areas"], triangle.ravel(), np.repeat(doubled[which] / 6 - cell, 3)
            )
            hidden["positions"].append(
                np.einsum("lk,tkx->tlx", weights, points["positions"][triangle]).reshape(-1, 3)
            )
            hidden["normals"].append(
                _unit(np.einsum("lk,tkx->tlx", weights, shading[which]).reshape(-1, 3))
            )
            hidden["geometric_normals"].append(np.repeat(face_normal[which], len(inner), axis=0))
            hidden["materials"].append(
                surfaces.at(first + np.repeat(which, len(inner)), np.tile(uv, (len(which), 1)))
            )
            hidden["areas"].append(np.repeat(cell, len(inner)))
            middle = points["positions"][triangle].mean(axis=1, keepdims=True)
            place = np.einsum("lk,tkx->tlx", weights, points["positions"][triangle])
            lift, sideways = (np.repeat(x[which], len(inner)) for x in lifts)
            hidden["ray_offset"].append(
                _ray_offset(
                    hidden["geometric_normals"][-1], (middle - place).reshape(-1, 3), lift, sideways
                )
            )
            hidden["object_index"].append(
                np.repeat(points["object_index"][triangle[:, 0]], len(inner))
            )
            hidden["visible"].append(np.zeros(n_new, bool))
        lattice[(start[which][:, None] + np.arange(len(coordinates))).ravel()] = ids.ravel()
    return lattice, hidden, n_hidden
