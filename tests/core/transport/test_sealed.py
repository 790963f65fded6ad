"""Light does not go through walls: what a ray meets is told by points on its own side of them."""

import numpy as np
import pytest

from prt_core.runtime.progress import run
from prt_core.scene import Mesh, Scene
from prt_core.sphere import CubeMap
from prt_core.transport import (
    Sharing,
    all_bounces,
    detail_steps,
    gather_hits,
    gather_operator,
    received_light,
    visibility_bits,
)
from tests.meshes import caster_of, plane

CUBE = CubeMap(6)


def shell(name, low, high, inward, n=8):
    """A box without a bottom, of n x n quads a side, that faces out or in."""
    vertices, quads = [], []
    for axis in range(3):
        for side in (0, 1):
            if (axis, side) == (2, 0):
                continue
            first = len(vertices)
            u, v = (k for k in range(3) if k != axis)
            for j in range(n + 1):
                for i in range(n + 1):
                    p = np.empty(3)
                    p[axis] = (low, high)[side][axis]
                    p[u] = low[u] + (high[u] - low[u]) * i / n
                    p[v] = low[v] + (high[v] - low[v]) * j / n
                    vertices.append(p)
            for j in range(n):
                for i in range(n):
                    a = first + j * (n + 1) + i
                    quad = [a, a + 1, a + n + 2, a + n + 1]
                    outward = (side == 1) != (axis == 1)
                    quads.append(quad if outward != inward else quad[::-1])
    vertices, quads = np.array(vertices), np.array(quads)
    a, b, c = (vertices[quads[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corner = np.arange(quads.size).reshape(-1, 4)
    triangles = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    albedo = np.full((quads.size, 3), 0.8)
    return Mesh(name, vertices, quads.ravel(), np.repeat(normal, 4, axis=0), triangles, albedo,
                face_sizes=np.full(len(quads), 4))  # fmt: skip


def sealed(thickness, floor_quads, ground=4.0, place=(0.0, 0.0)):
    """A sealed room of 2 x 2 x 1.5 that stands on a ground."""
    x, y = place
    wall = thickness
    outside = shell("outside", (x - 1, y - 1, 0), (x + 1, y + 1, 1.5), False)
    low, high = (x - 1 + wall, y - 1 + wall, 0), (x + 1 - wall, y + 1 - wall, 1.5 - wall)
    floor = plane(floor_quads + 1, -ground, ground, name="ground", albedo=0.8)
    return [floor, outside, shell("inside", low, high, True)]


def relit(scene, rounds=4):
    """(scene with details, radiance under a white sky, Gathered of each round)."""
    caster = caster_of(scene)
    scene, _ = run(detail_steps(scene, caster, 0))
    every = slice(0, len(scene.points))
    bits = visibility_bits(scene, CUBE, caster, every)
    white = np.ones((CUBE.n_directions, 1), np.float32)
    received = received_light(bits, scene.points.normals, CUBE, white)
    result = [gather_hits(scene, caster, every, 0, r) for r in range(rounds)]
    gather = gather_operator(np.hstack([one.hits for one in result]), len(scene.points))
    caster.close()
    return scene, all_bounces(gather, scene.points.albedo[:, :1], received, 1e-5)[0][:, 0], result


@pytest.mark.parametrize("thickness", [1e-3, 0.02, 0.3])
@pytest.mark.parametrize("floor_quads", [1, 20])
@pytest.mark.parametrize("ground", [4.0, 300.0])
def test_a_sealed_room_is_dark(thickness, floor_quads, ground):
    if ground > 4 and floor_quads > 1:
        floor_quads = 7
    scene, radiance, result = relit(Scene.from_meshes(sealed(thickness, floor_quads, ground)))
    inside = scene.points.object_index == 2
    assert radiance[inside].max() < 1e-4
    ground = (scene.points.object_index == 0) & scene.points.visible
    assert radiance[ground].max() > 0.5
    rays = sum(one.n_rays for one in result)
    assert sum(one.n_hidden for one in result) < 0.005 * rays


def test_details_are_sought_where_they_are_asked_for():
    scene = Scene.from_meshes(sealed(0.02, 20))
    caster, found = caster_of(scene), []

    def sought(triangles, places):
        found.append(len(triangles))
        assert (scene.triangle_object[triangles] >= 0).all()
        return places[:, 0] > 0

    everywhere, all_rays = run(detail_steps(scene, caster, 0))
    some, rays = run(detail_steps(scene, caster, 0, sought))
    caster.close()
    here, there = (each.points.positions[each.details.point, 0] for each in (some, everywhere))
    assert len(here) > 20 and (here > 0).all() and (there < 0).sum() > 20
    assert rays < 0.9 * all_rays and found[0] > 0


def test_the_room_would_not_be_dark_by_corners_alone(monkeypatch):
    monkeypatch.setattr(
        Sharing, "_hand", lambda self, caster, places, some, points, handed:
        handed.chosen.__setitem__(some, points) or np.ones(len(some), bool),
    )  # fmt: skip
    scene, radiance, _ = relit(Scene.from_meshes(sealed(0.02, 20)))
    assert radiance[scene.points.object_index == 2].max() > 0.05


def test_a_lit_room_within_one_face_bounces_off_its_floor():
    """A room with a hole in its roof, inside one cell of the ground: its floor is not lost."""
    results = []
    for quads, ground in ((40, 4.0), (1, 300.0)):
        meshes = sealed(0.02, quads, ground, (0.37, 0.21))
        for mesh in meshes[1:]:
            # Faces of the roof near its middle are taken away.
            middle = mesh.vertices[mesh.corner_vertex].reshape(-1, 4, 3).mean(axis=1)
            roof = (middle[:, 2] > 1.4) & (np.abs(middle[:, :2] - [0.37, 0.21]).max(axis=1) < 0.5)
            kept = ~roof[mesh.triangle_corners[:, 0] // 4]
            mesh.triangle_corners = mesh.triangle_corners[kept]
        scene, radiance, result = relit(Scene.from_meshes(meshes), 8)
        inside = (scene.points.object_index == 2) & scene.points.visible
        results.append(radiance[inside].mean())
        assert sum(one.n_hidden for one in result) < 0.005 * sum(one.n_rays for one in result)
    fine, coarse = results
    assert fine > 0.03
    np.testing.assert_allclose(coarse, fine, rtol=0.1)


@pytest.mark.parametrize("far", [None, 500.0])
def test_a_gap_below_one_large_face_is_dark(far):
    """Its corners are all at the lit rim: that they agree tells nothing of the middle.

    In a scene that reaches far its face has no other points.
    """
    floor = plane(25, -1, 1, name="floor", albedo=0.8)
    slab = plane(2, -0.5, 0.5, z=0.006, name="slab", albedo=0.8)
    slab.triangle_corners = slab.triangle_corners[:, ::-1]
    slab.corner_normal = -slab.corner_normal
    lid = plane(2, -0.5, 0.5, z=0.006, name="lid", albedo=0.8)
    speck = [] if far is None else [plane(2, far, far + 1, name="far")]
    scene, radiance, _ = relit(Scene.from_meshes([floor, slab, lid, *speck]))
    place = scene.to_world(scene.points.positions)
    under = (scene.points.object_index == 0) & (np.abs(place[:, :2]).max(axis=1) < 0.4)
    assert under.sum() > 50
    assert radiance[under].max() < 0.05
    level = scene.triangle_level[scene.triangle_object == 1]
    assert (level.max() == 1) == (far is not None)


def test_a_hit_is_shared_in_proportion_among_the_corners_it_sees():
    """A screen hides one corner of a triangle: the other two share what it would have had."""
    floor = plane(2, 0, 1, name="floor")
    screen = plane(2, -0.3, 0.3, name="screen")
    screen.vertices = screen.vertices[:, [0, 2, 1]] + [0.75, 0.75, 0.0]
    screen.vertices[:, [0, 1]] = (screen.vertices[:, [0, 1]] - 0.75) @ [
        [0.7, -0.7],
        [0.7, 0.7],
    ] + 0.75
    scene = Scene.from_meshes([floor, screen], max_hidden=0)
    from prt_core.rays import Hits

    caster = caster_of(scene)
    first = int(np.flatnonzero(scene.triangle_object == 0)[0])
    barycentric = np.tile(np.float32([[0.3, 0.2]]), (20000, 1))
    hits = Hits(np.full(20000, first, np.int32), barycentric, np.full(20000, 0.3, np.float32))
    down = np.tile(np.float32([[0, 0, -1]]), (20000, 1))
    pick = np.random.default_rng(0).random(20000).astype(np.float32)
    ends, unlit, hidden, short = Sharing(scene).ends(caster, hits, down, pick)
    around, weights = scene.hit_points([first], barycentric[:1], np.zeros(1, bool))
    at = scene.to_world(scene.points.positions[around[0]])
    seen = at[:, :2].min(axis=1) < 0.5
    assert seen.sum() == 2 and not unlit.any() and not hidden.any()
    shares = np.array([(ends == point).mean() for point in around[0]])
    wanted = np.where(seen, weights[0], 0) / weights[0][seen].sum()
    np.testing.assert_allclose(shares, wanted, atol=4 * np.sqrt(0.25 / 20000))
    # One ray for the corner that is picked, another where it is refused.
    assert set(short.tolist()) == {1, 2}
    assert short.mean() - 1 == pytest.approx(weights[0][~seen].sum(), abs=0.015)
    caster.close()
