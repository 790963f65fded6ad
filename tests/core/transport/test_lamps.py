"""Lamps in scenes: shadows up to the lamp, half of a lamp behind an edge, any scale."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core.light import Lamp
from prt_core.reflectance import OrenNayar
from prt_core.reflectance.bump import bump_mean
from prt_core.scene import Scene
from prt_core.transport import lamp_light
from tests.meshes import caster_of, plane

POWER = np.array([100.0, 50.0, 10.0])
DOWN = np.eye(3)


def irradiance(scene, lamps, n_samples=256, seed=0):
    return np.pi * lamp_light(scene, caster_of(scene), lamps, n_samples, seed)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 300.0])
def test_what_is_just_behind_a_lamp_casts_no_shadow(scale):
    floor = plane(3, -0.1 * scale, 0.1 * scale, name="floor")
    kinds = (
        Lamp("point", POWER, (0, 0, scale)),
        Lamp("area", POWER, (0, 0, scale), size=(0.1 * scale, 0.1 * scale)),
    )
    # In the lamp's own plane lies the mesh that shows it.
    for height, shaded in ((1.005, False), (1.0, False), (0.995, True)):
        lid = plane(3, -scale, scale, name="lid", z=height * scale)
        scene = Scene.from_meshes([floor, lid], max_hidden=0)
        for lamp in kinds:
            lit = irradiance(scene, [lamp], 4)[:9]
            assert (lit.max() == 0) if shaded else (lit.min() > 0), (height, lamp.kind)


def polygon(corners, place):
    """The z component of Lambert's vector of a polygon of radiance 1 seen from a place."""
    ways = corners - place
    total = 0.0
    for p, q in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        across = np.cross(p, q)
        length = np.linalg.norm(across)
        total += np.arctan2(length, p @ q) / 2 * across[2] / length
    return abs(total)


@pytest.mark.parametrize("scale", [0.1, 50.0])
def test_half_of_a_lamp_behind_an_edge(scale):
    # A rectangle above, and half-way up a plate that hides what of it lies at x > 0.2.
    floor = plane(2, -0.01 * scale, 0.01 * scale, name="floor")
    plate = plane(2, 0.0, 3.0, name="plate", z=0.5 * scale)
    plate.vertices[:, :2] = (plate.vertices[:, :2] - [0, 1.5]) * scale
    plate.vertices[:, 0] += 0.1 * scale
    scene = Scene.from_meshes([floor, plate], max_hidden=0)
    size = np.array([1.0, 0.6])
    lamp = Lamp("area", POWER, (0, 0, scale), DOWN, size=size * scale)
    result = irradiance(scene, [lamp], 4096)
    radiance = POWER / (np.pi * size.prod() * scale**2)
    for point in range(4):
        place = scene.to_world(scene.points.positions[[point]])[0]
        assert abs(place[2]) < 1e-6
        # The edge at x = 0.1 at half the height, seen from there, meets the lamp's plane.
        edge = place[0] + 2 * (0.1 * scale - place[0])
        x = np.array([-0.5 * scale, edge, edge, -0.5 * scale])
        y = np.array([-0.3, -0.3, 0.3, 0.3]) * scale
        corners = np.stack([x, y, np.full(4, scale)], axis=1)
        np.testing.assert_allclose(result[point], radiance * polygon(corners, place), rtol=0.01)


def test_light_needs_both_horizons():
    mesh = plane(3, -0.01, 0.01)
    lean = np.array([0.8, 0, 0.6])
    mesh.corner_normal = np.broadcast_to(lean, mesh.corner_normal.shape).copy()
    scene = Scene.from_meshes([mesh], max_hidden=0)
    middle = int(np.linalg.norm(scene.points.positions, axis=1).argmin())
    for way in ((0, 0, 1.0), (0.9, 0, 0.3), (0.9, 0, -0.1), (-0.9, 0, 0.3), (0.3, 0.5, -1.0)):
        way = np.array(way) / np.linalg.norm(way)
        result = irradiance(scene, [Lamp("point", POWER, 2 * way)])[middle]
        seen = way[2] > 0 and way @ lean > 0
        wanted = POWER * (way @ lean) / (16 * np.pi) if seen else 0 * POWER
        np.testing.assert_allclose(result, wanted, rtol=1e-3, atol=1e-9)


def test_lamps_add_up_and_each_has_samples_of_its_own():
    scene = Scene.from_meshes([plane(5), plane(2, -0.2, 0.2, z=0.3, name="lid")], max_hidden=0)
    near = Lamp("area", POWER, (0.3, 0, 0.6), DOWN, size=(0.9, 0.9))
    far = Lamp("sun", POWER, angle=0.3)
    one, two, both = (irradiance(scene, subset, 16) for subset in ([near], [far], [near, far]))
    twice = irradiance(scene, [near, near], 16)
    # The second lamp's samples are others: noise in the penumbra is not the same.
    assert np.abs(twice - 2 * one).max() > 1e-3 * one.max()
    np.testing.assert_allclose(twice.mean(), 2 * one.mean(), rtol=0.08)
    np.testing.assert_allclose(both.mean(), (one + two).mean(), rtol=0.08)
    assert np.abs(irradiance(scene, [near], 16, 1) - one).max() > 1e-3 * one.max()
    np.testing.assert_array_equal(irradiance(scene, [near], 16), one)


def test_points_of_two_blocks_have_samples_of_their_own():
    # More points than are drawn together: the light of those that lie alike is not alike.
    scene = Scene.from_meshes([plane(92, -1e-5, 1e-5)], max_hidden=0)
    assert len(scene.points) > 2 * 4096
    lamp = Lamp("area", POWER, (0, 0, 0.5), DOWN, size=(1.0, 1.0))
    result = irradiance(scene, [lamp], 2)[:, 0]
    assert np.std(result[:4096] - result[4096:8192]) > 0.01 * result.max()
    assert np.std(result[:50]) > 0.01 * result.max()
    corners = np.array([(-0.5, -0.5, 0.5), (0.5, -0.5, 0.5), (0.5, 0.5, 0.5), (-0.5, 0.5, 0.5)])
    wanted = POWER[0] / np.pi * polygon(corners, np.zeros(3))
    assert result.mean() == pytest.approx(wanted, rel=0.01)


def test_a_lamp_lights_its_receivers_alone_and_meets_its_blockers_alone():
    floor, lid = plane(3, -0.1, 0.1, name="floor"), plane(2, -1, 1, name="lid", z=0.5)
    part = plane(2, -1, 1, name="many/part", z=-1.0)
    part.owner, part.source = "many", "part"
    scene = Scene.from_meshes([floor, lid, part], max_hidden=0)
    number = scene.points.object_index

    def lit(**settings):
        light = irradiance(scene, [Lamp("sun", POWER, **settings)], 1)[:, 0]
        return [bool(light[number == index].max() > 0) for index in range(3)]

    assert lit() == [False, True, False]
    assert lit(casts_shadow=False) == [True, True, True]
    assert lit(casts_shadow=False, receivers=["floor"]) == [True, False, False]
    assert lit(casts_shadow=False, receivers=["many/part"]) == [False, False, True]
    assert lit(casts_shadow=False, receivers=["many", "part"]) == [False, False, False]
    assert lit(blockers=["many/part"]) == [True, True, True]
    assert lit(blockers=[]) == [True, True, True]
    assert lit(blockers=["lid"]) == [False, True, False]
    assert lit(blockers=["floor"], receivers=["floor", "many/part"]) == [True, False, True]


def test_lamps_that_share_their_blockers_share_a_caster(monkeypatch):
    from types import SimpleNamespace

    from prt_core.relight.lamps import LampLight
    from prt_core.runtime.progress import run

    scene = Scene.from_meshes([plane(3, name="floor"), plane(2, name="lid", z=0.5)], max_hidden=0)
    blockers, make = [], scene.make_caster

    def counted(name="auto", *kind, objects=None):
        blockers.append(None if objects is None else objects.tolist())
        return make("brute", *kind, objects=objects)

    monkeypatch.setattr(scene, "make_caster", counted)
    light = LampLight(SimpleNamespace(scene=scene, make_caster=counted, reflections=()), "brute")
    linked = Lamp("sun", POWER, blockers=("floor",)), Lamp("sun", POWER, blockers=("floor", "sky"))
    every = Lamp("sun", POWER), Lamp("sun", POWER, blockers=("lid", "floor"))
    none = Lamp("sun", POWER, casts_shadow=False), Lamp("sun", POWER, blockers=())
    parts = run(light.steps([*linked, *every, *none], 1))
    assert blockers == [[True, False], None]
    floor = [part[scene.points.object_index == 0].max() > 0 for part in parts]
    assert floor == [True, True, False, False, True, True]
    run(light.steps([*every], 1))
    run(light.steps([*linked], 2))
    assert blockers == [[True, False], None, [True, False]]
    light.close()


def test_lamps_on_bent_normals_are_dimmed_near_the_horizon():
    """Normals bent by 44.4 degrees: 0.9608 of light at 50, as Cycles bakes it."""
    strength, way = 0.119596, np.array([0.7660444, 0, 0.6427876])
    light = []
    for bump in (0.0, strength):
        mesh = plane(3, -0.01, 0.01)
        n = len(mesh.corner_vertex)
        mesh.corner_normal = np.tile([0.69925, 0.0, 0.71488], (n, 1))
        mesh.materials = mesh.materials.replaced(bump=np.full((n, 1), bump))
        scene = Scene.from_meshes([mesh], max_hidden=0)
        middle = int(np.linalg.norm(scene.points.positions, axis=1).argmin())
        light.append(irradiance(scene, [Lamp("point", POWER, 2 * way)])[middle])
    # Albedo holds the mean of what is left.
    np.testing.assert_allclose(light[1] * bump_mean(strength), light[0] * 0.9608, rtol=2e-4)


def test_rough_diffuse_surfaces_receive_as_seen_from_straight_above():
    floor = plane(3, name="floor", albedo=(0.9, 0.5, 0.2))
    n = len(floor.materials.albedo)
    rough = replace(floor, materials=floor.materials.replaced(diffuse_roughness=np.ones((n, 1))))
    smooth, scene = (Scene.from_meshes([mesh], max_hidden=0) for mesh in (floor, rough))
    up = np.array([[0, 0, 1.0]])
    for degrees in (10, 75):
        way = np.array([[np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]])
        # A lamp of a point far away.
        lamp = [Lamp("point", 1e6 * POWER, tuple(1e4 * way[0]))]
        ratio = irradiance(scene, lamp, 1) / irradiance(smooth, lamp, 1)
        wanted = np.pi * OrenNayar(1.0, 1.0, np.array([0.9, 0.5, 0.2])).eval(way, up)
        np.testing.assert_allclose(ratio, np.repeat(wanted, len(ratio), axis=0), rtol=1e-3)
    assert wanted.max() < 0.9
