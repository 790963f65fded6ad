"""Which backs matter: a few rays tell, before anything else is baked.

Surfaces are lit on both sides, but most backs are never seen: those of closed objects, the
underside of a ground. A back needs bake points where both are so: something that matters sees it,
and light gets there. Rays of the bake points, and of the camera, find the backs that are seen.
From there paths go on, from surface to surface, until they leave the scene or meet a lamp (light
gets there, and to all backs on the way) or come to nothing.

What is decided together is a part of an object whose triangles hang together, where enough rays met
it; small ones with the rest of their object, or with all objects of the same owner, as leaves are.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from prt_core.rays import cast_on_all_cores
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import view_rays, with_backs
from prt_core.transport.gather import cosine_directions
from prt_core.transport.sharing import Places

# Rays of all points together, about, at least and at most; of a point, at most.
_FEWEST, _MOST, _OF_POINT = 1 << 13, 1 << 18, 64
# Pixels of the camera along its wider side.
_PIXELS = 48
# Surfaces that a path meets.
_LENGTH = 8
# A back has points where light gets to so many of those that met the part, and to this share.
_LIT, _SHARE = 2, 0.02
# Hits of a part that is decided on its own.
_ENOUGH = 16
# Paths walked together.
_PATHS = 1 << 15
# How far shadow rays go of the way to a lamp.
_SHORT = 1 - 1e-4


def side_steps(scene, caster, seed, lamps=(), camera=None):
    """The scene with points on the backs that matter; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    seed : int
    lamps : sequence of Lamp
        From which light comes, besides the sky.
    camera : Camera, optional
        From which backs are seen, besides the bake points.

    Returns
    -------
    scene : Scene
        The same object where none matters.
    n_rays : int
        That were cast.
    """
    walks = _Walks(scene, caster, seed, lamps)
    points = np.unique(scene.lattice)
    count = int(np.clip(-(-_FEWEST // len(points)), 1, _OF_POINT))
    points = points[:: -(-len(points) // _MOST)]
    yield from walks.from_points(points, count)
    if camera is not None:
        yield from walks.from_camera(camera)
    lit = walks.lit_backs()
    return (with_backs(scene, lit) if lit.any() else scene), walks.n_rays


class _Walks:
    """Paths, and what they met: hits of each triangle, and those of its back that light gets to."""

    def __init__(self, scene, caster, seed, lamps):
        self._scene, self._caster, self._seed, self._lamps = scene, caster, seed, list(lamps)
        self._dark = scene.lattice_back[scene.lattice_start] < 0
        self.hits, self.lit = np.zeros((2, len(scene.triangles)), np.int64)
        self.n_rays = 0

    def from_points(self, points, count):
        """Paths that begin at bake points; yields `Progress`."""
        scene = self._scene
        normals = scene.points.normals, scene.points.geometric_normals

        def walk(caster, first):
            chosen = points[first : first + size]
            rng = generator(self._seed, Stage.SIDES, 0, first)
            starts, ways = _away(
                scene.ray_origins[chosen], *(n[chosen] for n in normals), count, rng
            )
            return self._walk(caster, starts, ways, rng)

        size = max(1, _PATHS // count)
        yield from self._all(walk, range(0, len(points), size), len(points))

    def from_camera(self, camera):
        """Paths that begin at a camera; yields `Progress`."""
        rays = view_rays(camera, _PIXELS, _PIXELS, 1)
        ways = rays.directions.astype(np.float32)
        starts = self._scene.to_frame(rays.origins).astype(self._scene.ray_origins.dtype)

        def walk(caster, first):
            return self._walk(caster, starts, ways, generator(self._seed, Stage.SIDES, 1, first))

        yield from self._all(walk, [0], len(ways))

    def _all(self, walk, firsts, total):
        together = max(2, self._caster.threads)
        firsts = list(firsts)
        for first in range(0, len(firsts), together):
            chosen = firsts[first : first + together]
            for hits, lit, n_rays in cast_on_all_cores(self._caster, walk, chosen):
                self.hits += np.bincount(hits, minlength=len(self.hits))
                self.lit += np.bincount(lit, minlength=len(self.lit))
                self.n_rays += n_rays
            yield Progress("details", min(first + together, len(firsts)), len(firsts))

    def _walk(self, caster, starts, ways, rng):
        """Triangles met first or on their backs; those whose backs light gets to; rays cast."""
        scene, n_rays = self._scene, 0
        path = np.arange(len(ways))
        hits, backs, paths = [], [], []
        light = np.zeros(len(ways), bool)
        for step in range(_LENGTH):
            ends = caster.intersect(starts, ways)
            n_rays += len(ways)
            met = np.flatnonzero(ends.triangle >= 0)
            triangle = ends.triangle[met]
            if step:
                light[path[ends.triangle < 0]] = True
                light[path[met[scene.triangle_emitter[triangle] >= 0]]] = True
            places = Places(scene, triangle, ends.barycentric[met], ways[met])
            unlit = places.back & self._dark[triangle]
            hits.append(triangle if not step else triangle[unlit])
            backs.append(triangle[unlit])
            paths.append(path[met[unlit]])
            # A side that has points tells of its light itself; only what has none is followed.
            kept = np.flatnonzero(unlit) if not step else np.arange(len(met))
            path = path[met[kept]]
            if not len(path):
                break
            reached, n_shadow = self._reached(caster, places, kept, rng)
            n_rays += n_shadow
            light[path[reached]] = True
            path, kept = path[~reached], kept[~reached]
            if not len(path):
                break
            normal = places.normal[kept].astype(np.float32)
            start = places.start[kept].astype(scene.ray_origins.dtype)
            starts, ways = _away(start, normal, normal, 1, rng)
        backs, paths = np.concatenate(backs), np.concatenate(paths)
        return np.concatenate(hits), backs[light[paths]], n_rays

    def _reached(self, caster, places, chosen, rng):
        """Which of chosen places a lamp shines at, one lamp tried for each; and rays cast."""
        scene = self._scene
        reached = np.zeros(len(chosen), bool)
        if not self._lamps:
            return reached, 0
        which, n_rays = rng.integers(0, len(self._lamps), len(chosen)), 0
        uv = rng.random((len(chosen), 2))
        for number, lamp in enumerate(self._lamps):
            mine = np.flatnonzero(which == number)
            start = places.start[chosen[mine]]
            ways, distance, irradiance = lamp.sample(scene.to_world(start), uv[mine])
            facing = np.einsum("mx,mx->m", ways, places.normal[chosen[mine]]) > 0
            shines = np.flatnonzero(facing & (irradiance != 0).any(axis=1))
            if not len(shines):
                continue
            limit = np.minimum(distance[shines] / scene.size * _SHORT, 1e3).astype(np.float32)
            start = start[shines].astype(scene.ray_origins.dtype)
            blocked = caster.occluded(start, ways[shines].astype(np.float32), limit)
            reached[mine[shines]] = ~blocked
            n_rays += len(shines)
        return reached, n_rays

    def lit_backs(self):
        """(n_triangles,) bool: triangles whose backs get points."""
        scene, result = self._scene, np.zeros(len(self.hits), bool)
        if not self.lit.any():
            return result
        names = [(item.owner, item.library) for item in scene.objects]
        _, owner = np.unique(np.array(names), axis=0, return_inverse=True)
        owner = owner.reshape(-1)[scene.triangle_object]
        wanted = np.zeros(owner.max() + 1, bool)
        wanted[owner[self.lit > 0]] = True
        chosen = np.flatnonzero(wanted[owner])
        part, is_closed = _parts(scene, chosen)
        own = self._sums(chosen, part)
        few = own[1] < _ENOUGH
        item = scene.triangle_object[chosen]
        rest = self._sums(chosen[few], item[few], len(scene.objects))
        group = np.where(rest[1, item] < _ENOUGH, owner[chosen] + len(scene.objects), item)
        pooled = self._sums(chosen[few], group[few], group.max() + 1)[:, group]
        # No light gets into a closed part because others of its object are open.
        lit, hits = np.where(few & ~is_closed, pooled, own)
        result[chosen] = (lit >= _LIT) & (lit >= _SHARE * hits)
        return result & self._dark

    def _sums(self, triangles, group, n_groups=None):
        """(2, n): light that got to the backs of groups, and hits; of each triangle by default."""
        sums = np.stack(
            [np.bincount(group, x[triangles], n_groups or 0) for x in (self.lit, self.hits)]
        )
        return sums[:, group] if n_groups is None else sums


def _away(starts, normals, geometric, count, rng):
    """`count` rays from each start, cosine-distributed, that leave the surface."""
    shift = rng.random((len(starts), 2), np.float32)
    ways = cosine_directions(normals, shift, count).reshape(-1, 3)
    up = np.einsum("rx,rx->r", ways, np.repeat(geometric, count, axis=0)) > 0
    return np.repeat(starts, count, axis=0)[up], ways[up]


def _parts(scene, chosen):
    """Of chosen triangles the number of the part that each belongs to, and whether it is closed."""
    corners = scene.triangles[chosen]
    used, corner = np.unique(corners, return_inverse=True)
    item = np.zeros(len(scene.vertices), np.int64)
    item[corners] = scene.triangle_object[chosen][:, None]
    # Corners at one place are one: meshes are cut where normals or maps are.
    key = np.column_stack([item[used], scene.vertices[used]])
    _, welded = np.unique(key, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[corner.reshape(-1, 3)]
    n = corners.max() + 1
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    graph = sp.coo_matrix((np.ones(len(tails)), (tails, heads)), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    part = part[corners[:, 0]]
    # Every edge is gone along as often one way as the other.
    edge = np.minimum(tails, heads) * np.int64(n) + np.maximum(tails, heads)
    _, which = np.unique(edge, return_inverse=True)
    which = which.reshape(-1)
    balance = np.bincount(which, np.where(tails < heads, 1, -1))
    is_open = np.bincount(np.repeat(part, 3), balance[which] != 0)
    return part, is_open[part] == 0
