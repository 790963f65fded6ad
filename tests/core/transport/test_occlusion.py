"""Ambient occlusion, sky visibility and bent normals, against closed forms."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import Occlusion, occlusion_steps, received_light, visibility_bits
from prt_core.transport.occlusion import FALLOFFS, as_colours
from tests.meshes import caster_of, plane, sphere, wall


def asked_of(scene, resolution=16, **asked):
    cube_map, caster = CubeMap(resolution), caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    return run(occlusion_steps(scene, cube_map, bits, Occlusion(**asked), caster))


def beside_a_wall(height=1.0, tilt=None):
    floor = plane(3, -0.01, 0.01, z=0.0, name="floor")
    scene = Scene.from_meshes([floor, wall(1.0, height, 300.0)], max_hidden=0)
    places = scene.to_world(scene.points.positions)
    return scene, np.flatnonzero(np.linalg.norm(places[:, :2], axis=1) < 1e-6)[0]


@pytest.mark.parametrize("resolution", [7, 8])
@pytest.mark.parametrize("kind", ["ambient", "sky", "bent-normal"])
@pytest.mark.parametrize("weight", ["cosine", "even"])
@pytest.mark.parametrize("scale, shift", [(1e-3, 0), (1e5, 1e5)])
def test_open_ground_is_open(resolution, kind, weight, scale, shift):
    mesh = plane(3, -scale, scale)
    mesh.vertices = mesh.vertices + shift
    values = asked_of(Scene.from_meshes([mesh]), resolution, kind=kind, weight=weight)
    wanted = [[0, 0, 1]] if kind == "bent-normal" else 1
    np.testing.assert_allclose(values, np.broadcast_to(wanted, values.shape), atol=2e-6)


def test_a_ball_in_the_air_sees_the_half_of_the_sky_that_its_side_faces():
    scene = Scene.from_meshes([sphere(24)])
    up = scene.points.normals[:, 2]
    for weight in ("cosine", "even"):
        sky = asked_of(scene, 32, kind="sky", weight=weight)
        # An open plane at an angle to the ground sees (1 + cos) / 2 of an even sky; the share of
        # the half above the horizon that is in front of it is 1 - angle / pi.
        closed = (1 + up) / 2 if weight == "cosine" else 1 - np.arccos(np.clip(up, -1, 1)) / np.pi
        assert np.abs(sky - closed).max() < 0.03, weight
    assert asked_of(scene, 32).min() > 0.97


@pytest.mark.parametrize("height", [0.5, 2.0])
def test_beside_an_infinite_wall(height):
    scene, middle = beside_a_wall(height)
    hidden = (1 - 1 / np.sqrt(1 + height**2)) / 2
    ambient = asked_of(scene, 64)[middle]
    assert abs(1 - ambient - hidden) < 1 / 64
    # Of all directions alike a wedge of that angle is hidden.
    even = asked_of(scene, 64, weight="even")[middle]
    assert abs(1 - even - np.arctan(height) / np.pi) < 1 / 64
    bent = asked_of(scene, 64, kind="bent-normal", weight="even")[middle]
    # The mean direction of what is left of the half circle is in its middle.
    angle = np.arctan(height) / 2
    np.testing.assert_allclose(bent, [-np.sin(angle), 0, np.cos(angle)], atol=0.02)
    assert asked_of(scene, 64, kind="bent-normal")[middle][0] < 0


def test_ambient_is_what_an_even_light_gives():
    scene = Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6)), plane(9)])
    cube_map, caster = CubeMap(16), caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    even = np.ones((cube_map.n_directions, 1), np.float32)
    lit = received_light(bits, scene.points.normals, cube_map, even)[:, 0]
    ambient = run(occlusion_steps(scene, cube_map, bits, Occlusion()))
    np.testing.assert_allclose(ambient, lit, atol=5e-3)
    assert ambient.min() < 0.3


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_what_is_farther_than_the_distance_is_not_in_the_way(scale):
    meshes = [plane(5, -scale, scale), plane(3, -9 * scale, 9 * scale, "roof", z=scale)]
    meshes[1].triangle_corners = meshes[1].triangle_corners[:, ::-1]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    middle = np.linalg.norm(scene.points.positions[:25, :2], axis=1).argmin()
    assert asked_of(scene, distance=0.99 * scale)[middle] == 1
    # Of a roof above, what is within 2 of its height lies within 60 degrees: 3/4 by the cosine.
    assert abs(asked_of(scene, 32, distance=2 * scale)[middle] - 1 / 4) < 0.01
    far = asked_of(scene, distance=1e30 * scale)
    np.testing.assert_allclose(far, asked_of(scene), atol=1e-6)
    # The open share of a falloff f over distances r > h is the integral of f(h / c / D) 2 c dc.
    cosines = (np.arange(4000) + 0.5) / 4000
    for falloff, passed in FALLOFFS.items():
        value = asked_of(scene, 32, distance=4 * scale, falloff=falloff)[middle]
        wanted = (np.where(cosines < 1 / 4, 1, passed(1 / cosines / 4)) * 2 * cosines).mean()
        assert abs(value - wanted) < 0.01, falloff


def test_falloffs_are_those_of_blender():
    near, half, far = np.float64([0, 0.5, 1]).T
    passed = {name: fall(np.array([near, 0.25, half, far])) for name, fall in FALLOFFS.items()}
    np.testing.assert_allclose(passed["constant"], 0)
    np.testing.assert_allclose(passed["linear"], [0, 0.25, 0.5, 1])
    np.testing.assert_allclose(passed["smooth"], [0, 0.15625, 0.5, 1])
    np.testing.assert_allclose(passed["sharp"], [0, 0.4375, 0.75, 1])


def test_where_nothing_is_open_the_bent_normal_is_the_normal():
    scene = Scene.from_meshes([sphere(6, inside=True)])
    assert not asked_of(scene, 8).any()
    np.testing.assert_array_equal(asked_of(scene, 8, kind="bent-normal"), scene.points.normals)


def test_blocks_and_pace_do_not_matter():
    scene = Scene.from_meshes([sphere(8, 0.5, (0, 0, 0.6)), plane(12)])
    cube_map, caster = CubeMap(5), caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    work = scene, cube_map, bits, Occlusion(distance=0.4, falloff="smooth"), caster
    whole = run(occlusion_steps(*work))
    caster.batch = 97
    np.testing.assert_array_equal(run(occlusion_steps(*work, pace=1e-4)), whole)


def test_colours_of_shares_are_grey_and_of_vectors_half_and_half():
    np.testing.assert_array_equal(as_colours(np.float32([0.25])), [[0.25] * 3])
    vector = as_colours(np.float32([[0, -1, 1]]))
    np.testing.assert_array_equal(vector, [[0.5, 0, 1]])


@pytest.mark.parametrize("wrong, says", [
    ({"kind": "shadow"}, "ambient, sky, bent-normal"),
    ({"falloff": "linear"}, "needs a distance"),
    ({"distance": 0}, "distance"),
    ({"distance": float("inf")}, "distance"),
    ({"weight": "both"}, "cosine, even"),
])  # fmt: skip
def test_wrong_requests(wrong, says):
    with pytest.raises(PRTError, match=says):
        Occlusion(**wrong)
