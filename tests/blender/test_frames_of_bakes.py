"""Which frame of a moving scene a bake is of: kept, told, and held against that of a .blend."""

import json
from pathlib import Path

import bpy
import pytest

from prt_core import BakeStore
from prt_core.cli import main
from tests.blender.conftest import cube


@pytest.fixture
def moving(tmp_path, monkeypatch):
    """A file at frame 3 whose cube moves from frame 10 on, and whose lamp always does."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    monkeypatch.chdir(tmp_path)
    scene = bpy.context.scene
    item = cube("box", scene.collection)
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    scene.collection.objects.link(lamp)
    for moved, first in ((item, 10), (lamp, 1)):
        moved.location = 0, 0, 3
        moved.keyframe_insert("location", frame=first)
        moved.location = 0, 0, 4
        moved.keyframe_insert("location", frame=20)
    save(scene, 3)
    return scene


def save(scene, frame, name="moving.blend"):
    scene.frame_set(int(frame), subframe=frame % 1)
    bpy.ops.wm.save_as_mainfile(filepath=str(Path.cwd() / name))


def bake(*flags):
    return main(["bake", "moving.blend", "-o", "a.prt", "--resolution", "4", "--quiet", *flags])


def lines_of(capsys, start):
    out = capsys.readouterr().out
    return [line for line in out.splitlines() if line.startswith(start)]


def test_the_frame_of_a_bake_is_told(moving, capsys):
    assert bake() == 0 and main(["info", "a.prt"]) == 0
    wanted = "  scene   'Scene' of moving.blend at frame 3"
    assert lines_of(capsys, "  scene") == [wanted, wanted]
    assert main(["info", "a.prt", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["origin"]["frame"] == "3"
    # The lamp alone has moved: what was cast stays, and the lamps are those of the new frame.
    save(bpy.context.scene, 5.5)
    assert bake() == 0
    assert lines_of(capsys, "  scene") == [wanted.replace("frame 3", "frame 5.500")]
    # Bakes of before say nothing of it.
    store = BakeStore("a.prt", "a")
    store.update(origin={"file": "moving.blend", "scene": "Scene"})
    assert main(["info", "a.prt"]) == 0 and not lines_of(capsys, "  scene")


def test_a_blend_of_another_frame_is_said_to_be_one(moving, capsys):
    assert bake() == 0
    words = ["relight", "a.prt", "--lamps", "--blend", "lit.blend", "--scene"]
    for frame, said in ((7, []), (15, ["it is at frame 15, the bake is of frame 3"])):
        save(bpy.context.scene, frame, f"at_{frame}.blend")
        capsys.readouterr()
        assert main([*words, f"at_{frame}.blend"]) == 0
        notes = lines_of(capsys, "  note    the scene is not")
        assert len(notes) == len(said) and all(a in b for a, b in zip(said, notes, strict=True))


def test_lamps_of_another_frame_are_said_to_be_so(moving, capsys):
    assert bake() == 0
    save(bpy.context.scene, 7, "at_7.blend")
    capsys.readouterr()
    words = ["relight", "a.prt", "--blend", "lit.blend", "--scene", "at_7.blend"]
    assert main([*words, "--lamps"]) == 0
    (note,) = lines_of(capsys, "  note    lamps and world are those that were baked")
    assert "it is at frame 7, the bake is of frame 3" in note
    # Light from elsewhere is the same at every frame.
    skies = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world")
    assert main([*words, "--light", str(skies / "city.exr")]) == 0
    assert not lines_of(capsys, "  note")
