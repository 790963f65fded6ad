"""What a page draws: triangles between bake points, in the order of a curve.

Large triangles are drawn as the cells of their lattice, so that the light of hidden points shows.
A side that returns light has points of its own and is drawn from them; another back is black, as
in pictures. Of what lets light pass the pieces are drawn (see `pieces`), whose corners lie between
points.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect
from prt_core.export.web.curve import hilbert_index
from prt_core.scene.lattice import lattice_coordinates, lattice_index, lattice_of_hits
from prt_core.scene.pieces import pieces_of

# Pieces of triangles that let light pass, at most.
_MOST_PIECES = 1 << 17
# Steps of the roots of shares, of normals, which narrow lobes ask for, and of places.
_CODES, _WAYS, _FULL = 4095, 16383, 65535


@dataclass(frozen=True)
class Surface:
    """Triangles of a page.

    Attributes
    ----------
    points : (n,) int
        The bake's points that the page holds, in its order: object by object, along a curve.
    triangles : (m, 3) int
        Corners, numbers in that order; from n on those of `between`.
    n_single : int
        So many of the first are drawn from both sides; the others from their front alone.
    between : (k, 3) int
        The points around a corner of a piece, numbers of the page's order.
    weights : (k, 3) float32
    opacity : (k,) float32
        Share of the light that stops there.
    places : (k, 3) float64
        In the scene's frame.
    """

    points: np.ndarray
    triangles: np.ndarray
    n_single: int
    between: np.ndarray
    weights: np.ndarray
    opacity: np.ndarray
    places: np.ndarray


def surface_of(scene, more=()):
    """The `Surface` that cameras see of a scene.

    Parameters
    ----------
    scene : Scene
    more : (m,) int, optional
        Points that it holds as well: those that are seen in reflections.
    """
    seen = np.array([item.camera_rays for item in scene.objects], bool)[scene.triangle_object]
    passing = np.zeros_like(seen)
    if scene.opacity is not None:
        passing = seen & scene.opacity.passing
    single, front, back = _cells(scene, np.flatnonzero(seen & ~passing))
    pieces = _pieces(scene, np.flatnonzero(passing))
    parts = [single.ravel(), front.ravel(), back.ravel(), pieces[0].ravel()]
    used = np.unique(np.concatenate(parts))
    expect(len(used), "bake: cameras see nothing of its scene; there is nothing to show")
    used = np.union1d(used, np.asarray(more, used.dtype))
    if scene.points.materials.through.any():
        behind = scene.opposite[used]
        used = np.union1d(used, behind[behind >= 0])
    points = _along_curve(scene, used)
    number = np.full(len(scene.points), -1)
    number[points] = np.arange(len(points))
    around, weights, opacity, places = pieces
    cut = len(points) + np.arange(len(around)).reshape(-1, 3)
    ones = np.concatenate([number[single], cut])
    both = np.concatenate([number[front], number[back]])
    triangles = np.concatenate([_sorted(ones), _sorted(both)])
    return Surface(points, triangles, len(ones), number[around], weights, opacity, places)


def _along_curve(scene, used):
    """Points object by object, each object's along a curve."""
    index, group = np.empty(len(used), np.uint64), scene.points.object_index[used]
    for number in np.unique(group):
        mine = group == number
        index[mine] = hilbert_index(scene.points.positions[used[mine]])
    return used[np.lexsort([index, group])]


def _cells(scene, triangles):
    """Cells of triangles: those without points on their back, fronts of others, their backs."""
    single, front, back = [], [], []
    level = scene.triangle_level[triangles]
    for n in np.unique(level):
        mine = triangles[level == n]
        slots = scene.lattice_start[mine, None, None] + _lattice_cells(int(n))
        cells, behind = scene.lattice[slots], scene.lattice_back[slots]
        has_back = (behind >= 0).all(axis=(1, 2))
        single.append(cells[~has_back].reshape(-1, 3))
        front.append(cells[has_back].reshape(-1, 3))
        back.append(behind[has_back].reshape(-1, 3)[:, ::-1])
    empty = np.zeros((0, 3), np.int32)
    return tuple(np.concatenate([empty, *parts]) for parts in (single, front, back))


def _lattice_cells(n):
    """(n^2, 3) int: corners of the cells of a triangle of level n, counter-clockwise."""
    i, j = lattice_coordinates(n - 1).T
    upright = [lattice_index(n, i, j), lattice_index(n, i + 1, j), lattice_index(n, i, j + 1)]
    i, j = lattice_coordinates(n - 2).T if n > 1 else np.zeros((2, 0), int)
    turned = [
        lattice_index(n, i + 1, j + 1), lattice_index(n, i, j + 1), lattice_index(n, i + 1, j)
    ]  # fmt: skip
    return np.concatenate([np.stack(upright, axis=1), np.stack(turned, axis=1)])


def _pieces(scene, triangles):
    """Corners of the pieces of triangles that let light pass: (3 m, ...) arrays."""
    if not len(triangles):
        nothing = np.zeros((0, 3))
        return nothing.astype(int), nothing.astype(np.float32), np.zeros(0, np.float32), nothing
    pieces = pieces_of(scene.opacity, triangles, _MOST_PIECES)
    owner, corners = np.repeat(pieces.triangle, 3), pieces.corners.reshape(-1, 2)
    cell, weights = lattice_of_hits(scene.triangle_level[owner], corners)
    around = scene.lattice[cell + scene.lattice_start[owner, None]]
    middle = pieces.corners.mean(axis=1)
    opacity = np.where(pieces.is_opaque, 1, scene.opacity.at(pieces.triangle, middle))
    return around, weights, np.repeat(opacity, 3).astype(np.float32), pieces.positions(scene)


def _sorted(triangles):
    """Triangles that begin with their smallest corner, by it: small differences."""
    if not len(triangles):
        return triangles
    first = triangles.argmin(axis=1)
    turned = np.take_along_axis(triangles, (first[:, None] + np.arange(3)) % 3, axis=1)
    return turned[np.lexsort(turned.T[::-1])]


def pack_surface(pack, scene, surface):
    """Put a `Surface` into a `Pack`: places in 16 bits of each object, normals, albedo."""
    points = scene.points
    positions, normals = points.positions[surface.points], points.normals[surface.points]
    groups = points.object_index[surface.points]
    codes = np.empty((len(positions), 3), np.uint16)
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    boxes = np.empty((len(starts), 6), np.float32)
    for box, first, end in zip(boxes, starts, [*starts[1:], len(groups)], strict=True):
        codes[first:end], box[:3], box[3:] = _in_box(positions[first:end])
    pack.add("position", codes, differences=True)
    pack.add("box", boxes)
    pack.add("box_start", starts.astype(np.uint32))
    pack.add("normal", octahedral(normals), differences=True)
    if len(surface.between):
        codes, low, step = _in_box(surface.places)
        pack.add("between_position", codes, differences=True)
        pack.add("between_box", np.concatenate([low, step]).astype(np.float32))
        pack.add("between", surface.between.astype(np.uint32), differences=True)
        pack.add("between_weight", np.rint(surface.weights * _FULL).astype(np.uint16))
        pack.add("between_opacity", np.rint(surface.opacity * 255).astype(np.uint8))
    first = surface.triangles[:, :1]
    pack.add("triangle", first[:, 0].astype(np.uint32), differences=True)
    pack.add("corner", (surface.triangles[:, 1:] - first).astype(np.uint32).T)


def _in_box(positions):
    """Codes of 16 bits, where their box begins and a step of it."""
    low = positions.min(axis=0)
    step = np.maximum(np.ptp(positions, axis=0) / _FULL, 1e-30)
    return np.rint((positions - low) / step).astype(np.uint16), low, step


def octahedral(normals):
    """(n, 2) uint16, of 14 bits: unit vectors (n, 3) on an unfolded octahedron."""
    x, y, z = (normals / np.abs(normals).sum(axis=1, keepdims=True)).T
    folded = (1 - np.abs([y, x])) * np.where(np.array([x, y]) >= 0, 1, -1)
    square = np.where(z < 0, folded, [x, y]).T
    return np.rint((square + 1) / 2 * _WAYS).astype(np.uint16)


def pack_share(pack, name, shares):
    """Put shares of light (n, 3), such as albedo, into a `Pack`: roots, in 12 bits.

    Returns
    -------
    float
        The largest.
    """
    most = float(max(shares.max(initial=0), 1e-30))
    codes = np.rint(np.sqrt(np.clip(shares / most, 0, 1)) * _CODES)
    pack.add(name, codes.astype(np.uint16), differences=True)
    return most
