import sys

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.bake.visibility import chosen_method
from prt_core.sampling.tracer import count_bits
from prt_core.store import BakeStore
from tests.meshes import plane, sphere, wall


@pytest.fixture(scope="module")
def scene():
    ball = sphere(10, 0.4, (0, 0, 0.5), name="ball", albedo=(0.9, 0.3, 0.1))
    return Scene.from_meshes([ball, plane(21, -1.2, 1.2, name="floor", albedo=0.7)])


def baked(scene, path, **settings):
    settings = BakeSettings(**{"resolution": 12, "caster": "auto", "bounces": 0, **settings})
    report = run(bake_steps(scene, path, settings))
    return report, load(path)


def test_a_sampled_bake_keeps_the_tolerance_it_reports(scene, tmp_path):
    exact, truth = baked(scene, tmp_path / "e.prt", method="exhaustive")
    report, bake = baked(scene, tmp_path / "a.prt", method="agreement", tolerance=0.02)
    assert exact["visibility_error"] == 0 and exact["certificate"] == []
    assert report["tolerance_met"] and report["visibility_error"] <= 0.02
    # Of so few rays the certificate takes most.
    assert report["rays"] < 0.65 * exact["rays"]
    assert report["entries_percent"] < exact["entries_percent"]
    assert {item["name"] for item in report["certificate"]} == {"ball", "floor"}
    sky = np.ones((bake.cube_map.n_directions, 3), np.float32)
    lit, wanted = (b.transport.radiance(sky) for b in (bake, truth))
    index = bake.scene.points.object_index
    for number, item in enumerate(report["certificate"]):
        mine = index == number
        error = np.linalg.norm((lit - wanted)[mine]) / np.linalg.norm(wanted[mine])
        assert error <= item["relit"]["even sky"]["high"]


def test_a_tighter_tolerance_asks_again_and_in_the_end_traces_all(scene, tmp_path):
    loose, _ = baked(scene, tmp_path / "a.prt", method="agreement", tolerance=0.1)
    tight, bake = baked(scene, tmp_path / "b.prt", method="agreement", tolerance=1e-7)
    truth = baked(scene, tmp_path / "e.prt", method="exhaustive")[1]
    assert loose["sampling"]["turns"] == 0 < tight["sampling"]["turns"]
    assert tight["tolerance_met"] and tight["visibility_error"] == 0
    wrong = count_bits(bake.transport.bits ^ truth.transport.bits)
    assert wrong < 1e-3 * truth.transport.bits.size


def test_small_objects_are_traced_whole(tmp_path):
    floor = plane(31, -1.2, 1.2, name="floor")
    bead = sphere(4, 0.3, (0, 0, 0.4), name="bead")
    scene = Scene.from_meshes([bead, floor], max_hidden=0)
    report, _ = baked(scene, tmp_path / "a.prt", method="agreement")
    bead, rest = report["certificate"]
    assert (bead["name"], bead["matrix"]["high"]) == ("bead", 0)
    assert rest["wrong"] > 0


def test_auto_traces_everything_where_that_is_quick(scene, tmp_path):
    assert baked(scene, tmp_path / "a.prt")[0]["method"] == "exhaustive"
    assert chosen_method("auto", 60_000, 6144) == "agreement"
    assert chosen_method("exhaustive", 60_000, 6144) == "exhaustive"


def test_an_unknown_method_is_named():
    with pytest.raises(PRTError, match="method: expected one of auto, exhaustive, agreement"):
        BakeSettings(method="guess")


def test_a_bake_by_another_method_is_refused(scene, tmp_path):
    baked(scene, tmp_path / "a.prt", method="exhaustive")
    with pytest.raises(PRTError, match="another method"):
        baked(scene, tmp_path / "a.prt", method="agreement")


def test_traced_bits_are_kept(scene, tmp_path):
    report, _ = baked(scene, tmp_path / "a.prt", method="agreement")
    traced = BakeStore(tmp_path / "a.prt").read("traced")
    share = count_bits(traced) / (len(scene.points) * 864)
    assert report["entries_percent"] == pytest.approx(100 * share)


def test_bounces_that_cannot_matter_are_not_baked(tmp_path):
    open_scene = Scene.from_meshes([plane(21)])
    report, bake = baked(open_scene, tmp_path / "a.prt", bounces=None)
    assert report["rays_gather"] == 0 and bake.transport.gather is None
    assert report["skipped"]["bounces_below"] == 0
    black = Scene.from_meshes([plane(9, albedo=0.0), wall(0.5, 1.0, 1.0)])
    assert baked(black, tmp_path / "b.prt", bounces=None)[0]["rays_gather"] == 0


def test_bounces_that_matter_are_baked(scene, tmp_path):
    report, bake = baked(scene, tmp_path / "a.prt", bounces=None, tolerance=0.05)
    assert report["rays_gather"] > 0 and bake.transport.gather is not None
    # The upper half of the ball sees no surface: no ray is cast for it, none would hit.
    assert report["skipped"]["gather_open_points"] > 0
    assert report["skipped"]["gather_rays"] > 0


@pytest.mark.parametrize("method", ["exhaustive", "agreement"])
def test_progress_never_goes_back(scene, tmp_path, method, monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 64)
    shown = []
    settings = BakeSettings(resolution=12, method=method, tolerance=0.1)
    run(bake_steps(scene, tmp_path / "p.prt", settings), shown.append)
    shares = [p.done / p.total for p in shown if p.stage == "visibility" and p.total]
    assert shares == sorted(shares) and len(set(shares)) > 3 and shares[-1] > 0.5


def test_bounces_go_on_until_the_tolerance_and_say_where_they_cannot(tmp_path, monkeypatch):
    """A room that is lit through a small window needs many rays; with too few it is said."""
    from prt_core.bake import bounces
    from prt_core.bake.report_lines import report_lines

    room = sphere(10, inside=True, albedo=0.8)
    room.triangle_corners = room.triangle_corners[6:]
    scene = Scene.from_meshes([room, plane(5, -0.4, 0.4, z=-0.5)])

    def bake(name, **settings):
        steps = bake_steps(scene, tmp_path / name, BakeSettings(resolution=4, **settings))
        return run(steps)

    near = bake("near.prt", tolerance=0.02)
    assert near["rays_a_point"] > 64 and near["error"] <= 0.02 and near["tolerance_met"]
    monkeypatch.setattr(bounces, "MOST_ROUNDS", 4)
    far = bake("far.prt", tolerance=0.02)
    assert far["rays_a_point"] == 128 and far["error"] > 0.02 and not far["tolerance_met"]
    assert any("the bounces may be" in m and "2.00%" in m for m in far["messages"])
    lines = "\n".join(report_lines("far.prt", far))
    assert "from the bounces (128 rays a point), NOT within the tolerance of 2.00%" in lines
    assert "NOT" not in "\n".join(report_lines("near.prt", near))
