"""Images whose pixels are bake points: what a fixed camera sees, or an object's UV atlas.

Such points receive light and bounce none: rays end at the points of the meshes, so the bake goes
on as ever. A pixel is the mean of its points, which smooths its edges.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from prt_core.errors import expect
from prt_core.scene.points import BakePoints

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
    """

    height: int
    width: int
    samples: int
    pixel: np.ndarray
    point: np.ndarray

    def pixels(self, radiance):
        """(height, width, n_channels) float32 from the radiance (n_points, n_channels)."""
        result = np.empty((self.height * self.width, radiance.shape[1]), np.float32)
        for channel, values in enumerate(radiance.T):
            sums = np.bincount(self.pixel, values[self.point], len(result))
            result[:, channel] = sums / self.samples
        return result.reshape(self.height, self.width, -1)


def camera_rays(camera, width, height, samples):
    """Directions through the pixels of a view.

    Parameters
    ----------
    camera : dict
        `matrix` (4 x 4, camera to world) and `tangent` of half the wider angle.
    width, height : int
    samples : int
        Along each side of a pixel.

    Returns
    -------
    (height * samples * width * samples, 3) float64
        Unit vectors in world axes, in reading order of the samples.
    """
    step = 2 * camera["tangent"] / max(width, height)
    x = (np.arange(width * samples) + 0.5) / samples - width / 2
    y = height / 2 - (np.arange(height * samples) + 0.5) / samples
    x, y = np.meshgrid(x * step, y * step)
    local = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
    matrix = np.asarray(camera["matrix"], np.float64)
    directions = local @ (matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)).T
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def with_camera_image(scene, caster, camera, width, height, samples=2):
    """The scene with a bake point wherever a camera's rays meet it.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
        Of its triangles.
    camera : dict
        See `camera_rays`.
    width, height : int
    samples : int
        Along each side of a pixel.

    Returns
    -------
    Scene
        With an `image`.
    """
    _expect_size(width, height)
    expect(1 <= samples <= 8, f"pixel samples: expected 1 to 8 along each side, got {samples}")
    ways = camera_rays(camera, width, height, samples).astype(np.float32)
    origin = scene.to_frame(np.asarray(camera["matrix"], np.float64)[:3, 3]).astype(np.float32)
    row, column = np.divmod(np.arange(len(ways)), width * samples)
    pixel = row // samples * width + column // samples
    triangle, barycentric = _intersect(caster, np.broadcast_to(origin, ways.shape), ways)
    hit = np.flatnonzero(triangle >= 0)
    hit = hit[np.argsort(pixel[hit], kind="stable")]
    back = (ways[hit] * scene.triangle_normals[triangle[hit]]).sum(axis=1) > 0
    points, lit = surface_points(scene, triangle[hit], barycentric[hit], back)
    new = len(scene.points) + np.arange(lit.sum())
    image = PointImage(
        height, width, samples**2, pixel[hit[lit]].astype(np.int32), new.astype(np.int32)
    )
    return _extended(scene, points, image)


def atlas_triangles(scene, mesh):
    """The UV layout of an object as something flat to cast rays at.

    Parameters
    ----------
    scene : Scene
    mesh : Mesh
        One of those the scene was made of, with `corner_uv`.

    Returns
    -------
    vertices : (n, 3) float32, triangles : (n / 3, 3) int32
        In the order of the scene's triangles of this object.
    """
    expect(
        mesh.corner_uv is not None,
        f"{mesh.name}: a geometry image needs a UV map; unwrap the object without overlaps",
    )
    uv = mesh.corner_uv[mesh.solid_triangles()].reshape(-1, 2)
    vertices = np.column_stack([uv, np.zeros(len(uv))]).astype(np.float32)
    return vertices, np.arange(len(uv), dtype=np.int32).reshape(-1, 3)


def with_atlas_image(scene, caster, name, size):
    """The scene with a bake point at each texel that the UV layout of an object covers.

    Texels beside it show the nearest one that is covered, so that the image has no edges where
    the surface has none.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
        Of `atlas_triangles`.
    name : str
        Of the object.
    size : int
        Texels along each side.

    Returns
    -------
    Scene
        With an `image`.
    """
    _expect_size(size, size)
    u, v = np.meshgrid((np.arange(size) + 0.5) / size, 1 - (np.arange(size) + 0.5) / size)
    origins = np.stack([u.ravel(), v.ravel(), np.ones(size * size)], axis=1).astype(np.float32)
    down = np.broadcast_to(np.float32([0, 0, -1]), origins.shape)
    triangle, barycentric = _intersect(caster, origins, down)
    index = [item.name for item in scene.objects].index(name)
    hit = np.flatnonzero(triangle >= 0)
    expect(len(hit), f"{name}: its UV layout covers nothing between 0 and 1")
    mine = np.flatnonzero(scene.triangle_object == index)
    points, lit = surface_points(
        scene, mine[triangle[hit]], barycentric[hit], np.zeros(len(hit), bool)
    )
    texel = np.full(size * size, -1)
    texel[hit[lit]] = len(scene.points) + np.arange(lit.sum())
    texel = texel.reshape(size, size)
    nearest = distance_transform_edt(texel < 0, return_distances=False, return_indices=True)
    point = texel[tuple(nearest)].ravel().astype(np.int32)
    image = PointImage(size, size, 1, np.arange(size * size, dtype=np.int32), point)
    return _extended(scene, points, image)


def surface_points(scene, triangle, barycentric, back):
    """Bake points anywhere on the triangles of a scene.

    Parameters
    ----------
    scene : Scene
    triangle : (m,) int
    barycentric : (m, 2) float
        Weights of the second and third corner.
    back : (m,) bool
        Whether the back side is meant.

    Returns
    -------
    points : BakePoints
        Of the sides that receive light.
    lit : (m,) bool
        Which sides these are.
    """
    around, weights = scene.hit_points(triangle, barycentric, back)
    lit = around[:, 0] >= 0
    around, weights, triangle = around[lit], weights[lit].astype(np.float64), triangle[lit]
    corners = scene.vertices[scene.triangles[triangle]].astype(np.float64)
    second, third = np.asarray(barycentric[lit], np.float64).T
    places = np.stack([1 - second - third, second, third], axis=1)
    geometric = scene.triangle_normals[triangle] * np.where(back[lit], -1, 1)[:, None]

    def between(values):
        return np.einsum("mk,mkx->mx", weights, values[around])

    normals = between(scene.points.normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-6, normals / np.maximum(length, 1e-30), geometric)
    points = BakePoints(
        positions=np.einsum("mk,mkx->mx", places, corners).astype(np.float32),
        normals=normals.astype(np.float32),
        geometric_normals=geometric.astype(np.float32),
        inward=np.zeros((len(around), 3), np.float32),
        areas=np.zeros(len(around), np.float32),
        albedo=between(scene.points.albedo).astype(np.float32),
        object_index=scene.triangle_object[triangle].astype(np.int32),
        visible=np.ones(len(around), bool),
    )
    return points, lit


def _extended(scene, points, image):
    expect(len(points), "image: nothing of the scene is in it")
    joined = {
        f.name: np.concatenate([getattr(scene.points, f.name), getattr(points, f.name)])
        for f in fields(BakePoints)
    }
    return replace(scene, points=BakePoints(**joined), image=image)


def _intersect(caster, origins, directions):
    triangle = np.empty(len(origins), np.int64)
    barycentric = np.empty((len(origins), 2), np.float32)
    for first in range(0, len(origins), _BATCH):
        part = slice(first, first + _BATCH)
        found = caster.intersect(
            np.ascontiguousarray(origins[part]), np.ascontiguousarray(directions[part])
        )
        triangle[part], barycentric[part] = found.triangle, found.barycentric
    return triangle, barycentric


def _expect_size(width, height):
    expect(
        1 <= width <= 8192 and 1 <= height <= 8192,
        f"image: expected 1 to 8,192 pixels along each side, got {width} x {height}",
    )
