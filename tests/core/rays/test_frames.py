"""Frames of float32: parts of a scene that lie far apart are each as fine as alone."""

import numpy as np
import pytest

from prt_core.rays import FramedCaster, make_caster, precision_frames
from prt_core.scene import Scene
from tests.meshes import caster_of, plane, sphere


def ball_at(x, name, n=9):
    return sphere(n, 0.5, (x, 0, 0.5), name=name)


def test_a_scene_of_one_scale_has_one_frame_at_its_zero():
    scene = Scene.from_meshes([plane(23, -3, 3), ball_at(0, "ball")])
    assert len(scene.frames) == 1 and not scene.frames.centres.any()
    assert scene.ray_origins.dtype == np.float32


def test_what_lies_far_apart_has_frames_of_its_own():
    meshes = [plane(11, name="floor"), ball_at(0, "near"), ball_at(1e6, "far")]
    scene = Scene.from_meshes(meshes)
    owners = [set(scene.frames.of_triangle[scene.triangle_object == i]) for i in range(3)]
    assert owners[0] == owners[1] != owners[2] and len(scene.frames) == 2
    assert not scene.frames.coarse.any()
    local = scene.frames.local(scene.vertices, scene.triangles) * scene.size
    assert np.abs(local).max() < 10


def test_what_no_frame_serves_is_said():
    meshes = [ball_at(1e6 * k * (k + 1), f"ball{k}", 3) for k in range(11)]
    scene = Scene.from_meshes(meshes)
    assert len(scene.frames) <= 8
    assert any("ball" in m and "lies so far from the rest" in m for m in scene.messages)


@pytest.fixture(scope="module")
def framed():
    rng = np.random.default_rng(2)
    near = rng.normal(size=(37, 3, 3)) * 0.7
    far = rng.normal(size=(29, 3, 3)) * 0.7 + [3e5, 0, 0]
    vertices = np.concatenate([near, far]).reshape(-1, 3)
    triangles = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    frames = precision_frames(vertices, triangles, np.repeat([0, 1], [37, 29]))
    assert len(frames) == 2
    origins = np.concatenate([rng.normal(size=(503, 3)), rng.normal(size=(501, 3)) + [3e5, 0, 0]])
    directions = rng.normal(size=(1004, 3))
    directions[:40] = [1, 0, 0]  # across, from one frame to the other
    directions[40:60] = [0, 0, 1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return vertices, triangles, frames, origins, directions.astype(np.float32)


def test_framed_rays_equal_those_of_the_oracle_in_float64(framed):
    vertices, triangles, frames, origins, directions = framed

    class Exact:
        """Möller and Trumbore in float64, one ray at a time."""

        def __init__(self):
            a, b, c = np.moveaxis(vertices[triangles], 1, 0)
            self.a, self.e1, self.e2 = a, b - a, c - a

        def hit(self, o, d):
            p = np.cross(d, self.e2)
            det = (self.e1 * p).sum(-1)
            s = o - self.a
            u = (s * p).sum(-1) / det
            q = np.cross(s, self.e1)
            v, t = (d * q).sum(-1) / det, (self.e2 * q).sum(-1) / det
            t = np.where((u > 0) & (v > 0) & (u + v < 1) & (t > 0), t, np.inf)
            return (int(t.argmin()), t.min()) if np.isfinite(t.min()) else (-1, np.inf)

    exact = Exact()
    truth = [exact.hit(o, d) for o, d in zip(origins, directions.astype(np.float64), strict=True)]
    triangle, distance = map(np.array, zip(*truth, strict=True))
    caster = FramedCaster(lambda v, t: make_caster("brute", v, t), vertices, triangles, frames)
    result = caster.intersect(origins, directions)
    assert 0.05 < (triangle >= 0).mean() < 0.95
    assert (result.triangle != triangle).mean() < 2e-3
    same = (result.triangle == triangle) & (triangle >= 0)
    inside = same & (distance < 100)
    assert inside.sum() > 200 and (same & ~inside).sum() > 2
    np.testing.assert_allclose(result.distance[inside], distance[inside], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(result.distance[same], distance[same], rtol=1e-4, atol=0.1)
    blocked = caster.occluded(origins, directions)
    np.testing.assert_array_equal(blocked, result.triangle >= 0)
    same = inside
    half = (np.where(np.isfinite(distance), distance, 5) / 2).astype(np.float32)
    assert not caster.occluded(origins[same], directions[same], half[same]).any()
    beyond = (half[same] * 2.001).astype(np.float32)
    assert caster.occluded(origins[same], directions[same], beyond).all()


def test_rays_go_from_one_frame_into_another(framed):
    vertices, triangles, frames, _, _ = framed
    scene = Scene.from_meshes(
        [plane(5, -0.5, 0.5, name="near"), plane(5, -0.5, 0.5, name="far", z=1e6)]
    )
    assert len(scene.frames) == 2
    caster = caster_of(scene)
    points = scene.points
    up = np.zeros((len(points), 3), np.float32)
    up[:, 2] = 1
    near = points.object_index == 0
    np.testing.assert_array_equal(caster.occluded(scene.ray_origins, up), near)
    caster.close()
