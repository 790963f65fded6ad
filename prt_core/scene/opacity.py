"""How opaque the triangles of a scene are, in small cells: all that rays need to know of it.

Kept with the bake, so that lamps shine through cut-outs without Blender. A triangle is cut into
n x n cells of one shape, as finely as its paint has texels; each holds the opacity of its middle.
Triangles that are painted alike, as instances are, share their cells.

A cut-out has cells that are opaque or clear, and on its rim some in between. Those are made one or
the other, by a threshold that runs through a sequence of low discrepancy over the triangle, so that
as much light passes as before, and rays need not ask what they meet.
"""

import hashlib
from dataclasses import dataclass

import numpy as np

# Cells along an edge at most; of all triangles together; where the corners say it all, and where
# these differ.
_ALONG, _ALL = 256, 1 << 21
_SLOPING = 16
_PIECES = 8
_BLOCK = 1 << 19
_OPAQUE = 65535
# Share of a triangle that lets part of the light pass, not all or nothing, above which it is no
# cut-out, and is said.
_MUCH = 0.2
# Of the plastic number, for the two axes of cells (Roberts 2018).
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


@dataclass(frozen=True)
class Opacity:
    """The share of light that does not go straight through, in cells of triangles.

    Attributes
    ----------
    first : (n_triangles,) int32
        Where the cells of each triangle begin; -1 where it is opaque.
    along : (n_triangles,) int32
        Cells along an edge, n; a triangle has n^2 of them.
    cells : (m,) uint16
        65535 is opaque.
    back : (n_triangles,) int32, or None
        Where the cells of each triangle begin for rays that meet its back; None: at `first`.
    """

    first: np.ndarray
    along: np.ndarray
    cells: np.ndarray
    back: np.ndarray | None = None

    # Of cells that nothing passes.
    opaque = _OPAQUE

    @property
    def first_of_back(self):
        """(n_triangles,) int32: where the cells begin for rays that meet the back."""
        return self.first if self.back is None else self.back

    @property
    def passing(self):
        """(n_triangles,) bool: triangles that let light pass."""
        return self.first >= 0

    @property
    def partial(self):
        """(n_triangles,) float64: share of each triangle that lets part of the light pass."""
        between = (self.cells > 0) & (self.cells < _OPAQUE)
        before = np.concatenate([[0], np.cumsum(between)])
        count, first = self.along.astype(np.int64) ** 2, np.maximum(self.first, 0)
        return np.where(self.passing, (before[first + count] - before[first]) / count, 0)

    def at(self, triangle, barycentric, back=False):
        """Opacity at places of triangles that let light pass.

        Parameters
        ----------
        triangle : (m,) int
        barycentric : (m, 2) float
            Weights of the second and third corner.
        back : bool, or (m,) bool
            Whether the back is met.

        Returns
        -------
        (m,) float64
        """
        cell = _cell(self.along[triangle].astype(np.int64), barycentric)
        first = self.first[triangle]
        if self.back is not None:
            first = np.where(back, self.back[triangle], first)
        return self.cells.take(first + cell) / float(_OPAQUE)

    def cells_of(self, triangles, order):
        """(n_sides, n, k) uint16: cells of triangles, by their numbers in `order` (k,)."""
        sides = [self.first] if self.back is None else [self.first, self.back]
        return np.stack([self.cells[first[triangles, None] + order] for first in sides])

    @staticmethod
    def cell_of(n, barycentric):
        """Which cell of a triangle each place lies in.

        Parameters
        ----------
        n : int
            Cells along an edge.
        barycentric : (m, 2) float
            Weights of the second and third corner.

        Returns
        -------
        (m,) int64
        """
        return _cell(n, barycentric)

    @staticmethod
    def middles(n):
        """(n^2, 2) barycentric middles of the cells, by their number."""
        return _middles(n)

    def digest(self):
        """bytes that tell it from others."""
        state = hashlib.blake2b(digest_size=16)
        arrays = [self.first, self.along, self.cells]
        for array in arrays if self.back is None else [*arrays, self.back]:
            state.update(np.ascontiguousarray(array))
        return state.digest()


def opacities_of(surfaces):
    """`Opacity` by which diffuse and shadow rays are met, by the names that a `Scene` has for it.

    Parameters
    ----------
    surfaces : Surfaces
        What is shown.
    """
    opacity = shadow = _opacity_of(surfaces.bounced, surfaces.back)
    if surfaces.shadow is not surfaces.bounced:
        shadow = _opacity_of(surfaces.shadow, surfaces.shadow)
    return {"opacity": opacity, "shadow_opacity": shadow}


def _opacity_of(surfaces, backs):
    """`Opacity` of the triangles of a scene's `Surfaces`, and of their backs'; None where all are
    opaque."""
    sides = [surfaces] if backs is surfaces else [surfaces, backs]
    along = np.max([side.opacity_cells(_SLOPING) for side in sides], axis=0)
    candidates = np.flatnonzero(along)
    if not len(candidates):
        return None
    fewer = np.sqrt(max(1.0, (np.minimum(along[candidates], _ALONG) ** 2.0).sum() / _ALL))
    along[candidates] = np.clip(np.ceil(along[candidates] / fewer), 1, _ALONG)
    # So that pieces are made of whole cells.
    fine = along >= _PIECES
    along[fine] = -(-along[fine] // _PIECES) * _PIECES
    begin = np.full((len(sides), len(along)), -1, np.int64)
    known, parts, end = {}, [], 0
    for n in np.unique(along[candidates]):
        members = candidates[along[candidates] == n]
        places = _middles(int(n))
        alike = np.stack([side.alike(members) for side in sides])
        _, first, kind = np.unique(alike, axis=1, return_index=True, return_inverse=True)
        begins = np.full((len(sides), len(first)), -1, np.int64)
        each = max(1, _BLOCK // len(places))
        for start in range(0, len(first), each):
            part = members[first[start : start + each]]
            where = np.repeat(part, len(places)), np.tile(places, (len(part), 1))
            rows = np.stack([side.at(*where).opacity.reshape(len(part), -1) for side in sides])
            rows = _cut_out(np.rint(rows * _OPAQUE).astype(np.uint16), int(n))
            for one in np.flatnonzero((rows < _OPAQUE).any(axis=(0, 2))):
                for side, row in enumerate(rows[:, one]):
                    key = row.tobytes()
                    if key not in known:
                        known[key] = end
                        parts.append(row)
                        end += len(places)
                    begins[side, start + one] = known[key]
        begin[:, members] = begins[:, kind.ravel()]
    if not parts:
        return None
    along[begin[0] < 0] = 1
    first, back = begin[0].astype(np.int32), begin[-1].astype(np.int32)
    back = back if (back != first).any() else None
    return Opacity(first, along.astype(np.int32), np.concatenate(parts), back)


def dimming(scene):
    """A line on objects that let part of the light through, where there are any."""
    if scene.opacity is None:
        return
    numbers = np.unique(scene.triangle_object[scene.opacity.partial > _MUCH])
    if len(numbers):
        names = [scene.objects[number].name for number in numbers]
        shown = ", ".join(names[:4]) + (" …" if len(names) > 4 else "")
        yield (
            f"{len(names)} objects let part of the light through ({shown}); a hard sun in an image "
            "is noisy behind them: relight with --sharp-sun, or use a sun lamp"
        )


def _cut_out(rows, n):
    """(..., n^2) uint16 cells, of cut-outs opaque or clear; all others as they are."""
    between = (rows > 0) & (rows < _OPAQUE)
    share = between.mean(axis=-1, keepdims=True)
    threshold = (np.rint(_middles(n) * n * 3) @ _STEPS + 0.5) % 1 * _OPAQUE
    return np.where(
        between & (share <= _MUCH), np.where(rows > threshold, _OPAQUE, 0), rows
    ).astype(np.uint16)


def _cell(n, barycentric):
    """(m,) int64 number of the cell, of n^2, that each place lies in."""
    u, v = np.clip(np.asarray(barycentric, np.float64).T, 0, 1) * n
    i = np.minimum(u.astype(np.int64), n - 1)
    j = np.minimum(v.astype(np.int64), n - 1 - i)
    turned = (u - i + v - j > 1) & (i + j < n - 1)
    # The turned cells fill the other half of the square.
    return np.where(turned, (n - 1 - i) * n + n - 1 - j, i * n + j)


def _middles(n):
    """(n^2, 2) barycentric middles of the cells, by their number."""
    i, j = np.indices((n, n)).reshape(2, -1)
    turned = (i + j >= n)[:, None]
    place = np.stack([i, j], axis=1)
    return np.where(turned, n - 1 - place + 2 / 3, place + 1 / 3) / n
