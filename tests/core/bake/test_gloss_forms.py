"""Gloss in bakes: its certificate, and the form that views are relit from under turning light."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress
from prt_core.bake import gloss_certificate
from prt_core.bake.measure import standing_lights
from prt_core.bake.report_lines import report_lines
from prt_core.cli import main
from prt_core.rays.caster import known_casters
from prt_core.relight.relighter import Relighter
from prt_core.transport import View
from prt_core.transport import reflections as stage
from tests.meshes import plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"
SKIES = standing_lights()
GOLD = np.float32([1, 0.7, 0.3])
SIDE = View(np.array([2.0, -2.0, 1.2]))


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


def scene_of(roughness):
    floor = of(plane(9, name="floor"), dielectric=1.0, roughness=roughness)
    ball = of(sphere(10, 0.4, (0, 0, 0.5)), metal=GOLD, stand_in=0.5 * GOLD, roughness=roughness)
    return Scene.from_meshes([floor, ball], max_hidden=0)


def baked(path, roughness=0.6, **settings):
    settings = {"resolution": 8, "caster": CASTER, "gloss": True, "bounces": 1, **settings}
    return run(bake_steps(scene_of(roughness), path, BakeSettings(**settings)))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("gloss") / "a.prt"
    baked(path)
    return path


def off(values, truth):
    return np.linalg.norm(values - truth) / np.linalg.norm(truth)


def test_the_certificate_tells_what_is_wrong_with_reflections(path, tmp_path, monkeypatch):
    report = load(path).report
    found = report["gloss_error"]
    assert set(found["errors"]) == {"even sky", "low sun", "high sun"} and found["views"] == 4
    assert found["points"] == 48 and found["rays"] == report["rays_gloss_certificate"] > 5e3
    assert 0.001 < max(found["errors"].values()) < 0.03
    lines = [line for line in report_lines(path, report) if "glossy points" in line]
    assert len(lines) == 1 and "of what 4 views show of 48 glossy points" in lines[0]
    # What stands in the way is said to be nothing: that is what it is there to find.
    monkeypatch.setattr(stage, "_ends", lambda caster, sharing, starts, *_: (
        np.full(len(starts), -2, np.int32), 0))  # fmt: skip
    worse = baked(tmp_path / "b.prt", tolerance=0.02)
    assert min(worse["gloss_error"]["errors"].values()) > 0.05 and not worse["tolerance_met"]
    assert any("what views show of gloss may be" in line for line in worse["messages"])


def test_what_no_certificate_counts_is_said(path, tmp_path):
    # A ball of metal on a floor of plastic mirrors no metal; on gold it does.
    report = load(path).report
    assert report["gloss_error"]["metal"] < 0.02
    assert not any("metal seen in metal" in line for line in report_lines(path, report))
    gold = {"metal": GOLD, "stand_in": 0.5 * GOLD, "roughness": 0.5}
    meshes = [of(plane(9, name="floor"), **gold), of(sphere(10, 0.4, (0, 0, 0.5)), **gold)]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    settings = BakeSettings(resolution=8, caster=CASTER, gloss=True, bounces=1)
    report = run(bake_steps(scene, tmp_path / "gold.prt", settings))
    assert report["gloss_error"]["metal"] > 0.9
    lines = [line for line in report_lines(path, report) if "metal seen in metal" in line]
    assert len(lines) == 1 and f"({report['gloss_error']['metal']:.0%} of what" in lines[0]


def test_mirrors_are_not_certified(tmp_path, monkeypatch):
    assert "gloss_error" not in baked(tmp_path / "a.prt", roughness=0.05, bounces=0)
    monkeypatch.setattr(gloss_certificate, "_POINTS", 7)
    report = baked(tmp_path / "b.prt", roughness=0.4, bounces=0)
    assert report["gloss_error"]["points"] <= 7


def test_what_has_no_coat_is_certified_beside_what_has_one(tmp_path):
    coat = {"dielectric": 1.0, "roughness": 0.5, "coat": 1.0, "coat_roughness": 0.02}
    lacquer = of(sphere(10, 0.4, (0, 0, 0.5)), **coat)
    floor = of(plane(9, name="floor"), metal=GOLD, stand_in=0.5 * GOLD, roughness=0.5)
    scene = Scene.from_meshes([floor, lacquer], max_hidden=0)
    settings = BakeSettings(resolution=8, caster=CASTER, gloss=True, bounces=1)
    report = run(bake_steps(scene, tmp_path / "a.prt", settings))
    # The lacquer is a mirror, which is traced when it is seen.
    assert report["gloss_error"]["points"] == 48


def test_what_reflects_more_than_arrives_is_certified(tmp_path):
    grey = np.float32([0.7, 0.7, 0.7])
    bright = of(plane(9, name="bright"), glossy=grey, stand_in=grey, albedo=2 * grey)
    bright = of(bright, roughness=0.5)
    scene = Scene.from_meshes([bright, sphere(6, 0.4, (0, 0, 0.5))], max_hidden=0)
    settings = BakeSettings(resolution=8, caster=CASTER, gloss=True)
    report = run(bake_steps(scene, tmp_path / "a.prt", settings))
    assert max(report["gloss_error"]["errors"].values()) < 0.05
    assert load(tmp_path / "a.prt").transport.materials.albedo.max() > 1.3


def test_transfer_matrices_are_stored_and_relight_views(path, tmp_path):
    report = compress(path, method="transfer", tolerance=0.2, lights=SKIES)
    assert report["of"] == "gloss" and report["stored"] and report["tolerance_met"]
    assert report["lights"] == 3 and report["views"] == 3 and 0 < report["error"] < 0.1
    quick, exact = Relighter(load(path), CASTER), Relighter(load(path), CASTER, "exact")
    sky = SKIES["low soft sun"]
    result = quick.radiance(sky, rotation=65, view=SIDE)
    wanted = exact.radiance(sky, rotation=65, view=SIDE)
    even = exact.radiance(sky, rotation=65)
    assert 0 < off(result, wanted) < min(0.1, 0.3 * off(even, wanted))
    # Reflections see the scene, not the sky alone.
    other = View(np.array([-2.0, 1.0, 0.7]))
    assert off(run(quick.view_steps(other)), run(exact.view_steps(other))) < 0.1
    # Lamps have highlights and are seen in reflections: exactly.
    lamps = {"lamps": [Lamp("point", (300.0, 200, 100), (1.0, 1, 2))], "lamp_samples": 2}
    np.testing.assert_array_equal(
        quick.radiance(sky, view=SIDE, **lamps), exact.radiance(sky, view=SIDE, **lamps)
    )
    with pytest.raises(PRTError, match="megabytes, milliseconds: cannot be kept"):
        compress(path, method="transfer:n_components=4", megabytes=0.001, lights=SKIES)
    assert compress(path, method="none") is None
    np.testing.assert_array_equal(
        Relighter(load(path), CASTER).radiance(sky, rotation=65, view=SIDE), wanted
    )


def test_auto_takes_them_where_they_keep_the_tolerance(path, tmp_path, capsys):
    lights = {name: SKIES[name] for name in ("even sky", "low soft sun")}
    report = compress(path, tolerance=0.1, lights=lights)
    assert report["of"] == "points" and report["gloss"]["stored"]
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "gloss:\n  method  transfer (order 5" in said and "of what views show of gloss" in said
    assert " and 3 views it was not chosen under" in said
    compress(path, method="none")
    report = compress(path, tolerance=0.003, lights=lights)
    assert not report["gloss"]["stored"]
    assert main(["info", str(path)]) == 0
    assert "gloss:" not in capsys.readouterr().out
    compress(path, method="none")


def test_narrow_lobes_and_forms_of_the_bench_are_refused(path, tmp_path):
    narrow = tmp_path / "a.prt"
    baked(narrow, roughness=0.3, bounces=0, resolution=8)
    assert "gloss" not in compress(narrow, tolerance=0.2, lights={"sky": SKIES["even sky"]})
    with pytest.raises(PRTError, match="method: 'terms' is of views and is not stored, for a li"):
        compress(path, method="terms")
    with pytest.raises(PRTError, match="method: 'transfer' has the settings order, n_components"):
        compress(path, method="transfer:clusters=3")
    plain = tmp_path / "b.prt"
    settings = BakeSettings(resolution=4, bounces=0, caster=CASTER)
    run(bake_steps(scene_of(0.5), plain, settings))
    with pytest.raises(PRTError, match="method: 'transfer' is of gloss, and this bake knows of no"):
        compress(plain, method="transfer", lights=SKIES)
