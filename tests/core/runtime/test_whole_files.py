"""Files appear whole or not at all, whatever the system does; and what it refuses is one line."""

import errno
import os
import resource
import sys
from contextlib import contextmanager

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, relight, run
from prt_core.api import compress
from prt_core.bake.measure import standing_lights
from prt_core.errors import system_errors
from prt_core.evaluate import write_png
from prt_core.evaluate.report import Report, write_report
from prt_core.evaluate.sequence import write_npz
from prt_core.light import write_image
from prt_core.runtime.files import expect_output, new_folder, written
from prt_core.runtime.machine import expect_memory, memory_bytes
from tests.meshes import plane

NOISE = np.random.default_rng(0).integers(0, 256, (64, 96, 3), np.uint8)
ROWS = [{"row": "x" * 20_000}]
WRITERS = {
    "o.png": lambda path: write_png(path, NOISE),
    "o.npz": lambda path: write_npz(path, {"a": NOISE}),
    "o.exr": lambda path: write_image(path, NOISE.astype(np.float32)),
}


@contextmanager
def small_disk(most=4096):
    """Files of at most so many bytes: the system refuses to write more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder):
    return sorted(path.name for path in folder.rglob("*"))


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_what_was_there(tmp_path, name):
    write, path = WRITERS[name], tmp_path / name
    with small_disk(), pytest.raises(PRTError, match=f"{name}: "):
        write(path)
    assert names(tmp_path) == []
    path.write_bytes(b"before")
    with small_disk(), pytest.raises(PRTError) as caught:
        write(path)
    assert path.read_bytes() == b"before" and names(tmp_path) == [name]
    assert "\n" not in str(caught.value)
    write(path)
    assert path.stat().st_size > 4096 and names(tmp_path) == [name]


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_in_the_way_is_said(tmp_path, name):
    write = WRITERS[name]
    (tmp_path / "file").write_text("")
    (tmp_path / name).mkdir()
    for path, what in (
        (tmp_path / name, "is a directory; a folder is in the way"),
        (tmp_path / "file" / name, "a file is in the way of a folder|something is in the way"),
        (tmp_path / ("n" * 300 + name), "too long"),
    ):
        with pytest.raises(PRTError, match=what):
            write(path)
    assert names(tmp_path) == sorted(["file", name])
    # Folders on the way are made, and stay only with what they are made for.
    write(tmp_path / "new" / "folder" / name)
    with small_disk(), pytest.raises(PRTError):
        write(tmp_path / "other" / "folder" / name)
    assert not (tmp_path / "other").exists()


def test_a_report_is_whole_or_not_at_all(tmp_path):
    report = Report("Rows", ROWS, [("row", "")], plots={"plot": b"png"})
    with small_disk(), pytest.raises(PRTError, match="rows.json: file too large"):
        write_report(tmp_path / "r", report)
    assert names(tmp_path) == []
    write_report(tmp_path / "r", Report("Few", [{"row": 1}], [("row", "")]))
    before = {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()}
    with small_disk(30_000), pytest.raises(PRTError, match="report.html: file too large"):
        write_report(tmp_path / "r", report)
    assert {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()} == before
    write_report(tmp_path / "r", report)
    wanted = ["plot.png", "report.html", "rows.csv", "rows.json"]
    assert names(tmp_path / "r") == wanted


def test_a_link_is_not_written_through(tmp_path):
    (tmp_path / "outside").write_text("mine")
    os.link(tmp_path / "outside", tmp_path / "o.part.npz")
    write_npz(tmp_path / "o.npz", {"a": NOISE})
    assert (tmp_path / "outside").read_text() == "mine"
    assert names(tmp_path) == ["o.npz", "outside"]


def test_any_failure_inside_takes_the_part_away(tmp_path):
    with pytest.raises(KeyboardInterrupt), written(tmp_path / "a.npz") as part:
        part.write_text("half")
        raise KeyboardInterrupt
    with pytest.raises(ZeroDivisionError), new_folder(tmp_path / "b" / "c"):
        raise ZeroDivisionError
    assert names(tmp_path) == []


def test_outputs_are_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.npz").mkdir()
    assert expect_output("o", tmp_path / "o.npz", ".npz") == tmp_path / "o.npz"
    assert expect_output("o", tmp_path / "new" / "o.prt", ".prt", folder=True, create=True)
    for path, options, what in (
        ("o.png", {}, "ends in .npz"),
        ("folder.npz", {}, "a folder is in the way"),
        ("no/o.npz", {}, "there is no folder"),
        ("file/o.npz", {}, "a file is in the way"),
        ("file/more/o.npz", {"create": True}, "a file is in the way"),
        ("n" * 300 + ".npz", {}, "too long"),
    ):
        with pytest.raises(PRTError, match=what):
            expect_output("o", tmp_path / path, ".npz", **options)
    with pytest.raises(PRTError, match="expected a folder, this is a file"):
        expect_output("o", tmp_path / "file", None, folder=True)
    with pytest.raises(PRTError, match="/proc/o.npz: "):
        expect_output("o", "/proc/o.npz", ".npz")
    assert names(tmp_path) == ["file", "folder.npz"]


@pytest.mark.parametrize(
    ("code", "what"),
    [
        (errno.ENOSPC, "a: no space left on device; free some space"),
        (errno.EROFS, "a: read-only file system; choose another folder"),
        (errno.EACCES, "a: permission denied; choose another folder"),
        (errno.EIO, "a: input/output error"),
    ],
)
def test_what_the_system_refuses_names_path_reason_and_remedy(code, what):
    with pytest.raises(PRTError, match=what) as caught, system_errors("a"):
        raise OSError(code, os.strerror(code))
    assert caught.value.__cause__.errno == code
    with pytest.raises(PRTError, match="b: "), system_errors():
        raise OSError(code, os.strerror(code), "b")
    with pytest.raises(PRTError, match="memory: not enough memory"), system_errors():
        raise MemoryError


@pytest.fixture
def scene():
    return Scene.from_meshes([plane(3)], max_hidden=0)


def test_a_bake_on_a_full_disk_goes_on_or_is_not_there(tmp_path, scene, monkeypatch):
    settings, path = BakeSettings(resolution=2, caster="brute"), tmp_path / "a.prt"
    with small_disk(64), pytest.raises(PRTError, match="cannot be written .File too large"):
        run(bake_steps(scene, path, settings))
    assert names(tmp_path) == []
    (tmp_path / "file").write_text("")
    for wrong in ("file/a.prt", "file"):
        with pytest.raises(PRTError):
            run(bake_steps(scene, tmp_path / wrong, settings))
    # With rays in it the bake stays, and goes on.
    monkeypatch.setattr(sys.modules["prt_core.bake.steps"], "bounce_steps", full)
    with pytest.raises(PRTError, match="no space left on device; free some space"):
        run(bake_steps(scene, path, settings))
    monkeypatch.undo()
    assert (path / "visibility").is_dir()
    run(bake_steps(scene, path, settings))
    light = np.ones((24, 3), np.float32)
    assert load(path).transport.radiance(light).min() > 0


def full(*_):
    """A stage of the bake whose disk is full."""
    yield
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_wrong_parts_of_a_bake_are_refused_before_anything_is_written(tmp_path, scene):
    settings = BakeSettings(resolution=2, caster="brute")
    for wrong in (
        {"world": np.ones((23, 3))},
        {"world": np.ones((24, 4))},
        {"world": np.full((24, 3), np.nan)},
        {"lamps": [None]},
        {"camera": "the front"},
        {"source": {"a": 1}},
        {"lights": {"sky": np.ones((5, 3))}},
    ):
        with pytest.raises(PRTError):
            run(bake_steps(scene, tmp_path / "a.prt", settings, **wrong))
        assert names(tmp_path) == []


def test_a_compressed_form_on_a_full_disk_leaves_the_old_one(tmp_path, scene):
    path, sky = tmp_path / "a.prt", standing_lights()
    run(bake_steps(scene, path, BakeSettings(resolution=4, caster="brute", bounces=0)))
    compress(path, method="harmonics", tolerance=0.5, lights=sky)
    before = relight(path, sky["even sky"], form="compressed")
    with small_disk(256), pytest.raises(PRTError):
        compress(path, method="pca", tolerance=0.1, lights=sky)
    after = relight(path, sky["even sky"], form="compressed")
    for name in before:
        np.testing.assert_array_equal(before[name], after[name])


def test_what_needs_more_than_there_is_is_refused():
    assert memory_bytes() > 1 << 28
    expect_memory("a", 1000, "less")
    with pytest.raises(PRTError, match=r"a: needs about .* GB of memory, there are .*; less"):
        expect_memory("a", 2.0 * memory_bytes(), "less")
