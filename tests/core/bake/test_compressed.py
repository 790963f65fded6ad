"""The compressed form behind the public calls: chosen, kept, used, never where it is not right."""

import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import prt_core
from prt_core import BakeSettings, BakeStore, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress, relight_points
from prt_core.bake.compress import CompressSettings, compress_steps
from prt_core.bake.measure import standing_lights
from prt_core.bake.report_lines import compressed_lines, trial_lines
from prt_core.compress import (
    Harmonics,
    Limits,
    Method,
    candidate_names,
    method_named,
    register_method,
)
from prt_core.compress.choice import methods
from prt_core.compress.choice.choose import Trial
from prt_core.light import EnvironmentMap
from prt_core.relight import Lighting, Relighter
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from tests.meshes import plane, sphere

LAMP = Lamp("point", (1, 2, 3), (0, 0, 4), name="bulb")
SKY = standing_lights()["low soft sun"]


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    ball = sphere(10, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(13, albedo=0.7)])
    run(bake_steps(scene, path, BakeSettings(resolution=8, tolerance=0.05), [LAMP]))
    return path


@pytest.fixture(scope="module")
def chosen(original, tmp_path_factory):
    """A bake compressed by `auto`, and its attributes."""
    path = shutil.copytree(original, tmp_path_factory.mktemp("auto") / "a.prt")
    return path, compress(path, tolerance=0.03, lights=standing_lights())


@pytest.fixture
def baked(original, tmp_path):
    return shutil.copytree(original, tmp_path / "a.prt")


def relative(found, truth):
    return np.linalg.norm(np.float64(found) - truth) / np.linalg.norm(np.float64(truth))


def test_auto_says_what_it_chose_and_how_near_it_is(chosen):
    path, attributes = chosen
    points = SimpleNamespace(image=None)
    quick = {name for name in candidate_names() if method_named(name).first(points)}
    assert attributes["method"] in quick and attributes["tolerance_met"] is True
    assert {t["method"] for t in attributes["trials"]} == quick
    assert 0 < attributes["error"] <= 0.03 and attributes["error"] <= attributes["worst"] <= 0.06
    bake = load(path)
    # The measured error is that of what `relight` gives, against the exact one.
    errors = []
    for name, light in standing_lights().items():
        for turn in (65, 185, 305):
            result = relight_points(bake, light, rotation=turn)
            truth = relight_points(bake, light, rotation=turn, form="exact")
            errors.append(relative(result, truth))
            if f"{name} at {turn}°" == attributes["worst_light"]:
                assert errors[-1] == pytest.approx(attributes["worst"], rel=1e-4)
    assert np.mean(errors) == pytest.approx(attributes["error"], rel=1e-4)
    lines = [*trial_lines(attributes), *compressed_lines(attributes)]
    assert any("chosen: " in line for line in lines) and "within the tolerance" in lines[-3]


def test_colours_are_those_of_the_compressed_form_or_exact(chosen):
    bake = load(chosen[0])
    exact = Relighter(bake, form="exact")
    light = SKY.to_cube_map(bake.cube_map, 30)
    np.testing.assert_array_equal(exact.radiance(SKY, rotation=30), bake.transport.radiance(light))
    auto = Relighter(bake)
    result = auto.radiance(SKY, rotation=30)
    assert auto.used == "compressed" and auto.why == ""
    np.testing.assert_array_equal(result, relight_points(bake, SKY, rotation=30))
    assert 0 < relative(result, exact.radiance(SKY, rotation=30)) < 0.06
    # Whatever was asked before, and however often.
    auto.radiance(SKY, rotation=200, strength=3)
    np.testing.assert_array_equal(auto.radiance(SKY, rotation=30), result)
    np.testing.assert_allclose(auto.radiance(SKY, rotation=30, strength=2), 2 * result, rtol=1e-6)
    stepped = run(auto.steps(Lighting(light), pace=0.01))
    np.testing.assert_allclose(stepped, result, rtol=0.02, atol=0.02)


def test_lamps_and_sharp_suns_are_exact(chosen):
    bake = load(chosen[0])
    quick, exact = Relighter(bake), Relighter(bake, form="exact")
    lamps = exact.radiance(lamps=True)
    np.testing.assert_array_equal(quick.radiance(lamps=True), lamps)
    assert quick.used == "exact"
    both = quick.radiance(SKY, lamps=True)
    assert quick.used == "compressed"
    np.testing.assert_allclose(both, quick.radiance(SKY) + lamps, rtol=1e-5, atol=1e-6)
    pixels = SKY.pixels.copy()
    pixels[20, 40] = 5e3
    sun = EnvironmentMap(pixels)
    for turn in (None, 77):
        options = {"rotation": turn, "sharp_sun": True, "lamp_samples": 16}
        # Without its sun the sky is soft: what is left is its error alone.
        assert relative(quick.radiance(sun, **options), exact.radiance(sun, **options)) < 0.05


def test_other_bounces_are_exact(chosen):
    bake = load(chosen[0])
    quick = Relighter(bake)
    exact = Relighter(bake, form="exact")
    np.testing.assert_array_equal(quick.radiance(SKY, bounces=0), exact.radiance(SKY, bounces=0))
    assert quick.used == "exact" and "bounces" in quick.why
    with pytest.raises(PRTError, match="holds the bounces of the bake, not 1"):
        Relighter(bake, form="compressed").radiance(SKY, bounces=1)
    with pytest.raises(PRTError, match="form: expected one of"):
        Relighter(bake, form="fast")


def test_a_form_of_another_bake_is_not_used(chosen, tmp_path):
    path = shutil.copytree(chosen[0], tmp_path / "a.prt")
    bake, quick = load(path), None
    quick = Relighter(bake)
    quick.radiance(SKY)
    assert quick.used == "compressed"
    bake.transport.albedo = bake.transport.albedo * np.float32(0.5)
    np.testing.assert_array_equal(
        quick.radiance(SKY), bake.transport.radiance(SKY.to_cube_map(bake.cube_map))
    )
    assert quick.used == "exact" and "another state of the bake" in quick.why
    with pytest.raises(PRTError, match="compress again"):
        Relighter(bake, form="compressed").radiance(SKY)
    # A bake that is made anew has none.
    run(
        bake_steps(load(path).scene, path, BakeSettings(resolution=4, tolerance=0.05), restart=True)
    )
    anew = Relighter(load(path))
    anew.radiance(SKY)
    assert "there is no compressed form" in anew.why


def test_a_damaged_form_is_said_and_not_used(chosen, tmp_path):
    path = shutil.copytree(chosen[0], tmp_path / "a.prt")
    folder = next(path.glob("compressed*"))
    for chunk in folder.glob("*/c/0*"):
        if chunk.is_file():
            chunk.write_bytes(chunk.read_bytes()[:-3])
    quick = Relighter(load(path))
    quick.radiance(SKY)
    assert quick.used == "exact" and "cannot be read" in quick.why
    with pytest.raises(PRTError, match="cannot be read; compress again"):
        relight_points(load(path), SKY, form="compressed")


@pytest.mark.parametrize("method", candidate_names())
def test_each_method_by_its_name(baked, method):
    attributes = compress(baked, method=method, tolerance=0.2, lights=standing_lights())
    assert attributes["method"] == method and attributes["tolerance_met"]
    assert {t["method"] for t in attributes["trials"]} == {method}
    bake = load(baked)
    result = relight_points(bake, SKY, form="compressed")
    assert relative(result, relight_points(bake, SKY, form="exact")) < 0.4


def test_none_removes_it(chosen, tmp_path):
    path = shutil.copytree(chosen[0], tmp_path / "a.prt")
    assert compress(path, method="none") is None
    assert not list(path.glob("compressed*"))
    relighter = Relighter(load(path))
    relighter.radiance(SKY)
    assert relighter.used == "exact"
    with pytest.raises(PRTError, match="takes no tolerance"):
        compress(path, method="none", tolerance=0.1)
    with pytest.raises(PRTError, match="there is no such bake"):
        compress(tmp_path / "no.prt", method="none")


def test_an_even_sample_must_be_nearer_than_was_asked_for():
    """Errors of all points are larger than those of some of them."""
    limits = Limits(tolerance=0.01)
    trial = Trial("pca", "", 0, error=0.0089, worst=0.0178, growth=1.12)
    assert limits.near(trial)
    assert not limits.near(replace(trial, error=0.0091))
    assert not limits.near(replace(trial, worst=0.0182))
    assert limits.near(replace(trial, error=0.01, worst=0.02, growth=1.0))


def test_what_misses_the_tolerance_when_measured_is_made_nearer(baked, monkeypatch):
    """A sample that promises too much costs another fit, not the tolerance."""
    budgets = method_named("harmonics").budgets(None)
    wanted = compress(baked, method="harmonics:order=10", lights=standing_lights())
    built = []

    class Counted(Harmonics):
        def fit_steps(self, rows):
            built.append((self.order, rows.n_points))
            return (yield from super().fit_steps(rows))

    monkeypatch.setattr(methods, "_METHODS", dict(methods._METHODS))
    orders = [model.order for model in budgets]
    register_method(Method("counted", Counted, lambda _: [Counted(n) for n in orders], local=False))
    tolerance = 1.01 * max(wanted["error"], wanted["worst"] / 2)
    monkeypatch.setattr(Limits, "near", lambda self, trial: True)
    attributes = compress(baked, method="counted", tolerance=tolerance, lights=standing_lights())
    n_points = load(baked).transport.n_points
    assert [order for order, n in built if n == n_points][-2:] == [5, 10]
    assert attributes["settings"]["order"] == 10 and attributes["tolerance_met"] is True
    assert "of all points order=10" in attributes["why"]


def test_size_is_kept_where_it_is_asked_for(baked):
    large = compress(baked, tolerance=0.01, method="cpca", lights=standing_lights())
    limit = large["bytes"] / 3e6
    small = compress(baked, megabytes=limit, method="cpca", lights=standing_lights())
    assert small["bytes"] <= limit * 1e6 and small["tolerance_met"] is None
    assert small["error"] > large["error"]


def test_a_stopped_compression_leaves_what_was_there(baked):
    compress(baked, method="harmonics", tolerance=0.3, lights=standing_lights())
    before = relight_points(load(baked), SKY)
    steps = compress_steps(load(baked), CompressSettings("cpca"), standing_lights())
    stages = []
    while not stages or stages[-1] != "store":
        stages.append(next(steps).stage)
    steps.close()
    assert {"choice", "measure"} <= set(stages)
    np.testing.assert_array_equal(relight_points(load(baked), SKY), before)
    steps = compress_steps(load(baked), CompressSettings("cpca"), standing_lights())
    steps = steps_in_thread(steps, MainThreadCalls(), "compress")
    next(steps)
    steps.close()
    np.testing.assert_array_equal(relight_points(load(baked), SKY), before)


def test_the_same_seed_gives_the_same_bytes(original, tmp_path):
    result = []
    for name in "ab":
        path = shutil.copytree(original, tmp_path / f"{name}.prt")
        compress(path, method="cpca", tolerance=0.05, seed=3, lights=standing_lights())
        result.append(BakeStore(path))
    for name in ("labels", "bases", "weights", "shares"):
        one, two = (s.read(f"{s.attributes['compressed']['folder']}/{name}") for s in result)
        np.testing.assert_array_equal(one, two, err_msg=name)


def test_a_method_of_ones_own_needs_one_call(baked, monkeypatch):
    monkeypatch.setattr(methods, "_METHODS", dict(methods._METHODS))

    class Mine(Harmonics):
        """Registered from outside."""

    register_method(Method("mine", Mine, lambda task: [Mine(2), Mine(6)], local=False))
    attributes = compress(baked, method="mine", tolerance=0.25, lights=standing_lights())
    assert attributes["method"] == "mine"
    relighter = Relighter(load(baked), form="compressed")
    relighter.radiance(SKY)
    assert isinstance(relighter.compressed().model, Mine)
    with pytest.raises(PRTError, match="cannot be a method's name"):
        register_method(Method("none", Mine, lambda task: []))
    monkeypatch.undo()
    relighter = Relighter(load(baked))
    relighter.radiance(SKY)
    assert "'mine' is not known here" in relighter.why


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"method": "best"}, "method: expected auto, cpca"),
        ({"tolerance": 0.0}, "tolerance: expected a number above 0 and below 1"),
        ({"tolerance": 1.5}, "tolerance: expected"),
        ({"megabytes": -1}, "megabytes: expected a number above 0, got -1"),
        ({"milliseconds": float("nan")}, "milliseconds: expected"),
    ],
)
def test_wrong_settings_are_said(settings, message):
    with pytest.raises(PRTError, match=message):
        CompressSettings(**settings)
    with pytest.raises(PRTError, match="limits: give one"):
        Limits()


def test_a_bake_that_is_nowhere_cannot_keep_a_form(original):
    bake = replace(load(original), path=None)
    with pytest.raises(PRTError, match="not on disk"):
        run(compress_steps(bake, CompressSettings("cpca")))
    relighter = Relighter(bake)
    relighter.radiance(SKY)
    assert relighter.why == "the bake is not on disk"


def test_the_fingerprint_is_of_all_that_colours_depend_on(original):
    transport = load(original).transport
    same = prt_core.load(original).transport
    assert transport.fingerprint() == same.fingerprint()
    other = [
        replace(transport, bits=transport.bits ^ np.uint8(1)),
        replace(transport, materials=transport.albedo * np.float32(0.9)),
        replace(transport, gather=transport.gather * np.float32(0.9)),
        replace(transport, normals=-transport.normals),
        replace(transport, bounces=2),
    ]
    assert len({t.fingerprint() for t in [transport, *other]}) == 6


def test_the_old_name_of_compress_is_kept_for_one_release(baked):
    compress(baked, method="harmonics", tolerance=0.3, lights=standing_lights())
    with pytest.warns(DeprecationWarning, match="compress_bake is prt_core.compress now"):
        assert prt_core.compress_bake(baked, method="none") is None
    assert not list(baked.glob("compressed*"))
