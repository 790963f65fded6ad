"""How far views of a bake with gloss are off, by new rays, under lights and views not known before.

At some points all that lies above the horizon is traced anew, a ray through each texel, with what
it meets between its bake points. Lobes are summed over all of that, texel by texel, and held
against what a view makes of the bake: lobes over the field of incoming light, from the visibility
and the reflections that were baked. Light between surfaces has come straight there, on both sides:
bounces have an error of their own. Metal that is seen in metal counts as the colour that stands in
for it, so how much of that there is is told beside the error.
"""

import time
from dataclasses import dataclass

import numpy as np

from prt_core.bake.bake import Bake
from prt_core.bake.reflections import reflection_tables
from prt_core.bake.visibility import add_seconds, read_visibility
from prt_core.errors import expect
from prt_core.reflectance.mean_gloss import more_by_gloss
from prt_core.relight.glossy_points import METAL, GlossyPoints, metal_among
from prt_core.relight.point_lobes import PointLobes
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling.certificate import probe_lights
from prt_core.sphere import square_to_cosine, tangent_frames
from prt_core.transport import Reflections, Transport
from prt_core.transport.view_weights import ViewWeights

# Points that are traced anew, at most and at least, and one of so many of small bakes; views of
# each, and points traced together.
_POINTS, _FEWEST, _ONE_OF, _VIEWS, _TOGETHER = 192, 48, 32, 4, 32
# Least cosine of a view.
_GRAZING = 0.2


@dataclass(frozen=True)
class GlossError:
    """What was found out.

    Attributes
    ----------
    errors : dict of str -> float
        Relative L2 of what glossy points show to views, diffuse light included, under each light.
    points, views, rays : int
    metal : float
        How much of what stands around these points is metal, of whose highlights in each other
        nothing is known here: 0 to 1.
    """

    errors: dict
    points: int
    views: int
    rays: int
    metal: float = 0.0

    @property
    def worst(self):
        """(name, error) of the light under which it is largest."""
        return max(self.errors.items(), key=lambda item: item[1])


def gloss_certificate_steps(store, scene, cube_map, caster, settings, lights, seconds, memory):
    """The `GlossError` of a bake whose reflections are stored; a generator of `Progress`.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    lights : dict of str -> (n_directions, 3) float32, callable() -> dict, or None
    seconds : dict of str -> float
        By stage; added to.
    memory : Memory

    Returns
    -------
    GlossError, or None
        None where nothing has gloss, or mirrors alone do, which are traced when they are seen.
    """
    if not store.attributes.get("reflections"):
        return None
    start = time.perf_counter()
    yield Progress("gloss certificate", 0, 1)
    shape = len(scene.points), -(-cube_map.n_directions // 8)
    bits = read_visibility(store, shape, memory)
    points = scene.points
    transport = Transport(
        cube_map, bits, None, points.normals, points.materials,
        mean_materials=points.mean_materials,
        opposite=scene.opposite if points.materials.through.any() else None,
    )  # fmt: skip
    rng = generator(settings.seed, Stage.GLOSS_CERTIFICATE)
    tables = list(reflection_tables(store, scene, cube_map))
    n_glossy = sum(len(of) for of, _, _ in tables)
    count = min(_POINTS, max(_FEWEST, n_glossy // _ONE_OF)) // len(tables)
    parts = []
    for of, divided, read in tables:
        rows = _some(of, points, cube_map, rng, count)
        if len(rows):
            some = [tuple(table[rows] for table in read())]
            parts.append(Reflections.of_tables(of[rows], divided, some))
    if not parts:
        return None
    bake = Bake(scene, transport, [], None, None, settings.stored(), {})
    some = np.concatenate([part.points for part in parts])
    lobes = PointLobes(points.materials[some], points.normals[some])
    glossy, first = [], 0
    for part in parts:
        glossy.append(GlossyPoints(bake, part, lobes, first))
        first += len(part)
    views = [_view(scene, some, rng) for _ in range(_VIEWS)]
    seen, rays = [], 0
    for begin in range(0, len(some), _TOGETHER):
        rows = some[begin : begin + _TOGETHER]
        seen.append(_traced(scene, cube_map, caster, rows))
        rays += seen[-1].n_rays
        yield Progress("gloss certificate", begin + len(rows), len(some))
    weights = ViewWeights(scene, transport, parts, lobes, views[0], glossy[0].narrowest, METAL)
    more, shown, lit = more_by_gloss(transport.materials), {}, {}
    lights = (lights() if callable(lights) else lights) or probe_lights(cube_map)
    lights = {name: np.asarray(light, np.float32) for name, light in lights.items()}
    # Of all at once: what points see is unpacked for them together.
    every = transport.received(np.hstack(list(lights.values())))
    for index, (name, light) in enumerate(lights.items()):
        received = np.ascontiguousarray(every[:, 3 * index : 3 * index + 3])
        sent = transport.exit_radiance(received).toward()
        even = sent - transport.materials.stand_in * received
        sent = sent + more * received
        for part in glossy:
            part.light(light, sent)
        shown[name] = [_shown(glossy, view, even) for view in views]
        lit[name] = light, sent, even
        yield Progress("gloss certificate", len(shown), len(shown))
    sums = {name: np.zeros(2) for name in lit}
    for turn, view in enumerate(views):
        truths = _truths(weights.toward(view), some, seen, lit.values())
        for name, truth in zip(lit, truths, strict=True):
            away = (shown[name][turn] - truth).astype(np.float64)
            sums[name] += (away**2).sum(), (truth.astype(np.float64) ** 2).sum()
        yield Progress("gloss certificate", turn + 1, len(views))
    errors = {name: float(np.sqrt(a / b)) if b else 0.0 for name, (a, b) in sums.items()}
    add_seconds(seconds, "gloss certificate", time.perf_counter() - start)
    return GlossError(errors, len(some), _VIEWS, rays, _metal_around(points, parts))


def _some(candidates, points, cube_map, rng, count):
    """(n,) int: the places of some of the glossy points (k,) whose lobes no mirrors are."""
    lobes = PointLobes(points.materials[candidates], points.normals[candidates])
    # As seen from straight above: a mirror stays one.
    groups, _ = lobes.at(np.arange(len(candidates)), np.ones(len(candidates), np.float32))
    # Where one has no lobe of a kind, as no coat, others count.
    least = np.min([np.where(p.any(axis=(1, 2)), a.min(axis=1), np.inf) for a, p in groups], axis=0)
    texel = np.pi / 2 / cube_map.resolution
    shows = np.isfinite(least) & (least > texel / 2)
    good = np.flatnonzero(shows & points.visible[candidates])
    if len(good) > count:
        good = np.sort(rng.choice(good, count, replace=False))
    return good


def _view(scene, some, rng):
    """(n_points, 3) float32: a view of some points each, of others from behind."""
    normals = scene.points.normals
    outgoing = -normals.copy()
    local = square_to_cosine(rng.random((len(some), 2)))
    local[:, 2] = np.maximum(local[:, 2], _GRAZING)
    world = np.einsum("ij,ijk->ik", local, tangent_frames(normals[some]))
    outgoing[some] = world / np.linalg.norm(world, axis=1, keepdims=True)
    return outgoing


def _metal_around(points, parts):
    """How much of what is met from metal by some reflections is metal too, by solid angle."""
    metal = total = 0.0
    for part in parts:
        strong = np.repeat(metal_among(points, part.points), np.diff(part.start))
        met, block = part.met[strong], part.block[strong]
        size = part.share[strong] * part.blocks.solid_angles[block]
        kinds, which = np.unique(met, return_inverse=True)
        # Negative numbers are of what returns no light.
        shines = (kinds >= 0) & metal_among(points, np.maximum(kinds, 0))
        metal += float(size @ shines[which])
        total += float(size.sum())
    return metal / total if total else 0.0


@dataclass(frozen=True)
class _Seen:
    """What some points see along every texel: the sky, or bake points with weights."""

    free: np.ndarray  # (n, n_directions) bool
    row: np.ndarray
    texel: np.ndarray
    points: np.ndarray  # (m, 3)
    weights: np.ndarray
    n_rays: int


def _traced(scene, cube_map, caster, rows):
    directions = cube_map.samples.astype(np.float32)
    points = scene.points
    above = points.normals[rows] @ cube_map.vectors.T > 0
    above &= points.geometric_normals[rows] @ directions.T > 0
    row, texel = np.nonzero(above)
    ways = directions[texel]
    triangle, barycentric = [], []
    for first in range(0, len(row), caster.batch):
        part = slice(first, first + caster.batch)
        hits = caster.intersect(scene.ray_origins[rows[row[part]]], ways[part])
        triangle.append(hits.triangle)
        barycentric.append(hits.barycentric)
    triangle, barycentric = np.concatenate(triangle), np.concatenate(barycentric)
    free = np.zeros(above.shape, bool)
    free[row, texel] = triangle < 0
    met = np.flatnonzero(triangle >= 0)
    back = np.einsum("ix,ix->i", ways[met], scene.triangle_normals[triangle[met]]) > 0
    around, weights = scene.hit_points(triangle[met], barycentric[met], back)
    lit = (around >= 0).all(axis=1)
    met = met[lit]
    return _Seen(free, row[met], texel[met], around[lit], weights[lit], len(row))


def _shown(glossy, view, even):
    """(n, 3): what a view shows of the points, by the fields."""
    result = []
    for part in glossy:
        rows = np.arange(len(part.points))
        reflected, diffuse = part.toward(rows, view[part.points])
        result.append(reflected + diffuse * even[part.points])
    return np.concatenate(result)


def _truths(weights, some, seen, lights):
    """(n, 3) under each light: the same, summed over all that was traced anew."""
    lights, first = list(lights), 0
    result = np.empty((len(lights), len(some), 3), np.float32)
    for part in seen:
        rows = slice(first, first + len(part.free))
        first = rows.stop
        lobe, diffuse = weights.lobes_at(some[rows])
        open_, there = lobe * part.free[:, None], lobe[part.row, :, part.texel]
        for index, (light, sent, even) in enumerate(lights):
            total = np.einsum("ncd,dc->nc", open_, light)
            met = there * np.einsum("mk,mkc->mc", part.weights, sent[part.points])
            for channel in range(3):
                total[:, channel] += np.bincount(part.row, met[:, channel], len(total))
            result[index, rows] = total + diffuse * even[some[rows]]
    expect(np.isfinite(result).all(), "gloss: what views show is not finite")
    return result
