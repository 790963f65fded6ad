"""What K hands a hit to, against barycentric weights by plain geometry."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.scene import Mesh, Scene
from prt_core.transport import gather_hits, gather_operator, ray_ends
from prt_core.transport.gather import DARK, MISS, REPRESENTED, ROUND
from tests.meshes import caster_of


def triangles(name, vertices, faces, two_sided=False):
    vertices = np.array(vertices, float)
    a, b, c = np.moveaxis(vertices[np.array(faces)], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corner_vertex = np.array(faces).ravel()
    return Mesh(
        name,
        vertices,
        corner_vertex,
        np.repeat(normal, 3, axis=0),
        np.arange(len(corner_vertex)).reshape(-1, 3),
        np.full((len(corner_vertex), 3), 0.5),
        two_sided=two_sided,
    )


ROUNDS = 160
CORNERS = np.array([(-3.0, -2.0, 0.0), (4.0, -1.0, 0.0), (-1.0, 5.0, 0.0)])


@pytest.fixture(scope="module")
def scene():
    """A triangle that faces up, and a small one above it that looks down, near one corner."""
    eye = [(1.5, -0.6, 1.0), (1.52, -0.58, 1.0), (1.54, -0.6, 1.0)]
    meshes = [triangles("floor", CORNERS, [[0, 1, 2]]), triangles("eye", eye, [[0, 1, 2]])]
    return Scene.from_meshes(meshes, max_hidden=0)


@pytest.fixture(scope="module")
def gather(scene):
    every, caster = slice(0, len(scene.points)), caster_of(scene)
    result = [gather_hits(scene, caster, every, 3, turn).hits for turn in range(ROUNDS)]
    return gather_operator(np.concatenate(result, axis=1), len(scene.points)).toarray()


def expected_shares(origin):
    """Of each corner of the floor among the cosine-distributed rays of a point that looks down."""
    n = 600
    u, v = ((np.arange(n) + 0.5) / n for _ in range(2))
    u, v = (x.ravel() for x in np.meshgrid(u, v))
    ways = np.stack(
        [np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), -np.sqrt(1 - u)]
    )
    places = origin[:2, None] + ways[:2] * origin[2] / -ways[2]
    whole = np.linalg.det(np.insert(CORNERS[:, :2], 0, 1, axis=1))
    weights = []
    for k in range(3):
        p, q = CORNERS[(k + 1) % 3, :2], CORNERS[(k + 2) % 3, :2]
        # The share of the triangle between a place and the opposite edge.
        side = (q[0] - p[0]) * (places[1] - p[1]) - (q[1] - p[1]) * (places[0] - p[0])
        weights.append(side / whole)
    weights = np.array(weights)
    return (weights * (weights >= 0).all(axis=0)).mean(axis=1)


def test_a_hit_is_handed_to_a_corner_with_the_chance_of_its_weight(scene, gather):
    world = scene.to_world(scene.points.positions)
    floor = [int(np.linalg.norm(world - corner, axis=1).argmin()) for corner in CORNERS]
    for eye in np.flatnonzero(scene.points.object_index == 1):
        wanted = expected_shares(world[eye])
        assert wanted.max() > 2 * wanted.min() > 0.1
        # Four standard deviations of a count of independent rays.
        spread = np.sqrt(wanted * (1 - wanted) / (ROUNDS * ROUND))
        assert (np.abs(gather[eye, floor] - wanted) < 4 * spread).all()
        assert gather[eye].sum() == pytest.approx(gather[eye, floor].sum())


def test_radiosity_that_is_linear_is_gathered_without_bias(scene, gather):
    # Of a linear function the mean over hits is that of its values at the hits.
    world = scene.to_world(scene.points.positions)
    radiosity = 2 + 0.3 * world[:, 0] - 0.2 * world[:, 1]
    at_corners = 2 + 0.3 * CORNERS[:, 0] - 0.2 * CORNERS[:, 1]
    result = gather @ radiosity
    for eye in np.flatnonzero(scene.points.object_index == 1):
        wanted = expected_shares(world[eye]) @ at_corners
        assert result[eye] == pytest.approx(wanted, abs=4 * 1.5 / np.sqrt(ROUNDS * ROUND))


def test_rows_of_k_are_shares_of_the_rays():
    rng = np.random.default_rng(0)
    hits = rng.integers(-2, 7, (5, 3 * ROUND)).astype(np.int32)
    hits[4] = MISS
    blocked = np.array([0.5, 1.0, 0.01, 0.3, 0.2], np.float32)
    plain, scaled = (gather_operator(hits, 7, *b).toarray() for b in ((), (blocked,)))
    for x in range(5):
        row = [np.count_nonzero(hits[x] == y) / hits.shape[1] for y in range(7)]
        np.testing.assert_allclose(plain[x], row, rtol=1e-6)
        met = np.count_nonzero(hits[x] != MISS) / hits.shape[1]
        # Of a row that expects less than two hits nothing is known better.
        few = blocked[x] * hits.shape[1] < 2
        scale = 1 if few or not met else blocked[x] / met
        np.testing.assert_allclose(scaled[x], np.array(row) * scale, rtol=1e-6)
    assert (hits == DARK).any()


@pytest.mark.parametrize(
    "slot, code",
    [(3, REPRESENTED + 1), (3, REPRESENTED - 3), (3, REPRESENTED - ROUND), (6, REPRESENTED - 7)],
)
def test_a_ray_that_stands_for_none_that_was_cast_is_refused(slot, code):
    """Of no meaning, for itself, for one of another round, for one that stands for another."""
    hits = np.full((5, 2 * ROUND), 2, np.int32)
    hits[1, 3] = REPRESENTED - 6
    assert ray_ends(hits)[1, 3] == 2
    hits[1, slot] = code
    for call in (ray_ends, lambda hits: gather_operator(hits, 7)):
        with pytest.raises(PRTError, match="hits: expected points"):
            call(hits)
