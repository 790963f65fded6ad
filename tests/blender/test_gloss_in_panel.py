"""Gloss in the panel without a window: colours that follow the view, the timer called by hand."""

import shutil
import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from blender_addon import gloss, live, panel_look, plan, preview, rendering, viewport, work
from blender_addon.request import request, view_of
from prt_core import load
from prt_core.relight.relighter import Relighter
from prt_core.transport import View
from prt_core.transport.view_map import ViewMap
from tests.blender.conftest import colours_on
from tests.blender.test_gloss_bake import gild
from tests.blender.test_preview_state import Layout

EYE = (1.5, -4.0, 2.5)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Where the first bake is kept for all tests."""
    return tmp_path_factory.mktemp("gold") / "kept"


@pytest.fixture
def scene(floor_scene, kept, tmp_path):
    """A golden ball on a floor, baked with gloss, seen from a camera."""
    gild()
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    floor_scene.collection.objects.link(eye)
    floor_scene.camera = eye
    look_from(EYE)
    floor_scene.prt.gloss, floor_scene.prt.seen_from = True, "CAMERA"
    if kept.is_dir():
        shutil.copytree(kept, tmp_path / "prt")
        assert bpy.ops.prt.load() == {"FINISHED"}
    else:
        assert bpy.ops.prt.bake() == {"FINISHED"}
        shutil.copytree(tmp_path / "prt", kept)
    return floor_scene


def look_from(place):
    bpy.data.objects["eye"].location = place
    bpy.context.view_layer.update()


def above(view, bake):
    return view.above(bake.scene.to_world(bake.scene.points.positions), bake.scene.points.normals)


def wanted(scene, view):
    """Colours of the ball by the core alone, from the disk."""
    bake = load(plan.output_path(scene))
    if view is not None and scene.prt.seen_from == "CAMERA":
        view = above(view, bake)
    relighter = Relighter(bake, "blender")
    try:
        return bake.colours(relighter.radiance(request(scene).lighting, view=view))["ball"]
    finally:
        relighter.close()


def settle(scene):
    """Let the timer look until all is done; how fine what was shown in between is."""
    fineness, end = [], time.perf_counter() + 30
    while True:
        gloss.tick()
        fineness.append(preview.held(scene).shown.every)
        if gloss.idle(scene) and not gloss.moves(scene):
            return fineness
        assert time.perf_counter() < end
        time.sleep(0.005)


def test_colours_are_those_of_the_api_and_follow_the_view_alone(scene, monkeypatch):
    first = colours_on("ball")
    np.testing.assert_array_equal(first, wanted(scene, View(position=EYE)))
    settle(scene)
    # The light is not worked out again, whoever asks.
    with monkeypatch.context() as alone:
        alone.setattr(Relighter, "steps", None)
        look_from((-3.0, 2.0, 4.0))
        assert settle(scene)[-1] == 1
        second = colours_on("ball")
        scene.camera.data.type = "ORTHO"
        bpy.context.view_layer.update()
        settle(scene)
        third = colours_on("ball")
        assert bpy.ops.prt.relight() == {"FINISHED"}
    np.testing.assert_array_equal(second, wanted(scene, View(position=(-3.0, 2.0, 4.0))))
    np.testing.assert_array_equal(third, wanted(scene, View(direction=(0, 0, 1))))
    assert np.abs(second - first).max() > 0.05 * first.max()
    assert not work.status().failed


def test_metal_is_not_black_from_elsewhere(scene):
    bake = preview.held(scene).bake
    view = View(position=EYE)
    around = above(view, bake)
    normals = bake.scene.points.normals
    places = bake.scene.to_world(bake.scene.points.positions)
    plain, bent = view.outgoing(places), around.outgoing(places)
    facing = np.einsum("nx,nx->n", normals, plain) >= 0
    assert facing.any() and not facing.all()
    np.testing.assert_allclose(bent[facing], plain[facing], atol=1e-12)
    assert (np.einsum("nx,nx->n", normals, bent) > -1e-6).all()
    corner = bake.scene.objects[[o.name for o in bake.scene.objects].index("ball")].corner_point
    shown, before = colours_on("ball"), bake.colours(
        preview.held(scene).relighter.radiance(request(scene).lighting, view=view)
    )["ball"]  # fmt: skip
    behind = ~facing[corner]
    # But for some whose lobes graze their surface.
    same = np.isclose(shown[~behind], before[~behind], atol=1e-5).all(axis=1)
    assert same.mean() > 0.98
    np.testing.assert_allclose(shown[~behind], before[~behind], atol=2e-3)
    assert shown[behind].max(axis=1).mean() > 5 * before[behind].max(axis=1).mean()


def test_a_view_that_moves_is_coarse_and_the_newest_takes_the_place_of_older_ones(scene):
    settle(scene)
    look_from((-3.0, 2.0, 4.0))
    fineness = settle(scene)
    assert 8 in fineness and fineness[-1] == 1
    # A fine one is under way when the view moves on.
    look_from((0.5, 3.0, 2.0))
    gloss.moves(scene)
    gloss._NOW.moved, gloss._NOW.moving = -1.0, 8
    gloss._begin(scene)
    older = gloss._NOW.job
    assert gloss._NOW.every == 1
    look_from((4.0, 1.0, 2.0))
    before, gloss._NOW.moving = gloss.written[0], 8
    gloss.tick()  # the older one ends without colours
    assert older.gi_frame is None and gloss._NOW.every in (4, 8, 16) and gloss.moves(scene)
    settle(scene)
    # One or some of fewer points, then that of all.
    assert gloss.written[0] - before <= 6
    np.testing.assert_array_equal(colours_on("ball"), wanted(scene, View(position=(4.0, 1.0, 2.0))))


def facing(item, eye):
    """(n_corners,): cosines between normals and the way to an eye, at a mesh's corners."""
    mesh, matrix = item.data, item.matrix_world
    places = np.array([matrix @ vertex.co for vertex in mesh.vertices])
    normals = np.array([vertex.normal for vertex in mesh.vertices])
    way = np.asarray(eye) - places
    cosine = np.einsum("nx,nx->n", way, normals) / np.linalg.norm(way, axis=1)
    return cosine[[corner.vertex_index for corner in mesh.loops]]


def test_maps_of_views_are_made_in_quiet_moments_and_serve_while_it_moves(scene, monkeypatch):
    # So few points would not be worth it.
    monkeypatch.setattr(ViewMap.__init__, "__defaults__", (0, None))
    shader = bpy.data.materials["gold"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.6
    assert bpy.ops.prt.bake() == {"FINISHED"}

    def look_until(done):
        end = time.perf_counter() + 60
        while not done():
            gloss.tick()
            assert time.perf_counter() < end
            time.sleep(0.002)

    def shown():
        return preview.held(scene).shown

    def has_maps():
        return preview.held(scene).blend.maps_views(shown().lights)

    settle(scene)
    gloss.tick()
    assert not has_maps() and gloss._NOW.job is None, "the view has not moved yet"
    look_from((-3.0, 2.0, 4.0))
    settle(scene)
    look_until(has_maps)
    other = View(position=(0.5, 3.0, 2.0))
    look_from(other.position)
    look_until(lambda: shown().mapped)
    quick = colours_on("ball")
    settle(scene)
    assert not shown().mapped and shown().every == 1
    fine = wanted(scene, other)
    np.testing.assert_array_equal(colours_on("ball"), fine)
    # What faces away is looked up as if it were seen at its rim, which nobody sees.
    seen = facing(bpy.data.objects["ball"], other.position) > 0.05
    away = np.linalg.norm((quick - fine)[seen])
    assert seen.sum() > 1000 and 0 < away < 0.03 * np.linalg.norm(fine[seen])
    # A view that moves while maps are made does not wait for them.
    relighter = preview.held(scene).blend.relighter(shown().lights[0].name)
    relighter._gloss._maps = None
    for part in relighter._gloss._parts:
        part._map = None
    gloss.tick()
    assert gloss._NOW.maps and gloss.idle(scene)
    look_from((-3.0, 2.0, 4.0))
    gloss.tick()
    assert not gloss._NOW.maps and not has_maps()
    settle(scene)


def test_fewer_points_are_evaluated_where_there_is_no_time_and_it_helps(addon):
    def moving(seconds):
        for _ in range(9):
            gloss._adapt(seconds(gloss._NOW.moving), gloss._NOW.moving)
        return gloss._NOW.moving

    gloss._NOW.__init__()
    assert gloss._NOW.moving == 8
    assert moving(lambda every: 8 / every) == 32
    gloss._adapt(9.0, 16)
    assert gloss._NOW.moving == 32, "that was of the time before"
    assert moving(lambda every: 0.01 / every) == 1
    gloss._NOW.__init__()
    # Where what is left takes long, fewer points help little.
    assert moving(lambda every: 0.2 + 0.8 / every) in (4, 8)


def test_gloss_is_turned_off_and_on(scene):
    on = colours_on("ball")
    scene.prt.show_gloss = False
    assert bpy.ops.prt.relight() == {"FINISHED"}
    np.testing.assert_array_equal(colours_on("ball"), wanted(scene, None))
    assert gloss.idle(scene) and gloss.tick() is None
    assert drawn_gloss() == ["show_gloss"]
    scene.prt.show_gloss = True
    assert bpy.ops.prt.relight() == {"FINISHED"}
    np.testing.assert_array_equal(colours_on("ball"), on)
    assert drawn_gloss() == ["show_gloss", "seen_from", "seen_by"]
    scene.prt.seen_from = "VIEW"
    assert drawn_gloss() == ["show_gloss", "seen_from"]


def test_another_camera_of_the_scene_is_looked_through(scene):
    own = colours_on("ball")
    other = bpy.data.objects.new("other", bpy.data.cameras.new("other"))
    scene.collection.objects.link(other)
    other.location = (-3.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    scene.prt.seen_by = other
    assert bpy.ops.prt.relight() == {"FINISHED"}
    there = colours_on("ball")
    np.testing.assert_array_equal(there, wanted(scene, View(np.array(other.location))))
    assert np.abs(there - own).max() > 0.02
    # Renders go on looking through the scene's own, and so does what has lost it.
    own_view, chosen = (viewport.view_of(scene, "CAMERA", rendered) for rendered in (True, False))
    np.testing.assert_allclose(own_view.position, scene.camera.location)
    np.testing.assert_allclose(chosen.position, other.location)
    scene.collection.objects.unlink(other)
    np.testing.assert_allclose(viewport.view_of(scene, "CAMERA").position, scene.camera.location)


class Writing(Layout):
    def prop(self, _settings, name, **_):
        self.drawn.append(name)

    def column(self, **_):
        return self

    row = column


def drawn_gloss():
    layout, scaled = Writing(), SimpleNamespace(system=SimpleNamespace(ui_scale=1))
    wide = SimpleNamespace(width=10_000)
    panel_look.draw_gloss(
        layout, SimpleNamespace(scene=bpy.context.scene, region=wide, preferences=scaled)
    )
    return layout.drawn


def test_a_bake_without_gloss_says_why(floor_scene):
    assert drawn_gloss() == []
    bpy.ops.prt.bake()
    held = preview.held(floor_scene)
    assert preview.no_gloss(held).startswith("Baked without Gloss")
    assert drawn_gloss() == [preview.no_gloss(held)]
    assert view_of(floor_scene) is None and gloss.tick() is None and gloss.idle(floor_scene)
    floor_scene.prt.gloss, floor_scene.prt.name = True, "dull"
    for item in floor_scene.objects:
        if item.type == "MESH":
            item.data.materials.clear()
    bpy.ops.prt.bake()
    assert preview.no_gloss(preview.held(floor_scene)) == "The materials of this bake have no gloss"


def test_a_light_that_another_asked_for_is_worked_out_again(scene):
    held = preview.held(scene)
    assert not gloss.is_stale(scene)
    strong = request(scene)
    held.relighter.radiance(strong.lighting, view=strong.view)
    assert gloss.is_stale(scene) and gloss.tick() is None and gloss.idle(scene)
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert not gloss.is_stale(scene)


def test_renders_look_through_the_camera(scene, tmp_path):
    scene.prt.seen_from = "VIEW"
    bpy.ops.prt.relight()
    from_view, rendered = colours_on("ball"), []
    view = viewport.view_of(scene, "VIEW")
    np.testing.assert_array_equal(from_view, wanted(scene, view))
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.filepath = str(tmp_path / "frame")
    scene.camera.location.x = -3.0
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x = 3.0
    scene.camera.keyframe_insert("location", frame=2)
    scene.frame_start, scene.frame_end = 1, 2

    def note(*_):
        rendered.append((colours_on("ball"), rendering.is_under_way()))

    bpy.app.handlers.render_post.append(note)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_post.remove(note)
    assert [flag for _, flag in rendered] == [True, True] and not rendering.is_under_way()
    for (colours, _), x in zip(rendered, (-3.0, 3.0), strict=True):
        np.testing.assert_array_equal(colours, wanted(scene, View(position=(x, *EYE[1:]))))
    # Afterwards the view leads again.
    settle(scene)
    np.testing.assert_array_equal(colours_on("ball"), from_view)


def test_a_camera_that_is_not_there_is_said_once(scene):
    settle(scene)
    scene.camera = None
    assert gloss.tick() is not None
    assert "view: the scene 'Scene' has no camera to look through" in work.status().message
    work.say("")
    gloss.tick()
    assert work.status().message == ""
    with pytest.raises(RuntimeError, match="no camera to look through; add one, or choose"):
        bpy.ops.prt.relight()


def test_objects_that_are_renamed_or_gone_meanwhile(scene):
    settle(scene)
    scene.objects["ball"].name = "globe"
    look_from((-3.0, 2.0, 4.0))
    settle(scene)
    np.testing.assert_array_equal(
        colours_on("globe"), wanted(scene, View(position=(-3.0, 2.0, 4.0)))
    )
    bpy.data.objects.remove(scene.objects["globe"])
    look_from(EYE)
    before, end = gloss.written[0], time.perf_counter() + 20
    while not work.status().failed and time.perf_counter() < end:
        gloss.tick()
    # Said once, not tried again until the view moves on.
    assert work.status().failed and gloss._NOW.job is None
    while gloss.moves(scene):
        time.sleep(0.02)
    gloss.tick()
    assert gloss._NOW.job is None and gloss.idle(scene) and gloss.written[0] == before


def test_kept_colours_are_those_of_the_view_at_that_time(scene):
    look_from((-3.0, 2.0, 4.0))
    assert bpy.ops.prt.keep(attribute="Mine") == {"FINISHED"}
    kept = colours_on("ball", "Mine")
    np.testing.assert_array_equal(kept, wanted(scene, View(position=(-3.0, 2.0, 4.0))))
    look_from(EYE)
    settle(scene)
    np.testing.assert_array_equal(colours_on("ball", "Mine"), kept)


def test_full_rays_wait_until_the_view_stands(scene):
    settle(scene)
    live._NOW.scene, live._NOW.touched = scene.session_uid, -1.0
    look_from((0.5, 3.0, 2.0))
    try:
        live._begin()
        assert live._NOW.job is None
        settle(scene)
        live._begin()
        assert live._NOW.kind == "full"
    finally:
        live.stop()
        live.another_file()
