"""Shadows of what nearly touches, at every scale: a plate just above a floor leaves no light."""

import numpy as np
import pytest

from prt_core.runtime.progress import run
from prt_core.sampling import CertificateSettings, Sampled, certificate_steps
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import received_light, visibility_bits
from prt_core.transport.visibility import horizon_bits
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(6)


def turned(mesh, matrix, move=(0, 0, 0)):
    mesh.vertices = mesh.vertices @ matrix.T + move
    mesh.corner_normal = mesh.corner_normal @ matrix.T
    return mesh


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def sky_seen(scene):
    """(n_points,) how much of an even sky each point sees, of what its horizon leaves of it."""
    caster = caster_of(scene)
    bits = visibility_bits(scene, CUBE, caster, slice(None))
    caster.close()
    white = np.ones((CUBE.n_directions, 1), np.float32)
    subset, whole = (
        received_light(b, scene.points.normals, CUBE, white)[:, 0]
        for b in (bits, horizon_bits(scene, CUBE, slice(None)))
    )
    return subset / whole


def contact(gap, matrix, move, others=(), size=1.0):
    """A floor of 2 x 2, a plate of 1 x 1 above it, and whatever else."""
    floor = plane(13, -size, size, name="floor")
    plate = plane(4, -size / 2, size / 2, name="plate", z=gap)
    meshes = [turned(mesh, matrix, move) for mesh in (floor, plate)]
    return Scene.from_meshes([*meshes, *others])


def faults(scene, size=1.0, matrix=None, move=(0, 0, 0)):
    """What is wrong with the light around the plate, in words."""
    matrix = np.eye(3) if matrix is None else matrix
    seen, points = sky_seen(scene), scene.points
    floor = np.flatnonzero(points.object_index == 0)
    place = (scene.to_world(points.positions[floor]) - move) @ matrix / size
    away = np.abs(place[:, :2]).max(axis=1)
    under, open_floor = floor[away < 0.4], floor[away > 0.75]
    plate = (points.object_index == 1) & points.visible
    # The shortcut for open points may not call any point open that is not.
    result = {
        "too few points under the plate": len(under) < 16,
        "light under the plate": seen[under].max() >= 0.01,
        "shadow beside the plate": seen[open_floor].min() <= 0.97,
        "the plate shades itself": seen[plate].min() <= 0.999,
        "points under the plate are called open": scene.open_points[under].any(),
    }
    return [what for what, is_so in result.items() if is_so]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("seed", [None, 1])
def test_a_plate_a_thousandth_above_its_floor_shades_it(scale, seed):
    matrix = np.eye(3) if seed is None else rotation(seed)
    assert not faults(contact(1e-3 * scale, matrix, (0, 0, 0), size=scale), scale, matrix)


@pytest.mark.parametrize("size", [1e3, 1e4, 1e6])
def test_a_far_ground_takes_no_shadow_away(size):
    ground = plane(3, -size, size, name="ground", z=-0.02)
    assert not faults(contact(0.01, np.eye(3), (0, 0, 0), [ground]))


@pytest.mark.parametrize("seed", [None, 2])
def test_a_millimetre_in_a_kilometre(seed):
    matrix = np.eye(3) if seed is None else rotation(seed)
    ground = turned(plane(3, -500, 500, name="ground", z=-0.02), matrix)
    assert not faults(contact(1e-3, matrix, (0, 0, 0), [ground]), 1.0, matrix)
    # The contact is the ground's own, far from the middle of the scene.
    move = matrix @ [300.0, 200.0, 0]
    post = turned(plane(3, -500, 500, name="ground"), matrix)
    assert not faults(contact(1e-3, matrix, move, [post]), 1.0, matrix, move)


@pytest.mark.parametrize("far", [1e4, 1e6])
def test_one_object_far_from_the_rest_leaves_both_right(far):
    ball = sphere(9, 1.0, (far, 0, 0), name="far")
    scene = contact(1e-3, rotation(3), (0, 0, 0), [ball])
    assert not faults(scene, 1.0, rotation(3))
    seen = sky_seen(scene)[scene.points.object_index == 2]
    assert seen.min() > 0.995, "a convex body shades itself"
    # And the other way round: the contact is the one that is far.
    move = np.array([far, -far, far / 3])
    assert not faults(
        contact(1e-3, rotation(4), move, [sphere(9, 1.0, name="near")]), 1.0, rotation(4), move
    )


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("far", [0.0, 30.0, 1e4])
def test_no_surface_meets_its_own_rays(seed, far):
    matrix, move = rotation(seed), np.random.default_rng(seed).normal(size=3) * far
    meshes = [turned(plane(2 + 5 * seed, name="floor"), matrix, move)]
    if far:
        meshes.append(plane(3, -1e-3, 1e-3, name="speck"))
    scene = Scene.from_meshes(meshes)
    seen = sky_seen(scene)
    assert seen[scene.points.object_index == 0].min() == 1


def test_large_triangles_that_hover_are_seen_by_the_shortcut():
    """All corners of a great plate lie near the horizon; what it covers is dark all the same."""
    plate = plane(2, -1e4, 1e4, name="plate", z=0.05)
    scene = Scene.from_meshes([plane(5, name="floor"), plate])
    assert not scene.open_points[scene.points.object_index == 0].any()


def test_the_certificate_does_not_believe_in_open_points():
    """All points taken as open, as by a shortcut that is blind: found out, and put right."""
    scene = contact(0.05, np.eye(3), (0, 0, 0))
    bits = horizon_bits(scene, CUBE, slice(None))
    sampled = Sampled(bits.copy(), np.zeros_like(bits), 0)
    caster = caster_of(scene)
    light = {"even": np.ones((CUBE.n_directions, 3), np.float32)}
    errors = run(
        certificate_steps(scene, CUBE, caster, sampled, light, CertificateSettings(seed=3))
    )
    caster.close()
    assert errors[0].worst > 0.1
    assert (sampled.bits != bits).any()
