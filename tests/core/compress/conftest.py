"""One small bake for all: a coloured ball over a floor, and light that no basis knows."""

import numpy as np
import pytest

from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import Transport, gather_hits, gather_operator, visibility_bits
from tests.meshes import caster_of, plane, sphere


@pytest.fixture(scope="session")
def scene():
    ball = sphere(12, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    return Scene.from_meshes([ball, plane(17, albedo=(0.7, 0.65, 0.6))])


@pytest.fixture(scope="session")
def transport(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    every = slice(0, len(scene.points))
    bits = visibility_bits(scene, cube_map, caster, every)
    hits = [gather_hits(scene, caster, every, 0, r).hits for r in range(2)]
    gather = gather_operator(np.concatenate(hits, axis=1), len(scene.points))
    points = scene.points
    return Transport(cube_map, bits, gather, points.normals, points.albedo, 1e-5)


@pytest.fixture(scope="session")
def light(transport):
    """Smooth sky, noise, and a sun of 1e5."""
    rng = np.random.default_rng(7)
    sky = 1 + transport.cube_map.directions[:, 2:] * [0.5, 0.6, 0.9]
    light = sky + rng.random((transport.n_directions, 3))
    light[100] = [1e5, 9e4, 7e4]
    return light.astype(np.float32)


def relative(found, truth):
    found, truth = np.asarray(found, np.float64), np.asarray(truth, np.float64)
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)
