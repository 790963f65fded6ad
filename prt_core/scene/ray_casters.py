"""Casters over what rays of a kind meet, and through what lets light pass."""

import numpy as np

from prt_core.errors import expect_one_of
from prt_core.rays import EmptyCaster, FramedCaster, PassingCaster, SubsetCaster, make_caster
from prt_core.scene.mesh import RAYS
from prt_core.scene.pieces import Pieces, pieces_of

# Weights of the second and third corner at the corners of a triangle.
_WHOLE = np.array([[0.0, 0], [1, 0], [0, 1]])


def caster_of(scene, name, rays, resolution, objects=None):
    """A caster over the triangles of a scene (see `Scene.make_caster`)."""
    expect_one_of("rays", rays, RAYS.values())
    flag = next(flag for flag, kind in RAYS.items() if kind == rays)
    met = np.array([getattr(item, flag) for item in scene.objects], bool)
    met = (met if objects is None else met & objects)[scene.triangle_object]
    opacity = scene.shadow_opacity if rays == "shadow" else scene.opacity
    if opacity is None:
        return _caster_over(scene, name, met)
    passing = met & opacity.passing
    if not passing.any():
        return _caster_over(scene, name, met)
    pieces = pieces_of(opacity, np.flatnonzero(passing))
    opaque = _caster_over(scene, name, met & ~passing, pieces, pieces.is_opaque)
    if pieces.is_opaque.all():
        return opaque
    try:
        others = _caster_over(scene, name, np.zeros_like(met), pieces, ~pieces.is_opaque)
    except BaseException:
        opaque.close()
        raise

    def opacity_at(triangle, barycentric, directions):
        if opacity.back is None:
            return opacity.at(triangle, barycentric)
        behind = np.einsum("mx,mx->m", directions, scene.triangle_normals[triangle]) > 0
        return opacity.at(triangle, barycentric, behind)

    return PassingCaster(opaque, others, opacity_at, _Behind(scene), resolution)


def _caster_over(scene, name, met, pieces=None, chosen=None):
    """A caster over triangles, (n_triangles,) bool, and pieces; hits are of the scene's triangles.

    `chosen` : (n_pieces,) bool.
    """

    def factory(vertices, triangles):
        return make_caster(name, vertices, triangles)

    vertices, triangles, numbers, corners = scene.vertices, scene.triangles, None, None
    if not met.all():
        numbers = np.flatnonzero(met)
        triangles = triangles[numbers]
    if chosen is not None and chosen.any():
        more = Pieces(pieces.triangle[chosen], pieces.corners[chosen], pieces.is_opaque[chosen])
        cut = len(vertices) + np.arange(3 * len(more.triangle), dtype=np.int32).reshape(-1, 3)
        vertices = np.concatenate([vertices, more.positions(scene)])
        whole = np.broadcast_to(_WHOLE, (len(triangles), 3, 2))
        corners = np.concatenate([whole, more.corners])
        triangles = np.concatenate([triangles, cut])
        numbers = np.concatenate([numbers, more.triangle])
    if not len(triangles):
        return EmptyCaster()
    if len(scene.frames) == 1:
        caster = factory(vertices.astype(np.float32), triangles)
    else:
        frames = scene.frames if numbers is None else scene.frames.of_some(numbers)
        caster = FramedCaster(factory, vertices, triangles, frames)
    return caster if numbers is None else SubsetCaster(caster, numbers, corners)


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
