"""What a smooth ridge gathers: of what is below the face of a corner Cycles gives it nothing."""

import numpy as np

from prt_core.scene import Mesh, Scene
from prt_core.transport import gather_hits
from prt_core.transport.gather import DARK, MISS
from tests.meshes import caster_of, sphere

ROUNDS = 24


def ridge(degrees, half=0.2):
    """Two slopes that meet smoothly, each so steep."""
    fall = half * np.tan(np.deg2rad(degrees))
    xs, ys = (-half, 0, half), (-half, -half / 3, half)
    vertices = np.array([(x, y, -fall * (x != 0)) for y in ys for x in xs], float)
    quads = np.array([(i, i + 1, i + 4, i + 3) for i in (0, 1, 3, 4)])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    normals = np.tile([0, 0, 1.0], (faces.size, 1))
    corners, albedo = np.arange(faces.size).reshape(-1, 3), np.full((faces.size, 3), 0.5)
    return Mesh("ridge", vertices, faces.ravel(), normals, corners, albedo)


def ends_on_top(meshes):
    """Hits of the rays of the points along the ridge."""
    scene = Scene.from_meshes(meshes, max_hidden=0)
    caster, every = caster_of(scene), slice(0, len(scene.points))
    hits = [gather_hits(scene, caster, every, 7, turn).hits for turn in range(ROUNDS)]
    caster.close()
    x, _, z = scene.to_world(scene.points.positions).T
    on_top = (np.abs(x) < 1e-6) & (np.abs(z) < 1e-6) & (scene.points.object_index == 0)
    assert on_top.sum() == 3
    return np.concatenate(hits, axis=1)[on_top]


def test_a_ridge_within_walls_gathers_what_is_above_its_faces():
    for degrees in (10, 35, 60):
        ends = ends_on_top([ridge(degrees), sphere(9, 1.0, inside=True, name="walls")])
        # Of a hemisphere about the normal so much of the cosine is below a plane that leans.
        lost = (1 - np.cos(np.deg2rad(degrees))) / 2 if degrees > 20 else 0
        assert (ends >= 0).mean() + (ends == DARK).mean() == 1
        noise = 4 * np.sqrt(0.25 / ends.size)
        assert abs((ends == DARK).mean() - lost) < noise, degrees


def test_the_sky_is_as_open_as_the_visibility_says():
    assert (ends_on_top([ridge(60)]) == MISS).all()
