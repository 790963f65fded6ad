"""A bake that takes from an earlier one is that of the scene as it is now."""

import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.bake.gather import gather_terms
from prt_core.bake.memory import Memory
from prt_core.bake.report_lines import report_lines
from prt_core.light import sun_light
from prt_core.sampling.tracer import count_bits
from prt_core.store import BakeStore
from prt_core.transport.gather import REPRESENTED
from prt_core.transport.sharing import DARK
from tests.meshes import glowing, plane, sphere, wall

EXACT = BakeSettings(resolution=8, tolerance=0.1, method="exhaustive")
DIRECT = replace(EXACT, bounces=0)
SAMPLED = replace(EXACT, resolution=12, method="agreement")


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 256)


def moved(mesh, *shift):
    return replace(mesh, vertices=mesh.vertices + np.array(shift, float))


FLOOR = plane(15, -1.5, 1.5, name="floor", albedo=0.7)
BALL = sphere(7, 0.3, (-0.5, 0, 0.35), name="ball", albedo=(0.9, 0.3, 0.1))
BLOCK = sphere(6, 0.25, (0.6, 0.4, 0.3), name="block", albedo=0.6)
SCREEN = wall(1.0, 0.8, 0.6, n=4, name="screen", albedo=0.5)
BEFORE = [FLOOR, BALL, BLOCK, SCREEN]
BEAD = sphere(5, 0.15, (0, -0.7, 0.2), name="bead", albedo=0.4)
AFTER = {
    "moved": [FLOOR, moved(BALL, 0.35, -0.25, 0.02), BLOCK, SCREEN],
    "turned and grown": [
        FLOOR, replace(BALL, vertices=BALL.vertices[:, [1, 0, 2]] * 1.1), BLOCK, SCREEN
    ],
    "added": [BEAD, *BEFORE],
    "deleted": [FLOOR, BALL, SCREEN],
    "deformed": [FLOOR, BALL, replace(BLOCK, vertices=BLOCK.vertices * [1, 1, 1.6]), SCREEN],
    "out of the old box": [FLOOR, BALL, BLOCK, moved(SCREEN, 1.5, 0.3, 0.4)],
    "another order": [SCREEN, moved(BLOCK, -0.2, 0, 0), BALL, FLOOR],
}  # fmt: skip


def baked(meshes, path, settings=EXACT, **options):
    return run(bake_steps(Scene.from_meshes(meshes), path, settings, **options))


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """A bake of the scene before, by each method."""
    folder = tmp_path_factory.mktemp("before")
    paths = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 256)
        for name, settings in (("direct", DIRECT), ("exhaustive", EXACT), ("agreement", SAMPLED)):
            paths[name] = folder / f"{name}.prt"
            baked(BEFORE, paths[name], settings)
    return paths


def off(path, other, lights=None):
    """Relative difference of relit colours at points that both have, the worst light's."""
    one, two = load(path), load(other)
    cube_map = one.cube_map
    lights = lights or [
        np.ones((cube_map.n_directions, 3), np.float32),
        sun_light(cube_map, [0.5, 0.3, 0.8], [3, 3, 3.0], angle=0.2).astype(np.float32),
        sun_light(cube_map, [-0.6, 0.2, 0.4], [3, 3, 3.0], angle=0.3).astype(np.float32),
    ]
    errors = []
    for light in lights:
        a, b = (bake.colours(bake.transport.radiance(light)) for bake in (one, two))
        a, b = (np.concatenate([c[name] for name in sorted(c)]).astype(float) for c in (a, b))
        errors.append(np.linalg.norm(a - b) / np.linalg.norm(b))
    return max(errors)


@pytest.mark.parametrize("name", AFTER)
def test_visibility_is_that_of_a_whole_bake(earlier, name, tmp_path):
    report = baked(AFTER[name], tmp_path / "a.prt", DIRECT, reuse=earlier["direct"])
    whole = baked(AFTER[name], tmp_path / "b.prt", DIRECT)
    one, two = load(tmp_path / "a.prt"), load(tmp_path / "b.prt")
    np.testing.assert_array_equal(one.transport.bits, two.transport.bits)
    assert report["rays_visibility"] < 0.75 * whole["rays_visibility"]


@pytest.mark.parametrize("name", ["moved", "deleted"])
def test_a_sampled_bake_is_within_the_tolerance(earlier, name, tmp_path):
    report = baked(AFTER[name], tmp_path / "a.prt", SAMPLED, reuse=earlier["agreement"])
    exact = replace(SAMPLED, method="exhaustive", seed=5)
    whole = baked(AFTER[name], tmp_path / "b.prt", exact)
    assert report["tolerance_met"] and report["visibility_error"] <= SAMPLED.tolerance
    assert report["reused"]["rays_share"] < 0.8
    # As shares of all rays, not of the few that were cast.
    assert report["dark_backs"] == pytest.approx(whole["dark_backs"], abs=0.01)
    assert report["hidden_hits"] == pytest.approx(whole["hidden_hits"], abs=0.002)
    assert off(tmp_path / "a.prt", tmp_path / "b.prt") < SAMPLED.tolerance
    lines = "\n".join(report_lines("a.prt", report))
    said = {"moved": "ball moved", "deleted": "block deleted"}[name]
    assert f"reused  {said}: " in lines and "% of the rays of a whole bake" in lines


def test_another_material_asks_for_no_ray_that_was_cast(earlier, tmp_path):
    albedo = np.full_like(BALL.materials.albedo, 0.2)
    painted = [FLOOR, replace(BALL, materials=BALL.materials.replaced(albedo=albedo)), *BEFORE[2:]]
    report = baked(painted, tmp_path / "a.prt", reuse=earlier["exhaustive"])
    assert report["rays_visibility"] == report["rays_gather"] == 0
    assert report["reused"]["line"].startswith("no object changed: 0 of ")
    baked(painted, tmp_path / "b.prt")
    assert off(tmp_path / "a.prt", tmp_path / "b.prt") < EXACT.tolerance
    assert off(tmp_path / "a.prt", earlier["exhaustive"]) > 0.02


def test_bakes_are_taken_from_one_another_again_and_again(earlier, tmp_path):
    before = earlier["agreement"]
    for turn in range(2):
        meshes = [moved(BALL, 0.2 * turn, 0.1, 0), FLOOR, BLOCK, SCREEN]
        report = baked(meshes, tmp_path / f"{turn}.prt", SAMPLED, reuse=before)
        before = tmp_path / f"{turn}.prt"
        assert report["tolerance_met"] and report["reused"]["generation"] == turn + 1
    baked(meshes, tmp_path / "b.prt", replace(SAMPLED, method="exhaustive"))
    assert off(before, tmp_path / "b.prt") < SAMPLED.tolerance
    # Rays keep the directions they were cast along, whatever block they are in now.
    bake, store = load(before), BakeStore(before)
    hits, caster = store.read("gather"), bake.make_caster()
    origins, seen = bake.scene.ray_origins, []

    def weigh(block, ways):
        ends = hits[block]
        cast = ends > REPRESENTED
        starts = np.repeat(origins[block], cast.sum(axis=1), axis=0)
        met = caster.intersect(starts, ways[cast]).triangle >= 0
        seen.append(met[ends[cast] != DARK] == (ends[cast] >= 0)[ends[cast] != DARK])
        return np.ones((1, *ways.shape[:2]))

    gather_terms(bake, weigh)
    assert np.concatenate(seen).mean() > 0.999


def test_the_certificate_draws_what_no_bake_before_has_drawn(earlier, tmp_path, monkeypatch):
    stage, turns = sys.modules["prt_core.bake.sampled"], []
    draw = stage.certificate_steps

    def drawn(*given, **more):
        turns.append(given[6])
        return draw(*given, **more)

    monkeypatch.setattr(stage, "certificate_steps", drawn)
    before = earlier["agreement"]
    for turn in range(2):
        after = [moved(BALL, 0.1 + 0.1 * turn, 0, 0), FLOOR, BLOCK, SCREEN]
        settings = replace(SAMPLED, bounces=None)
        baked(after, tmp_path / f"{turn}.prt", settings, reuse=before)
        before = tmp_path / f"{turn}.prt"
    # A bake asks three times at most; none of those of another.
    assert turns and set(turns) <= {16, 17, 18, 19, 32, 33, 34, 35} and max(turns) >= 32


def test_a_selection_leaves_others_and_the_next_bake_brings_them(earlier, tmp_path):
    meshes = AFTER["moved"]
    report = baked(meshes, tmp_path / "a.prt", reuse=earlier["exhaustive"], only=["ball"])
    old, new = load(earlier["exhaustive"]), load(tmp_path / "a.prt")
    floor = old.scene.points.object_index == 0
    n = len(old.scene.points) - len(old.scene.details)
    np.testing.assert_array_equal(
        old.transport.bits[:n][floor[:n]], new.transport.bits[:n][floor[:n]]
    )
    assert "only a selection was baked" in report["messages"][0]
    assert report["reused"]["left_alone"] > 0
    baked(meshes, tmp_path / "b.prt")
    assert off(tmp_path / "a.prt", tmp_path / "b.prt") > 0.05
    # In its place: it is no bake of the scene before.
    again = baked(meshes, tmp_path / "a.prt", reuse=tmp_path / "a.prt", restart="changed")
    assert again["reused"]["points"] == 0 < again["rays_visibility"]
    assert off(tmp_path / "a.prt", tmp_path / "b.prt") < EXACT.tolerance


def test_a_sampled_selection_asks_nothing_of_others(earlier, tmp_path):
    """The certificate would find that their shadows are old, and mend some of them."""
    meshes, settings = AFTER["moved"], replace(SAMPLED, bounces=None, tolerance=0.02)
    before = tmp_path / "before.prt"
    baked(BEFORE, before, settings)
    report = baked(meshes, tmp_path / "a.prt", settings, reuse=before, only=["ball"])
    old, new = load(before), load(tmp_path / "a.prt")
    n = len(old.scene.points) - len(old.scene.details)
    others = old.scene.points.object_index[:n] != 1
    np.testing.assert_array_equal(old.transport.bits[:n][others], new.transport.bits[:n][others])
    assert report["rays_visibility"] < len(new.scene.points) * new.cube_map.n_directions


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (replace(DIRECT, tolerance=0.2), "it was baked with tolerance 0.1, now 0.2"),
        (replace(DIRECT, resolution=4), "it was baked with resolution 8, now 4"),
    ],
)
def test_what_cannot_be_reused_is_said_and_baked_whole(earlier, tmp_path, settings, said):
    report = baked(AFTER["moved"], tmp_path / "a.prt", settings, reuse=earlier["direct"])
    assert report["messages"][0] == f"nothing was taken from the earlier bake: {said}"
    assert said in report["reused"]["line"]
    whole = baked(AFTER["moved"], tmp_path / "b.prt", settings)
    assert report["rays"] == whole["rays"]


def test_nothing_in_common_is_said(earlier, tmp_path):
    other = [moved(mesh, 0, 0, 0.3 * k + 1) for k, mesh in enumerate(BEFORE)]
    report = baked(other, tmp_path / "a.prt", DIRECT, reuse=earlier["direct"])
    assert "hardly a point is where it was" in report["messages"][0]


def test_a_bake_that_is_not_there_or_not_finished_is_refused(earlier, tmp_path):
    with pytest.raises(PRTError, match="reuse: .*there is no such bake.*bake without it"):
        baked(BEFORE, tmp_path / "a.prt", reuse=tmp_path / "none.prt")
    half = shutil.copytree(earlier["exhaustive"], tmp_path / "half.prt")
    BakeStore(half, "r+").update(complete=False)
    with pytest.raises(PRTError, match="half.prt: the bake is not finished"):
        baked(BEFORE, tmp_path / "a.prt", reuse=half)
    with pytest.raises(PRTError, match="only: there is no object 'cup' that is baked"):
        baked(BEFORE, tmp_path / "a.prt", reuse=earlier["exhaustive"], only=["cup"])
    assert not (tmp_path / "a.prt").exists()


def test_a_stopped_one_goes_on_and_the_old_one_stays(earlier, tmp_path):
    path = shutil.copytree(earlier["agreement"], tmp_path / "a.prt")
    lit = load(path).transport.radiance(np.ones((6 * 12 * 12, 3), np.float32))
    options = {"settings": SAMPLED, "reuse": path, "restart": "changed"}
    for stage in ("visibility", "gather"):
        steps = bake_steps(Scene.from_meshes(AFTER["moved"]), path, **options)
        while next(steps).stage != stage:
            pass
        steps.close()
        now = load(path).transport.radiance(np.ones((6 * 12 * 12, 3), np.float32))
        np.testing.assert_array_equal(now, lit)
    baked(AFTER["moved"], path, **options)
    baked(AFTER["moved"], tmp_path / "b.prt", SAMPLED, reuse=earlier["agreement"])
    one, two = BakeStore(path), BakeStore(tmp_path / "b.prt")
    assert sorted(one.names()) == sorted(two.names())
    for name in one.names():
        np.testing.assert_array_equal(one.read(name), two.read(name), err_msg=name)
    assert not path.with_name("a.prt.restart").exists()
    assert one.attributes["reused"]["digest"] == two.attributes["reused"]["digest"]


def test_parts_made_from_another_bake_are_made_again(earlier, tmp_path):
    steps = bake_steps(
        Scene.from_meshes(AFTER["moved"]), tmp_path / "a.prt", SAMPLED, reuse=earlier["agreement"]
    )
    while next(steps).stage != "bounces":
        pass
    steps.close()
    report = baked(AFTER["moved"], tmp_path / "a.prt", SAMPLED)
    whole = baked(AFTER["moved"], tmp_path / "b.prt", SAMPLED)
    assert "reused" not in report
    one, two = load(tmp_path / "a.prt"), load(tmp_path / "b.prt")
    assert count_bits(one.transport.bits ^ two.transport.bits) == 0
    assert report["rays_visibility"] == whole["rays_visibility"]


def test_emitters_and_reflections_are_made_anew(tmp_path):
    n = len(FLOOR.corner_vertex)
    glossy = np.full((n, 3), 0.4), np.full((n, 1), 0.4)
    floor = replace(
        FLOOR, materials=FLOOR.materials.replaced(glossy=glossy[0], roughness=glossy[1])
    )
    settings = replace(DIRECT, gloss=True)
    baked([floor, glowing(BALL, (2, 1, 0.5)), BLOCK], tmp_path / "old.prt", settings)
    after = [floor, glowing(moved(BALL, 0.4, 0.1, 0), (2, 1, 0.5)), BLOCK]
    report = baked(after, tmp_path / "a.prt", settings, reuse=tmp_path / "old.prt")
    whole = baked(after, tmp_path / "b.prt", settings)
    one, two = BakeStore(tmp_path / "a.prt"), BakeStore(tmp_path / "b.prt")
    names = [name for name in two.names() if name.startswith(("reflections", "emission"))]
    assert len(names) > 4
    for name in ("visibility", *names):
        np.testing.assert_array_equal(one.read(name), two.read(name), err_msg=name)
    assert report["rays_visibility"] < whole["rays_visibility"]
    assert report["gloss_error"] == whole["gloss_error"]


def test_tiles_are_asked_by_themselves(earlier, tmp_path, monkeypatch):
    monkeypatch.setattr(Memory, "tile_points", lambda *_: 220)
    report = baked(AFTER["moved"], tmp_path / "a.prt", SAMPLED, reuse=earlier["agreement"])
    assert report["sampling"]["tiles"] > 2 and report["tolerance_met"]
    assert report["reused"]["rays_share"] < 0.8
    baked(AFTER["moved"], tmp_path / "b.prt", replace(SAMPLED, method="exhaustive"))
    assert off(tmp_path / "a.prt", tmp_path / "b.prt") < SAMPLED.tolerance
