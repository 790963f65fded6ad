"""The live preview: colours that follow the light, in the moments between the user's events.

Changes only leave a mark here; one timer does the work in short steps. While it works further
marks change nothing but what comes next, so that dragging a slider never queues. Lamps are drawn
with few rays first and with all of them when nothing changes any more.
"""

import time

import bpy
from bpy.app.handlers import persistent

from prt_core import run
from prt_core.blender.identity import by_uid
from prt_core.blender.stand_ins import arrange

from . import (
    bakes,
    field_list,
    following,
    freshness,
    gloss,
    plan,
    preview,
    reflections,
    rendering,
    showing,
    work,
)
from .evaluated import what_changed
from .idle_work import IdleWork
from .own_changes import are_own, is_own, own_changes
from .request import request

# Seconds: between looks when there is nothing to do; of quiet before lamps get all their rays
# and plans are made; of work in one call of the timer, and in the call that a slider makes where
# there are few points.
_IDLE, _QUIET, _BUDGET, _HOLD, _FEW = 0.05, 0.35, 0.02, 0.2, 20000
# Shadow rays a lamp while it moves.
_DRAFT = 4


class _State(IdleWork):
    """What is to be done beside what is under way."""

    def forget(self):
        self.scene = None  # session_uid of the scene to relight
        self.show = False  # whether the look has changed, not only the light
        self.touched = 0.0  # when something changed last
        self.kind = None  # of the job: "draft", "full", "check" or "plan"
        self.previewed = False  # whether a scene of the file showed a preview when last looked at
        self.at = None  # session_uid of the scene that was looked at
        self.rearrange = False  # whether objects came or went
        self.begun = False  # whether the timer has looked at the file


_NOW = _State()
# Seconds from a change to its colours, of the last hundred (for measuring).
delays = []


def touch(scene, show=False):
    """The light of a scene, or the look of its preview, has changed."""
    if bpy.app.background or are_own():
        return
    _NOW.scene = scene.session_uid
    _NOW.show |= show
    _NOW.touched = time.perf_counter()


def start():
    """Begin at once with what a button or slider asked for, before Blender draws it: what is
    ready within a moment is drawn with the change, and only once."""
    if not (_NOW.job is None and _NOW.begun) or rendering.is_under_way() or work.status().running:
        return
    # Lamps are read where they are evaluated, and that takes back what a script has set on
    # something animated and not keyed yet.
    if bpy.data.actions:
        return
    _begin()
    if _soon():
        _go_on(_HOLD)


def geometry_changed(scene):
    """Objects, or how they are baked, have changed."""
    plan.outdate(scene)
    following.geometry_changed()


def settings_changed(scene):
    """How a scene would be baked has changed, not what."""
    plan.outdate(scene, geometry=False)


def note_preview():
    """(whether the file showed a preview when last asked, whether it does): undo may take it."""
    before = _NOW.previewed
    _NOW.previewed = any(s.prt.loaded or s.prt.field.loaded for s in bpy.data.scenes)
    return before, _NOW.previewed


def another_file():
    """Nothing that is to be done outlives the file."""
    showing.forget()
    _NOW.__init__()


def look_again(scene):
    """Colours, hidden objects and what is known of the scene may be of another state."""
    plan.outdate(scene)
    held = preview.held(scene)
    if held is not None:
        held.shown = None
    following.look_again()
    _NOW.rearrange = True


def idle():
    """Whether the colours are those of the light as it is now, with all rays."""
    return _NOW.scene is None and _NOW.job is None and gloss.idle(bpy.context.scene)


def stop():
    """Drop what is under way."""
    following.stop()
    gloss.stop()
    _drop()


def _drop():
    _NOW.stop()
    _NOW.kind = None


def _tick():
    """The one timer; returns the seconds until it wants to be called again."""
    try:
        if work.status().running or rendering.is_under_way():
            stop()
            look = None if rendering.is_under_way() else showing.tick(_NOW.touched)
            return _IDLE if look is None else look
        # A view that moves comes first: it is drawn anew anyway.
        looks = [following.tick()]
        if _NOW.kind != "draft":
            # Full rays of lamps wait until the view stands still.
            if gloss.moves(bpy.context.scene) and _NOW.kind == "full":
                _drop()
            if _NOW.kind != "full":
                looks.append(gloss.tick())
        if idle() and gloss.is_stale(bpy.context.scene):
            touch(bpy.context.scene, show=True)
        if _NOW.job is None and bpy.context.mode == "OBJECT":
            preview.see_again(bpy.context.scene)
            reflections.follow(bpy.context.scene)
        return min([_work(), _IDLE, *(look for look in looks if look is not None)])
    except Exception:
        stop()
        _NOW.scene = None
        work.say("The live preview failed; the system console has the details", True)
        raise


def _work():
    if not _NOW.begun:
        # The add-on was enabled, or a file loaded: colours may be of an older light.
        _NOW.begun = _NOW.rearrange = True
        touch(bpy.context.scene, show=True)
    _look_around()
    if _NOW.job is None or (_NOW.kind == "full" and _changed_lately()):
        _drop()
        _begin()
    if _NOW.job is None:
        return _IDLE
    _go_on(_HOLD / 2 if _soon() and _NOW.kind == "draft" else _BUDGET)
    return 0.0 if _NOW.job is not None else _IDLE / 5


def _look_around():
    """Small things that no event tells of at the time when they can be done."""
    scene = bpy.context.scene
    if scene.session_uid != _NOW.at:
        if _NOW.at is not None:
            work.say("")  # it was said of the scene before
        bakes.refresh(scene)
        field_list.refresh(scene)
        _NOW.at = scene.session_uid
    if _NOW.rearrange and not _changed_lately():
        _NOW.rearrange = False
        for each in bpy.data.scenes:
            arrange(each)


def _soon():
    """Whether colours take a moment only: waited for, they are drawn with what changed."""
    held = preview.held()
    return held is not None and (
        held.blend.used == "compressed" or held.bake.transport.n_points <= _FEW
    )


def _go_on(seconds):
    """So many seconds of the job, or the rest of it."""
    try:
        if _NOW.go_on(seconds):
            _NOW.kind = None
    except work.FAILURES as error:
        _NOW.job = _NOW.kind = _NOW.scene = None
        work.say(str(error), True)


def _changed_lately():
    return time.perf_counter() - _NOW.touched < _QUIET


def _begin():
    """Start what is most urgent: colours of the new light, then their full rays, then a look at
    the scene: a plan where the panel asks for one, else whether the bake is still of it."""
    scene = by_uid(bpy.data.scenes, _NOW.scene) if _NOW.scene else None
    if scene is not None and scene.prt.loaded and scene.prt.live:
        draft = _changed_lately()
        if not draft and gloss.moves(scene):
            return
        gloss.stop()
        _NOW.job, _NOW.kind = _relight_steps(scene, draft), "draft" if draft else "full"
        return
    _NOW.scene = None
    if _changed_lately():
        return
    scene = plan.wanted()
    if scene is not None:
        _NOW.job, _NOW.kind = _plan_steps(scene), "plan"
    elif _wants_check(bpy.context.scene):
        _NOW.job, _NOW.kind = _check_steps(bpy.context.scene), "check"


def _wants_check(scene):
    """Whether the scene of the bake in memory was changed, and is read in a moment."""
    if preview.held(scene) is None:
        return False
    read, holds = plan.reading(scene)
    return read is None or (not holds and plan.is_quick(read))


def _plan_steps(scene):
    bakes.refresh(scene)
    field_list.refresh(scene)
    uid = scene.session_uid
    try:
        yield from plan.steps(scene, work.PACE, bakes.rate(plan.back_end(scene)), again=False)
    except work.FAILURES:
        pass  # the plan keeps what is wrong, and the panel draws it
    freshness.note(by_uid(bpy.data.scenes, uid))
    work.redraw()


def _check_steps(scene):
    uid, held = scene.session_uid, preview.held(scene)
    yield from freshness.check_steps(scene, held, work.PACE)
    freshness.note(by_uid(bpy.data.scenes, uid))
    work.redraw()


def _relight_steps(scene, draft):
    since, uid = _NOW.touched, scene.session_uid
    held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
    scene = by_uid(bpy.data.scenes, uid)
    if scene is None:
        return
    if plan.reading(scene)[0] is None:
        # A file was opened: is its bake still one of this scene?
        yield from _check_steps(scene)
        scene = by_uid(bpy.data.scenes, uid)
        if scene is None:
            return
    full = request(scene)
    # Where the lamps stay as they are, the first colours are the last.
    draft = draft and not held.blend.has_lamps(full.lights)
    asked = request(scene, min(_DRAFT, scene.prt.lamp_samples)) if draft else full
    last = asked.key == full.key
    shown = held.shown
    if shown is not None and shown.key == full.key and not _NOW.show:
        _done(since)
        return
    if shown is not None and shown.key == asked.key and not _NOW.show:
        return  # the draft is there; the full rays come when all is quiet
    radiance = yield from asked.steps(held, work.PACE)
    yield from show_steps(uid, held, radiance, asked, work.PACE)
    delays.append(time.perf_counter() - since)
    del delays[:-100]
    if last:
        _done(since)


def _done(since):
    if _NOW.touched == since:
        _NOW.scene, _NOW.show = None, False


def show_steps(uid, held, radiance, asked, pace=None):
    """Write colours on a scene's meshes; objects that were renamed are found by what they are."""
    scene = by_uid(bpy.data.scenes, uid)
    if preview.missing(scene, held):
        yield from freshness.check_steps(scene, held, pace)
        scene = by_uid(bpy.data.scenes, uid)
    with own_changes(scene):
        preview.write(scene, held, radiance, asked)
    work.redraw()


@persistent
def _updated(scene, depsgraph):
    """Blender evaluated a change: was it the light, or what is baked?"""
    if are_own() or bpy.app.background or is_own(scene):
        return
    light, geometry = what_changed(depsgraph)
    if any(isinstance(update.id, bpy.types.Material) for update in depsgraph.updates):
        _NOW.show |= preview.outdate_materials(scene)
    if not geometry and any(isinstance(u.id, bpy.types.Collection) for u in depsgraph.updates):
        geometry = plan.regrouped(scene)
    _NOW.rearrange |= any(isinstance(u.id, bpy.types.Collection | bpy.types.Scene)
                          for u in depsgraph.updates)  # fmt: skip
    if geometry:
        geometry_changed(scene)
    if light or geometry:
        touch(scene)


@persistent
def _frame_changed(scene, depsgraph=None):
    """A new frame: at once where it is rendered or there is no window, else by the timer."""
    if not scene.prt.loaded or is_own(scene):
        return
    if not (rendering.is_under_way() or bpy.app.background):
        if depsgraph is not None and what_changed(depsgraph)[1]:
            geometry_changed(scene)
        touch(scene)
        return
    if not scene.prt.live:
        return
    try:
        run(_frame_steps(scene, depsgraph))
    except work.FAILURES as error:
        work.say(f"frame {scene.frame_current}: {error}", True)
        print(f"PRT: frame {scene.frame_current}: {error}")


def _frame_steps(scene, depsgraph):
    held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
    yield from freshness.frame_steps(scene, held, depsgraph, aloud=True)
    asked = request(scene, depsgraph=depsgraph, rendered=rendering.is_under_way())
    if held.shown is not None and held.shown.looks_like(asked):
        return
    radiance = yield from asked.steps(held)
    if preview.missing(scene, held):
        yield from freshness.check_steps(scene, held)
    preview.write(scene, held, radiance, asked)


def _render_begins(scene):
    stop()
    if scene.prt.loaded and scene.prt.live:
        _frame_changed(scene)


_HANDLERS = (("depsgraph_update_post", _updated), ("frame_change_post", _frame_changed))


def register():
    rendering.begins.append(_render_begins)
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)
    if not bpy.app.background:
        bpy.app.timers.register(_tick, first_interval=_IDLE, persistent=True)


def unregister():
    stop()
    _NOW.__init__()
    rendering.begins.remove(_render_begins)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
