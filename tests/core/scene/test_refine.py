"""Split meshes stay closed and flat, and carry over what their corners hold."""

import numpy as np
import pytest

from prt_core.scene import Mesh, Scene, SplitMeshes, mesh_digests, split_evenly
from prt_core.scene.paint import Look
from tests.core.scene.test_points import mesh
from tests.meshes import sphere


def square(name, x=0.0, n=1, turned=False, **settings):
    """A square face of four corners beside others along x."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float) + (x, 0, 0)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    settings.setdefault("materials", np.full((4, 3), 0.5))
    if turned:
        # A mirrored object's loops run the other way round.
        vertices, triangles = vertices[::-1], np.array([[2, 1, 0], [3, 2, 0]])
    up = np.tile([0, 0, 1.0], (4, 1))
    return Mesh(name, vertices, np.arange(4), up, triangles, face_sizes=[4], **settings)


def split_at_random(meshes, rounds=5, share=0.3, seed=0):
    state, rng = SplitMeshes(meshes), np.random.default_rng(seed)
    for _ in range(rounds):
        state.split(rng.random(state.n_edges) < share)
    return state.meshes()


def doubled_areas(item):
    a, b, c = np.moveaxis(item.vertices[item.corner_vertex[item.triangle_corners]], 1, 0)
    return np.cross(b - a, c - a)


def edges_of(item):
    """Edges by their vertices, and how many triangles each has."""
    triangles = item.corner_vertex[item.triangle_corners]
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("turned", [False, True])
def test_squares_stay_squares_without_gaps(size, turned):
    items = [square("a", turned=turned), square("b", 1.0)]
    for item in items:
        item.vertices = item.vertices * size
    one, two = split_at_random(items)
    for item in (one, two):
        normals = doubled_areas(item) / size**2
        np.testing.assert_allclose(normals.sum(axis=0), [0, 0, 2], atol=1e-9)
        assert (normals[:, 2] > 0).all()
        loops = item.vertices[item.corner_vertex.reshape(-1, 3)]
        up = np.cross(loops[:, 1] - loops[:, 0], loops[:, 2] - loops[:, 0])[:, 2]
        assert ((up < 0) == (turned and item.name == "a")).all()
        edges, counts = edges_of(item)
        assert set(counts) == {1, 2}
        ends = item.vertices[edges[counts == 1]] / size
        # What only one triangle has is the border: nothing hangs on an edge's middle.
        assert np.isclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum(), 4)
    border = [{tuple(v) for v in item.vertices if np.isclose(v[0], size)} for item in (one, two)]
    assert border[0] == border[1] and len(border[0]) > 2


def test_borders_that_rounding_moved_apart_are_split_together():
    one, two = split_at_random([square("a"), square("b", 1 + 1e-9)], seed=4)
    border = [sorted(v[1] for v in item.vertices if abs(v[0] - 1) < 1e-6) for item in (one, two)]
    assert len(border[0]) > 2
    np.testing.assert_allclose(*border, atol=1e-8)


def test_what_is_not_split_stays_the_same_object():
    apart = square("apart", 7)
    state = SplitMeshes([square("a"), apart])
    state.split(np.isin(np.arange(state.n_edges), state.edges[:2]))
    first, second = state.meshes()
    assert second is apart and first.refined.vertex_round.max() == 1 and not first.own_mesh
    assert len(first.vertices) == 9 and len(first.triangle_corners) == 8


def test_faces_that_are_whole_keep_their_corners():
    both = mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 0, 0], [9, 1, 0], [8, 1, 0]],
        [(0, 1, 2), (0, 2, 3), (4, 5, 6)],
    )
    state = SplitMeshes([both])
    state.split(np.arange(state.n_edges) == state.edges[0, 0])
    (item,) = state.meshes()
    assert item.face_sizes.tolist() == [3] * 4 and len(item.vertices) == 8
    stayed = (item.refined.around == item.refined.around[:, :1]).all(axis=1)
    assert stayed.sum() == 6 and item.refined.n_before == 9


def test_three_faces_on_one_edge_and_seams_stay_together():
    fan = mesh(
        [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0], [0, 0, 0], [0, 0, 1]],
        # The last face has vertices of its own on the common edge.
        [(0, 2, 1), (0, 3, 1), (5, 4, 6)],
    )
    state = SplitMeshes([fan])
    common = np.intersect1d(np.intersect1d(state.edges[0], state.edges[1]), state.edges[2])
    state.split(np.isin(np.arange(state.n_edges), common))
    assert len(state.triangles) == 6
    middles = state.vertices[state.vertex_round == 1]
    np.testing.assert_allclose(middles, [[0, 0, 0.5]] * 2)


def test_faces_without_area_are_split_with_their_neighbours():
    corners = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], float)
    up, triangles = np.tile([0, 0, 1.0], (6, 1)), np.arange(6).reshape(2, 3)
    flat = Mesh("flat", corners, [0, 1, 2, 0, 2, 3], up, triangles, np.full((6, 3), 0.5))
    (item,) = split_evenly([flat])
    assert len(item.triangle_corners) == 8 and item.is_solid().sum() == 4
    Scene.from_meshes([item])


def test_vertices_of_one_mesh_are_never_taken_for_one():
    # Far smaller than what rounding may move apart in the scene.
    dust = mesh([[0, 0, 0], [1e-9, 0, 0], [0, 1e-9, 0]], [(0, 1, 2)])
    state = SplitMeshes([dust, square("far", 1000)])
    assert state.n_edges == 8
    state.split(np.ones(state.n_edges, bool))
    assert len(state.meshes()[0].triangle_corners) == 4


def test_meshes_without_triangles_or_vertices_stay():
    none = np.zeros((0, 3))
    empty = Mesh("empty", none, np.zeros(0, int), none, none.astype(int), none)
    assert split_evenly([empty])[0] is empty
    assert split_evenly([empty, square("a")])[0] is empty


class Stripes:
    """Red grows along the first corner's weight, squared: not linear between corners."""

    def at(self, corners, weights):
        red = np.asarray(weights)[:, 0] ** 2
        return {"albedo": np.stack([red, 0 * red, 0 * red], axis=1)}

    def alike(self, corners):
        return np.zeros(len(corners), int)

    def texels(self, corners):
        return np.full(len(corners), 64.0)

    def digest(self):
        return b"stripes"


def test_corners_hold_what_is_between_those_of_their_face():
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    paint = Stripes()
    one = square("a", corner_uv=uv, paint=paint, bounced=Look(square("b").materials, paint))
    one.corner_normal = np.array([[0, -0.6, 0.8], [0, -0.6, 0.8], [0, 0.6, 0.8], [0, 0.6, 0.8]])
    one.materials = one.materials.replaced(albedo=np.repeat(uv[:, :1], 3, axis=1))
    (item,) = split_at_random([one])
    place = item.vertices[item.corner_vertex]
    np.testing.assert_allclose(item.corner_uv, place[:, :2], atol=1e-12)
    expected = np.stack([0 * place[:, 0], 1.2 * place[:, 1] - 0.6, 0.8 + 0 * place[:, 0]], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(item.corner_normal, expected, atol=1e-12)
    # What is painted within a face is painted on its parts, the same at the same place.
    parts = item.triangle_corners
    third = np.full((len(parts), 3), 1 / 3)
    painted = item.paint.at(parts, third)["albedo"][:, 0]
    middle = place[parts].mean(axis=1)
    weight = np.where(middle[:, 0] >= middle[:, 1], 1 - middle[:, 0], 1 - middle[:, 1])
    np.testing.assert_allclose(painted, weight**2, atol=1e-9)
    assert np.isclose(item.paint.texels(parts).sum(), 128)
    assert item.bounced.paint is item.paint
    assert item.paint.digest() != paint.digest()
    assert mesh_digests([item]) != mesh_digests([one])
    scene = Scene.from_meshes([item])
    assert len(scene.points) >= len(item.vertices)


def test_alike_are_parts_in_the_same_place_of_faces_alike():
    items = split_evenly([square("a", paint=Stripes())])
    kinds = items[0].paint.alike(items[0].triangle_corners)
    assert len(set(kinds)) == 4 and (np.bincount(kinds) == 2).all()


def test_a_ball_stays_closed_and_smooth():
    (ball,) = split_at_random([sphere(6, 0.5, (0, 0, 0), name="ball")], rounds=3)
    # Its poles and its seam have several vertices in one place.
    _, place = np.unique(ball.vertices, axis=0, return_inverse=True)
    ends = place.reshape(-1)[ball.corner_vertex[ball.triangle_corners[ball.is_solid()]]]
    ends = np.stack([ends, np.roll(ends, -1, axis=1)], axis=-1).reshape(-1, 2)
    assert (np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)[1] == 2).all()
    length = np.linalg.norm(ball.corner_normal, axis=1)
    np.testing.assert_allclose(length, 1, atol=1e-12)
