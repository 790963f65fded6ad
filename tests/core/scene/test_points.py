"""Bake points: their normals, areas and sides, in closed form."""

import numpy as np
import pytest

from prt_core.scene import Mesh, Scene
from tests.meshes import plane, sphere


def mesh(vertices, faces, normals=None, name="mesh", **settings):
    """Triangles of shared vertices; normals by vertex, by corner, or those of the faces."""
    vertices, faces = np.array(vertices, float), np.array(faces)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    of_face = np.cross(b - a, c - a)
    of_face /= np.linalg.norm(of_face, axis=1, keepdims=True)
    if normals is None:
        normals = np.repeat(of_face, 3, axis=0)
    elif len(normals) == len(vertices):
        normals = np.array(normals, float)[faces.ravel()]
    settings.setdefault("materials", np.full((faces.size, 3), 0.5))
    corners = np.arange(faces.size)
    return Mesh(name, vertices, faces.ravel(), normals, corners.reshape(-1, 3), **settings)


def points_of(scene, place):
    world = scene.to_world(scene.points.positions)
    return np.flatnonzero(np.linalg.norm(world - place, axis=1) < 1e-5)


# A roof of three triangles about a tip, of angles 90, 45 and 135 degrees.
TIP = [(0, 0, 1.0), (2, 0, 0), (0, 2, 0), (-2, 2, 0), (0, -3, 0.5)]
FACES = [(0, 1, 2), (0, 2, 3), (0, 3, 4)]


def corner_angle(p, q, r):
    u, v = np.subtract(q, p), np.subtract(r, p)
    return np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))


def sideways(points):
    """(n,): whether rays start beside the point and not just above it."""
    along = np.einsum("ij,ij->i", points.ray_offset, points.geometric_normals)[:, None]
    return np.linalg.norm(points.ray_offset - along * points.geometric_normals, axis=1) > (
        1e-3 * along[:, 0]
    )


def test_the_geometric_normal_is_that_of_the_faces_by_their_angles():
    smooth = np.array([(0, 0, 1.0)] * 5)
    scene = Scene.from_meshes([mesh(TIP, FACES, smooth)], max_hidden=0)
    assert len(scene.points) == 5
    wanted = np.zeros(3)
    for p, q, r in FACES:
        p, q, r = (np.array(TIP[i]) for i in (p, q, r))
        normal = np.cross(q - p, r - p)
        wanted += corner_angle(p, q, r) * normal / np.linalg.norm(normal)
    (tip,) = points_of(scene, TIP[0])
    result = scene.points.geometric_normals[tip]
    np.testing.assert_allclose(result, wanted / np.linalg.norm(wanted), atol=1e-6)
    np.testing.assert_allclose(scene.points.normals, smooth, atol=1e-6)
    # Not flat: no way leads inwards.
    assert not sideways(scene.points)[tip].any()


@pytest.mark.parametrize("bulge", [-0.1, -0.05, 0.05, 0.1])
def test_rays_of_a_gently_curved_surface_start_above_it(bulge):
    """The middle of the triangles around a point of a dome lies below it."""
    dome = plane(33)
    dome.vertices[:, 2] = bulge * (dome.vertices[:, :2] ** 2).sum(axis=1)
    scene = Scene.from_meshes([dome], max_hidden=0)
    points = scene.points
    above = np.einsum("nx,nx->n", points.ray_offset, points.geometric_normals)
    # As high as the lowest of the triangles of the scene asks for, and no higher than the highest.
    lifts = scene.triangle_lifts
    assert (above >= 0.99 * lifts.min()).all() and (above <= 1.01 * lifts.max()).all()
    assert np.mean(sideways(points)) > 0.9


def test_a_point_has_a_third_of_each_triangle_around_it():
    scene = Scene.from_meshes([mesh(TIP, FACES, np.array([(0, 0, 1.0)] * 5))], max_hidden=0)
    areas = dict.fromkeys(range(5), 0.0)
    for face in FACES:
        p, q, r = (np.array(TIP[i]) for i in face)
        for corner in face:
            areas[corner] += np.linalg.norm(np.cross(q - p, r - p)) / 6
    for corner, area in areas.items():
        (point,) = points_of(scene, TIP[corner])
        assert scene.points.areas[point] * scene.size**2 == pytest.approx(area, rel=1e-5)


def test_corners_share_a_point_where_normal_material_and_albedo_agree():
    pair = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    faces = [(0, 1, 2), (0, 2, 3)]
    up = np.tile([0, 0, 1.0], (6, 1))

    def count(**settings):
        scene = Scene.from_meshes([mesh(pair, faces, up.copy(), **settings)], max_hidden=0)
        return len(scene.points)

    assert count() == 4
    materials = np.repeat([0, 1], 3)
    assert count(corner_material=materials) == 6
    for step, n_points in ((1 / 200, 4), (1 / 8, 6)):
        albedo = np.full((6, 3), 0.5)
        albedo[3:, 1] += step
        assert count(materials=albedo) == n_points
    for angle, n_points in ((1e-4, 4), (0.02, 6)):
        up[3:] = [np.sin(angle), 0, np.cos(angle)]
        assert count() == n_points


def test_points_of_the_back_look_the_other_way_and_are_not_shown():
    scene = Scene.from_meshes([plane(3, two_sided=True)], max_hidden=0)
    points = scene.points
    assert len(points) == 18 and points.visible.sum() == 9
    front, back = points.visible, ~points.visible
    for normals in (points.normals, points.geometric_normals):
        np.testing.assert_allclose(normals[front], [[0, 0, 1]] * 9, atol=1e-6)
        np.testing.assert_allclose(normals[back], [[0, 0, -1]] * 9, atol=1e-6)
    np.testing.assert_allclose(points.positions[front], points.positions[back])
    # Rays of both sides begin above their own.
    height = scene.ray_origins[:, 2] - points.positions[:, 2]
    assert (height[front] > 0).all() and (height[back] < 0).all()
    # A hit is handed to the side that it met.
    triangle, middle = np.zeros(2, int), np.full((2, 2), 0.2)
    result, _ = scene.hit_points(triangle, middle, np.array([False, True]))
    assert points.visible[result[0]].all() and not points.visible[result[1]].any()
    one = Scene.from_meshes([plane(3)], max_hidden=0)
    assert (one.hit_points(triangle, middle, np.array([False, True]))[0][1] == -1).all()


def test_only_what_receives_is_visible():
    floor, lid = plane(3, name="floor"), plane(2, z=1.0, name="lid", receives=False)
    scene = Scene.from_meshes([floor, lid], max_hidden=0)
    np.testing.assert_array_equal(scene.points.visible, scene.points.object_index == 0)


def test_where_a_normal_is_missing_that_of_the_face_is_taken():
    missing = mesh(TIP, FACES, np.zeros((5, 3)))
    scene = Scene.from_meshes([missing], max_hidden=0)
    plain = Scene.from_meshes([mesh(TIP, FACES)], max_hidden=0)
    np.testing.assert_allclose(scene.points.normals, plain.points.normals, atol=1e-6)
    assert np.linalg.norm(scene.points.normals, axis=1) == pytest.approx(1, abs=1e-6)


def test_points_of_a_flat_part_start_towards_its_middle():
    scene = Scene.from_meshes([plane(3)], max_hidden=0)
    points = scene.points
    rim = np.abs(points.positions[:, :2]).max(axis=1) > 0.4
    way = (scene.ray_origins - points.positions)[:, :2]
    assert sideways(points)[rim].all()
    assert (np.einsum("ij,ij->i", way, points.positions[:, :2])[rim] < 0).all()
    # Less than a thousandth of the scene, and less than a quarter of the way.
    assert np.abs(way).max() < 1e-3
    ball = Scene.from_meshes([sphere(8)], max_hidden=0)
    # But for the poles, whose triangles do not share their corners.
    assert not sideways(ball.points)[np.abs(ball.points.normals[:, 2]) < 0.99].any()
    outwards = (ball.ray_origins - ball.points.positions) * ball.points.geometric_normals
    assert (outwards.sum(axis=1) > 0).all()


def bent_quad(rise, **settings):
    """A flat-shaded quad whose last corner is lifted; its normals are those of the whole quad."""
    corners = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, rise)], float)
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    albedo = np.full((4, 3), 0.5)
    return Mesh("quad", corners, np.arange(4), normals, triangles, albedo, flat=True, **settings)


def test_corners_of_a_bent_quad_are_points_of_its_first_triangle():
    scene = Scene.from_meshes([bent_quad(1.0)], max_hidden=0)
    points, (first, second) = scene.points, scene.triangle_normals
    assert first @ second < 0.95
    np.testing.assert_array_equal(scene.objects[0].corner_point, [0, 1, 2, 3])
    for values in (points.normals, points.geometric_normals):
        np.testing.assert_allclose(values[:3], [first] * 3, atol=1e-6)
        np.testing.assert_allclose(values[3:], [second] * 3, atol=1e-6)
    # The second triangle has points of its own where both meet, which are not shown.
    assert len(points) == 6 and points.visible.tolist() == [True] * 4 + [False] * 2
    np.testing.assert_allclose(points.positions[4:], points.positions[[0, 2]])
    around, _ = scene.hit_points(np.array([0, 1]), np.full((2, 2), 0.3), np.zeros(2, bool))
    assert set(around[0]) == {0, 1, 2} and set(around[1]) == {3, 4, 5}
    area = np.linalg.norm(np.cross((2, 2, 0), (0, 2, 1))) / 2
    shares = points.areas[[0, 1, 2, 3, 4, 5]] * scene.size**2
    np.testing.assert_allclose(shares, np.array([2, 2, 2, area, area, area]) / 3, rtol=1e-5)


def test_a_quad_that_bends_little_has_a_point_a_corner():
    scene = Scene.from_meshes([bent_quad(0.2)], max_hidden=0)
    assert len(scene.points) == 4 and scene.points.visible.all()
    first, second = scene.triangle_normals
    assert first @ second < 0.999
    np.testing.assert_allclose(scene.points.normals, [first] * 3 + [second], atol=1e-6)


@pytest.mark.parametrize("degrees", [6, 30, 60])
@pytest.mark.parametrize("rise", [0.0, -1.0])
def test_rays_of_a_sharp_crease_start_between_its_faces(degrees, rise):
    angle = np.deg2rad(degrees)
    tip = (0, 2 * np.cos(angle), 2 * np.sin(angle))
    roof = mesh([(0, 0, 0), tip, (2, 0, 0)], [(0, 1, 2)], name="roof")
    scene = Scene.from_meshes([bent_quad(rise), roof], max_hidden=0)
    corner = scene.objects[0].corner_point[0]
    start = scene.ray_origins[corner] - scene.points.positions[corner]
    for triangle in (0, 2):
        above = start @ scene.triangle_normals[triangle].astype(float)
        assert above > scene.triangle_lifts[triangle] / 2


def test_hidden_points_lie_evenly_in_their_triangle():
    corners = np.array([(0, 0, 0), (3, 0, 0), (0, 2, 0.0)])
    leaning = np.array([(0, 0, 1.0), (0.6, 0, 0.8), (0, 0.6, 0.8)])
    scene = Scene.from_meshes([mesh(corners, [(0, 1, 2)], leaning)])
    level, points = int(scene.triangle_level[0]), scene.points
    assert level > 3 and len(points) == (level + 1) * (level + 2) // 2
    world = scene.to_world(points.positions)
    v, w = world[:, 0] / 3, world[:, 1] / 2
    np.testing.assert_allclose(v * level, np.rint(v * level), atol=1e-4)
    np.testing.assert_allclose(w * level, np.rint(w * level), atol=1e-4)
    assert len({(round(a), round(b)) for a, b in zip(v * level, w * level, strict=True)}) == len(v)
    # Shading normals are those between the corners, the geometric one is the face's.
    wanted = np.outer(1 - v - w, leaning[0]) + np.outer(v, leaning[1]) + np.outer(w, leaning[2])
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    np.testing.assert_allclose(points.normals, wanted, atol=1e-5)
    np.testing.assert_allclose(points.geometric_normals, [[0, 0, 1]] * len(points), atol=1e-6)
    assert points.visible.sum() == 3
    # All have the same share, and together the triangle's area.
    assert points.areas.sum() * scene.size**2 == pytest.approx(3, rel=1e-5)
    np.testing.assert_allclose(points.areas, points.areas[0], rtol=1e-4)


def test_triangles_are_cut_by_their_longest_edge_and_a_budget():
    small, large = plane(9, -0.1, 0.1, name="small"), plane(2, -3, 3, z=-1.0, name="large")
    both = Scene.from_meshes([small, large], max_hidden=10**6)
    index = both.triangle_object
    # The longest edge of the small one is a 23rd of the whole.
    edges = np.array([np.sqrt(2) * 0.2 / 8, np.sqrt(2) * 6]) / 6
    wanted = np.ceil(edges * 32)
    np.testing.assert_array_equal(both.triangle_level, wanted[index])
    # Of what receives: beside a small receiver a large blocker is cut as finely as it allows.
    large.receives = False
    fine = Scene.from_meshes([small, large], max_hidden=10**6)
    assert fine.triangle_level[index == 1].min() == 256
    assert (fine.triangle_level[index == 0] == np.ceil(32 * np.sqrt(2) / 8)).all()
    for budget in (0, 100, 1000):
        subset = Scene.from_meshes([small, large], max_hidden=budget)
        hidden = len(subset.points) - 81 - 4
        assert hidden <= budget and (hidden > budget / 4 or not budget)
