"""Images whose pixels are bake points, and what a fixed camera sees as one of them.

Such points receive light and bounce none: rays end at the points of the meshes, so the bake goes
on as ever. A pixel is the mean of its points, which smooths its edges.
"""

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from prt_core.errors import expect, expect_caster, expect_offers, expect_whole
from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.scene.backs import backs_of
from prt_core.scene.camera import Camera, expect_camera, view_rays
from prt_core.scene.ended import ended_share
from prt_core.scene.points import BakePoints, joined

_BATCH = 1 << 20


@dataclass(frozen=True)
class PointImage:
    """Which points each pixel shows.

    Attributes
    ----------
    height, width : int
    samples : int
        Points of a whole pixel; where fewer meet the scene the rest is black.
    pixel : (m,) int32
        In reading order, sorted.
    point : (m,) int32
        A bake point that `pixel` shows.
    camera : Camera, optional
        That sees it; None: an image of a surface, which nobody looks at.
    atlas : Atlas, optional
        By which UV maps it shows objects, where it is for them to wear.
    """

    height: int
    width: int
    samples: int
    pixel: np.ndarray
    point: np.ndarray
    camera: Camera | None = None
    atlas: object = None

    def digest(self):
        """Of what it shows: the same for the same image only."""
        digest = hashlib.blake2b(digest_size=16)
        digest.update(f"{self.height} {self.width} {self.samples};".encode())
        for array in (self.pixel, self.point):
            digest.update(np.ascontiguousarray(array, np.int32))
        return digest.hexdigest()

    def pixels(self, radiance):
        """(height, width, n_channels) float32 from the radiance (n_points, n_channels)."""
        result = np.empty((self.height * self.width, radiance.shape[1]), np.float32)
        for channel, values in enumerate(radiance.T):
            sums = np.bincount(self.pixel, values[self.point], len(result))
            result[:, channel] = sums / self.samples
        return result.reshape(self.height, self.width, -1)

    def finished(self, pixels):
        """Pixels as they are handed out: where it is an atlas, with both sides of seams alike.

        Parameters
        ----------
        pixels : (height, width, n_channels) float32
        """
        return pixels if self.atlas is None else self.atlas.seams.mended(pixels, self.point)


def with_camera_image(scene, caster, camera, width, height, samples=2):
    """The scene with a bake point wherever a camera's rays meet it.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
        Of its triangles.
    camera : Camera
    width, height : int
    samples : int
        Along each side of a pixel.

    Returns
    -------
    Scene
        With an `image`.
    """
    expect_offers("scene", scene, ("to_frame", "hit_points"), "a Scene")
    expect_caster(caster)
    camera = expect_camera(camera)
    expect_size(width, height)
    expect_whole("pixel samples", samples, 1, 8)
    rays = view_rays(camera, width, height, samples)
    ways = rays.directions
    row, column = np.divmod(np.arange(len(ways)), width * samples)
    pixel = row // samples * width + column // samples
    triangle, barycentric = hits_in_view(scene, caster, rays)
    hit = np.flatnonzero(triangle >= 0)
    hit = hit[np.argsort(pixel[hit], kind="stable")]
    back = (ways[hit] * scene.triangle_normals[triangle[hit]]).sum(axis=1) > 0
    place = triangle[hit], barycentric[hit], back
    points, _ = surface_points(scene, *place, any_side=True)
    share = ended_share(scene, *place, *scene.hit_points(*place))
    points = replace(points, materials=points.materials.of_rays_that_end(share))
    new = len(scene.points) + np.arange(len(hit))
    shown = pixel[hit].astype(np.int32), new.astype(np.int32)
    image = PointImage(height, width, samples**2, *shown, camera=camera)
    return extended(scene, points, image)


def hits_in_view(scene, caster, rays):
    """What the rays of a camera meet.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    rays : ViewRays

    Returns
    -------
    triangle : (m,) int64
        -1 where nothing is met before the camera's far end.
    barycentric : (m, 2) float32
    """
    origins, directions = scene.to_frame(rays.origins), rays.directions.astype(np.float32)
    triangle, barycentric, distance = intersect(caster, origins, directions)
    triangle[distance * scene.size > rays.lengths] = -1
    return triangle, barycentric


def surface_points(scene, triangle, barycentric, back, any_side=False):
    """Bake points anywhere on the triangles of a scene.

    Parameters
    ----------
    scene : Scene
    triangle : (m,) int
    barycentric : (m, 2) float
        Weights of the second and third corner.
    back : (m,) bool
        Whether the back side is meant.
    any_side : bool
        Whether backs that bounce no light are to receive it here.

    Returns
    -------
    points : BakePoints
        Of the sides that receive light.
    lit : (m,) bool
        Which sides these are.
    """
    around, weights = scene.hit_points(triangle, barycentric, back)
    lit = around[:, 0] >= 0
    mirrored = np.zeros(len(lit), bool)
    if any_side and not lit.all():
        mirrored, lit = ~lit, np.ones(len(lit), bool)
        fronts, _ = scene.hit_points(triangle, barycentric, np.zeros(len(lit), bool))
        around = np.where(mirrored[:, None], fronts, around)
    around, weights, triangle = around[lit], weights[lit].astype(np.float64), triangle[lit]
    corners = scene.vertices[scene.triangles[triangle]]
    second, third = np.asarray(barycentric[lit], np.float64).T
    places = np.stack([1 - second - third, second, third], axis=1)
    geometric = scene.triangle_normals[triangle] * np.where(back[lit], -1, 1)[:, None]

    def between(values):
        return np.einsum("mk,mkx->mx", weights, values[around])

    normals = between(scene.points.normals) * np.where(mirrored[lit], -1, 1)[:, None]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-6, normals / np.maximum(length, 1e-30), geometric)
    place = triangle, barycentric[lit], back[lit]
    materials, met = (scene.materials_at(*place, shown=shown).stored() for shown in (True, False))
    points = BakePoints(
        positions=np.einsum("mk,mkx->mx", places, corners),
        normals=normals.astype(np.float32),
        geometric_normals=geometric.astype(np.float32),
        ray_offset=(scene.triangle_lifts[triangle][:, None] * geometric).astype(np.float32),
        areas=np.zeros(len(around), np.float32),
        materials=materials,
        mean_materials=with_mean_gloss(met).of_what_is_met(),
        object_index=scene.triangle_object[triangle].astype(np.int32),
        visible=np.ones(len(around), bool),
        emitter=scene.triangle_emitter[triangle],
    )
    return points, lit


def extended(scene, points, image):
    """The scene with more bake points, and an image that shows them."""
    expect(len(points), "image: nothing of the scene is in it")
    through = np.flatnonzero(points.materials.through.any(axis=1))
    if len(through):
        # Light on the other side is shown as well.
        points = joined(points, backs_of(points, through))
    return replace(scene, points=joined(scene.points, points), image=image)


def intersect(caster, origins, directions):
    """(m,) int64 triangles, (m, 2) float32 barycentrics and (m,) float32 distances of hits, for
    any number of rays."""
    triangle = np.empty(len(origins), np.int64)
    barycentric = np.empty((len(origins), 2), np.float32)
    distance = np.empty(len(origins), np.float32)
    for first in range(0, len(origins), _BATCH):
        part = slice(first, first + _BATCH)
        hits = caster.intersect(
            np.ascontiguousarray(origins[part]), np.ascontiguousarray(directions[part])
        )
        triangle[part], barycentric[part] = hits.triangle, hits.barycentric
        distance[part] = hits.distance
    return triangle, barycentric, distance


def expect_size(width, height):
    """Raise `PRTError` unless an image may be so large."""
    for side in (width, height):
        expect_whole("image: pixels along a side", side, 1, 8192)
