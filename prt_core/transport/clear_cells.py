"""Cells of triangles in which every place sees the bake points around it.

What stands on a cell and parts its corners from each other crosses its edges. So one ray along
each edge, which most cells share with a neighbour, tells for which of the places in a cell nobody
has to ask (see `transport.sharing`).
"""

import numpy as np

from prt_core.rays import cast_on_all_cores

# Rays worked on at once, and the share of an edge after which they end.
_AT_ONCE, _SHORT = 1 << 15, 1 - 1e-4


def clear_cells(scene, caster):
    """Triangles between three bake points that see each other.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster

    Returns
    -------
    clear : (n_triangles, 2) bool
        By front and back. Triangles that are cut, and sides that return no light, are not.
    n_rays : int
    """
    whole = np.flatnonzero(scene.triangle_level == 1)
    cells = scene.lattice_start[whole, None] + np.arange(3)
    clear, n_rays = np.zeros((len(scene.triangles), 2), bool), 0
    for side, lattice in enumerate((scene.lattice, scene.lattice_back)):
        points = lattice[cells].astype(np.int64)
        lit = (points >= 0).all(axis=1)
        ends = np.sort(np.stack([points[lit], np.roll(points[lit], 1, axis=1)]), axis=0)
        keys, edge = np.unique(ends[0] * len(scene.points) + ends[1], return_inverse=True)
        open_edges = _see_each_other(scene, caster, *np.divmod(keys, len(scene.points)))
        clear[whole[lit], side] = open_edges[edge].reshape(-1, 3).all(axis=1)
        n_rays += len(keys)
    return clear, n_rays


def _see_each_other(scene, caster, one, other):
    """(k,) bool: whether bake points (k,) see others (k,)."""

    def cast(caster, first):
        part = slice(first, first + _AT_ONCE)
        starts = scene.ray_origins[one[part]]
        ways = scene.ray_origins[other[part]].astype(np.float64) - starts
        lengths = np.linalg.norm(ways, axis=1)
        apart = np.flatnonzero(lengths > 0)
        seen = np.ones(len(ways), bool)
        directions = (ways[apart] / lengths[apart, None]).astype(np.float32)
        limits = (_SHORT * lengths[apart]).astype(np.float32)
        seen[apart] = ~caster.occluded(starts[apart], directions, limits)
        return seen

    parts = cast_on_all_cores(caster, cast, range(0, len(one), _AT_ONCE))
    return np.concatenate([np.zeros(0, bool), *parts])
