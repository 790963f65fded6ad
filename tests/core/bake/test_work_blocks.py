"""Blocks of work: whoever computes them, in whatever order, the bake is the same bit for bit."""

import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, finish, load, run
from prt_core.bake.blocks import block_figures, compute, missing_blocks, stages
from prt_core.bake.plan import finish_steps, plan_steps
from prt_core.bake.stages import BlocksMissing, Stage, ranges_text
from prt_core.store import BakeStore, remove_bake
from tests.meshes import ball_on_paint, plane, sphere

SETTINGS = BakeSettings(resolution=8, method="agreement", tolerance=0.03)
TILE = 200


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    memory = sys.modules["prt_core.bake.memory"].Memory
    monkeypatch.setattr(memory, "tile_points", lambda self, n_points, row_bytes: TILE)


@pytest.fixture(scope="module")
def scene():
    ball = sphere(8, 0.4, (0, 0, 0.5), name="ball", albedo=(0.9, 0.3, 0.1))
    floor = plane(24, -1.2, 1.2, name="floor", albedo=0.7)
    return Scene.from_meshes([ball, floor], max_hidden=0)


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory):
    """Digests of the arrays of a bake in one process, and its report."""
    path = tmp_path_factory.mktemp("whole") / "a.prt"
    with pytest.MonkeyPatch.context() as patch:
        memory = sys.modules["prt_core.bake.memory"].Memory
        patch.setattr(memory, "tile_points", lambda self, n_points, row_bytes: TILE)
        report = run(bake_steps(scene, path, SETTINGS))
    return digests(path), report


@pytest.fixture
def planned(scene, tmp_path):
    path = tmp_path / "a.prt"
    run(plan_steps(scene, path, SETTINGS))
    return path


def digests(path):
    return BakeStore(path).attributes["arrays"]


def finished(path, compute_all):
    """Finish a bake, by `compute_all(stage, blocks)` of whatever is missing: its report."""
    while True:
        try:
            return run(finish_steps(path))
        except BlocksMissing as error:
            compute_all(error.stage, error.blocks)


def start(path, stage):
    """A process that computes all blocks of a stage that are missing."""
    command = [sys.executable, "-m", "prt_core", "bake-blocks", str(path), "--stage", stage]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def test_a_plan_names_its_stages_and_a_block_what_it_took(planned):
    (stage,) = stages(planned)
    assert stage == Stage("visibility", 4)
    assert missing_blocks(planned, stage) == [0, 1, 2, 3]
    done = compute(planned, stage, 2)
    assert done.seconds > 0 and done.rays > 1000 and not done.again
    assert missing_blocks(planned, stage) == [0, 1, 3]
    assert block_figures(planned, stage)[2].tolist() == [done.seconds, done.rays, 0]
    again = compute(str(planned), "visibility", 2)
    assert again.again and again.rays == done.rays


def test_any_order_with_repeats_gives_the_same_bake(planned, whole):
    def backwards(stage, blocks):
        for index in [*reversed(blocks), blocks[0]]:
            compute(planned, stage, index)

    report = finished(planned, backwards)
    assert digests(planned) == whole[0]
    same = "rays", "error", "visibility_error", "rays_gather", "certificate", "sampling", "points"
    assert {k: report[k] for k in same} == {k: whole[1][k] for k in same}
    attributes = BakeStore(planned).attributes
    assert "work" not in attributes and not [n for n in attributes["arrays"] if "work" in n]
    assert report["sampling"]["tiles"] == 4
    load(planned)


def test_what_is_asked_again_comes_by_blocks_as_well(scene, tmp_path, monkeypatch):
    # So carelessly that another turn finds more, and in the end all is traced.
    careless = {"neighbours": 1, "candidates": 2, "checks": 1, "edge_halvings": 9}
    monkeypatch.setattr(sys.modules["prt_core.bake.sampled"], "TURNS", (careless, careless))
    settings = BakeSettings(resolution=7, method="agreement", tolerance=1e-7, bounces=0)
    report = run(bake_steps(scene, tmp_path / "a.prt", settings))
    assert report["sampling"]["turns"] == 3
    path, opened = tmp_path / "b.prt", []
    run(plan_steps(scene, path, settings))

    def backwards(stage, blocks):
        opened.append(stage)
        others = set(range(4)) - set(blocks)
        assert all(compute(path, stage, index).again for index in others)
        for index in reversed(blocks):
            assert not compute(path, stage, index).again
        assert not missing_blocks(path, stage)

    by_blocks = finished(path, backwards)
    assert opened == ["visibility", "visibility1", "visibility2", "visibility3"]
    assert digests(path) == digests(tmp_path / "a.prt")
    assert by_blocks["sampling"] == report["sampling"] and by_blocks["rays"] == report["rays"]
    assert not [name for name in BakeStore(path).names() if name.startswith(("tile", "work"))]


def test_what_is_computed_into_another_bake_is_an_error_not_for_ever_missing(
    scene, planned, tmp_path, monkeypatch
):
    other = tmp_path / "other.prt"
    run(plan_steps(scene, other, SETTINGS))
    blocks = sys.modules["prt_core.bake.blocks"]
    place = blocks._workplace(BakeStore(other))
    compute(other, "visibility", 0)
    monkeypatch.setattr(blocks, "_workplace", lambda store: place)
    with pytest.raises(PRTError, match="block 0 of stage 'visibility' was computed and is not"):
        finished(planned, lambda stage, missing: compute(planned, stage, missing[0]))


def test_a_block_of_a_stage_that_was_closed_meanwhile_is_no_error(planned):
    blocks = sys.modules["prt_core.bake.blocks"]
    (stage,) = stages(planned)
    late = BakeStore(planned)
    assert not blocks._is_over(late, stage)
    finish(planned, compute=True)
    assert blocks._is_over(late, stage)


def test_two_threads_give_the_same_bake(planned, whole):
    def side_by_side(stage, blocks):
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda index: compute(planned, stage, index), blocks * 2))

    finished(planned, side_by_side)
    assert digests(planned) == whole[0]


def test_processes_at_once_of_which_one_is_killed_give_the_same_bake(planned, whole):
    workers = [start(planned, "visibility") for _ in range(2)]
    until = time.monotonic() + 60
    while len(missing_blocks(planned, "visibility")) == 4 and time.monotonic() < until:
        time.sleep(0.02)
    workers[0].send_signal(signal.SIGKILL)
    assert workers[1].wait(60) == 0
    assert not missing_blocks(planned, "visibility")
    finish(planned, compute=True)
    assert digests(planned) == whole[0]
    workers[0].wait()


def test_a_plain_bake_goes_on_with_what_blocks_there_are(scene, planned, whole):
    for index in (3, 1):
        compute(planned, "visibility", index)
    report = run(bake_steps(scene, planned, SETTINGS))
    assert digests(planned) == whole[0]
    assert any("blocks of work" in message for message in report["messages"])


def test_a_bake_that_was_begun_can_be_planned(scene, tmp_path, whole):
    steps = bake_steps(scene, tmp_path / "a.prt", SETTINGS)
    for progress in steps:
        if progress.stage == "visibility" and progress.done > TILE:
            break
    steps.close()
    assert len(run(plan_steps(scene, tmp_path / "a.prt", SETTINGS))) == 1
    assert 0 < len(missing_blocks(tmp_path / "a.prt", "visibility")) < 4
    finish(tmp_path / "a.prt", compute=True)
    assert digests(tmp_path / "a.prt") == whole[0]


def test_what_is_missing_is_named_in_one_line(planned):
    compute(planned, "visibility", 1)
    with pytest.raises(BlocksMissing, match=r"3 blocks of stage 'visibility' missing \(0,2-3\)"):
        finish(planned)
    with pytest.raises(BlocksMissing) as caught:
        finish(planned)
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.stage, error.blocks, error.exit_code) == ("visibility", [0, 2, 3], 3)
    assert str(error) == str(caught.value) and "\n" not in str(error)


def test_a_tampered_block_is_named_and_computed_again(planned, whole):
    for index in range(4):
        compute(planned, "visibility", index)
    chunk = next((planned / "tile_bits0" / "c" / "2").rglob("0"))
    chunk = chunk if chunk.is_file() else next(p for p in chunk.rglob("*") if p.is_file())
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    with pytest.raises(BlocksMissing, match=r"1 block of stage 'visibility' missing \(2\)"):
        finish(planned)
    assert not compute(planned, "visibility", 2).again
    finish(planned, compute=True)
    assert digests(planned) == whole[0]


def test_a_damaged_round_of_bounces_is_computed_again_in_its_place(scene, tmp_path):
    settings = BakeSettings(resolution=6, method="exhaustive", tolerance=0.004)
    path, alone, opened = tmp_path / "a.prt", tmp_path / "b.prt", []
    run(plan_steps(scene, path, settings))

    def all_of_them(stage, blocks):
        opened.append(stage)
        # As in another process.
        sys.modules["prt_core.bake.blocks"]._kept.clear()
        for index in blocks:
            assert not compute(path, stage, index).again
        if len(opened) == 3:
            chunk = next(p for p in sorted((path / "gather" / "c" / "0").rglob("*")) if p.is_file())
            chunk.write_bytes(chunk.read_bytes()[:-1])

    finished(path, all_of_them)
    assert opened[1] == opened[3] == "gather2" != opened[2]
    run(bake_steps(scene, alone, settings))
    assert digests(path) == digests(alone)


def test_a_kill_before_it_is_sealed_leaves_the_plan(planned, whole, monkeypatch):
    def killed(store, *parts, **named):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(BakeStore, "seal", killed)
        finish(planned, compute=True)
    finish(planned)
    assert digests(planned) == whole[0]
    assert not [name for name in BakeStore(planned).names() if name.startswith("work")]


def test_another_plan_in_the_same_place_is_not_taken_for_the_first(scene, planned, monkeypatch):
    compute(planned, "visibility", 0)
    remove_bake(planned)
    memory = sys.modules["prt_core.bake.memory"].Memory
    monkeypatch.setattr(memory, "tile_points", lambda self, n_points, row_bytes: TILE // 2)
    run(plan_steps(scene, planned, SETTINGS))
    finished(planned, lambda stage, blocks: [compute(planned, stage, each) for each in blocks])
    alone = planned.with_name("alone.prt")
    run(bake_steps(scene, alone, SETTINGS))
    assert digests(planned) == digests(alone)


def test_blocks_write_nothing_of_what_is_said_of_the_bake(planned):
    before = (planned / "zarr.json").read_bytes()
    compute(planned, "visibility", 0)
    assert (planned / "zarr.json").read_bytes() == before


def test_every_entry_traced_and_surfaces_that_shine_come_by_blocks_as_well(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 64)
    settings = BakeSettings(resolution=4, tolerance=0.05, method="exhaustive")
    glowing = ball_on_paint(max_hidden=0)
    world = np.random.default_rng(3).random((96, 3)).astype(np.float32)
    lights = [Lamp("point", (1, 2, 3), (0, 0, 4), name="bulb")], world
    report = run(bake_steps(glowing, tmp_path / "a.prt", settings, *lights))
    path = tmp_path / "b.prt"
    assert (
        run(plan_steps(glowing, path, settings, *lights))[0].blocks
        == -(-report["points"] // 64)
        > 1
    )
    by_blocks = finished(
        path, lambda stage, blocks: [compute(path, stage, i) for i in reversed(blocks)]
    )
    assert digests(path) == digests(tmp_path / "a.prt")
    assert by_blocks["emitters"] == report["emitters"]
    assert by_blocks["rays"] == report["rays"]
    assert set(report["messages"]) <= set(by_blocks["messages"])
    assert np.array_equal(load(path).world, world)


def test_what_cannot_be_done_is_said(scene, planned, tmp_path):
    with pytest.raises(PRTError, match="'huang' looks at all of a scene"):
        run(plan_steps(scene, tmp_path / "h.prt", BakeSettings(8, method="huang")))
    with pytest.raises(PRTError, match="stage: expected one of visibility, got 'gather2'"):
        compute(planned, "gather2", 0)
    with pytest.raises(PRTError, match="expected a whole number from 0 to 3, got 4"):
        compute(planned, "visibility", 4)
    with pytest.raises(PRTError, match="there is no such bake"):
        stages(tmp_path / "none.prt")
    finish(planned, compute=True)
    report = finish(planned)
    assert report == BakeStore(planned).attributes["report"]
    with pytest.raises(PRTError, match="the bake is finished; nothing of it is left to compute"):
        compute(planned, "visibility", 0)
    with pytest.raises(PRTError, match="the bake is finished; nothing of it is left to plan"):
        run(plan_steps(scene, planned, SETTINGS))
    plain = tmp_path / "plain.prt"
    steps = bake_steps(scene, plain, SETTINGS)
    next(p for p in steps if p.stage == "visibility")
    steps.close()
    with pytest.raises(PRTError, match="was not planned"):
        finish(plain)
    with pytest.raises(PRTError, match="was not planned for blocks of work"):
        stages(plain)


def test_ranges_are_short():
    assert ranges_text([]) == ""
    assert ranges_text([4]) == "4"
    assert ranges_text([0, 1, 2, 7, 9, 10]) == "0-2,7,9-10"


@pytest.mark.parametrize(
    "stages_said", [[["../x", 3]], [["visibility", -1]], [["visibility"]], "visibility", None]
)
def test_a_damaged_plan_is_said_in_one_line(planned, stages_said):
    store = BakeStore(planned, "r+")
    store.update(work={**store.attributes["work"], "stages": stages_said})
    for ask in (stages, lambda path: compute(path, "visibility", 0)):
        with pytest.raises(PRTError, match="its plan is damaged") as caught:
            ask(planned)
        assert "\n" not in str(caught.value)
