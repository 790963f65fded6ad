"""Albedo is applied in one place: exact, compressed and lit by lamps, all colours end there."""

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress_bake, relight_points
from prt_core.light import EnvironmentMap
from prt_core.transport import ExitRadiance, all_bounces
from tests.meshes import plane, wall

RNG = np.random.default_rng(7)
SKY = EnvironmentMap(RNG.random((3, 6, 3)).astype(np.float32), "sky")
LAMP = Lamp("point", (3.0, 5.0, 7.0), (0.2, 0.3, 2.0))


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    meshes = [plane(5, albedo=(0.2, 0.5, 0.9)), wall(0.9, 1.0, 1.0, albedo=0.7)]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    run(bake_steps(scene, path, BakeSettings(resolution=2, caster="brute"), [LAMP]))
    compress_bake(path, method="harmonics", tolerance=0.5, lights={"sky": SKY})
    return load(path)


@pytest.mark.parametrize("between", [(), (5,), (5, 2)])
def test_it_is_albedo_times_what_is_received(between):
    received, albedo = RNG.random((7, *between, 3)), RNG.random((7, 3))
    result = ExitRadiance(received, albedo).toward()
    for point in range(7):
        np.testing.assert_array_equal(result[point], albedo[point] * received[point])


@pytest.mark.parametrize(
    "received, albedo", [((7, 3), (5, 3)), ((7, 3), (7, 2)), ((7,), (7, 3)), ((7, 3), (7,))]
)
def test_other_shapes_are_refused(received, albedo):
    with pytest.raises(PRTError, match="albedo: expected one of each point and channel"):
        ExitRadiance(np.zeros(received), np.zeros(albedo))


def test_every_way_to_colours_ends_in_it(bake, monkeypatch):
    transport, albedo = bake.transport, bake.transport.albedo
    light = SKY.to_cube_map(bake.cube_map)
    ways = {
        "exact": lambda: transport.radiance(light),
        "rows": lambda: transport.rows(np.array([3, 5])),
        "columns": lambda: transport.columns(np.array([3, 5])),
        "arrays": lambda: all_bounces(transport.gather, albedo, np.ones_like(albedo))[0],
        "relighter": lambda: relight_points(bake, SKY, form="exact"),
        "compressed": lambda: relight_points(bake, SKY, form="compressed"),
        "lamps": lambda: relight_points(bake, lamps=True, lamp_samples=3, caster="brute"),
        "both": lambda: relight_points(bake, SKY, lamps=True, lamp_samples=3, caster="brute"),
    }
    before = {name: way() for name, way in ways.items()}
    toward = ExitRadiance.toward
    monkeypatch.setattr(ExitRadiance, "toward", lambda self, view=None: 2 * toward(self, view))
    for name, way in ways.items():
        assert before[name].any()
        np.testing.assert_array_equal(way(), 2 * before[name], err_msg=name)


@pytest.mark.parametrize("way", ["exact", "compressed"])
def test_strength_is_the_lights_on_every_way(bake, way):
    """It multiplies before the bounces, so that it is the same as a stronger light."""
    light = SKY.to_cube_map(bake.cube_map)
    for options, factor in (({"strength": 3.0}, 3.0), ({"strength": 1.0}, 1.0)):
        result = relight_points(bake, light, transport=way, **options)
        wanted = relight_points(bake, light * np.float32(factor), transport=way)
        if way == "compressed":
            np.testing.assert_array_equal(result, wanted)
        np.testing.assert_allclose(result, wanted, rtol=1e-5)
