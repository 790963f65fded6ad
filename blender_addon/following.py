"""Colours of a light field that follow the view, the lamps and the timeline.

The timer of the live preview asks here first. A move is looked for, never told of, and what is
there when it is looked for is shown: moves never queue.
"""

import time

import bpy
from bpy.app.handlers import persistent

from prt_core import run
from prt_core.blender.identity import by_uid

from . import light_fields, preview, rendering, viewport, work
from .idle_work import IdleWork
from .own_changes import is_own, own_changes

# Seconds: between looks at the view; of work in one call; of quiet before objects that moved are
# looked at.
_LOOK, _BUDGET, _QUIET = 1 / 60, 0.02, 0.35


class _State(IdleWork):
    """What is under way; nothing of it outlives the file."""

    def forget(self):
        self.failed = None  # the key of what went wrong, so that it is said once
        self.moved = None  # when geometry changed that was not looked at yet


_NOW = _State()
# For measuring: of the last frames the seconds of the look-up, of writing the colours, and of
# Blender's evaluation; and how many there were.
frames, written = [], [0]


another_file, stop = _NOW.another_file, _NOW.stop


def idle(scene):
    """Whether a scene's colours are those of its view and lamps as they are now."""
    shown = light_fields.held(scene)
    if not scene.prt.field.loaded or not scene.prt.live:
        return True
    if _NOW.job is not None or _NOW.moved is not None:
        return False
    return shown is not None and shown.shown == key_of(scene)


def start():
    """Begin at once with what a slider asked for, before Blender draws it."""
    if not (bpy.app.background or work.status().running or bpy.app.is_job_running("RENDER")):
        tick()


def geometry_changed():
    """Objects have changed: are those of the light field where they were?"""
    _NOW.moved = time.perf_counter()


def look_again():
    """Colours may be of another state."""
    shown = light_fields.held()
    if shown is not None:
        shown.shown = None
        geometry_changed()
    _NOW.failed = None


def key_of(scene, view=None):
    """What the colours depend on: views and lamps of one key look the same."""
    view = _view_of(scene) if view is None else view
    lamps = tuple((lamp.name, lamp.strength, *lamp.colour) for lamp in scene.prt.field.lamps)
    settings = scene.prt.domain, scene.prt.look, scene.prt.exposure
    field = light_fields.path_of(scene), scene.prt.field.use_compressed
    return viewport.place_of(view), lamps, settings, field


def _view_of(scene, *rendered):
    return viewport.view_of(scene, scene.prt.field.follow, *rendered)


def tick():
    """One look at the view, and the colours of what is seen there.

    Returns
    -------
    float or None
        Seconds until it wants to look again; None where there is nothing to follow.
    """
    scene = bpy.context.scene
    if not (scene.prt.field.loaded and scene.prt.live) or rendering.is_under_way():
        stop()
        return None
    if bpy.context.mode.startswith("EDIT"):
        return _LOOK
    viewport.look_around()
    try:
        if _NOW.job is None:
            _begin(scene)
        if _NOW.go_on(_BUDGET):
            _NOW.failed = None
    except work.FAILURES as error:
        stop()
        work.say(str(error), True)
    return _LOOK


def _begin(scene):
    try:
        key = key_of(scene)
    except work.FAILURES as error:
        key = str(error)
        if _NOW.failed != key:
            _NOW.failed = key
            raise
        return
    shown = light_fields.held(scene)
    differs = shown is None or shown.shown != key or preview.is_seen_otherwise(scene, shown)
    if key != _NOW.failed and differs:
        _NOW.failed = key
        _NOW.job = show_steps(scene)
    elif _NOW.moved is not None and time.perf_counter() - _NOW.moved > _QUIET:
        _NOW.moved = None
        if shown is not None:
            light_fields.check_moved(scene, shown)
            work.redraw()


def show_steps(scene, view=None):
    """Colours of a scene's light field towards a view (default: as the panel says) on its meshes.

    A generator of `Progress`; returns the `ShownField`.
    """
    uid, path = scene.session_uid, light_fields.path_of(scene)
    if light_fields.held(scene) is None:
        shown = yield from light_fields.load_steps(path, scene.prt.field.use_compressed)
        scene = by_uid(bpy.data.scenes, uid)
        if scene is None or light_fields.path_of(scene) != path:
            return shown
        light_fields.check_moved(scene, shown)
    shown = light_fields.held(scene)
    light_fields.add_lamps(scene, shown)
    start = time.perf_counter()
    view = _view_of(scene) if view is None else view
    key = key_of(scene, view)
    radiance = yield from shown.viewer.steps(view, light_fields.weights(scene, shown))
    scene, looked_up = by_uid(bpy.data.scenes, uid), time.perf_counter()
    if scene is None:
        return shown
    with own_changes(scene):
        light_fields.write(scene, shown, radiance, key)
        wrote = time.perf_counter()
    frames.append((looked_up - start, wrote - looked_up, time.perf_counter() - wrote))
    del frames[:-1000]
    written[0] += 1
    return shown


@persistent
def _frame_changed(scene, depsgraph=None):
    """A new frame that is rendered, or that no window shows: at once."""
    settings = scene.prt
    if not (settings.field.loaded and settings.live) or is_own(scene):
        return
    if not (rendering.is_under_way() or bpy.app.background):
        return
    try:
        rendered = rendering.is_under_way()
        run(show_steps(scene, _view_of(scene, rendered, depsgraph if rendered else None)))
    except work.FAILURES as error:
        work.say(f"frame {scene.frame_current}: {error}", True)
        print(f"PRT: frame {scene.frame_current}: {error}")


def _render_begins(scene):
    stop()
    if scene.camera is not None:
        _frame_changed(scene)


def register():
    bpy.app.handlers.frame_change_post.append(_frame_changed)
    rendering.begins.append(_render_begins)


def unregister():
    another_file()
    light_fields.forget()
    bpy.app.handlers.frame_change_post.remove(_frame_changed)
    rendering.begins.remove(_render_begins)
