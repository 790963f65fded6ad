"""Geometry images: square images of an object's surface, by its UV layout or over the sphere.

Either layout is triangles that rays are cast at: the flat UV layout from above, the sphere from
its middle, in the directions of an unfolded octahedron. What a texel hits is its bake point.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from prt_core.errors import expect, expect_caster, expect_kind, expect_offers, expect_one_of
from prt_core.scene.images.closed_surface import closed_surface
from prt_core.scene.images.point_images import (
    PointImage,
    expect_size,
    extended,
    intersect,
    surface_points,
)
from prt_core.scene.images.spherical import evenness, spherical_positions
from prt_core.sphere import octahedral_directions

PARAMETRISATIONS = ("auto", "uv", "sphere")


@dataclass(frozen=True)
class Layout:
    """An object's surface laid out for texels to be cast at.

    Attributes
    ----------
    name : str
        The object.
    vertices : (n, 3) float32
    triangles : (m, 3) int32
    source : (m,) int64
        For each of them the triangle of the object (among those with an area); -1: a filled hole.
    places : (m, 3, 2) float
        Where their corners lie in that triangle: weights of its second and third corner.
    round : bool
        A sphere about the origin, seen from inside, instead of the plane z = 0.
    message : str or None
        How even it is, for the report of the bake.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    source: np.ndarray
    places: np.ndarray
    round: bool = False
    message: str | None = None


def geometry_layout(mesh, parametrisation="auto"):
    """How the surface of an object becomes a square.

    Parameters
    ----------
    mesh : Mesh
    parametrisation : {"auto", "uv", "sphere"}
        `auto`: the UV map where there is one, else the sphere.

    Returns
    -------
    Layout

    Raises
    ------
    PRTError
        There is no UV map, or the surface is no sphere (see `closed_surface`).
    """
    expect_offers("mesh", mesh, ("corner_uv", "solid_triangles"), "a Mesh")
    expect_one_of("parametrisation", parametrisation, PARAMETRISATIONS)
    if parametrisation == "auto":
        parametrisation = "sphere" if mesh.corner_uv is None else "uv"
    return (atlas_layout if parametrisation == "uv" else sphere_layout)(mesh)


def atlas_layout(mesh):
    """The `Layout` of an object's UV map."""
    expect(
        mesh.corner_uv is not None,
        f"{mesh.name}: a geometry image from UVs needs a UV map; unwrap the object without "
        "overlaps, or, for a closed surface, use the parametrisation 'sphere'",
    )
    uv = mesh.corner_uv[mesh.solid_triangles()].reshape(-1, 2)
    vertices = np.column_stack([uv, np.zeros(len(uv))]).astype(np.float32)
    triangles = np.arange(len(uv), dtype=np.int32).reshape(-1, 3)
    places = np.broadcast_to([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(triangles), 3, 2))
    return Layout(mesh.name, vertices, triangles, np.arange(len(triangles)), places)


def sphere_layout(mesh):
    """The `Layout` of an object over the sphere, for closed surfaces without handles."""
    triangles = mesh.corner_vertex[mesh.solid_triangles()]
    surface = closed_surface(mesh.name, mesh.vertices, triangles)
    place = spherical_positions(mesh.name, surface.vertices, surface.faces)
    efficiency, least = evenness(surface.vertices, surface.faces, place)
    message = (
        f"{mesh.name}: over the sphere with a stretch efficiency of {efficiency:.0%}; the "
        f"hundredth of it with the fewest texels has {least:.0%} of the mean density"
    )
    if surface.n_holes:
        message += f"; {surface.n_holes:,} holes filled ({surface.filled:.1%} of the surface)"
    if surface.other:
        message += f"; parts that are not joined left out ({surface.other:.1%})"
    return Layout(
        mesh.name, place.astype(np.float32), surface.faces.astype(np.int32), surface.source,
        surface.places, True, message,
    )  # fmt: skip


def with_geometry_image(scene, caster, layout, size):
    """The scene with a bake point at each texel that shows an object.

    The others (beside a UV layout, in filled holes) show the nearest one that does, so that the
    image has no edges where the surface has none.

    Parameters
    ----------
    scene : Scene
        Made of the mesh of the layout, among others.
    caster : RayCaster
        Of the layout's vertices and triangles.
    layout : Layout
    size : int
        Texels along each side.

    Returns
    -------
    Scene
        With an `image`.
    """
    expect_offers("scene", scene, ("hit_points", "objects"), "a Scene")
    expect_caster(caster)
    expect_kind("layout", layout, Layout)
    expect_size(size, size)
    triangle, barycentric, _ = intersect(caster, *_texel_rays(size, layout.round))
    source = np.where(triangle >= 0, layout.source[triangle], -1)
    hit = np.flatnonzero(source >= 0)
    expect(len(hit), f"{layout.name}: its UV layout covers nothing between 0 and 1")
    names = [item.name for item in scene.objects]
    expect(layout.name in names, f"layout: its object '{layout.name}' is not in the scene")
    index = names.index(layout.name)
    mine = np.flatnonzero(scene.triangle_object == index)
    second, third = barycentric[hit].T
    weights = np.stack([1 - second - third, second, third], axis=1)
    inside = np.einsum("mk,mkx->mx", weights, layout.places[triangle[hit]])
    points, lit = surface_points(scene, mine[source[hit]], inside, np.zeros(len(hit), bool))
    texel = np.full(size * size, -1)
    texel[hit[lit]] = len(scene.points) + np.arange(lit.sum())
    texel = texel.reshape(size, size)
    nearest = distance_transform_edt(texel < 0, return_distances=False, return_indices=True)
    point = texel[tuple(nearest)].ravel().astype(np.int32)
    image = PointImage(size, size, 1, np.arange(size * size, dtype=np.int32), point)
    return extended(scene, points, image)


def _texel_rays(size, round_):
    """Origins and directions (size^2, 3) float32, in reading order of the texels."""
    middle = (np.arange(size) + 0.5) / size
    u, v = (x.ravel() for x in np.meshgrid(middle, 1 - middle))
    if round_:
        ways = octahedral_directions(u, v).astype(np.float32)
        return np.zeros_like(ways), ways
    origins = np.stack([u, v, np.ones_like(u)], axis=1).astype(np.float32)
    return origins, np.broadcast_to(np.float32([0, 0, -1]), origins.shape)
