"""The scripts in examples/ run, on a small bake, and do what they say."""

import ast
import importlib
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

import prt_core

bpy = pytest.importorskip("bpy")
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FLOOR = EXAMPLES.parent / "blend_scenes" / "08_two_triangle_floor.blend"
# An old name that still works is no example.
pytestmark = pytest.mark.filterwarnings("error:.*prt_core:DeprecationWarning")


@pytest.fixture(scope="module")
def floor(tmp_path_factory):
    """A bake of a floor and a ball."""
    path = tmp_path_factory.mktemp("floor") / "floor.prt"
    prt_core.bake(FLOOR, path, resolution=8, tolerance=0.05)
    return path


@pytest.fixture
def play(tmp_path, monkeypatch, capsys):
    """Runs an example in an empty folder; what it printed."""
    monkeypatch.chdir(tmp_path)

    def run(name, *arguments):
        monkeypatch.setattr("sys.argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run


def is_picture(path, width, height):
    """Whether a PNG is of this size and not all of one colour."""
    image = bpy.data.images.load(str(path.resolve()))
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    return tuple(image.size) == (width, height) and pixels.std() > 0.02


def test_one_call(play, hdri, tmp_path):
    shown = play("one_call.py", FLOOR, hdri("courtyard"))
    assert (tmp_path / "example.prt" / "zarr.json").exists()
    means = dict(re.findall(r"(\w+): [\d,]+ corners, mean radiance (\d\.\d+)", shown))
    assert set(means) == {"floor", "ball"} and all(0.05 < float(m) < 2 for m in means.values())


def test_objects(play, hdri, tmp_path):
    shown = play("objects.py", FLOOR, hdri("city"))
    assert 1 < float(re.search(r"bounces add (\d+\.\d)%", shown)[1]) < 50
    assert is_picture(tmp_path / "example_objects.png", 960, 540)


def test_arrays(play):
    shown = play("arrays.py")
    direct, all_of_it = map(float, re.search(r"direct (\S+), with bounces (\S+)", shown).groups())
    assert 1.5 * direct < all_of_it < 0.7


def test_turntable(play, floor, hdri, tmp_path):
    shown = play("turntable.py", floor, hdri("city"), 2)
    assert re.findall(r"(\d+\.0) degrees: exact", shown) == ["0.0", "180.0"]
    pictures = [tmp_path / f"turn_00{step}.png" for step in (1, 2)]
    assert all(is_picture(path, 480, 300) for path in pictures)
    assert pictures[0].read_bytes() != pictures[1].read_bytes()


def test_compare_methods(play, floor, hdri):
    shown = play("compare_methods.py", floor, hdri("city"))
    rows = re.findall(r"(\w+) +(\d+\.\d\d) MB +\d+\.\d ms +(\d+\.\d\d)%", shown)
    assert [row[0] for row in rows] == ["PCA", "ClusteredPCA", "HaarLighting", "Harmonics"]
    assert all(float(size) > 0 and 0 < float(error) < 60 for _, size, error in rows)


def test_transport_svd(play, floor):
    shown = play("transport_svd.py", floor, 200)
    rows = re.findall(r"(\w+) +(direct|all bounces) +(\d+) +(\d+)", shown)
    assert {row[:2] for row in rows} == {
        (name, kind) for name in ("floor", "ball") for kind in ("direct", "all bounces")
    }
    assert all(1 <= int(few) <= int(more) <= 200 for _, _, few, more in rows)


def test_own_lamp(play, floor, tmp_path):
    shown = play("own_lamp.py", floor, "lamp.png")
    assert 1 < float(re.search(r"bounces add (\d+\.\d)%", shown)[1]) < 100
    assert is_picture(tmp_path / "lamp.png", 480, 300)


def test_headless(play, hdri, tmp_path):
    shutil.copy(FLOOR, tmp_path / "scene.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    shown = play("headless.py", "-b", "scene.blend", "--", hdri("city"), "lit.blend")
    assert "ball: colours of" in shown and "floor: colours of" in shown
    wanted = prt_core.relight(tmp_path / "lit.prt", hdri("city"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "lit.blend"))
    for name, colours in wanted.items():
        data = bpy.data.objects[name].data.color_attributes["Baked light"].data
        result = np.empty(4 * len(data), np.float32)
        data.foreach_get("color", result)
        assert (result.reshape(-1, 4)[:, :3] == colours).all()


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_examples_are_short_and_use_what_is_exported(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 45 and f"[{path.name}]" in (EXAMPLES / "README.md").read_text()
    checked = 0
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("prt_core"):
            exported = importlib.import_module(node.module).__all__
            for alias in node.names:
                checked += 1
                assert alias.name in exported, f"{node.module} does not export {alias.name}"
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "prt_core":
            checked += 1
            assert node.attr in prt_core.__all__, f"prt_core does not export {node.attr}"
    assert checked
