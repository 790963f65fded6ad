"""Light fields in the add-on without a window: against the API, beside a bake, and given back."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from blender_addon import field_list, field_operators, light_fields, preview, viewport, work
from prt_core.api import light_field
from prt_core.bake.light_field_compress import compress_light_field_steps
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_view import field_toward
from prt_core.bake.light_field_viewer import FieldViewer
from prt_core.blender.realised import holds
from prt_core.lightfield.methods import METHODS
from prt_core.runtime.progress import run
from prt_core.store import BakeStore, compressed_attributes, read_compressed
from prt_core.transport import View
from tests.blender.conftest import colours_on

NEW = bpy.app.version >= (4, 5, 0)
needs_camera = pytest.mark.skipif(not NEW, reason="cameras that are shaders came with Blender 4.5")
pytestmark = pytest.mark.usefixtures("addon")
FIELD = preview.LIGHT_FIELD


def shown_on(item):
    """Names of an object's colour attributes, but for what Solid mode shows of each."""
    names = list(item.data.color_attributes.keys())
    assert all(f"{name} Solid" in names for name in names if not name.endswith(" Solid"))
    return [name for name in names if not name.endswith(" Solid")]


ANGLES, SAMPLES = (5, 3), 2


@pytest.fixture
def scene(floor_scene):
    """A floor, a ball that is selected, a camera, and settings for a quick capture."""
    floor_scene.prt.field.angles, floor_scene.prt.field.samples = ANGLES, SAMPLES
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    eye.location = 1.5, -4.0, 2.5
    floor_scene.collection.objects.link(eye)
    floor_scene.camera = eye
    floor_scene.prt.field.follow = "CAMERA"
    bpy.context.view_layer.update()
    select(floor_scene.objects["ball"])
    return floor_scene


def select(*items):
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)


def lamp(scene, name, location, energy=80.0):
    data = bpy.data.lights.new(name, "POINT")
    data.energy = energy
    item = bpy.data.objects.new(name, data)
    item.location = location
    scene.collection.objects.link(item)


def why_not(name, **options):
    with pytest.raises(RuntimeError) as caught:
        getattr(bpy.ops.prt, name)(**options)
    return str(caught.value)


def wanted_on(item, path, view, weights=None):
    """Colours of an object's corners by the core alone."""
    field = load_light_field(path)
    radiance = run(FieldViewer(field).steps(view, weights))
    scene_points = np.zeros((len(field.scene.points), 3), np.float32)
    scene_points[field.point] = radiance
    strengths = {} if weights is None else dict(zip(field.lights, weights, strict=True))
    slow, _ = field_toward(field, view, strengths)
    np.testing.assert_allclose(scene_points, slow, rtol=2e-4, atol=2e-5 * slow.max())
    (baked,) = [o for o in field.scene.objects if o.name == item]
    return scene_points[baked.corner_point]


@needs_camera
def test_the_button_is_the_api(scene, tmp_path):
    assert bpy.ops.prt.light_field_bake() == {"FINISHED"}
    path = field_list.output_path(scene)
    light_field(None, tmp_path / "api.slf", objects=["ball"], angles=ANGLES, samples=SAMPLES)
    one, two = load_light_field(path), load_light_field(tmp_path / "api.slf")
    np.testing.assert_array_equal(one.radiance[...], two.radiance[...])
    np.testing.assert_array_equal(one.point, two.point)
    assert one.radiance[...].max() > 0
    eye = View(position=np.array(scene.camera.matrix_world)[:3, 3])
    shown = colours_on("ball", FIELD)
    np.testing.assert_array_equal(shown, wanted_on("ball", path, eye))
    assert scene.objects["ball"].data.color_attributes.active_color.name == f"{FIELD} Solid"
    assert not holds(scene.objects["floor"], [FIELD])
    scene.camera.location = -3.0, 2.0, 4.0
    bpy.context.view_layer.update()
    scene.frame_set(scene.frame_current + 1)
    moved = colours_on("ball", FIELD)
    assert np.abs(moved - shown).max() > 1e-3
    eye = View(position=np.array(scene.camera.matrix_world)[:3, 3])
    np.testing.assert_array_equal(moved, wanted_on("ball", path, eye))


@needs_camera
def test_lights_are_dimmed_and_coloured_apart(scene):
    lamp(scene, "left", (-2, -2, 3))
    lamp(scene, "right", (3, -1, 2), 120.0)
    scene.prt.field.each = True
    bpy.ops.prt.light_field_bake()
    lights = light_fields.held(scene).field.lights
    assert {"left", "right"} < set(lights)
    assert [row.name for row in scene.prt.field.lamps] == list(lights)
    path, eye = field_list.output_path(scene), viewport.view_of(scene, scene.prt.field.follow)
    np.testing.assert_array_equal(colours_on("ball", FIELD), wanted_on("ball", path, eye))
    factors = np.ones((len(lights), 3), np.float32)
    factors[lights.index("left")] = 0
    factors[lights.index("right")] = np.float32([0.5, 2.0, 0.25])
    scene.prt.field.lamps["left"].strength = 0
    scene.prt.field.lamps["right"].strength = 2
    scene.prt.field.lamps["right"].colour = 0.25, 1.0, 0.125
    scene.frame_set(2)
    mixed = colours_on("ball", FIELD)
    np.testing.assert_array_equal(mixed, wanted_on("ball", path, eye, factors))
    apart = sum(
        wanted_on("ball", path, eye, np.eye(len(lights), dtype=np.float32)[n]) * factors[n]
        for n in range(len(lights))
    )
    np.testing.assert_allclose(mixed, apart, rtol=1e-5, atol=1e-6)


def field_of_bake(scene):
    """The field of the loaded bake, on every object: for tests of what shows it."""
    assert bpy.ops.prt.light_field_bake(from_bake=True) == {"FINISHED"}


@needs_camera
def test_beside_relit_objects_each_has_one_owner(scene):
    before = [list(o.modifiers.keys()) for o in scene.objects]
    bpy.ops.prt.bake()
    baked = {name: colours_on(name) for name in ("ball", "floor")}
    bpy.ops.prt.light_field_bake()
    ball, floor = scene.objects["ball"], scene.objects["floor"]
    field = colours_on("ball", FIELD)
    assert shown_on(ball) == [FIELD]
    assert shown_on(floor) == ["PRT"]
    scene.prt.exposure = 1.0
    bpy.ops.prt.relight()
    np.testing.assert_allclose(colours_on("floor"), 2 * baked["floor"], rtol=1e-5)
    assert shown_on(ball) == [FIELD]
    scene.frame_set(2)
    np.testing.assert_allclose(colours_on("ball", FIELD), 2 * field, rtol=1e-5)
    # The field goes, the bake takes its object back at once.
    assert bpy.ops.prt.light_field_clear() == {"FINISHED"}
    assert shown_on(ball) == ["PRT"]
    np.testing.assert_allclose(colours_on("ball"), 2 * baked["ball"], rtol=1e-5)
    # The bake goes, the field stays.
    bpy.ops.prt.light_field_load()
    bpy.ops.prt.clear()
    assert shown_on(ball) == [FIELD]
    assert shown_on(floor) == [] and not preview.present(scene)
    assert ball.data.color_attributes.active_color.name == f"{FIELD} Solid"
    assert "PRT preview" in ball.modifiers and "PRT preview" not in floor.modifiers
    np.testing.assert_allclose(colours_on("ball", FIELD), 2 * field, rtol=1e-5)
    bpy.ops.prt.light_field_clear()
    assert shown_on(ball) == []
    assert [list(o.modifiers.keys()) for o in scene.objects] == before
    assert not [b for b in (*bpy.data.materials, *bpy.data.node_groups) if "PRT" in b.name]
    assert not light_fields.present(scene)


@needs_camera
def test_what_modifiers_make_is_shown_by_copies_of_its_own(scene):
    for name in ("ball", "floor"):
        scene.objects[name].modifiers.new("Fine", "SUBSURF").levels = 1
        scene.objects[name].modifiers["Fine"].render_levels = 1
    bpy.ops.prt.bake()
    copies = {o["prt_copy"]: shown_on(o)
              for o in scene.objects if o.get("prt_copy")}  # fmt: skip
    assert copies == {"ball": ["PRT"], "floor": ["PRT"]}
    # A copy that is clicked on stands for what it was made of.
    select(*[o for o in scene.objects if o.get("prt_copy") == "ball"])
    bpy.ops.prt.light_field_bake()

    def copies_of(name):
        return [shown_on(o)
                for o in scene.objects if o.get("prt_copy") == name]  # fmt: skip

    assert (copies_of("ball"), copies_of("floor")) == ([[FIELD]], [["PRT"]])
    copies = {o.session_uid for o in scene.objects if o.get("prt_copy")}
    bpy.ops.prt.relight()
    scene.prt.exposure = 1
    scene.frame_set(2)
    assert (copies_of("ball"), copies_of("floor")) == ([[FIELD]], [["PRT"]])
    # They are written again, not made again.
    assert copies == {o.session_uid for o in scene.objects if o.get("prt_copy")}
    assert scene.objects["ball"].hide_render
    bpy.ops.prt.clear()
    assert (copies_of("ball"), copies_of("floor")) == ([[FIELD]], [])
    assert scene.objects["ball"].hide_render and not scene.objects["floor"].hide_render
    bpy.ops.prt.light_field_clear()
    assert not copies_of("ball") and not scene.objects["ball"].hide_render


@needs_camera
def test_a_preview_that_is_shown_changes_no_capture(scene):
    scene.objects["floor"].modifiers.new("Fine", "SUBSURF").render_levels = 1
    bpy.ops.prt.light_field_bake()
    before = load_light_field(field_list.output_path(scene))
    bpy.ops.prt.light_field_clear()
    scene.prt.use_lamps, scene.prt.exposure = False, 5.0
    bpy.ops.prt.bake()
    scene.prt.field.name = "covered"
    select(scene.objects["ball"])
    bpy.ops.prt.light_field_bake()
    after = load_light_field(field_list.output_path(scene))
    np.testing.assert_array_equal(before.radiance[...], after.radiance[...])


def test_an_older_blender_says_so_and_offers_the_field_of_the_bake(scene, monkeypatch):
    from blender_addon import field_operators

    missing = "needs Blender 4.5 or later for its camera, this is 4.3; take a newer one"
    monkeypatch.setattr(field_operators, "custom_camera_missing", lambda: missing)
    assert "needs Blender 4.5" in why_not("light_field_bake")
    assert "bake the scene, or load a bake, first" in why_not("light_field_bake", from_bake=True)
    bpy.ops.prt.bake()
    relit = {name: colours_on(name) for name in ("ball", "floor")}
    field_of_bake(scene)
    for name, colours in relit.items():
        # The same light through the same transport; lamps have fewer shadow rays there.
        shown = colours_on(name, FIELD)
        assert np.linalg.norm(shown - colours) < 0.02 * np.linalg.norm(colours), name
    assert not [o.name for o in scene.objects if holds(o, ["PRT"])]


@needs_camera
def test_what_cannot_be_captured_is_said(scene):
    bpy.ops.object.select_all(action="DESELECT")
    assert "nothing is selected" in why_not("light_field_bake")
    select(scene.camera)
    assert "nothing that is selected has faces and renders (eye)" in why_not("light_field_bake")
    select(scene.objects["ball"])
    bpy.ops.prt.bake()
    Path(preview.path_of(scene)).rename(field_list.output_path(scene))
    assert "is a bake, not a light field" in why_not("light_field_bake")
    assert "is a bake, not a light field" in why_not("light_field_load")
    bpy.ops.prt.remove(filepath=str(field_list.output_path(scene)))
    assert "there is no such" in why_not("light_field_load")
    assert not scene.prt.field.loaded and work.status().failed


@needs_camera
def test_a_camera_that_is_not_there_is_said_and_shows_nothing(scene):
    scene.camera = None
    assert "has no camera to look through" in why_not("light_field_bake")
    assert not scene.prt.field.loaded and not light_fields.present(scene)
    scene.prt.field.follow = "VIEW"
    assert bpy.ops.prt.light_field_load() == {"FINISHED"}
    assert colours_on("ball", FIELD).max() > 0


@needs_camera
def test_a_render_looks_through_the_camera_and_so_does_each_of_its_frames(scene, tmp_path):
    bpy.ops.prt.light_field_bake()
    path, render = field_list.output_path(scene), scene.render
    scene.prt.field.follow = "VIEW"
    bpy.ops.prt.light_field_load()
    from_view, rendered = colours_on("ball", FIELD), []
    render.engine, scene.cycles.samples = "CYCLES", 1
    render.resolution_x = render.resolution_y = 4
    render.filepath = str(tmp_path / "frame")
    scene.camera.location.x = -3.0
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x = 3.0
    scene.camera.keyframe_insert("location", frame=3)
    scene.frame_start, scene.frame_end = 1, 3

    def note(*_):
        rendered.append(colours_on("ball", FIELD))

    bpy.app.handlers.render_post.append(note)
    try:
        scene.frame_set(3)
        bpy.ops.render.render()
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_post.remove(note)
    assert len(rendered) == 4
    for colours, x in zip(rendered, (3.0, -3.0, 0.0, 3.0), strict=True):
        wanted = wanted_on("ball", path, View(position=(x, -4.0, 2.5)))
        np.testing.assert_allclose(colours, wanted, rtol=1e-4, atol=1e-5, err_msg=str(x))
    assert np.abs(rendered[0] - rendered[1]).max() > 1e-3
    # When it is done the view leads again.
    np.testing.assert_array_equal(colours_on("ball", FIELD), from_view)


@needs_camera
def test_changed_settings_begin_anew_and_the_same_go_on(scene):
    bpy.ops.prt.light_field_bake()
    first = field_list.output_path(scene) / "zarr.json"
    stamp = first.stat().st_mtime_ns
    bpy.ops.prt.light_field_bake()
    assert first.stat().st_mtime_ns == stamp
    scene.prt.field.angles = 3, 7
    bpy.ops.prt.light_field_bake()
    assert light_fields.held(scene).field.angles == (3, 7)


@needs_camera
def test_an_object_that_moved_since_is_said(scene):
    bpy.ops.prt.light_field_bake()
    assert not light_fields.held(scene).warned
    scene.objects["ball"].location.x += 0.5
    bpy.context.view_layer.update()
    bpy.ops.prt.light_field_load()
    assert "ball changed since" in light_fields.held(scene).warned
    scene.objects["ball"].location.x -= 0.5
    bpy.context.view_layer.update()
    bpy.ops.prt.light_field_load()
    assert not light_fields.held(scene).warned
    # As many corners in another order.
    scene.objects["ball"].data.flip_normals()
    bpy.ops.prt.light_field_load()
    assert "ball changed since" in light_fields.held(scene).warned


@needs_camera
def test_a_file_that_gets_a_name_takes_its_light_field_along(addon, tmp_path):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=5, ring_count=3)
    scene = bpy.context.scene
    scene.prt.field.angles, scene.prt.field.samples, scene.prt.field.follow = (2, 3), 1, "VIEW"
    light = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    light.location = 0, 0, 4
    scene.collection.objects.link(light)
    bpy.ops.prt.light_field_bake()
    assert light_fields.path_of(scene).startswith(bpy.app.tempdir)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "mine.blend"))
    home = tmp_path / "prt" / "mine_Scene.slf"
    assert light_fields.path_of(scene) == str(home) and home.is_dir()
    assert light_fields.held(scene) is not None
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "mine.blend"))
    scene = bpy.context.scene
    assert light_fields.path_of(scene) == str(home) and light_fields.held() is None
    shown = colours_on("Sphere", FIELD)
    bpy.ops.prt.light_field_load(filepath=scene.prt.field.loaded)
    np.testing.assert_array_equal(colours_on("Sphere", FIELD), shown)


@needs_camera
def test_the_compressed_form_is_shown_where_it_is_asked_for(scene):
    bpy.ops.prt.light_field_bake()
    path, exact = field_list.output_path(scene), colours_on("ball", FIELD)
    run(compress_light_field_steps(path, "haar", n_coefficients=3))
    bpy.ops.prt.light_field_clear()
    bpy.ops.prt.light_field_load()
    assert light_fields.held(scene).has_compressed
    coarse = colours_on("ball", FIELD)
    slow, used = field_toward(
        load_light_field(path), viewport.view_of(scene, scene.prt.field.follow)
    )
    (ball,) = [o for o in light_fields.held(scene).field.scene.objects if o.name == "ball"]
    assert used == "compressed" and np.abs(coarse - exact).max() > 1e-3 * exact.max()
    np.testing.assert_allclose(coarse, slow[ball.corner_point], rtol=1e-3, atol=1e-4 * slow.max())
    scene.prt.field.use_compressed = False
    scene.frame_set(2)
    np.testing.assert_array_equal(colours_on("ball", FIELD), exact)


def form_of(path):
    """Attributes of a compressed form but its seconds and its folder's, and its bytes."""
    store = BakeStore(path)
    attributes = compressed_attributes(store)
    state = read_compressed(store, attributes)
    # Digests belong to the names of arrays, and so to their folder.
    own = "seconds", "folder", "arrays"
    return {k: v for k, v in attributes.items() if k not in own}, state["data"]


@needs_camera
def test_compress_is_the_api_and_shows_its_form(scene, tmp_path):
    assert "Bake a light field, or load one, first" in why_not("light_field_compress")
    bpy.ops.prt.light_field_bake()
    path, exact = field_list.output_path(scene), colours_on("ball", FIELD)
    shutil.copytree(path, tmp_path / "api.slf")
    scene.prt.field.use_compressed = False
    asked = {"method": "haar", "goal": "ERROR", "tolerance": 0.08}
    assert bpy.ops.prt.light_field_compress(**asked) == {"FINISHED"}
    report = run(
        compress_light_field_steps(tmp_path / "api.slf", "haar", tolerance=float(np.float32(0.08)))
    )
    (ours, our_data), (theirs, their_data) = form_of(path), form_of(tmp_path / "api.slf")
    assert ours == theirs and our_data.tobytes() == their_data.tobytes()
    assert 0.02 < ours["error"] <= 0.08 and f"error {report['error']:.2%}" in work.status().message
    slow, used = field_toward(
        load_light_field(path), viewport.view_of(scene, scene.prt.field.follow)
    )
    (ball,) = [o for o in light_fields.held(scene).field.scene.objects if o.name == "ball"]
    shown = colours_on("ball", FIELD)
    assert used == "compressed" and np.abs(shown - exact).max() > 1e-3 * exact.max()
    np.testing.assert_allclose(shown, slow[ball.corner_point], rtol=1e-3, atol=1e-4 * slow.max())
    (listed,) = work.status().fields
    assert listed.compressed.startswith("haar, ")
    # Another takes its place; what is asked for is kept.
    megabytes = 0.6 * ours["coded_nbytes"] / 1e6
    bpy.ops.prt.light_field_compress(method="haar", goal="SIZE", megabytes=megabytes)
    smaller, _ = form_of(path)
    assert smaller["coded_nbytes"] <= 1e6 * megabytes and smaller["error"] > ours["error"]
    assert bpy.ops.prt.light_field_compress(method="none") == {"FINISHED"}
    assert compressed_attributes(BakeStore(path)) is None and not work.status().fields[0].compressed
    np.testing.assert_array_equal(colours_on("ball", FIELD), exact)


def test_the_methods_of_the_dialog_are_those_there_are():
    items = bpy.ops.prt.light_field_compress.get_rna_type().properties["method"].enum_items
    assert items.keys() == [*METHODS, "none"]


class Compressing(work.LongWork):
    """The operator's work without Blender's operator around it, as a window drives it."""

    kind = field_operators.PRT_OT_light_field_compress
    title, when_stopped = kind.title, kind.when_stopped
    steps, finish = kind.steps, kind.finish
    method, goal, tolerance = "ceob:n_pairs=2", "ERROR", 0.03

    def report(self, *_):
        pass


@needs_camera
def test_compression_leaves_the_window_free_and_can_be_stopped(scene, monkeypatch):
    bpy.ops.prt.light_field_bake()
    path = field_list.output_path(scene)
    run(compress_light_field_steps(path, "haar", tolerance=0.1))
    before = form_of(path)[0]
    monkeypatch.setattr(work, "has_window", lambda context: True)
    manager = SimpleNamespace(
        event_timer_add=lambda *_, **__: None, modal_handler_add=lambda _: None
    )
    window = SimpleNamespace(scene=scene, window=None, window_manager=manager)

    def event(kind, value="NOTHING"):
        return SimpleNamespace(type=kind, value=value)

    operator, stages = Compressing(), set()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    assert "Compress is under way" in why_not("light_field_compress", method="haar")
    assert operator.modal(window, event("ESC", "PRESS")) == {"CANCELLED"}
    assert form_of(path)[0] == before and not work.status().running
    assert work.status().message == "Compress stopped; what there was is as before"
    operator.invoke(window, None)
    while (turned := operator.modal(window, event("TIMER"))) == {"RUNNING_MODAL"}:
        stages.add(work.status().stage)
    assert turned == {"FINISHED"} and len(work.turns) > 3 and stages
    held = [seconds for seconds, stage in work.turns if stage != "end"]
    assert max(held) < 0.5, work.turns
    assert form_of(path)[0]["method"] == "ceob:n_pairs=2"
    assert light_fields.held(scene).has_compressed


@needs_camera
def test_the_list_tells_what_there_is(scene):
    bpy.ops.prt.light_field_bake()
    broken = field_list.output_path(scene).with_name("broken.slf")
    broken.mkdir()
    (broken / "zarr.json").write_text("{")
    field_list.refresh(scene)
    listed = {item.name: item for item in work.status().fields}
    assert (
        "5 x 3 directions, 1 light, noise" in listed[Path(light_fields.path_of(scene)).stem].about
    )
    assert set(listed) <= {Path(light_fields.path_of(scene)).stem, "broken"}
