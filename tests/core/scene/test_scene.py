"""Scenes and bake points: merging of corners, refinement, frames, bad input."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.scene import Mesh, Scene
from prt_core.scene.lattice import lattice_coordinates, lattice_index, lattice_of_hits, lattice_size


def quad(name="floor", origin=(-2, -2, 0), x=(4, 0, 0), y=(0, 4, 0), albedo=0.5, **options):
    origin, x, y = (np.array(v, float) for v in (origin, x, y))
    normal = np.cross(x, y)
    return Mesh(
        name,
        np.array([origin, origin + x, origin + x + y, origin + y]),
        np.arange(4),
        np.tile(normal / np.linalg.norm(normal), (4, 1)),
        [[0, 1, 2], [0, 2, 3]],
        np.full((4, 3), albedo),
        **options,
    )


def cube(name="cube"):
    """A flat-shaded cube: 24 corners, 8 vertices."""
    vertices = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    corner_vertex, normals, triangles = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            normal = np.zeros(3)
            normal[axis] = sign
            face = [i for i in range(8) if vertices[i, axis] == sign]
            u, v = np.roll(normal, 1), np.roll(normal, 2)
            face.sort(key=lambda i, u=u, v=v: np.arctan2(vertices[i] @ v, vertices[i] @ u))
            first = len(corner_vertex)
            corner_vertex += face
            normals += [normal] * 4
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return Mesh(name, vertices, corner_vertex, normals, triangles, np.full((24, 3), 0.5))


def test_flat_cube_has_one_point_per_corner_normal():
    scene = Scene.from_meshes([cube()], max_hidden=0)
    assert len(scene.points) == 24
    assert sorted(scene.objects[0].corner_point) == list(range(24))
    np.testing.assert_allclose(scene.points.areas.sum() * scene.size**2, 24, rtol=1e-6)


def test_two_triangle_floor_gets_hidden_points_and_keeps_its_area():
    scene = Scene.from_meshes([quad(), quad("wall", two_sided=True, origin=(-2, -2, 1))])
    assert (scene.triangle_level > 8).all()
    np.testing.assert_allclose(scene.points.areas.sum() * scene.size**2, 16 + 2 * 16, rtol=1e-5)
    assert scene.points.visible.sum() == 8


@pytest.mark.parametrize("level", [1, 2, 3, 7])
def test_lattice_interpolation_reproduces_positions(level):
    coordinates = lattice_coordinates(level)
    assert len(coordinates) == lattice_size(level)
    assert (lattice_index(level, *coordinates.T) == np.arange(len(coordinates))).all()
    uv = np.random.default_rng(level).dirichlet([1, 1, 1], 501)[:, 1:]
    uv = np.concatenate([uv, [[0, 0], [1, 0], [0, 1], [0.5, 0.5]]])
    cell, weights = lattice_of_hits(np.full(len(uv), level), uv)
    result = (coordinates[cell] / level * weights[..., None]).sum(axis=1)
    np.testing.assert_allclose(result, uv, atol=1e-6)
    assert (weights >= 0).all()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_the_frame_hides_scale_and_place(scale):
    base = Scene.from_meshes([cube()])
    mesh = cube()
    mesh.vertices = mesh.vertices * scale + 1e5
    moved = Scene.from_meshes([mesh])
    np.testing.assert_allclose(
        moved.points.positions, base.points.positions, atol=3e-5 / min(scale, 1) * 1e-3
    )
    assert np.isclose(moved.size, 2 * scale, rtol=1e-6)


def test_faces_without_area_are_dropped_and_said():
    mesh = quad()
    mesh.triangle_corners = np.array([[0, 1, 2], [0, 2, 3], [1, 1, 2]])
    scene = Scene.from_meshes([mesh])
    assert len(scene.triangles) == 2
    assert scene.messages == ["floor: 1 triangles without area ignored"]


@pytest.mark.parametrize(
    ("meshes", "message"),
    [
        ([], "no triangle with an area"),
        ([quad(), quad()], "name 'floor' is used twice"),
    ],
)
def test_bad_scenes_say_what_is_wrong(meshes, message):
    with pytest.raises(PRTError, match=message):
        Scene.from_meshes(meshes)


def test_bad_meshes_say_what_is_wrong():
    with pytest.raises(PRTError, match="floor: albedo: expected values from 0 to 64, got 65"):
        quad(albedo=65)
    with pytest.raises(PRTError, match="NaN or infinite"):
        quad(origin=(np.nan, 0, 0))
