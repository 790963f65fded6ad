"""Casters over what rays of a kind meet, and through what lets light pass."""

import numpy as np

from prt_core.errors import expect_one_of
from prt_core.rays import EmptyCaster, FramedCaster, PassingCaster, SubsetCaster, make_caster
from prt_core.scene.mesh import RAYS


def caster_of(scene, name, rays, resolution):
    """A caster over the triangles of a scene (see `Scene.make_caster`)."""
    expect_one_of("rays", rays, RAYS.values())
    flag = next(flag for flag, kind in RAYS.items() if kind == rays)
    met = np.array([getattr(item, flag) for item in scene.objects], bool)[scene.triangle_object]
    if scene.opacity is None:
        return _caster_over(scene, name, met)
    passing = met & scene.opacity.passing
    if not passing.any():
        return _caster_over(scene, name, met)
    opaque = _caster_over(scene, name, met & ~passing)
    try:
        others = _caster_over(scene, name, passing)
    except BaseException:
        opaque.close()
        raise
    return PassingCaster(opaque, others, scene.opacity.at, _Behind(scene), resolution)


def _caster_over(scene, name, met):
    """A caster over some triangles, (n_triangles,) bool; its hits have the scene's numbers."""

    def factory(vertices, triangles):
        return make_caster(name, vertices, triangles)

    if not met.any():
        return EmptyCaster()
    whole = bool(met.all())
    triangles = scene.triangles if whole else scene.triangles[met]
    if len(scene.frames) == 1:
        caster = factory(scene.vertices.astype(np.float32), triangles)
    else:
        frames = scene.frames if whole else scene.frames.of_some(met)
        caster = FramedCaster(factory, scene.vertices, triangles, frames)
    return caster if whole else SubsetCaster(caster, np.flatnonzero(met))


class _Behind:
    """Where hits lie, and where rays that go on start (see `PassingCaster`)."""

    def __init__(self, scene):
        self._scene = scene

    def __call__(self, triangle, barycentric, directions):
        scene = self._scene
        front = scene.triangle_normals[triangle].astype(np.float64)
        onwards = np.where(np.einsum("mx,mx->m", directions, front) > 0, 1.0, -1.0)
        second, third = np.asarray(barycentric, np.float64).T[:, :, None]
        a, b, c = np.moveaxis(scene.vertices[scene.triangles[triangle]], 1, 0)
        place = a + second * (b - a) + third * (c - a)
        return place, place + (onwards * scene.triangle_lifts[triangle])[:, None] * front
