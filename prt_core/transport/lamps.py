"""Direct light of lamps at the bake points, by shadow rays: what K then bounces."""

import numpy as np

from prt_core.errors import expect_all, expect_caster, expect_kind, expect_seed, expect_whole
from prt_core.light.bright import BrightPixels
from prt_core.light.local import Lamp, lamp_samples
from prt_core.rays import transmitted
from prt_core.reflectance.bump import bump_mean, bump_shadowing
from prt_core.reflectance.oren_nayar import seen_from_above
from prt_core.runtime.progress import Pace, Progress, run
from prt_core.runtime.seeds import Stage, generator
from prt_core.runtime.threads import on_all_cores
from prt_core.scene import Scene

# Shadow rays end this share of their length before the lamp, and so many steps of float32 of the
# lamp's coordinates: a ceiling in which a lamp lies does not shade it, whatever rounding says.
_SHORT, _STEPS = 1 - 2e-6, 16 * 2.0**-24
# Points whose random numbers are drawn together; rays a call of the caster at most.
_BLOCK, _RAYS = 4096, 1 << 18
# Rays that are aimed at once.
_PIECE = 1 << 15


def lamp_light(scene, caster, lamps, n_samples=256, seed=0):
    """Irradiance / pi of lamps at all points (direct-to-indirect transfer gathers it onwards).

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    lamps : sequence of Lamp or BrightPixels
    n_samples : int
        Shadow rays a point and lamp; a lamp without size needs one.
    seed : int

    Returns
    -------
    (n_points, 3) float32
    """
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    lamps = expect_all("lamps", lamps, Lamp | BrightPixels, "lamps")
    received = np.zeros((len(scene.points), 3), np.float32)
    for index, lamp in enumerate(lamps):
        own = lamp.blockers is not None
        blockers = blocking_caster(scene, lamp, caster.name) if own else caster
        try:
            received += run(lamp_steps(scene, blockers, lamp, n_samples, (seed, index)))
        finally:
            if own and blockers is not None:
                blockers.close()
    return received


def blocking_caster(scene, lamp, name="auto"):
    """A ray caster over the objects that are in a lamp's way; None where nothing is.

    Parameters
    ----------
    scene : Scene
    lamp : Lamp or BrightPixels
    name : str
        See `Scene.make_caster`.
    """
    if not lamp.casts_shadow:
        return None
    if lamp.blockers is None:
        return scene.make_caster(name, "shadow")
    blocking = scene.objects_named(lamp.blockers)
    if not blocking[scene.triangle_object].any():
        return None
    return scene.make_caster(name, "shadow", objects=blocking)


def lamp_steps(scene, caster, lamp, n_samples=256, seed=(0, 0), pace=None, alike=False, cells=None):
    """`lamp_light` of one lamp, as a generator of `Progress`.

    Parameters
    ----------
    caster : RayCaster, or None
        Over the objects that are in the lamp's way (see `blocking_caster`).
    seed : sequence of int
    pace : Pace, optional
        In rays.
    alike : bool
        Whether all points ask for the same places of the lamp: what differs between points is then
        never chance.
    cells : LampCells, optional
        Takes note of which parts of the lamp points see.
    """
    expect_kind("scene", scene, Scene)
    if caster is not None:
        expect_caster(caster)
    expect_kind("lamp", lamp, (Lamp, BrightPixels))
    n_samples = expect_whole("n_samples", n_samples, 1, 1 << 20)
    for number in seed if isinstance(seed, tuple) else (seed,):
        expect_seed(number)
    points = scene.points
    n_points = len(points)
    world = scene.to_world(scene.ray_origins)
    shadow = caster if lamp.casts_shadow else None
    received = np.zeros((n_points, 3))
    receives = None
    if lamp.receivers is not None:
        receives = scene.objects_named(lamp.receivers)[points.object_index]
    count = 1 if lamp.is_small else n_samples
    rays = pace or Pace()
    for block in range(0, n_points, _BLOCK):
        inside = slice(block, min(block + _BLOCK, n_points))
        rng = generator(seed[0], Stage.LAMPS, *seed[1:], block)
        shift = rng.random((inside.stop - block, 2))
        uv = lamp_samples(count, 0 * shift + 0.5 if alike else shift)
        # Ray r is for sample r; a step is a range of rays.
        n_rays = (inside.stop - block) * count
        if cells is not None:
            cells.begin(inside)
        samples = _Samples(scene, world, lamp, receives, block, uv.reshape(-1, 2), count)
        for first in range(0, n_rays, _RAYS):
            for part in rays.parts(first, min(first + _RAYS, n_rays)):
                point, aim, light, share = samples.shaded(shadow, part)
                if len(point):
                    some = slice(point[0], point[-1] + 1)
                    for channel in range(3):
                        sums = np.bincount(point - point[0], light[:, channel])
                        received[some, channel] += sums
                if cells is not None:
                    cells.take(point, aim, share)
                rays.worked()
                yield Progress("lamps", block + (part.stop - 1) // count + 1, n_points)
        if cells is not None:
            cells.end()
    # A lamp in the surface itself may give more than float32 holds: infinity, which bounces refuse.
    with np.errstate(over="ignore"):
        return (received / (np.pi * count)).astype(np.float32)


class _Samples:
    """Samples of a lamp for the points of one block, as many of each, one point after the other.

    Parameters
    ----------
    scene : Scene
    world : (n_points, 3) float64
        Where rays start.
    lamp : Lamp or BrightPixels
    receives : (n_points,) bool, or None
        Which points it lights; None: all.
    first : int
        The first point of the block.
    uv : (n, 2) float64
        Where on the lamp.
    count : int
        Samples of each point.
    """

    def __init__(self, scene, world, lamp, receives, first, uv, count):
        self._scene, self._world, self._lamp, self._receives = scene, world, lamp, receives
        self._first, self._uv, self._count = first, uv, count

    def shaded(self, caster, part):
        """Those of a slice that can bring light, and what they do.

        Parameters
        ----------
        caster : RayCaster, or None
            Over what may be in the way.
        part : slice

        Returns
        -------
        point : (k,) int
            Ascending.
        uv : (k, 2) float64
        light : (k, 3) float64
            Irradiance, were each all of the lamp.
        share : (k,) float
            Of light that gets along the ray; it is in `light`.
        """
        pieces = range(part.start, part.stop, _PIECE)
        aimed = on_all_cores(
            self._aimed, [slice(first, min(first + _PIECE, part.stop)) for first in pieces]
        )
        point, uv, direction, limit, light = (
            np.concatenate(each) for each in zip(*aimed, strict=True)
        )
        if caster is None or not len(point):
            return point, uv, light, np.ones(len(point))
        limit = limit if np.isfinite(limit).all() else None
        share = transmitted(caster, self._scene.ray_origins[point], direction, limit)
        # A lamp in the surface gives infinity: nothing of it, where it is blocked.
        light[share == 0] = 0
        light *= np.where(share > 0, share, 1)[:, None]
        return point, uv, light, share

    def _aimed(self, part):
        """Points, places on the lamp, directions, lengths of rays and unshaded light of a slice."""
        point, uv = self._first + np.arange(part.start, part.stop) // self._count, self._uv[part]
        direction, distance, irradiance = self._lamp.sample(self._world[point], uv)
        light = _unshaded(self._scene.points, point, direction, irradiance)
        lit = (light[:, 0] != 0) | (light[:, 1] != 0) | (light[:, 2] != 0)
        if self._receives is not None:
            lit &= self._receives[point]
        lit = np.flatnonzero(lit)
        point, direction = point[lit], direction[lit]
        starts, distance = self._scene.ray_origins[point], distance[lit] / self._scene.size
        limit = before_the_lamp(starts, direction, distance)
        return point, uv[lit], direction.astype(np.float32), limit, light[lit]


def before_the_lamp(starts, directions, distances):
    """(n,) float32: how far shadow rays go, all in the scene's frame; infinity stays."""
    ends = starts + directions * np.where(np.isfinite(distances), distances, 0)[:, None]
    steps = _STEPS * np.maximum(np.abs(ends).max(axis=1), np.abs(starts).max(axis=1))
    return np.maximum(distances * _SHORT - steps, 0).astype(np.float32)


def _unshaded(points, which, direction, irradiance):
    """(n, 3) what each sample would bring if nothing were in the way; 0 behind the surface."""
    cosine = np.einsum("ij,ij->i", points.normals[which], direction)
    above = np.einsum("ij,ij->i", points.geometric_normals[which], direction)
    strength = points.materials.bump[:, 0]
    if strength.any():
        strength = strength[which]
        cosine = cosine * bump_shadowing(strength, above) / bump_mean(strength)
    light = np.where((cosine > 0) & (above > 0), cosine, 0)[:, None] * irradiance
    rough = points.materials.diffuse_roughness[:, 0]
    if rough.any():
        some = np.flatnonzero((rough[which] > 0) & (cosine > 0))
        point = which[some]
        colour = points.materials.albedo[point] - points.materials.stand_in[point]
        light[some] *= seen_from_above(cosine[some], rough[point], colour)
    return light
