"""Gloss where a camera looks: lobes at the normals and views of pixels, and mirrors by rays.

A pixel lies between bake points. Its lobes are those of its own normal, material and way to the
viewer; the light that they reflect is that of the fields of the points around. Lobes that are
narrower than a field can tell send one ray along the mirrored direction, and show the sky or what
the ray meets, as that looks from there.
"""

from dataclasses import dataclass, fields

import numpy as np

from prt_core.errors import expect
from prt_core.relight.highlights import highlights
from prt_core.scene import ended_share
from prt_core.transport.mirror import mirrored_share

# Mirrors in mirrors, until what they show is looked up in texels.
_DEPTH = 2
# Of two the number of samples of a wide lamp.
_POWER = 3
# Samples worked on at once.
_PART = 1 << 17


@dataclass(frozen=True)
class Places:
    """Places between bake points, each seen from one side.

    Attributes
    ----------
    points : (k, 3) int32
    weights : (k, 3) float32
        Of the points; they sum to 1.
    triangle : (k,) int32
    outgoing : (k, 3) float32
        Unit vectors towards who sees them.
    dither : (k,) float32
        Which of the points gives its field, 0 to 1.
    """

    points: np.ndarray
    weights: np.ndarray
    triangle: np.ndarray
    outgoing: np.ndarray
    dither: np.ndarray

    def __len__(self):
        return len(self.points)

    def __getitem__(self, some):
        return Places(*(getattr(self, field.name)[some] for field in fields(self)))

    def between(self, values):
        """(k, c): values (n_points, c) of all points, in between."""
        return np.einsum("km,kmc->kc", self.weights, values[self.points])


@dataclass(frozen=True)
class PixelLight:
    """What pixels show, but for their gloss.

    Attributes
    ----------
    even : (n_points, 3) float32
        What points send out to all sides that they received.
    own : (n_points, 3) float32, or None
        Of themselves.
    sky : callable((m, 3) directions) -> (m, 3)
    lamps : sequence of LitLamp
    """

    even: np.ndarray
    own: np.ndarray | None
    sky: object
    lamps: tuple = ()


class GlossyPixels:
    """Shades what a camera sees.

    Parameters
    ----------
    scene : Scene
    parts : list of GlossyPoints
        Under the light.
    lobes : PointLobes
        Of their points, one part after the other.
    make_caster : callable() -> RayCaster
        Called when there is a mirror.

    Attributes
    ----------
    n_rays : int
        That mirrors of the last picture cast.
    """

    def __init__(self, scene, parts, lobes, make_caster):
        self._scene, self._parts, self._lobes = scene, parts, lobes
        self._make_caster, self._caster, self.n_rays = make_caster, None, 0
        self._narrowest = min(part.narrowest for part in parts)
        n_points = len(scene.points)
        self._part_of = np.full(n_points, -1, np.int32)
        self._row_of = np.full(n_points, -1, np.int32)
        self._first = np.zeros(len(parts), np.int32)
        first = 0
        for index, part in enumerate(parts):
            self._first[index] = first
            self._part_of[part.points] = index
            self._row_of[part.points] = first + np.arange(len(part.points))
            first += len(part.points)

    def close(self):
        """Let go of the rays' caster."""
        if self._caster is not None:
            self._caster.close()
        self._caster = None

    def radiance(self, rays, light):
        """What the samples of a picture show.

        Parameters
        ----------
        rays : CameraRays
        light : PixelLight

        Returns
        -------
        (n_lit, 3) float32
            Of `rays.lit`.
        """
        n_points, n_triangles = len(self._scene.points), len(self._scene.triangles)
        expect(
            rays.points.max(initial=-1) < n_points and rays.triangle.max(initial=-1) < n_triangles,
            "rays: expected those of the baked scene; they met another one",
        )
        self.n_rays, lit = 0, rays.lit
        row, column = np.divmod(lit, rays.width * rays.samples)
        places = Places(
            rays.points[lit], rays.weights[lit], rays.triangle[lit], -rays.directions[lit],
            ordered_dither(row, column),
        )  # fmt: skip
        return self._shaded(places, light, _DEPTH)

    def _shaded(self, places, light, depth):
        result = np.empty((len(places), 3), np.float32)
        for first in range(0, len(places), _PART):
            part = slice(first, first + _PART)
            result[part] = self._radiance(places[part], light, depth)
        return result

    def _radiance(self, places, light, depth):
        result = places.between(light.even).astype(np.float32)
        glossy = np.flatnonzero((self._row_of[places.points] >= 0).any(axis=1))
        if len(glossy):
            reflected, diffuse = self._reflected(places[glossy], light, depth)
            result[glossy] = result[glossy] * diffuse + reflected
        return result if light.own is None else result + places.between(light.own)

    def _reflected(self, places, light, depth):
        """What lobes send to the viewer, and what they leave of diffuse light."""
        normals = self._normals(places)
        cosine = np.einsum("kx,kx->k", normals, places.outgoing)
        rows = self._row_of[places.points]
        groups, diffuse = self._lobes.between(rows, places.weights, cosine)
        frames = None
        if light.lamps or any((alpha[:, 0] != alpha[:, 1]).any() for alpha, _ in groups):
            frames = self._lobes.frames_between(rows, places.weights, normals)
        result = np.zeros((len(places), 3), np.float32)
        mirrored = np.zeros_like(result)
        for alpha, powers in groups:
            there = (cosine > 0) & powers.any(axis=(1, 2))
            narrow = alpha.max(axis=1) < self._narrowest if depth else np.zeros(len(places), bool)
            some = np.flatnonzero(there & narrow)
            mirrored[some] += mirrored_share(cosine[some], powers[some])
            some = np.flatnonzero(there & ~narrow)
            lobes = alpha[some], powers[some], None if frames is None else frames[some]
            result[some] += self._of_fields(places[some], normals[some], *lobes)
        some = np.flatnonzero(mirrored.any(axis=1))
        if len(some):
            seen = self._mirrored(places[some], normals[some], cosine[some], light, depth)
            result[some] += mirrored[some] * seen
        for lit in light.lamps:
            result += self._highlights(places, groups, frames, lit)
        return result, diffuse * self._rough_share(places, normals)

    def _normals(self, places):
        """(k, 3) float32: smooth normals, as renderers have them between corners."""
        normals = places.between(self._scene.points.normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        flat = self._geometric(places)
        return np.where(length > 1e-6, normals / np.maximum(length, 1e-30), flat).astype(np.float32)

    def _geometric(self, places):
        """(k, 3) float32: normals of the triangles, on the side that is seen."""
        normals = self._scene.triangle_normals[places.triangle]
        back = np.einsum("kx,kx->k", normals, places.outgoing) < 0
        return normals * np.where(back, np.float32(-1), np.float32(1))[:, None]

    def _of_fields(self, places, normals, alpha, powers, frames):
        """What lobes reflect of the field of one point around each place."""
        point = self._chosen(places)
        owner, result = self._part_of[point], np.zeros((len(places), 3), np.float32)
        for index, part in enumerate(self._parts):
            mine = np.flatnonzero(owner == index)
            if len(mine):
                result[mine] = part.reflected(
                    self._row_of[point[mine]] - self._first[index],
                    normals[mine], places.outgoing[mine], alpha[mine], powers[mine],
                    None if frames is None else frames[mine],
                )  # fmt: skip
        return result

    def _rough_share(self, places, normals):
        """(k, 3): what rough diffuse lobes send, in parts of what leaves evenly."""
        point = self._chosen(places)
        owner, result = self._part_of[point], np.ones((len(places), 3), np.float32)
        for index, part in enumerate(self._parts):
            mine = np.flatnonzero(owner == index)
            rows = self._row_of[point[mine]] - self._first[index]
            result[mine] = part.rough_share(rows, normals[mine], places.outgoing[mine])
        return result

    def _chosen(self, places):
        """(k,) a glossy point of each place, as often as it has weight."""
        weights = places.weights * (self._row_of[places.points] >= 0)
        ends = np.cumsum(weights, axis=1)
        which = (ends <= (places.dither * ends[:, 2])[:, None]).sum(axis=1)
        # By rounding a point without weight may come out, which may be one without a field.
        which = np.minimum(which, 2)
        taken = np.take_along_axis(weights, which[:, None], axis=1)[:, 0]
        which = np.where(taken > 0, which, weights.argmax(axis=1))
        return np.take_along_axis(places.points, which[:, None], axis=1)[:, 0]

    def _mirrored(self, places, normals, cosine, light, depth):
        """Radiance along the mirrored directions: of the sky, or of what is met there."""
        ways = 2 * cosine[:, None] * normals - places.outgoing
        flat = self._geometric(places)
        below = np.einsum("kx,kx->k", ways, flat)[:, None]
        # Smooth normals of coarse faces mirror into the surface: then along it.
        ways = ways + np.maximum(np.float32(1e-3) - below, 0) * flat
        ways = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
        scene = self._scene
        starts = places.between(scene.points.positions)
        starts = starts + scene.triangle_lifts[places.triangle][:, None] * flat
        starts = starts.astype(scene.ray_origins.dtype)
        if self._caster is None:
            self._caster = self._make_caster()
        hits = self._caster.intersect(starts, ways)
        self.n_rays += len(ways)
        result = np.zeros((len(places), 3), np.float32)
        free = hits.triangle < 0
        result[free] = light.sky(ways[free])
        met = np.flatnonzero(~free)
        triangle = hits.triangle[met]
        back = np.einsum("kx,kx->k", ways[met], scene.triangle_normals[triangle]) > 0
        points, weights = scene.hit_points(triangle, hits.barycentric[met], back)
        share = ended_share(scene, triangle, hits.barycentric[met], back, points, weights)
        lit = points[:, 0] >= 0
        there = Places(points, weights, triangle, -ways[met], places.dither[met])[lit]
        result[met[lit]] = self._shaded(there, light, depth - 1) / share[lit, None]
        return result

    def _highlights(self, places, groups, frames, lit_lamp):
        received = places.between(lit_lamp.received).astype(np.float32)
        result = np.zeros((len(places), 3), np.float32)
        lit = np.flatnonzero(received.any(axis=1))
        if len(lit):
            here = places[lit]
            groups = [(alpha[lit], powers[lit]) for alpha, powers in groups]
            world = self._scene.to_world(here.between(self._scene.points.positions))
            work = groups, frames[lit], lit_lamp.lamp, received[lit], world, here.outgoing
            result[lit] = highlights(*work, _POWER, lit_lamp.seen_at(here.points, here.weights))
        return result


def ordered_dither(row, column):
    """Thresholds in squares of 8 x 8, each of them once (Bayer 1973).

    Parameters
    ----------
    row, column : (k,) int

    Returns
    -------
    (k,) float32
        Above 0 and below 1.
    """
    value = np.zeros(len(row), np.int64)
    for bit in range(3):
        across, down = (column >> bit) & 1, (row >> bit) & 1
        value = 4 * value + 2 * (across ^ down) + down
    return ((value + 0.5) / 64).astype(np.float32)
