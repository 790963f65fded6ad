"""The figures that a bake gives of its bounces, against what very many rays say."""

import numpy as np
import pytest

from prt_core import BakeSettings, BakeStore, Mesh, Scene, bake_steps, load, run
from prt_core.bake.bounce_error import LOCAL, bounce_error
from prt_core.transport import all_bounces, gather_operator, gather_parts
from prt_core.transport.gather import NOT_CAST
from tests.meshes import caster_of, plane, sphere

TOWARDS = np.array([[0.8, 0.3, 0.52], [-0.5, -0.7, 0.51]])


def scene_of(albedo):
    ball = sphere(6, 0.4, (0, 0, 0.5), name="ball", albedo=0.75 * albedo)
    return Scene.from_meshes([ball, plane(9, -1.2, 1.2, name="floor", albedo=albedo)])


def baked(scene, path, **settings):
    settings = BakeSettings(**{"resolution": 8, "method": "exhaustive", **settings})
    return run(bake_steps(scene, path, settings)), load(path).transport


def probed(transport):
    """Received light of an even sky and of two soft suns, low on either side."""
    light = np.ones((transport.n_directions, 3), np.float32)
    light[:, 1:] = np.exp(12 * (transport.cube_map.directions @ TOWARDS.T - 1))
    return transport.received(light)


def radiance_of(scene, gather, received):
    albedo = scene.points.albedo.mean(axis=1, keepdims=True)
    return all_bounces(gather, albedo, received, 1e-5)[0][scene.points.visible]


def many_rays(scene, blocked, rounds=64):
    every = slice(0, len(scene.points))
    parts = [(every, turn) for turn in range(rounds)]
    result = gather_parts(scene, caster_of(scene), parts, 99)
    hits = np.concatenate([one.hits for one in result], axis=1)
    return gather_operator(hits, len(scene.points), blocked)


def test_the_error_that_is_reported_is_that_of_the_bounces(tmp_path):
    scene, reported, truths, true = scene_of(0.8), [], None, []
    for seed in range(3):
        report, transport = baked(scene, tmp_path / f"{seed}.prt", tolerance=0.9, seed=seed)
        received = probed(transport)
        if truths is None:
            blocked = np.clip(1 - received[:, 0], 0, 1)
            truths = radiance_of(scene, many_rays(scene, blocked), received)
        result = radiance_of(scene, transport.gather, received)
        errors = np.linalg.norm(result - truths, axis=0) / np.linalg.norm(truths, axis=0)
        reported.append(report["error"])
        true.append(errors.max())
    # Of the worst light; rather too large, for halves of the rays know less of what is blocked.
    assert 0.95 < np.mean(reported) / np.mean(true) < 1.5
    # Of 64 rays a point those stand for others that are likely to meet nothing.
    assert max(true) < 0.012 and report["skipped"]["gather_rays"] > 0


@pytest.mark.parametrize("albedo", [0.02, 0.1])
def test_bounces_that_are_left_out_are_weaker_than_is_said(tmp_path, albedo):
    scene = scene_of(albedo)
    report, transport = baked(scene, tmp_path / "a.prt", tolerance=0.5)
    bound = report["skipped"]["bounces_below"]
    assert transport.gather is None and 0 < bound <= 0.25
    received = probed(transport)
    gather = many_rays(scene, np.clip(1 - received[:, 0], 0, 1), 8)
    whole, direct = (radiance_of(scene, k, received) for k in (gather, None))
    share = np.linalg.norm(whole - direct, axis=0) / np.linalg.norm(direct, axis=0)
    # A bound, and not far from it: light is taken to come from the brightest place alone.
    assert share.max() < bound < 4 * share.max()
    # A tolerance that is below it bakes them.
    report, transport = baked(scene, tmp_path / "b.prt", tolerance=1.9 * bound)
    assert transport.gather is not None and "bounces_below" not in report["skipped"]


def test_enclosed_places_are_measured_by_their_own_light():
    rng = np.random.default_rng(0)
    truth = np.repeat([1.0, 1 / 50, 1 / 50, 1e-6], [600, 300, 10, 90])[:, None] * [1, 0.5]
    grain = np.repeat([0.001, 0.1, 0.1, 3], [600, 300, 10, 90])[:, None]
    halves = truth * (1 + grain * rng.choice([-1, 1], (2, *truth.shape)))
    seen = np.ones(len(truth), bool)
    seen[900:910] = False
    error = bounce_error(*halves, seen)
    assert error.whole < 0.005 and error.enclosed == pytest.approx(0.1 / 2**0.5, rel=0.2)
    np.testing.assert_allclose(error.of_points[600:900], error.enclosed / LOCAL, rtol=1e-6)
    # Neither what is open, nor what is dark, nor what is not seen.
    others = np.r_[0:600, 900:1000]
    np.testing.assert_allclose(error.of_points[others], error.whole, rtol=1e-6)
    # Points keep their class, whatever more rays say of them.
    again = bounce_error(*halves[:, ::-1], seen[::-1], error.classes[::-1])
    np.testing.assert_array_equal(again.of_points[::-1], error.of_points)
    moved = bounce_error(*halves, seen, np.zeros(len(seen), np.int8))
    assert moved.enclosed == 0 and moved.whole == error.whole
    # A corner is no place.
    few = bounce_error(*halves[:, np.r_[0:600, 600:610]], np.ones(610, bool))
    assert few.enclosed == 0


def opened(mesh, top):
    """The mesh of a ball without its faces above a height."""
    corners = mesh.vertices[mesh.corner_vertex].reshape(-1, 3, 3)
    kept = np.repeat(corners[..., 2].max(axis=1) < top, 3)
    vertex, count = mesh.corner_vertex[kept], np.count_nonzero(kept)
    triangles = np.arange(count).reshape(-1, 3)
    normals = mesh.corner_normal[kept]
    return Mesh(mesh.name, mesh.vertices, vertex, normals, triangles, np.full((count, 3), 0.7))


def test_a_cave_takes_more_rays_than_what_stands_in_the_open(tmp_path):
    """A hollow ball with a hole, from without as bright as the floor."""
    shell = [opened(sphere(12, 0.6, (0, 0, 0.7), name="outside"), 1.285)]
    shell.append(opened(sphere(12, 0.55, (0, 0, 0.7), inside=True, name="inside"), 1.24))
    scene = Scene.from_meshes([*shell, plane(9, -2, 2, name="floor", albedo=0.7)])
    report, _ = baked(scene, tmp_path / "a.prt", tolerance=0.008)
    store = BakeStore(tmp_path / "a.prt")
    rounds, hits = store.read("gather_rounds"), store.array("gather")[...]
    inside = load(tmp_path / "a.prt").scene.points.object_index == 1
    assert report["error"] <= 0.008 and 0 < report["error_enclosed"] <= LOCAL * 0.008
    # About half of its points see so much of the sky that they are not enclosed.
    assert rounds[inside].mean() > 1.3 * rounds[~inside].mean()
    np.testing.assert_array_equal(
        (hits == NOT_CAST).reshape(len(hits), -1, 32).all(axis=2).sum(axis=1),
        hits.shape[1] // 32 - rounds,
    )
