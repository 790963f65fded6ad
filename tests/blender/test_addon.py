"""The add-on without a window: every button as a script presses it, against the API."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import blender_addon
import prt_core
from blender_addon import advice, plan, preview, work
from prt_core import PRTError
from prt_core.blender.compat import fcurve_of
from prt_core.runtime.progress import Progress
from prt_core.store import BakeStore
from tests.blender.conftest import FLOOR, colours_on

OPTIONS = {"resolution": 8, "tolerance": 0.05, "caster": "blender"}


pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def scene(floor_scene):
    return floor_scene


@pytest.fixture
def baked(baked_floor):
    return baked_floor


def check_colours(wanted, attribute="PRT"):
    for name, colours in wanted.items():
        np.testing.assert_array_equal(colours_on(name, attribute), colours, err_msg=name)


def said():
    return bpy.context.window_manager.prt.message


def use_image(scene, path, degrees=0.0):
    scene.prt.light, scene.prt.file = "FILE", str(path)
    scene.prt.rotation = np.radians(degrees)
    return float(np.degrees(scene.prt.rotation))


def test_register_and_unregister_leave_nothing():
    names = [n for n in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, n), list)]
    handlers = {name: len(getattr(bpy.app.handlers, name)) for name in names}
    for _ in range(3):
        blender_addon.unregister()
        assert not hasattr(bpy.types.Scene, "prt") and not hasattr(bpy.types, "PRT_OT_bake")
        blender_addon.register()
    assert handlers == {name: len(getattr(bpy.app.handlers, name)) for name in names}
    assert bpy.context.scene.prt.resolution == "32"


def test_the_bake_button_is_the_api(baked, tmp_path):
    path = plan.output_path(baked)
    prt_core.bake(FLOOR, tmp_path / "api.prt", **OPTIONS)
    one, two = BakeStore(path), BakeStore(tmp_path / "api.prt")
    for name in ("visibility", "gather", "point_positions", "world1"):
        np.testing.assert_array_equal(one.read(name), two.read(name), err_msg=name)
    assert one.attributes["identity"] == two.attributes["identity"]


def test_relight_is_the_api(baked, hdri):
    degrees = use_image(baked, hdri("city"), 30)
    baked.prt.exposure, baked.prt.lamp_samples = 1.0, 16
    assert bpy.ops.prt.relight() == {"FINISHED"}
    bake = prt_core.load(preview.path_of(baked))
    wanted = prt_core.relight(
        bake, hdri("city"), rotation=degrees, strength=2.0, lamps=bake.lamps, lamp_samples=16
    )
    check_colours(wanted)
    baked.prt.use_lamps, baked.prt.exposure, baked.prt.sharp_sun = False, 0.0, True
    bpy.ops.prt.relight()
    options = {"rotation": degrees, "sharp_sun": True, "lamp_samples": 16}
    check_colours(prt_core.relight(bake, hdri("city"), **options))


def test_the_world_as_it_is_now_is_the_light(baked):
    bake = prt_core.load(preview.path_of(baked))
    world = baked.world
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    for link in list(background.inputs["Color"].links):
        world.node_tree.links.remove(link)
    background.inputs["Color"].default_value = (0.2, 0.5, 1.0, 1.0)
    background.inputs["Strength"].default_value = 3.0
    baked.prt.use_lamps = False
    bpy.ops.prt.relight()
    light = np.broadcast_to(np.float32([0.2, 0.5, 1.0]), (bake.cube_map.n_directions, 3))
    wanted = prt_core.relight(bake, light, strength=3.0)
    for name, colours in wanted.items():
        np.testing.assert_allclose(colours_on(name), colours, rtol=1e-5, atol=1e-6)


def test_a_studio_light(baked, hdri):
    baked.prt.light, baked.prt.studio, baked.prt.use_lamps = "STUDIO", "forest.exr", False
    bpy.ops.prt.relight()
    check_colours(prt_core.relight(preview.path_of(baked), hdri("forest"), rotation=0.0))


def test_a_second_bake_goes_on_and_a_changed_scene_is_baked_anew(baked):
    first = BakeStore(preview.path_of(baked)).attributes["identity"]
    bpy.ops.prt.bake()
    assert BakeStore(preview.path_of(baked)).attributes["identity"] == first
    baked.objects["ball"].location.x += 0.3
    bpy.ops.prt.refresh()
    built, _ = plan.of(baked)
    state = blender_addon.bakes.state(baked, bpy.context.window_manager.prt.bakes[0])
    assert "stale: ball changed" in state[0]
    bpy.ops.prt.bake()
    assert BakeStore(preview.path_of(baked)).attributes["identity"] != first
    assert blender_addon.bakes.state(baked, bpy.context.window_manager.prt.bakes[0])[0] == "fresh"
    present = prt_core.load(preview.path_of(baked)).scene
    assert built.cost.points == len(present.points) - len(present.details)


def test_clear_gives_everything_back(scene):
    mesh = scene.objects["ball"].data
    own = mesh.color_attributes.new("Own", "FLOAT_COLOR", "POINT")
    mesh.color_attributes.active_color = own
    before = [list(o.modifiers.keys()) for o in scene.objects]
    bpy.ops.prt.bake()
    assert mesh.color_attributes.active_color.name == "PRT Solid"
    assert mesh.color_attributes[mesh.color_attributes.render_color_index].name == "PRT"
    assert "PRT preview" in scene.objects["ball"].modifiers
    scene.prt.attribute = "Other"
    bpy.ops.prt.relight()
    assert "PRT" not in mesh.color_attributes and "Other" in mesh.color_attributes
    assert bpy.ops.prt.clear() == {"FINISHED"}
    assert list(mesh.color_attributes.keys()) == ["Own"]
    assert mesh.color_attributes.active_color.name == "Own"
    assert [list(o.modifiers.keys()) for o in scene.objects] == before
    assert not [b for b in (*bpy.data.materials, *bpy.data.node_groups) if "PRT" in b.name]
    assert "Bake the scene, or load a bake, first" in why_not("relight")


def why_not(name):
    with pytest.raises(RuntimeError) as caught:
        getattr(bpy.ops.prt, name)()
    return str(caught.value)


def test_grey_buttons_say_why(baked):
    bpy.context.view_layer.objects.active = baked.objects["ball"]
    bpy.ops.object.mode_set(mode="EDIT")
    for name in ("bake", "relight", "keep", "clear", "load", "subdivide"):
        assert "Leave Edit Mode first" in why_not(name), name
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "Nothing is under way" in why_not("cancel")
    work.status().running, work.status().title = True, "Bake"
    assert "Bake is under way" in why_not("bake")
    work.status().running = False


def test_what_changed_after_the_bake_is_said(baked):
    baked.objects["ball"].name = "globe"
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert "PRT" in bpy.data.objects["globe"].data.color_attributes
    bpy.ops.object.select_all(action="DESELECT")
    bpy.data.objects.remove(bpy.data.objects["globe"])
    assert "no such mesh object" in why_not("relight") and "no such mesh" in said()
    assert work.status().failed and not work.status().running


def test_a_changed_mesh_is_refused_whole(baked):
    floor = colours_on("floor").copy()
    bpy.ops.mesh.primitive_cube_add()
    baked.objects["ball"].data = bpy.context.object.data
    baked.prt.exposure = 3.0
    assert "the mesh was changed after the bake" in why_not("relight")
    np.testing.assert_array_equal(colours_on("floor"), floor)


def test_a_bake_that_is_gone_is_said(baked, tmp_path):
    path = Path(preview.path_of(baked))
    preview.forget()
    path.rename(tmp_path / "moved")
    assert "there is no such bake" in why_not("relight")
    (path.parent / "foreign.prt").mkdir()
    (path.parent / "foreign.prt" / "letter.txt").write_text("not a bake")
    bpy.ops.prt.refresh()
    assert len(work.status().bakes) == 0
    with pytest.raises(RuntimeError, match="broken.prt"):
        bpy.ops.prt.load(filepath=str(path.parent / "broken.prt"))


def test_a_file_without_a_name_bakes_into_the_temporary_folder(scene):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    chosen = bpy.context.scene.prt
    chosen.resolution, chosen.caster, chosen.tolerance = "8", "blender", 0.05
    assert any("File not saved" in text for text, *_ in advice.warnings(bpy.context.scene))
    bpy.ops.prt.bake()
    assert chosen.loaded.startswith(bpy.app.tempdir)
    assert len(colours_on("Cube")) == 24


def test_nothing_to_bake_is_said():
    assert "nothing that renders has faces" in why_not("bake")
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.prt.receives = False
    assert "none receives colours" in why_not("bake")


def test_objects_that_only_cast(scene):
    scene.objects["ball"].prt.receives = False
    bpy.ops.prt.bake()
    assert "PRT" not in scene.objects["ball"].data.color_attributes
    assert "PRT" in scene.objects["floor"].data.color_attributes


@pytest.mark.parametrize("domain", ["CORNER", "POINT"])
def test_keep(baked, domain):
    active = baked.objects["ball"].data.color_attributes.active_color.name
    bpy.ops.prt.keep(attribute="Mine", domain=domain)
    bpy.ops.prt.keep(attribute="Bytes", domain=domain, kind="BYTE_COLOR", channels={"G"})
    mesh = baked.objects["ball"].data
    kept, small = mesh.color_attributes["Mine"], mesh.color_attributes["Bytes"]
    assert (kept.domain, kept.data_type, small.data_type) == (domain, "FLOAT_COLOR", "BYTE_COLOR")
    assert mesh.color_attributes.active_color.name == active
    if domain == "CORNER":
        np.testing.assert_array_equal(colours_on("ball", "Mine"), colours_on("ball"))
    cut = np.clip(colours_on("ball", "Mine")[:, 1], 0, 1)
    np.testing.assert_allclose(colours_on("ball", "Bytes")[:, 1], cut, atol=5e-3)
    assert colours_on("ball", "Bytes")[:, 0].min() == 1  # untouched: white, as Blender makes it
    bpy.ops.prt.clear()
    assert {"Mine", "Bytes"} == set(mesh.color_attributes.keys())
    with pytest.raises(RuntimeError, match="Bake the scene"):
        bpy.ops.prt.keep(attribute="PRT")


def test_frames_follow_the_keyframed_light(baked, hdri, tmp_path):
    use_image(baked, hdri("sunset"), 10)
    baked.prt.use_lamps, baked.frame_start, baked.frame_end = False, 1, 4
    for last in (2, 4):  # the keys of a shorter turn before do not stop it
        baked.frame_end = last
        bpy.ops.prt.turntable()
    keys = fcurve_of(baked, "prt.rotation").keyframe_points
    assert [k.interpolation for k in keys] == ["LINEAR"] * 2
    bpy.ops.prt.export(filepath=str(tmp_path / "f_##.npz"), pictures=True, size=(32, 18))
    bake = prt_core.load(preview.path_of(baked))
    turned = set()
    for frame in (1, 3):
        baked.frame_set(frame)
        degrees = float(np.degrees(baked.prt.rotation))
        turned.add(round(degrees))
        wanted = prt_core.relight(bake, hdri("sunset"), rotation=degrees)
        check_colours(wanted)
        kept = np.load(tmp_path / f"f_{frame:02d}.npz")
        for name, colours in wanted.items():
            np.testing.assert_array_equal(kept[name], colours)
        assert (tmp_path / f"f_{frame:02d}.png").stat().st_size > 100
    assert turned == {10, 190}


def test_undo_and_redo_across_a_bake(scene):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.prt.bake()
    bpy.ops.ed.undo_push(message="baked")
    wanted = colours_on("ball").copy()
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert not scene.prt.loaded
    assert "PRT" not in bpy.data.objects["ball"].data.color_attributes
    bpy.ops.ed.redo()
    assert bpy.context.scene.prt.loaded
    np.testing.assert_array_equal(colours_on("ball"), wanted)
    assert bpy.ops.prt.relight() == {"FINISHED"}


def test_a_saved_file_opens_as_it_was_and_without_the_addon(baked, tmp_path):
    wanted = colours_on("ball").copy()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "again.blend"))
    blender_addon.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "again.blend"))
        np.testing.assert_array_equal(colours_on("ball"), wanted)
        assert not bpy.data.objects["ball"].data.validate()
        names = [s.name for s in bpy.data.scenes]
        assert names == ["Scene"], "data-blocks of the ray casters were saved"
    finally:
        blender_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "again.blend"))
    assert bpy.context.scene.prt.loaded and not work.status().running
    assert bpy.ops.prt.relight() == {"FINISHED"}
    np.testing.assert_array_equal(colours_on("ball"), wanted)


def test_remedies(scene):
    bpy.ops.mesh.primitive_plane_add(size=4)
    plane = bpy.context.object
    plane.name = "coarse"
    hidden = scene.objects["ball"]
    hidden.hide_render = True
    bpy.ops.prt.refresh()
    texts = [(text, helps) for text, helps, _ in advice.warnings(scene)]
    assert any("ball: hidden in renders" in t and h == "prt.unhide" for t, h in texts)
    assert any("coarse: a vertex every" in t and h == "prt.subdivide" for t, h in texts)
    bpy.ops.prt.unhide(object_name="ball")
    assert not hidden.hide_render
    bpy.ops.prt.subdivide(object_name="coarse")
    assert len(plane.data.vertices) > 500 and not plane.modifiers
    bpy.ops.prt.refresh()
    assert "coarse" not in plan.of(scene)[0].cost.coarse


def test_the_command_line_inside_blender(baked, hdri, tmp_path, capfd):
    path = preview.path_of(baked)
    assert blender_addon._command(["info", path, "--json"]) == 0
    out = str(tmp_path / "c.npz")
    assert blender_addon._command(["relight", path, "--light", "world", "--output", out]) == 0
    assert blender_addon._command(["info", str(tmp_path / "none.prt")]) == 2
    assert blender_addon._command(["nonsense"]) == 2
    assert "there is no such bake" in capfd.readouterr().err


class FakeManager:
    """A window manager's timers, as the modal driver sees them."""

    def __init__(self):
        self.timers, self.handlers = 0, 0

    def event_timer_add(self, _step, window):
        self.timers += 1
        return object()

    def event_timer_remove(self, _timer):
        self.timers -= 1

    def modal_handler_add(self, _operator):
        self.handlers += 1


class Counting(work.LongWork):
    """Counts to `total`, a step a turn."""

    title = "Count"

    def __init__(self, total=40, fails_at=None):
        self.total, self.fails_at = total, fails_at
        self.reports, self.closed, self.result, self.reached = [], False, None, 0

    def report(self, kind, text):
        self.reports.append((kind, text))

    def steps(self, _context, pace):
        assert pace is None or pace < 0.1
        try:
            for i in range(self.total):
                if i == self.fails_at:
                    raise PRTError("count: lost")
                self.reached = i
                import time

                time.sleep(0.005)
                yield Progress("counting", i, self.total)
            return "all"
        finally:
            self.closed = True

    def finish(self, _context, result):
        self.result = result


@pytest.fixture
def window(monkeypatch):
    monkeypatch.setattr(work, "has_window", lambda context: True)
    return SimpleNamespace(window=None, window_manager=FakeManager())


def event(kind, value="NOTHING"):
    return SimpleNamespace(type=kind, value=value)


def drive(operator, context, turns=200):
    for _ in range(turns):
        result = operator.modal(context, event("TIMER"))
        if result != {"RUNNING_MODAL"}:
            return result
    raise AssertionError("the work does not end")


def test_the_modal_driver_works_to_the_end(window):
    operator = Counting()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    assert work.status().running and window.window_manager.timers == 1
    assert operator.modal(window, event("MOUSEMOVE")) == {"PASS_THROUGH"}
    assert Counting().invoke(window, None) == {"CANCELLED"}, "two at once"
    assert drive(operator, window) == {"FINISHED"} and operator.result == "all"
    assert not work.status().running and window.window_manager.timers == 0
    assert max(seconds for seconds, _ in work.turns) < 0.5 and len(work.turns) > 3


@pytest.mark.parametrize(("total", "fails_at"), [(1, None), (5, 0)])
def test_work_that_ends_at_once_leaves_no_handler(window, total, fails_at):
    operator = Counting(total, fails_at)
    result = operator.invoke(window, None)
    assert result == ({"FINISHED"} if fails_at is None else {"CANCELLED"})
    assert window.window_manager.handlers == window.window_manager.timers == 0
    assert operator.closed and not work.status().running


@pytest.mark.parametrize("how", ["escape", "button", "blender", "unregister"])
def test_the_modal_driver_stops(window, how):
    operator = Counting(total=4000)
    operator.invoke(window, None)
    operator.modal(window, event("TIMER"))
    if how == "escape":
        assert operator.modal(window, event("ESC", "PRESS")) == {"CANCELLED"}
    elif how == "button":
        bpy.ops.prt.cancel()
        assert operator.modal(window, event("MOUSEMOVE")) == {"CANCELLED"}
    elif how == "blender":
        operator.cancel(window)
    else:
        work.stop_all()
    assert operator.closed and operator.result is None and operator.reached < 100
    assert not work.status().running and window.window_manager.timers == 0
    assert operator.modal(window, event("TIMER")) == {"CANCELLED"}


def test_the_modal_driver_says_what_failed(window):
    operator = Counting(fails_at=9)
    operator.invoke(window, None)
    assert drive(operator, window) == {"CANCELLED"}
    assert operator.reports == [({"ERROR"}, "count: lost")] and work.status().failed
    assert not work.status().running and window.window_manager.timers == 0


def test_a_stopped_bake_goes_on_to_the_same_bytes(scene, tmp_path):
    """The steps of the button, closed half-way, and then the button."""
    from prt_core.api import bake_blend_steps

    path = plan.output_path(scene)
    steps = bake_blend_steps(None, path, plan.bake_settings(scene), pace=0.001, scene=scene)
    while next(steps).stage != "visibility":
        pass
    steps.close()
    assert not BakeStore(path).attributes.get("complete")
    bpy.ops.prt.refresh()
    assert blender_addon.bakes.state(scene, work.status().bakes[0])[0] == "stopped"
    bpy.ops.prt.bake()
    prt_core.bake(FLOOR, tmp_path / "api.prt", **OPTIONS)
    one, two = BakeStore(path), BakeStore(tmp_path / "api.prt")
    for name in ("visibility", "gather"):
        np.testing.assert_array_equal(one.read(name), two.read(name))


class Baking(Counting):
    """The bake of the button, whose folder is removed when it has begun."""

    title = "Bake"

    def steps(self, context, pace):
        from prt_core.api import bake_blend_steps

        scene = bpy.context.scene
        path, settings = plan.output_path(scene), plan.bake_settings(scene)
        for progress in bake_blend_steps(None, path, settings, pace=pace, scene=scene):
            if progress.stage == "visibility" and path.exists():
                # The bake goes on writing meanwhile.
                shutil.rmtree(path, ignore_errors=True)
            yield progress


def test_a_folder_that_is_removed_in_mid_bake_leaves_the_button_free(scene, window):
    operator = Baking()
    operator.invoke(window, None)
    assert drive(operator, window, 10**5) == {"CANCELLED"}
    assert len(operator.reports) == 1 and "removed" in operator.reports[0][1]
    assert not work.status().running and window.window_manager.timers == 0
    bpy.ops.prt.bake()
    assert prt_core.load(plan.output_path(scene)).report["points"] > 0


def test_a_folder_that_a_kill_left_empty_is_baked_into(scene):
    plan.output_path(scene).mkdir(parents=True)
    bpy.ops.prt.bake()
    assert prt_core.load(plan.output_path(scene)).report["points"] > 0


def test_a_changed_scene_keeps_its_old_bake_until_the_new_one_is_finished(baked):
    from prt_core.api import bake_blend_steps

    path = plan.output_path(baked)
    before = BakeStore(path).attributes["identity"]
    bpy.data.objects["ball"].location.x += 0.1
    steps = bake_blend_steps(
        None, path, plan.bake_settings(baked), restart="changed", pace=0.001, scene=baked
    )
    while next(steps).stage != "visibility":
        pass
    steps.close()
    assert BakeStore(path).attributes["identity"] == before and prt_core.load(path)
    bpy.ops.prt.bake()
    assert BakeStore(path).attributes["identity"] != before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_damaged_bake_can_be_removed(baked):
    path = plan.output_path(baked)
    bpy.ops.prt.refresh()
    (path / "zarr.json").write_text("{")
    bpy.ops.prt.remove(filepath=str(path))
    assert not path.exists() and not work.status().bakes


def test_a_folder_that_cannot_be_written_is_said(scene, tmp_path):
    (tmp_path / "file").write_text("no folder")
    scene.prt.folder = str(tmp_path / "file" / "prt")
    assert "file" in why_not("bake") and not work.status().running
    assert work.status().failed


def test_saving_elsewhere_keeps_the_bake(baked, tmp_path):
    wanted = colours_on("ball").copy()
    (tmp_path / "deeper").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "deeper" / "x.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "deeper" / "x.blend"))
    assert Path(preview.path_of(bpy.context.scene)).is_dir()
    assert bpy.ops.prt.relight() == {"FINISHED"}
    np.testing.assert_array_equal(colours_on("ball"), wanted)


def test_a_bake_of_an_unsaved_file_moves_beside_it(tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    chosen = bpy.context.scene.prt
    chosen.resolution, chosen.caster, chosen.tolerance = "8", "blender", 0.05
    bpy.ops.prt.bake()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "new.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "new.blend"))
    assert preview.path_of(bpy.context.scene) == str(tmp_path / "prt" / "new_Scene.prt")
    assert bpy.ops.prt.relight() == {"FINISHED"}


def test_scenes_are_apart(baked):
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    assert "Bake the scene" in why_not("relight")
    assert plan.output_path(other).name == "scene_Other.prt"
    bpy.ops.mesh.primitive_cube_add()
    other.prt.resolution, other.prt.caster, other.prt.tolerance = "8", "blender", 0.05
    bpy.ops.prt.bake()
    assert len(colours_on("Cube")) == 24
    bpy.context.window.scene = baked
    wanted = colours_on("ball").copy()
    bpy.ops.prt.relight()
    np.testing.assert_array_equal(colours_on("ball"), wanted)
    bpy.data.scenes.remove(other)


def test_instances_linked_and_shared_meshes_get_copies(scene, tmp_path):
    """Copies in a collection; the originals hide behind them and come back."""
    floor = scene.objects["floor"]
    twin = bpy.data.objects.new("twin", scene.objects["ball"].data)
    twin.location = -0.5, 0.3, 0.5
    scene.collection.objects.link(twin)
    library = tmp_path / "library.blend"
    cube = bpy.data.meshes.new("linked")
    cube.from_pydata([(0, 0, 1), (0.2, 0, 1), (0, 0.2, 1)], [], [(0, 1, 2)])
    item = bpy.data.objects.new("linked", cube)
    bpy.data.libraries.write(str(library), {item}, fake_user=True)
    bpy.data.objects.remove(item)
    bpy.data.meshes.remove(cube)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["linked"]
    scene.collection.objects.link(wanted.objects[0])
    bpy.ops.prt.bake()
    copies = {o.name for o in bpy.data.collections["PRT"].objects}
    assert len(copies) == 3 and "PRT" in floor.data.color_attributes
    assert twin.hide_render and scene.objects["ball"].hide_render
    bake = prt_core.load(preview.path_of(scene))
    bpy.ops.prt.refresh()
    assert blender_addon.bakes.state(scene, work.status().bakes[0])[0] == "fresh"
    twin.data = twin.data.copy()  # made single-user: the copies stay right
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert {o.name for o in bake.scene.objects} == {"floor", "ball", "twin", "linked"}
    bpy.ops.prt.clear()
    assert not twin.hide_render and "PRT" not in bpy.data.collections


@pytest.mark.parametrize("how", ["join", "remesh"])
def test_joined_or_remeshed_after_the_bake(baked, how):
    ball, floor = baked.objects["ball"], baked.objects["floor"]
    bpy.context.view_layer.objects.active = ball
    if how == "join":
        with bpy.context.temp_override(
            object=ball, active_object=ball, selected_editable_objects=[ball, floor]
        ):
            bpy.ops.object.join()
        # Of the floor, or of the ball that is both: the order of objects is Blender's.
        why = why_not("relight")
        assert "no such mesh object" in why or "the mesh was changed after the bake" in why
    else:
        modifier = ball.modifiers.new("Remesh", "REMESH")
        ball.modifiers.move(1, 0)
        with bpy.context.temp_override(object=ball, active_object=ball):
            bpy.ops.object.modifier_apply(modifier=modifier.name)
        assert "the mesh was changed after the bake" in why_not("relight")
    bpy.ops.prt.bake()
    assert bpy.ops.prt.relight() == {"FINISHED"} and not work.status().failed


def test_an_appended_object_is_not_broken(baked, tmp_path):
    path = str(tmp_path / "lit.blend")
    wanted = colours_on("ball").copy()
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path) as (_, taken):
        taken.objects = ["ball"]
    bpy.context.scene.collection.objects.link(taken.objects[0])
    bpy.context.view_layer.update()
    np.testing.assert_array_equal(colours_on("ball"), wanted)
    bpy.ops.prt.clear()
    assert "PRT preview" not in bpy.data.objects["ball"].modifiers


def test_the_addon_can_be_taken_off_and_put_back(baked):
    blender_addon.unregister()
    blender_addon.register()
    scene = bpy.context.scene
    assert scene.prt.loaded and scene.prt.resolution == "8"
    assert bpy.ops.prt.relight() == {"FINISHED"}


def test_a_sampled_bake_shows_what_it_is_worth(scene, tmp_path):
    scene.prt.method = "agreement"
    bpy.ops.prt.bake()
    item = work.status().bakes[0]
    report = prt_core.load(preview.path_of(scene)).report
    assert (item.method, report["method"]) == ("agreement", "agreement")
    assert 0 < item.entries < 50 and item.entries == pytest.approx(report["entries_percent"])
    assert item.visibility_error == pytest.approx(report["visibility_error"])
    prt_core.bake(FLOOR, tmp_path / "api.prt", **OPTIONS, method="agreement")
    one, two = BakeStore(item.path), BakeStore(tmp_path / "api.prt")
    np.testing.assert_array_equal(one.read("visibility"), two.read("visibility"))


def test_compress_is_the_api(baked, hdri, tmp_path):
    """The button, the colours it leads to, the way back to exact ones, and its removal."""
    path = shutil.copytree(preview.path_of(baked), tmp_path / "api.prt")
    degrees = use_image(baked, hdri("city"), 30)
    baked.prt.use_lamps, baked.prt.compress_tolerance = False, 0.05
    assert bpy.ops.prt.compress(method="cpca") == {"FINISHED"}
    attributes = prt_core.compress(path, method="cpca", tolerance=baked.prt.compress_tolerance)
    assert "Compressed by cpca" in said() and attributes["tolerance_met"]
    one, two = BakeStore(preview.path_of(baked)), BakeStore(path)
    for name in ("labels", "bases", "weights"):
        pair = (s.read(f"{s.attributes['compressed']['folder']}/{name}") for s in (one, two))
        np.testing.assert_array_equal(*pair, err_msg=name)
    check_colours(prt_core.relight(path, hdri("city"), rotation=degrees, form="compressed"))
    item = work.status().bakes[0]
    assert item.compressed.startswith(f"cpca, error {attributes['error']:.2%}")
    baked.prt.use_compressed = False
    bpy.ops.prt.relight()
    exact = prt_core.relight(path, hdri("city"), rotation=degrees, form="exact")
    check_colours(exact)
    baked.prt.use_compressed = True
    assert bpy.ops.prt.compress(method="none") == {"FINISHED"}
    check_colours(exact)
    assert work.status().bakes[0].compressed == ""
    assert "expected auto, cpca" in _error(bpy.ops.prt.compress, method="best")


def test_a_compressed_bake_moves_with_its_file(tmp_path, hdri):
    bpy.ops.mesh.primitive_cube_add()
    chosen = bpy.context.scene.prt
    chosen.resolution, chosen.caster, chosen.tolerance = "8", "blender", 0.05
    bpy.ops.prt.bake()
    assert bpy.ops.prt.compress(method="harmonics") == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "new.blend"))
    held = preview.held(bpy.context.scene)
    held.relighter.close()
    use_image(bpy.context.scene, hdri("sunset"))
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert held.relighter.used == "compressed"


def _error(operator, **options):
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value)
