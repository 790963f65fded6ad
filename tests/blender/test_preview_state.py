"""What the panel and the views show is what the data are: after undo, files, scenes, failures."""

import shutil
import sys
import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import (
    advice,
    bakes,
    live,
    looking,
    panel_bakes,
    panels,
    plan,
    preview,
    views,
    work,
)
from prt_core import PRTError
from prt_core.runtime.progress import Progress
from tests.blender.conftest import colours_on, cube, quick

pytestmark = pytest.mark.usefixtures("addon")


class Layout:
    """A layout that writes down what is drawn."""

    def __init__(self, drawn=None):
        self.drawn = [] if drawn is None else drawn

    def label(self, text="", icon="NONE"):
        self.drawn.append(text)

    def operator(self, name, **_):
        self.drawn.append(name)
        return SimpleNamespace()

    def __getattr__(self, name):
        """Rows, columns and boxes write to the same list."""
        return lambda *_, **__: Layout(self.drawn)


def drawn(panel):
    layout = Layout()
    wide = SimpleNamespace(width=10_000)
    scaled = SimpleNamespace(system=SimpleNamespace(ui_scale=1))
    context = SimpleNamespace(scene=bpy.context.scene, region=wide, preferences=scaled)
    panel.draw(SimpleNamespace(layout=layout, _split=lambda: layout), context)
    return layout.drawn


def main():
    return drawn(panels.PRT_PT_main)


def all_notes(of_bake=False):
    """What the dialog behind "more to know" and behind a bake's notes holds."""
    layout = Layout()
    dialog = SimpleNamespace(layout=layout, of_bake=of_bake)
    scaled = SimpleNamespace(system=SimpleNamespace(ui_scale=100))
    looking.PRT_OT_notes.draw(dialog, SimpleNamespace(scene=bpy.context.scene, preferences=scaled))
    return " ".join(layout.drawn)


def said(messages, of_bake=False):
    text = all_notes(of_bake)
    return all(message in text for message in messages)


def push(message):
    bpy.ops.ed.undo_push(message=message)


def views_show():
    kinds = {(s.color_type, s.light) for *_, s in views.of_windows()}
    assert len(kinds) == 1, "one window, all its views alike"
    return kinds == {("VERTEX", "FLAT")}


def check_state(preview_is_there, says=""):
    """The look, the views, the buttons and the message are those of the data."""
    scene = bpy.context.scene
    assert bool(scene.prt.loaded) == preview_is_there == views_show()
    assert ("PRT" in bpy.data.objects["ball"].data.color_attributes) == preview_is_there
    text = main()
    assert ("prt.clear" in text) == ("prt.relight" in text) == preview_is_there
    assert work.status().message == says


def test_undo_and_redo_of_a_bake(floor_scene):
    push("before")
    bpy.ops.prt.bake()
    push("Bake")
    check_state(True, work.status().message)
    assert work.status().message.startswith("Baked")
    bpy.ops.ed.undo()
    check_state(False, "The preview is undone; its bake stays on the disk")
    bpy.ops.ed.redo()
    check_state(True)
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert bpy.ops.prt.clear() == {"FINISHED"}
    check_state(False, work.status().message)


def test_undo_of_restore_load_relight_and_keep(baked_floor):
    path = preview.path_of(baked_floor)
    push("Bake")
    bpy.ops.prt.clear()
    push("Restore")
    check_state(False, work.status().message)
    bpy.ops.ed.undo()
    check_state(True)
    bpy.ops.ed.redo()
    check_state(False, "The preview is undone; its bake stays on the disk")
    bpy.ops.prt.load(filepath=path)
    push("Load")
    bpy.ops.ed.undo()
    check_state(False, "The preview is undone; its bake stays on the disk")
    bpy.ops.ed.redo()
    check_state(True)
    bpy.ops.prt.keep(attribute="Mine")
    push("Keep")
    assert "'Mine' kept" in work.status().message
    bpy.ops.ed.undo()
    check_state(True)
    bpy.ops.prt.relight()
    push("Relight")
    bpy.ops.ed.undo()
    check_state(True)


def test_views_that_a_person_has_set_stay_so(baked_floor):
    push("Bake")
    bpy.ops.prt.shading()
    assert not views_show()
    baked_floor.objects["ball"].location.x += 0.1
    push("Move")
    bpy.ops.ed.undo()
    assert not views_show() and bpy.context.scene.prt.loaded


def test_restore_is_there_as_long_as_anything_of_the_preview_is(baked_floor):
    baked_floor.prt.loaded = ""
    assert "prt.clear" in main() and "prt.relight" not in main()
    bpy.ops.prt.clear()
    assert "prt.clear" not in main() and not preview.present(baked_floor)
    views.show()
    assert "prt.clear" in main()
    views.restore()


@pytest.mark.parametrize("way", ["open", "new", "revert"])
def test_nothing_that_was_said_survives_into_the_next_file(baked_floor, tmp_path, way):
    bpy.ops.prt.clear()
    bpy.ops.wm.save_mainfile()
    bpy.ops.prt.bake()
    assert work.status().message and bakes.listed(baked_floor) and views_show()
    work.status().active_bake = 0
    shutil.copy(tmp_path / "scene.blend", tmp_path / "next.blend")
    if way == "open":
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "next.blend"), load_ui=False)
    elif way == "new":
        bpy.ops.wm.read_homefile(load_ui=False, use_factory_startup=True)
    else:
        bpy.ops.wm.revert_mainfile()
    assert (work.status().message, work.status().notes) == ("", "")
    assert not views_show() and not bakes.listed(bpy.context.scene)
    assert "Not looked at yet" in drawn(panel_bakes.PRT_PT_bakes)


def test_another_file_ends_a_bake_that_is_under_way(floor_scene, monkeypatch, tmp_path):
    closed = []

    class Endless(work.LongWork):
        title = "Bake"

        def steps(self, _context, _pace):
            try:
                while True:
                    time.sleep(0.02)
                    yield Progress("visibility", 1, 2)
            finally:
                closed.append(True)

    monkeypatch.setattr(work, "has_window", lambda context: True)
    manager = SimpleNamespace(
        event_timer_add=lambda *_, **__: object(), event_timer_remove=lambda *_: None,
        modal_handler_add=lambda *_: None,
    )  # fmt: skip
    window = SimpleNamespace(window=None, window_manager=manager)
    Endless().invoke(window, None)
    assert work.status().running and "prt.cancel" in main()
    bpy.ops.wm.revert_mainfile()
    assert closed and not work.status().running and "prt.bake" in main()


def test_what_a_bake_has_to_say_reaches_the_panel(floor_scene, capfd):
    scene = floor_scene
    cube("fine", scene.collection).modifiers.new("Subdivision", "SUBSURF")
    bpy.ops.prt.bake()
    messages = prt_core.load(preview.path_of(scene)).report["messages"]
    assert any("realised copies" in text for text in messages)
    printed = capfd.readouterr().out
    assert all(f"Warning: {text}" in printed for text in messages)
    assert said(messages) and "prt.notes" in main() and work.status().message.startswith("Baked")
    assert said(messages, of_bake=True) and "prt.notes" in drawn(panel_bakes.PRT_PT_bakes)
    bpy.ops.prt.relight()
    assert not said(messages) and said(messages, of_bake=True)


def test_a_missed_tolerance_is_said_wherever_the_bake_is_spoken_of(floor_scene, monkeypatch, capfd):
    monkeypatch.setattr(sys.modules["prt_core.bake.bounces"], "MOST_ROUNDS", 2)
    # Of many lines the gravest are shown; here but one.
    monkeypatch.setattr(panels, "_GRAVEST", 1)
    floor_scene.prt.tolerance = 0.001
    cube("fine", floor_scene.collection).modifiers.new("Subdivision", "SUBSURF")
    floor_scene.prt.method = "exhaustive"
    bpy.ops.prt.bake()
    report = preview.held(floor_scene).bake.report
    assert report["error"] > 0.001 and report["tolerance_met"] is False
    missed = report["messages"][0]
    assert f"the bounces may be {report['error']:.2%} off" in missed and "of 0.10%" in missed
    assert len(report["messages"]) > 1
    assert missed in main() and said([missed], of_bake=True)
    assert f"Warning: {missed}" in capfd.readouterr().out
    path = preview.path_of(floor_scene)
    bpy.ops.prt.clear()
    assert missed not in main() and said([missed], of_bake=True)
    bpy.ops.prt.load(filepath=path)
    assert missed in main()


def test_a_compressed_form_that_misses_its_tolerance_says_so(baked_floor, monkeypatch, capfd):
    monkeypatch.setattr(sys.modules["prt_core.bake.compress"], "met", lambda *_: False)
    baked_floor.prt.compress_tolerance = 0.5
    assert bpy.ops.prt.compress(method="harmonics") == {"FINISHED"}
    (missed,) = [text for text in main() if text.startswith("NOT within the tolerance of 50.00%")]
    assert f"Warning: {missed}" in capfd.readouterr().out
    assert any("(NOT as asked)" in text for text in drawn(panel_bakes.PRT_PT_bakes))


def test_what_the_preview_hides_is_not_said_to_be_hidden(floor_scene):
    scene = floor_scene
    cube("fine", scene.collection).modifiers.new("Subdivision", "SUBSURF")
    cube("away", scene.collection).hide_set(True)
    bpy.ops.prt.bake()
    bpy.ops.prt.refresh()
    cube("gone", scene.collection).hide_render = True
    texts = [text for text, *_ in advice.warnings(scene)]
    assert [text for text in texts if "hidden" in text] == ["gone: hidden in renders, not baked"]
    assert colours_on("away").any()


def test_fields_of_paths_take_relative_ones():
    if "is_path_supports_blend_relative" not in bpy.types.Property.bl_rna.properties:
        pytest.skip("this Blender does not ask for it")
    scene = bpy.context.scene.prt.bl_rna.properties
    result = {name: scene[name] for name in ("folder", "file")}
    for name in ("export", "load", "remove"):
        result[name] = getattr(bpy.ops.prt, name).get_rna_type().properties["filepath"]
    for name, field in result.items():
        assert field.is_path_supports_blend_relative, name


def test_the_list_selects_the_bake_that_is_shown(baked_floor):
    def selected():
        state = work.status()
        return state.bakes[state.active_bake].name

    for name in ("zebra", "aardvark", "middle"):
        baked_floor.prt.name = name
        bpy.ops.prt.bake()
        assert selected() == name
    assert [item.name for item in work.status().bakes] == [
        "aardvark",
        "middle",
        "scene_Scene",
        "zebra",
    ]
    # Who looks at another keeps it, whatever comes and goes.
    work.status().active_bake = 3
    bpy.ops.prt.remove(filepath=work.status().bakes[0].path)
    assert selected() == "zebra"
    bpy.ops.prt.load(filepath=work.status().bakes[1].path)
    assert selected() == "scene_Scene"
    bpy.ops.prt.remove(filepath=work.status().bakes[1].path)
    assert work.status().active_bake == 0
    baked_floor.prt.loaded = "//prt/zebra.prt"
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.revert_mainfile()
    bpy.ops.prt.refresh()
    assert selected() == "zebra"


def test_another_scene_is_looked_at_anew(baked_floor):
    other = quick(bpy.data.scenes.new("Other"))
    other.prt.folder = "//other"
    live._look_around()
    assert bakes.listed(baked_floor) and work.status().message.startswith("Baked")
    bpy.context.window.scene = other
    assert "Not looked at yet" in drawn(panel_bakes.PRT_PT_bakes)
    live._look_around()
    assert work.status().message == "" and bakes.listed(other)
    assert "No bakes in the folder" in drawn(panel_bakes.PRT_PT_bakes)
    bpy.context.window.scene = baked_floor
    bpy.data.scenes.remove(other)
    live._look_around()
    assert bakes.listed(baked_floor)


class Failing(work.LongWork):
    """Work that fails where it is told to."""

    title = "Fail"

    def __init__(self, where, error):
        self.where, self.error, self.reports = where, error, []

    def report(self, kind, text):
        self.reports.append(text)

    def steps(self, _context, _pace):
        try:
            while self.where != "finish":
                time.sleep(0.02)
                yield Progress("counting", 1, 2)
                if self.where == "steps":
                    raise self.error
        finally:
            if self.where == "close":
                raise self.error

    def finish(self, _context, _result):
        raise self.error


@pytest.mark.parametrize("where", ["steps", "close", "finish"])
@pytest.mark.parametrize("error", [PRTError("gone"), FileNotFoundError("gone"), KeyError("gone")])
def test_no_failure_blocks_the_button(monkeypatch, where, error):
    monkeypatch.setattr(work, "has_window", lambda context: True)
    removed = []
    manager = SimpleNamespace(
        event_timer_add=lambda *_, **__: "timer", event_timer_remove=removed.append,
        modal_handler_add=lambda *_: None,
    )  # fmt: skip
    window = SimpleNamespace(window=None, window_manager=manager)
    operator = Failing(where, error)
    key = SimpleNamespace(type="ESC" if where == "close" else "TIMER", value="PRESS")
    try:
        if operator.invoke(window, None) == {"RUNNING_MODAL"}:
            for _ in range(9):
                operator.modal(window, key)
            assert removed == ["timer"]
    except KeyError:
        pass
    assert not work.status().running and not work._RUNNING
    assert "prt.bake" in main()
    if not isinstance(error, KeyError):
        assert work.status().message == "gone" and work.status().failed
    elif where != "close":
        assert "the system console has the details" in work.status().message


def test_a_folder_that_is_removed_under_way_ends_the_bake_in_one_line(floor_scene):
    from prt_core.api import bake_blend_steps

    scene, path = floor_scene, plan.output_path(floor_scene)
    scene.prt.method, scene.prt.resolution = "exhaustive", "16"

    class Bake(Failing):
        def steps(self, _context, pace):
            settings = plan.bake_settings(scene)
            yield from bake_blend_steps(None, path, settings, pace=pace, scene=scene)

    operator = Bake("", None)
    operator._steps = operator.steps(None, 0.001)
    while next(operator._steps).stage != "visibility":
        pass
    shutil.rmtree(path)
    for _ in range(10_000):
        if operator._turn(SimpleNamespace()) != {"RUNNING_MODAL"}:
            break
    assert not work.status().running and work.status().failed
    assert work.status().message and "\n" not in work.status().message
    shutil.rmtree(path, ignore_errors=True)
    assert bpy.ops.prt.bake() == {"FINISHED"}, "the button goes on"
    assert np.isfinite(colours_on("ball")).all()
