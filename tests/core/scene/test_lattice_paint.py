"""Samples on lattices between corners: exact where values are linear, shared, digested."""

import numpy as np
import pytest

from prt_core.scene import Scene, mesh_digests
from prt_core.scene.lattice import lattice_coordinates, lattice_size
from prt_core.scene.lattice_paint import LatticePaint, lattice_starts
from tests.core.scene.test_scene import quad

CORNERS = np.array([[4, 7, 2], [2, 9, 4], [11, 12, 13]])
LEVELS = np.array([5, 3, 1])


def values_at(weights, triangle):
    """Linear in the weights, unlike from triangle to triangle."""
    return weights @ np.array([[0.1, 0.5], [0.8, 0.2], [0.3, 0.9]]) / (1 + triangle)


def painted(share=False):
    """Two triangles with lattices, the third without."""
    of_corner = np.random.default_rng(0).random((14, 2))
    samples = []
    for number, level in enumerate(LEVELS[:2]):
        uv = lattice_coordinates(int(level)) / level
        samples.append(values_at(np.column_stack([1 - uv.sum(axis=1), uv]), number))
    starts = lattice_starts(LEVELS[:2])
    levels = LEVELS[:2]
    if share:
        starts, levels = np.array([0, 0]), np.array([5, 5])
    joined = np.concatenate(samples)
    paint = LatticePaint({"pair": of_corner}, CORNERS[:2], levels, starts, {"pair": joined})
    return paint, of_corner


def weights_of(n, seed=1):
    weights = np.random.default_rng(seed).dirichlet(np.ones(3), n)
    weights[:3] = np.eye(3)
    return weights


def test_linear_values_come_back_between_the_samples():
    paint, of_corner = painted()
    weights = weights_of(41)
    for number in range(2):
        corners = np.tile(CORNERS[number], (len(weights), 1))
        got = paint.at(corners, weights)["pair"]
        np.testing.assert_allclose(got, values_at(weights, number), atol=1e-6)
    corners = np.tile(CORNERS[2], (len(weights), 1))
    np.testing.assert_allclose(paint.at(corners, weights)["pair"], weights @ of_corner[CORNERS[2]])


def test_triangles_are_told_apart_in_any_order():
    paint, _ = painted()
    weights, which = weights_of(60), np.random.default_rng(2).integers(0, 3, 60)
    got = paint.at(CORNERS[which], weights)["pair"]
    for number in range(3):
        mine = which == number
        alone = paint.at(CORNERS[which[mine]], weights[mine])["pair"]
        np.testing.assert_array_equal(got[mine], alone)
    # Three corners of no triangle are between their corners.
    strange = np.array([[7, 4, 2], [0, 1, 13]])
    of_corner = paint.at(np.repeat(strange, 3, axis=0), np.tile(np.eye(3), (2, 1)))["pair"]
    assert of_corner.shape == (6, 2) and (paint.texels(strange) == 0).all()


def test_samples_may_be_shared():
    paint, _ = painted(share=True)
    weights = weights_of(23)
    first, second = (
        paint.at(np.tile(CORNERS[k], (23, 1)), weights)["pair"] for k in (0, 1)
    )  # fmt: skip
    np.testing.assert_array_equal(first, second)


def test_texels_are_half_the_square_of_the_level():
    paint, _ = painted()
    np.testing.assert_allclose(paint.texels(CORNERS), [12.5, 4.5, 0])
    assert paint.n_samples == lattice_size(5) + lattice_size(3)


@pytest.mark.parametrize("change", ["samples", "levels", "triangle"])
def test_what_is_sampled_belongs_to_the_digest(change):
    def mesh(**edit):
        given = {"corner_values": {"albedo": np.full((4, 3), 0.5)},
                 "triangle_corners": [[0, 1, 2]], "levels": [2], "starts": [0],
                 "samples": {"albedo": np.linspace(0, 1, 18).reshape(6, 3)}}  # fmt: skip
        result = quad(albedo=0.5)
        result.paint = LatticePaint(**{**given, **edit})
        return result

    edits = {
        "samples": {"samples": {"albedo": np.linspace(0, 0.9, 18).reshape(6, 3)}},
        "levels": {"levels": [1]},
        "triangle": {"triangle_corners": [[0, 2, 3]]},
    }
    assert mesh_digests([mesh()]) == mesh_digests([mesh()])
    assert mesh_digests([mesh()]) != mesh_digests([mesh(**edits[change])])


def test_bake_points_stand_for_their_samples():
    """A lattice that is black but for one corner of the face: the mean is small, not a half."""
    mesh = quad(albedo=1.0)
    level = 8
    black = np.zeros((lattice_size(level), 3))
    mesh.paint = LatticePaint(
        {"albedo": np.ones((4, 3))}, mesh.triangle_corners, [level] * 2, [0, 0], {"albedo": black}
    )
    points = Scene.from_meshes([mesh], max_hidden=0).points
    np.testing.assert_allclose(points.albedo, 1)
    np.testing.assert_allclose(points.mean_albedo, 0, atol=1e-6)


def test_paint_of_some_quantities_is_the_same_there():
    paint, _ = painted()
    corners, weights = np.tile(CORNERS[0], (7, 1)), weights_of(7)
    some = paint.only({"pair", "emission"})
    np.testing.assert_array_equal(
        some.at(corners, weights)["pair"], paint.at(corners, weights)["pair"]
    )
    assert paint.only({"emission"}) is None and "pair" in paint.at(corners, weights)
