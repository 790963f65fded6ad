"""Where rays of a light field end and start, and which surfaces are sheets."""

import numpy as np

from prt_core.rays import BruteForceCaster
from prt_core.scene import Scene, geometry_layout, with_geometry_image
from prt_core.scene.field_edges import field_edges
from prt_core.scene.field_points import field_points
from prt_core.scene.sheets import is_sheet
from prt_core.sphere import tangent_frames
from tests.meshes import caster_of, plane, sphere


def points_of(*meshes):
    scene = Scene.from_meshes(list(meshes), max_hidden=7)
    every = np.arange(len(scene.points))
    return scene, field_points(scene, every, tangent_frames(scene.points.normals))


def test_rays_meet_their_points_and_start_outside():
    scene, points = points_of(sphere(7, 0.4, (0.1, 0, 0.5)), plane(4, -2, 3, z=-0.3))
    height = np.linalg.norm(points.above, axis=1)
    normal = points.above / height[:, None]
    caster = caster_of(scene)
    for tilt in (0.0, 0.7, 1.4):
        way = np.cos(tilt) * normal + np.sin(tilt) * points.frames[:, 0]
        way /= np.linalg.norm(way, axis=1)[:, None]
        start = points.positions + way * (height / np.cos(tilt))[:, None]
        hits = caster.intersect(scene.to_frame(start), -way.astype(np.float32))
        assert (hits.triangle >= 0).all()
        met = start - way * (hits.distance * scene.size)[:, None]
        distance = np.linalg.norm(met - points.positions, axis=1)
        assert (distance < points.reach).all()
        # The reach is no larger than the facets around.
        assert (distance < 0.5).all()
    assert (points.reach[scene.points.object_index == 0] < 0.4).all()


def test_rays_of_a_rim_end_within_the_sheet():
    scene, points = points_of(plane(4, -1, 1))
    assert (np.abs(points.positions[:, :2]) < 1).all()
    assert np.allclose(points.positions[:, 2], 0, atol=1e-12)


def test_backs_start_on_their_side():
    scene, points = points_of(plane(3, -1, 1, two_sided=True))
    below = scene.points.normals[:, 2] < 0
    assert below.sum() == len(points) / 2
    assert (points.above[below, 2] < 0).all() and (points.above[~below, 2] > 0).all()


def test_sheets_are_told_from_closed_surfaces():
    assert is_sheet(plane(4))
    ball = sphere(9, 0.4, (0, 0, 0))
    assert not is_sheet(ball)
    # A pin-hole makes no sheet, half a ball is one.
    ball.triangle_corners = ball.triangle_corners[1:]
    assert not is_sheet(ball)
    corners = ball.vertices[ball.corner_vertex[ball.triangle_corners]]
    ball.triangle_corners = ball.triangle_corners[corners[..., 2].mean(axis=1) > 0]
    assert is_sheet(ball)


def test_neighbours_are_those_of_triangles_and_of_their_lattices():
    scene, points = points_of(plane(3, -1, 1))
    edges = field_edges(scene, points.point)
    # Eight triangles of nine vertices: twelve sides of squares and four diagonals.
    assert len(edges) == 16 and (edges[:, 0] < edges[:, 1]).all()
    lengths = np.linalg.norm(np.diff(points.positions[edges], axis=1)[:, 0], axis=1)
    assert lengths.max() < 1.5
    large = Scene.from_meshes([plane(2, -1, 1)], max_hidden=40)
    every = np.arange(len(large.points))
    edges = field_edges(large, every)
    degree = np.bincount(edges.ravel(), minlength=len(every))
    assert large.triangle_level.max() > 2 and degree.min() >= 2 and degree.max() <= 6
    # Some of the points alone: their numbers are counted among them.
    assert field_edges(large, every[::2]).max(initial=0) < len(every[::2])


def test_neighbours_of_an_image_are_its_texels_on_one_side():
    mesh = plane(2, -1, 1)
    mesh.corner_uv = mesh.vertices[mesh.corner_vertex, :2] / 2 + 0.5
    layout = geometry_layout(mesh, "uv")
    tracer = BruteForceCaster(layout.vertices, layout.triangles)
    scene = with_geometry_image(Scene.from_meshes([mesh], 0), tracer, layout, 5)
    edges = field_edges(scene, np.unique(scene.image.point))
    assert len(edges) == 2 * 5 * 4
