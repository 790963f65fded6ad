"""Highlights of lamps against sums over many samples of these."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Scene, bake_steps, load, run
from prt_core.light import EnvironmentMap, Lamp, sun_light
from prt_core.light.bright import split_sun
from prt_core.rays.caster import known_casters
from prt_core.reflectance import Materials, principled_lobes
from prt_core.relight.highlights import highlights
from prt_core.relight.point_lobes import PointLobes
from prt_core.relight.relighter import Relighter
from prt_core.sphere import sobol_points
from prt_core.transport import View
from prt_core.transport.lamp_cells import LampCells
from tests.meshes import plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"
AXES = np.stack([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]], axis=1)
AREA = {"kind": "area", "position": (0, 1.2, 1.2), "axes": AXES}
LAMPS = {
    "square": Lamp(**AREA, power=[60, 50, 40], size=(1.5, 1.5)),
    "tube": Lamp(**AREA, power=[60, 50, 40], size=(2.5, 0.2)),
    "slats": Lamp(**AREA, power=[60, 50, 40], size=(1.5, 1.5), spread=1.5),
    "disc": Lamp(**AREA, power=[60, 50, 40], size=(0.8, 0.8), ellipse=True),
    "soft point": Lamp("point", [60, 50, 40], (0.5, 0.6, 1.4), radius=0.4),
    "ball": Lamp("point", [60, 50, 40], (0.5, 0.6, 1.4), radius=0.4, soft_falloff=False),
    "sun": Lamp("sun", [3, 2, 1], axes=AXES, angle=1.2),
}


def floor(roughness, n=4):
    """Places of a floor of metal and the ways to a viewer."""
    rng = np.random.default_rng(3)
    world = np.column_stack([rng.uniform(-1.5, 1.5, (n, 2)), np.zeros(n)])
    outgoing = np.array([0.2, -3.4, 1.8]) - world
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    metal, rough = np.full((n, 3), 0.8), np.full((n, 1), roughness)
    return Materials(albedo=0 * metal, metal=metal, roughness=rough), world, outgoing


def shown_of(materials, lamp, received, world, outgoing, **options):
    """Highlights of places whose normals point up."""
    lobes = PointLobes(materials, np.tile([0.0, 0.0, 1.0], (len(world), 1)))
    groups = lobes.at(np.arange(len(world)), outgoing[:, 2])[0]
    return highlights(groups, lobes.frames, lamp, received, world, outgoing, **options)


def of_metal(mesh, roughness):
    """A mesh of gold."""
    n = len(mesh.materials.albedo)
    gold, rough = np.full((n, 3), 0.8), np.full((n, 1), roughness)
    metal = Materials(albedo=gold, stand_in=gold, metal=gold, roughness=rough)
    return replace(mesh, materials=metal)


@pytest.mark.parametrize("name", LAMPS)
def test_highlights_of_wide_lamps_are_what_lobes_reflect_of_them(name):
    lamp, uv = LAMPS[name], sobol_points(12)
    materials, world, outgoing = floor(0.3)
    received, truth = np.zeros((2, len(world), 3))
    for k, place in enumerate(world):
        ways, _, light = lamp.sample(np.tile(place, (len(uv), 1)), uv)
        light = light * np.maximum(ways[:, 2:], 0)
        lobes = principled_lobes(materials[np.array([k])])
        received[k] = light.mean(axis=0) / np.pi
        truth[k] = (light * lobes.eval(ways[None], outgoing[k][None, None])[0]).mean(axis=0)
    shown = shown_of(materials, lamp, received, world, outgoing, power=9)
    assert np.linalg.norm(shown - truth) < 0.03 * np.linalg.norm(truth), name


@pytest.mark.parametrize("name", LAMPS)
def test_what_hides_a_part_of_a_lamp_hides_it_from_its_highlight(name):
    lamp, uv = LAMPS[name], sobol_points(12)
    free = uv[:, 1] < 0.375
    materials, world, outgoing = floor(0.3)
    (received, truth), cells = np.zeros((2, len(world), 3)), LampCells(np.ones(len(world), bool), 8)
    cells.begin(slice(0, len(world)))
    for k, place in enumerate(world):
        ways, _, light = lamp.sample(np.tile(place, (len(uv), 1)), uv)
        light = light * np.maximum(ways[:, 2:], 0) * free[:, None]
        cells.take(np.full(len(uv), k), uv, free.astype(float))
        lobes = principled_lobes(materials[np.array([k])])
        received[k] = light.mean(axis=0) / np.pi
        truth[k] = (light * lobes.eval(ways[None], outgoing[k][None, None])[0]).mean(axis=0)
    cells.end()
    shown = shown_of(materials, lamp, received, world, outgoing, power=9, seen=cells.seen().of)
    whole = shown_of(materials, lamp, received, world, outgoing, power=9)

    assert np.linalg.norm(shown - truth) < 0.02 * np.linalg.norm(truth), name
    assert np.linalg.norm(shown - truth) < 0.1 * np.linalg.norm(whole - truth), name


def test_stripes_of_a_lamp_behind_slats_are_seen_in_metal(tmp_path):
    ground = of_metal(plane(30, name="floor"), 0.3)
    lamp = Lamp("area", [20, 20, 20], (0, 0, 1.5), size=(1.0, 1.0))
    shade = plane(2, name="shade")
    # It hides the half of the lamp at positive x from everywhere: it lies on it.
    shade = replace(
        shade, vertices=np.array([[0, -1, 1.49], [1, -1, 1.49], [0, 1, 1.49], [1, 1, 1.49]])
    )
    scene = Scene.from_meshes([ground, shade], max_hidden=0)
    settings = BakeSettings(resolution=8, caster=CASTER, bounces=0, gloss=True)
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    bake = load(tmp_path / "a.prt")
    half = Lamp("area", [10, 10, 10], (-0.25, 0, 1.5), size=(0.5, 1.0), casts_shadow=False)
    view, relighter = View(np.array([0.3, 1.5, 1.0])), Relighter(bake, CASTER)
    hidden = relighter.radiance(lamps=[lamp], lamp_samples=256, view=view)[:900]
    alone = relighter.radiance(lamps=[half], lamp_samples=256, view=view)[:900]
    relighter.close()

    assert np.linalg.norm(hidden - alone) < 0.12 * np.linalg.norm(alone)


def test_a_mirror_shows_the_radiance_of_a_lamp():
    materials, world, outgoing = floor(0.0)
    world, outgoing = 0 * world, np.tile([0.0, -0.8, 0.6], (len(world), 1))
    lamp = LAMPS["sun"]
    received = np.tile(lamp.power * 0.6 / np.pi, (len(world), 1))
    shown = shown_of(materials, lamp, received, world, outgoing, power=8)
    radiance = lamp.power / (np.pi * np.sin(lamp.angle / 2) ** 2)
    np.testing.assert_allclose(shown, np.tile(0.8 * radiance, (len(world), 1)), rtol=0.03)


def test_places_that_no_lobe_is_at_have_no_highlight():
    materials, world, outgoing = floor(0.3)
    bare = materials.replaced(metal=0 * materials.metal)
    close = Lamp("area", [9, 9, 9], (0, 0, 0.4), size=(4, 4))
    received = np.ones((len(world), 3))
    lobes = PointLobes(materials, np.tile([0.0, 0.0, 1.0], (len(world), 1)))
    (alpha, powers), *_ = lobes.at(np.arange(len(world)), outgoing[:, 2])[0]
    shown = highlights([(alpha, 0 * powers)], lobes.frames, close, received, world, outgoing)
    assert not shown.any() and not shown_of(bare, close, received, world, outgoing).any()


def test_a_wide_sun_of_an_image_stays_one_direction():
    pixels = np.full((16, 32, 3), 0.01, np.float32)
    pixels[6, 8:11] = 500
    _, sun = split_sun(EnvironmentMap(pixels))
    materials, world, outgoing = floor(0.1)
    shown = shown_of(materials, sun, np.ones((len(world), 3)), world, outgoing)
    assert sun.seen_from(world)[1].min() > 0.1 and np.isfinite(shown).all()


def test_metal_that_is_seen_in_metal_reflects_lamps(tmp_path):
    ball, ground = of_metal(sphere(8, 0.5, (0, 0, 0.6)), 0.6), of_metal(plane(7, name="floor"), 0.6)
    scene = Scene.from_meshes([ground, ball], max_hidden=0)
    settings = BakeSettings(resolution=8, caster=CASTER, bounces=1, gloss=True)
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    bake = load(tmp_path / "a.prt")
    sun = Lamp("sun", [3, 3, 3], axes=AXES @ np.diag([-1, -1, 1]), angle=0.5)
    view, relighter = View(np.array([0.5, 4.0, 2.0])), Relighter(bake, CASTER)
    by_lamp = relighter.radiance(lamps=[sun], lamp_samples=8, view=view)
    texels = sun_light(bake.cube_map, sun.towards, sun.power, sun.angle).astype(np.float32)
    by_texels = relighter.radiance(texels, view=view)
    relighter.close()
    assert by_lamp.sum() == pytest.approx(by_texels.sum(), rel=0.1)
    assert np.linalg.norm(by_lamp - by_texels) < 0.2 * np.linalg.norm(by_texels)
