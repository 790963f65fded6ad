"""Bakes with gloss: what is stored, gone on with, refused, and what is seen in the end."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import relight_points
from prt_core.bake.reflections import block_sides
from prt_core.light import EnvironmentMap
from prt_core.rays.caster import known_casters
from prt_core.reflectance import Materials, principled_lobes
from prt_core.relight.relighter import Relighter
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore
from prt_core.transport import View
from prt_core.transport.incoming_field import divisor, sides_of
from tests.meshes import plane, wall

SKY = EnvironmentMap(
    np.random.default_rng(4).random((8, 16, 3)).astype(np.float32) + np.float32(0.2), "sky"
)
VIEW = View(np.array([-3.0, -2.0, 2.5]))
CASTER = "embree" if "embree" in known_casters() else "brute"
SETTINGS = BakeSettings(resolution=16, caster=CASTER, gloss=True)


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


def room(**gloss):
    floor = of(plane(4, name="floor"), **(gloss or {"dielectric": 1.0, "roughness": 0.5}))
    return Scene.from_meshes([floor, wall(0.9, 1.5, 1.0, albedo=0.6)], max_hidden=0)


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    path = tmp_path_factory.mktemp("gloss") / "a.prt"
    run(bake_steps(room(), path, SETTINGS))
    return path


def test_glossy_points_know_what_they_see(baked):
    bake = load(baked)
    (reflections,) = bake.reflections
    assert reflections.blocks.side == 8
    floor = np.flatnonzero(bake.scene.points.object_index == 0)
    np.testing.assert_array_equal(reflections.points, floor)
    assert bake.report["glossy_points"] == len(floor)
    assert bake.report["rays_reflections"] > 0
    assert "reflections" in bake.report["seconds"]


def test_a_view_adds_what_lobes_reflect(baked):
    bake = load(baked)
    even = relight_points(bake, SKY, caster=CASTER)
    seen = relight_points(bake, SKY, caster=CASTER, view=VIEW)
    floor = bake.scene.points.object_index == 0
    np.testing.assert_array_equal(seen[~floor], even[~floor])
    # The lobe takes a little of diffuse light, and gives more towards the horizon.
    assert (np.abs(seen[floor] - even[floor]) > 1e-3).any(axis=1).all()
    other = relight_points(bake, SKY, caster=CASTER, view=View(np.array([0.2, 0.1, 4.0])))
    assert np.abs(other[floor] - seen[floor]).max() > 0.02


def test_colours_are_those_of_the_dense_sum(baked):
    bake = load(baked)
    points = bake.scene.points
    seen = relight_points(bake, SKY, caster=CASTER, view=VIEW)
    even = relight_points(bake, SKY, caster=CASTER)
    lobes = principled_lobes(points.materials)
    outgoing = VIEW.outgoing(bake.scene.to_world(points.positions))
    frames = lobes.frames(points.normals)
    cube_map = bake.cube_map
    incoming = np.einsum("mx,nkx->nmk", cube_map.directions, frames)
    view = np.einsum("nx,nkx->nk", outgoing, frames)[:, None]
    light = SKY.to_cube_map(cube_map, np.eye(3))
    spread = np.unpackbits(bake.transport.bits, axis=1, bitorder="little")
    arrives = spread[:, : len(light), None] * light
    # The wall sends one colour in the mean.
    wall_light = even[points.object_index == 1].mean(axis=0)
    above = points.normals @ cube_map.vectors.T > 0
    arrives = arrives + ((spread[:, : len(light)] == 0) & above)[..., None] * wall_light
    weights = lobes.eval(incoming, view) * np.maximum(incoming[..., 2:], 0)
    reflected = np.einsum("nmc,nmc,m->nc", weights, arrives, cube_map.solid_angles)
    wanted = even * lobes.diffuse_weight(view)[:, 0] + reflected
    floor = (points.object_index == 0) & (bake.scene.to_world(points.positions)[:, 0] < 0.85)
    error = np.linalg.norm(seen[floor] - wanted[floor]) / np.linalg.norm(wanted[floor])
    assert error < 0.01


def test_a_stopped_bake_goes_on_to_the_same(baked, tmp_path):
    path = tmp_path / "b.prt"
    steps = bake_steps(room(), path, SETTINGS)
    for progress in steps:
        if progress.stage == "reflections":
            break
    steps.close()
    run(bake_steps(room(), path, SETTINGS))
    one, two = load(baked).reflections[0], load(path).reflections[0]
    for name in ("points", "start", "block", "met", "share"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_damaged_reflections_are_said(baked, tmp_path):
    path = tmp_path / "c.prt"
    shutil.copytree(baked, path)
    store = BakeStore(path, "r+")
    met = store.read("reflections_8_met")
    met[0, 0] = 10_000
    store.write("reflections_8_met", met)
    with pytest.raises(PRTError, match="'reflections_8_met' is not what the bake was finished"):
        load(path)


def test_without_gloss_a_view_is_refused(tmp_path):
    path = tmp_path / "plain.prt"
    run(bake_steps(room(), path, replace(SETTINGS, gloss=False)))
    assert not load(path).reflections
    with pytest.raises(PRTError, match="view: this bake knows of no gloss"):
        relight_points(load(path), SKY, caster=CASTER, view=VIEW)
    with pytest.raises(PRTError, match="view: the baked scene has none called 'camera' whose lens"):
        relight_points(load(path), SKY, caster=CASTER, view="camera")
    with pytest.raises(PRTError, match="view: expected"):
        relight_points(load(path), SKY, caster=CASTER, view=(1, 2, 3))


def test_a_lamp_has_its_highlight(baked):
    bake = load(baked)
    place = bake.scene.to_world(bake.scene.points.positions)
    floor = np.flatnonzero(bake.scene.points.object_index == 0)
    lamp = Lamp("point", (200.0, 200.0, 200.0), (0.0, 0.0, 3.0), radius=0.1)
    # Mirrored at the middle of the floor.
    view = View(np.array([0.0, 0.0, 4.0]))
    even, seen = (
        relight_points(bake, lamps=[lamp], caster=CASTER, view=each) for each in (None, view)
    )
    more = (seen - even)[floor, 0]
    away = np.linalg.norm(place[floor, :2], axis=1)
    assert more[np.argmin(away)] > 3 * more[np.argmax(away)] > 0


def test_metal_is_seen_in_metal(tmp_path):
    gloss = {"metal": (0.9, 0.6, 0.3), "stand_in": (0.5, 0.5, 0.5), "roughness": 0.5}
    floor = of(plane(5, name="floor"), **gloss)
    upright = of(wall(0.9, 1.5, 1.0, n=5, albedo=0.5), **gloss)
    path = tmp_path / "metal.prt"
    run(bake_steps(Scene.from_meshes([floor, upright], max_hidden=0), path, SETTINGS))
    bake = load(path)
    relighter = Relighter(bake, CASTER)
    seen = relighter.radiance(SKY, view=VIEW)
    assert np.isfinite(seen).all() and (seen >= 0).all()
    # Without any sky it is dark; twice the light is twice the colour.
    twice = relighter.radiance(SKY, strength=2.0, view=VIEW)
    np.testing.assert_allclose(twice, 2 * seen, rtol=0.02, atol=1e-4)
    relighter.close()


def test_blocks_are_finer_for_narrow_lobes():
    cube_map = CubeMap(32)
    materials = Materials(
        albedo=np.zeros((5, 3)),
        dielectric=np.array([[1.0], [1], [0], [0], [1]]),
        roughness=np.array([[0.5], [0.2], [0.5], [0.1], [0.9]]),
        coat=np.array([[0.0], [0], [0], [0], [1]]),
        coat_roughness=np.full((5, 1), 0.03),
    )
    assert block_sides(materials, cube_map).tolist() == [8, 16, 0, 0, 16]
    assert sides_of([0.39, 0.4], 12).tolist() == [12, 6]
    assert divisor(12, 8) == 6 and divisor(7, 8) == 7 and divisor(1, 16) == 1
