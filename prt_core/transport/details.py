"""Where bake points inside of triangles are needed: found by a few rays, before anything is baked.

K hands what a ray meets to bake points around that place (see `transport.sharing`). Two kinds of
places are not told by those:

*Hidden places*, which see none of them: the floor of a room that stands inside one large face.
*Near places*, met from nearer than the nearest of them, that look otherwise than those tell: a gap
below a box. There radiosity changes over the width of the gap, not over that of the cell. How a
place looks is told by rays of its own, in a coarse solution from the rays of the points in which
all that is open for some distance brings light, so that rooms without a sky count as well.

Both get points of their own, as far apart as the rays that met them were long.

Most of a scene has no such places. Two rays of every point find where there are some, and only the
points around those, and the corners of what was met, cast the rest.
"""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.rays import boxes_around, cast_on_all_cores
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import with_details
from prt_core.transport.gather import cosine_directions
from prt_core.transport.sent import Sent, mean_of_channels, sent_of
from prt_core.transport.sharing import MISS, Places, Sharing

# Rays of every point, of those around points that met such a place, and more of those that are
# known to have met one.
_FIRST, _FEW, _MORE = 2, 8, 24
# How many points are around one.
_AROUND = 64
# A place looks otherwise where its light differs by so much of an open sky's, by so many rays.
_DIFFER, _JUDGES = 0.04, 32
# Light comes from what is this share of the object's size away, and less from what is nearer.
_OPEN = 0.1
_BOUNCES = 3
# Details lie this share of a ray's length apart; those of hidden places, which are all there is,
# are nearer to each other.
_APART, _HIDDEN_APART = 1.0, 0.25
# More of them than this share of the points, or so many, are not made.
_MOST, _LEAST_MOST = 0.15, 1500
# Rays cast together, about, and places whose light is found together.
_RAYS = 1 << 16


def detail_steps(scene, caster, seed, sought=None):
    """The scene with details where it needs them; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    seed : int
    sought : callable((m,) int, (m, 3) float64) -> (m,) bool, optional
        Whether places of triangles may get details; default: all.

    Returns
    -------
    scene : Scene
        The same object where none are needed.
    n_rays : int
        That were cast.
    """
    probe = _Probe(scene, caster, seed, sought)
    ends, ambient, first = yield from probe.cast_all(np.arange(len(scene.points)), _FIRST, 0)
    # Those that cast no more let their few rays count as often.
    ends = np.tile(ends, (1, _FEW // _FIRST))
    near = _points_around(scene, first)
    ends[near, _FIRST:], rest, hits = yield from probe.cast_all(near, _FEW - _FIRST, 1)
    ambient[near] = (_FIRST * ambient[near] + (_FEW - _FIRST) * rest) / _FEW
    light = _light(scene, ends, ambient)
    hits = yield from probe.told_apart(_Found.joined([first, hits]), light, 0)
    _, _, more = yield from probe.cast_all(np.unique(hits.asked_by), _MORE, 2)
    more = yield from probe.told_apart(more, light, 1)
    hits = _spread(scene, _without_translucent(scene, _Found.joined([hits, more])))
    detailed = with_details(scene, hits.triangle, hits.barycentric, hits.back)
    return detailed, probe.n_rays


class _Found:
    """Places that may need a detail.

    Attributes
    ----------
    asked_by : (n,) int64
        The bake points whose rays met them.
    triangle, barycentric, back : (n,), (n, 2), (n,)
    distance : (n,) float64
        How long the ray was.
    hidden : (n,) bool
        Whether no corner is seen.
    differs : (n,) float64
        How much its light differs from what is between the corners.
    """

    _NAMES = (
        "asked_by", "triangle", "barycentric", "back", "distance", "hidden", "differs",
    )  # fmt: skip

    def __init__(self, *arrays):
        for name, array in zip(self._NAMES, arrays, strict=True):
            setattr(self, name, array)

    def __len__(self):
        return len(self.asked_by)

    def __getitem__(self, chosen):
        return _Found(*(getattr(self, name)[chosen] for name in self._NAMES))

    @classmethod
    def joined(cls, parts):
        return cls(*(np.concatenate([getattr(p, n) for p in parts]) for n in cls._NAMES))


class _Probe:
    """Casts the rays, and sorts out what they meet."""

    def __init__(self, scene, caster, seed, sought):
        self._scene, self._caster, self._seed, self._sought = scene, caster, seed, sought
        self._sharing = Sharing(scene)
        index = scene.points.object_index
        low, high = boxes_around(index, scene.points.positions)
        self.n_rays = 0
        self._open = _OPEN * (high - low).max(axis=1)[index]

    def cast_all(self, points, count, turn):
        """Rays of some points; a generator of `Progress`.

        Parameters
        ----------
        points : (n,) int
        count : int
            Rays of each.
        turn : int
            Another one casts other rays.

        Returns
        -------
        ends : (n, count) int32
            Bake points that share what was met, negative where none does.
        ambient : (n,) float64
            How open the points are, 0 to 1.
        hits : _Found
        """

        def cast(caster, block):
            return self._cast(caster, block, count, turn)

        parts = yield from self._all(cast, points, count)
        ends, ambient, hits, n_rays = zip(*parts, strict=True)
        self.n_rays += sum(n_rays)
        hits = _Found.joined(hits)
        if self._sought is not None:
            hits = hits[self._sought(hits.triangle, _positions(self._scene, hits))]
        return np.concatenate(ends), np.concatenate(ambient), hits

    def told_apart(self, hits, light, turn):
        """Those that are hidden, or look otherwise than their corners; yields `Progress`.

        Parameters
        ----------
        hits : _Found
        light : (n_points,) float64
            See `_light`.
        turn : int

        Returns
        -------
        _Found
        """
        if not len(hits):
            return hits
        # One of each cube of space speaks for all.
        _, first, which = np.unique(
            _cubes(self._scene, hits), axis=0, return_index=True, return_inverse=True
        )

        def judge(caster, block):
            return self._judge(caster, hits[block], light, turn)

        parts = yield from self._all(judge, first, _JUDGES)
        self.n_rays += sum(n_rays for _, n_rays in parts)
        differs = np.concatenate([part for part, _ in parts])[which.reshape(-1)]
        hits.differs = np.where(hits.hidden, 1.0, differs)
        return hits[hits.differs > _DIFFER]

    def _all(self, function, items, count):
        """What `function(caster, block)` gives for blocks of items that cast `count` rays each."""
        size = max(1, _RAYS // count)
        blocks = [items[first : first + size] for first in range(0, max(len(items), 1), size)]
        together, parts = max(2, self._caster.threads), []
        for first in range(0, len(blocks), together):
            batch = blocks[first : first + together]
            parts += cast_on_all_cores(self._caster, function, batch)
            done = min((first + together) * size, len(items))
            yield Progress("details", done, len(items))
        return parts

    def _judge(self, caster, hits, light, turn):
        """How much places differ from what is between their corners, and the rays it took."""
        scene = self._scene
        front = scene.triangle_normals[hits.triangle]
        facing = np.where(hits.back[:, None], -front, front)
        places = Places(scene, hits.triangle, hits.barycentric, -facing)
        rng = generator(self._seed, Stage.DETAILS, 3 + turn, hits.asked_by[0])
        start = places.start.astype(scene.ray_origins.dtype)
        rays = start, facing, facing, self._open[hits.asked_by]
        ends, ambient, _, n_rays = self._shoot(caster, *rays, _JUDGES, rng)
        own = ambient + _sent(scene, light)[np.maximum(ends, -1)].mean(axis=1)
        between = np.einsum("mk,mk->m", places.weights.astype(np.float64), light[places.around])
        return np.abs(own - between), n_rays

    def _cast(self, caster, points, count, turn):
        all_points = self._scene.points
        rng = generator(self._seed, Stage.DETAILS, turn, points[0] if len(points) else 0)
        ends, ambient, met, n_rays = self._shoot(
            caster,
            self._scene.ray_origins[points],
            all_points.normals[points],
            all_points.geometric_normals[points],
            self._open[points],
            count,
            rng,
        )
        origin, places, chosen, distance = met
        lit = places.around[:, 0] >= 0
        away = np.where(lit[:, None], self._sharing.corner_distances(places), 0)
        hidden = lit & (chosen < 0)
        near = np.flatnonzero(hidden | (lit & (distance < away.min(axis=1))))
        places_hit = _Found(
            points[origin[near]],
            places.triangle[near],
            places.barycentric[near],
            places.back[near],
            distance[near],
            hidden[near],
            np.zeros(len(near)),
        )
        return ends, ambient, places_hit, n_rays

    def _shoot(self, caster, starts, normals, geometric, is_open, count, rng):
        """`count` rays from each of n places.

        Parameters
        ----------
        caster : RayCaster
        starts, normals, geometric : (n, 3)
        is_open : (n,) float64
            Length from which on a ray brings all light.
        count : int
        rng : numpy.random.Generator

        Returns
        -------
        ends : (n, count) int32
        ambient : (n,) float64
        met : tuple
            Of the rays that met something: place that they are of, `Places`, what they were
            handed to, length.
        n_rays : int
        """
        scene, n = self._scene, len(starts)
        shift = rng.random((n, 2), np.float32)
        ways = cosine_directions(normals, shift, count).reshape(-1, 3)
        up = np.einsum("rx,rx->r", ways, np.repeat(geometric, count, axis=0))
        above = np.flatnonzero(up > 0)
        origin = np.repeat(np.arange(n), count)[above]
        ways = ways[above]
        pick = rng.random(len(above), np.float32)
        hits = caster.intersect(starts[origin], ways)
        met = np.flatnonzero(hits.triangle >= 0)
        places = Places(scene, hits.triangle[met], hits.barycentric[met], ways[met])
        chosen, short = self._sharing.choose(caster, places, pick[met])
        ends = np.full(n * count, MISS, np.int32)
        ends[above[met]] = chosen
        # Light that reaches the place from this ray: all where it leaves, less where it is short.
        brings = np.minimum(hits.distance / is_open[origin], 1)
        ambient = np.bincount(origin, brings, n) / count
        met = origin[met], places, chosen, hits.distance[met].astype(np.float64)
        return ends.reshape(n, count), ambient, met, len(ways) + int(short.sum(dtype=np.int64))


def _without_translucent(scene, hits):
    """Those on surfaces that no light shines through: others are told by both sides at once."""
    if not scene.points.materials.translucency.any():
        return hits
    around, _ = scene.hit_points(hits.triangle, hits.barycentric, hits.back)
    return hits[~scene.points.materials.translucency[around].any(axis=(1, 2))]


def _points_around(scene, hits):
    """Bake points near those whose rays found something, and the corners of what they met."""
    if not len(hits):
        return np.zeros(0, np.int64)
    positions = scene.points.positions
    asked = positions[np.unique(hits.asked_by)]
    _, around = cKDTree(positions).query(asked, min(_AROUND, len(positions)), workers=-1)
    corners, _ = scene.hit_points(hits.triangle, hits.barycentric, hits.back)
    return np.union1d(around.ravel(), corners.ravel())


def _light(scene, ends, ambient):
    """(n_points,) received light where all that is open brings some, with a few bounces."""
    received = ambient
    for _ in range(_BOUNCES):
        received = ambient + _arriving(_sent(scene, received), ends)
    return received


def _arriving(sent, ends):
    """(n,) mean of what is sent from where rays ended, (n, count); of some places at a time."""
    result = np.empty(len(ends))
    for first in range(0, len(ends), _RAYS):
        part = slice(first, first + _RAYS)
        result[part] = sent[np.maximum(ends[part], -1)].mean(axis=1)
    return result


def _sent(scene, received):
    """(n_points + 1,) what points send on; the last is nothing."""
    sends = mean_of_channels(sent_of(scene.points.mean_materials, scene.opposite))
    if isinstance(sends, Sent):
        return np.append(sends(received[:, None])[:, 0], 0.0)
    return np.append(sends[:, 0].astype(np.float64) * received, 0.0)


def _cubes(scene, hits):
    """(n, 6) which cube of space each lies in, as large as they have to be apart."""
    level = np.ceil(np.log2(np.maximum(_apart(hits), 1e-12)))
    place = _positions(scene, hits)
    facing = scene.triangle_normals[hits.triangle] * np.where(hits.back, -1, 1)[:, None]
    return np.column_stack(
        [level, np.floor(place / np.exp2(level)[:, None]), np.rint(4 * facing),
         scene.triangle_object[hits.triangle]]
    )  # fmt: skip


def _positions(scene, hits):
    """(n, 3) float64 where each lies."""
    second, third = hits.barycentric.astype(np.float64).T[:, :, None]
    a, b, c = np.moveaxis(scene.vertices[scene.triangles[hits.triangle]], 1, 0)
    return a + second * (b - a) + third * (c - a)


def _apart(hits):
    return np.where(hits.hidden, _HIDDEN_APART, _APART) * hits.distance


def _spread(scene, hits):
    """As many of them as have to be, apart from each other as their rays were long."""
    if not len(hits):
        return hits
    # Of each cube of space the one that matters most, then the first.
    key = _cubes(scene, hits)
    order = np.lexsort((np.arange(len(hits)), -hits.differs))
    _, first = np.unique(key[order], axis=0, return_index=True)
    kept = np.sort(order[first])
    most = max(_LEAST_MOST, int(_MOST * len(scene.points)))
    if len(kept) > most:
        weight = (hits.differs * _apart(hits) ** 2)[kept]
        kept = np.sort(kept[np.argsort(-weight, kind="stable")[:most]])
    return hits[kept]
