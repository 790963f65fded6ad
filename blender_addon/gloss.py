"""Colours of a bake with gloss that follow the view, while the light stays as it is.

The timer of the live preview asks here. A move is looked for, never told of, and what is seen when
it is looked for is shown: moves never queue. While the view moves, lobes are evaluated at as many
points as fit into a moment, and at all of them when it stands still. After a first move, maps of
all views are made in quiet moments; then wide lobes of all points are looked up while it moves.
"""

import time

import bpy
import numpy as np

from prt_core.blender.identity import by_uid

from . import freshness, preview, rendering, viewport, work
from .idle_work import IdleWork
from .own_changes import own_changes
from .request import view_of

# Seconds: between looks at the view; of work in one call; of quiet before all points have their
# own lobes; that a view may take while it moves.
_LOOK, _BUDGET, _QUIET, _MOMENT = 1 / 60, 0.02, 0.2, 0.08
# Points that one stands for while the view moves: at first, and at most.
_FIRST, _MOST = 8, 32
# Half as many points are worth it where they take less than this share of the time.
_WORTH = 0.8


class _State(IdleWork):
    """What is under way; nothing of it outlives the file."""

    def forget(self):
        self.every = 1  # of the job
        self.turned = False  # whether the view has ever moved
        self.place = None  # from where it was looked when last asked
        self.moved = 0.0  # when that changed
        self.maps = self.mapped = False  # whether the job makes maps of views, or looks up there
        self.failed = self.said = None  # where something went wrong, and what: once is enough
        self.moving = _FIRST  # one of so many points while the view moves
        self.took = {}  # by these numbers: seconds of the last view
        self.bake = None  # path of the bake that this was found for


_NOW = _State()
# For measuring: of the last views the seconds of all, and one of how many points was evaluated.
frames, written = [], [0]


another_file, stop = _NOW.another_file, _NOW.stop


def idle(scene):
    """Whether a scene's colours are those of its view, of all points."""
    if not _follows(scene):
        return True
    shown, place = preview.held(scene).shown, _place(scene)
    done = shown.every == 1 and not shown.mapped and shown.place == place
    return (_NOW.job is None or _NOW.maps) and (done or place == _NOW.failed)


def moves(scene):
    """Whether the view of a scene with gloss moved a moment ago."""
    if not _follows(scene):
        return False
    _look(scene)
    return time.perf_counter() - _NOW.moved < _QUIET


def tick():
    """One look at the view, and the colours of what is seen from there.

    Returns
    -------
    float or None
        Seconds until it wants to look again; None where there is nothing to follow.
    """
    scene = bpy.context.scene
    if not _follows(scene) or rendering.is_under_way():
        stop()
        return None
    if bpy.context.mode.startswith("EDIT"):
        return _LOOK
    try:
        moving = moves(scene)
        if _NOW.job is None or (moving and _is_slow(scene)):
            _begin(scene)
        if _NOW.job is None and _NOW.turned and not moving:
            _map_views(scene)
        if _NOW.go_on(_BUDGET) and not _NOW.maps:
            _NOW.failed = _NOW.said = None
    except work.FAILURES as error:
        stop()
        if _NOW.said != str(error):
            work.say(str(error), True)
        _NOW.failed, _NOW.said = _NOW.place, str(error)
    return 0.0 if _NOW.job is not None else _LOOK


def _is_slow(scene):
    """Whether what is under way takes longer than a view that moves may."""
    if _NOW.maps or _NOW.every < _NOW.moving:
        return True
    held = preview.held(scene)
    return not _NOW.mapped and held.blend.maps_views(held.shown.lights)


def is_stale(scene):
    """Whether a scene shows gloss, and the light that it shows has to be worked out again."""
    return _shows(scene) and not _follows(scene)


def _shows(scene):
    held, settings = preview.held(scene), scene.prt
    if held is None or held.shown is None or held.shown.view is None:
        return False
    return settings.live and settings.show_gloss


def _follows(scene):
    """Whether a scene shows gloss, under a light that is known for any view."""
    held = preview.held(scene)
    return _shows(scene) and held.blend.has_light(held.shown.lights)


def _place(scene):
    try:
        return viewport.place_of(view_of(scene))
    except work.FAILURES:
        return None


def _look(scene):
    """Note whether the view has moved since this was asked last."""
    viewport.look_around()
    place = _place(scene)
    if _NOW.place not in (None, place):
        _NOW.moved, _NOW.turned = time.perf_counter(), True
    _NOW.place = place


def _begin(scene):
    """Begin with the view as it is, unless its colours are there."""
    moving, held = moves(scene), preview.held(scene)
    if _NOW.bake != held.path:
        _NOW.bake, _NOW.moving, _NOW.took = held.path, _FIRST, {}
    every = _NOW.moving if moving else 1
    mapped = moving and held.blend.maps_views(held.shown.lights)
    asked, shown = held.shown.seen_from(view_of(scene), every, mapped), held.shown
    near = shown.every <= every and (moving or not shown.mapped)
    there = asked.place == shown.place and near
    if there or asked.place == _NOW.failed:
        return
    stop()  # that of an older view, if any
    _NOW.job, _NOW.every = _steps(scene, held, asked), every
    _NOW.maps, _NOW.mapped = False, mapped


def _map_views(scene):
    """Make maps of views, in pieces: a view that moves meanwhile is shown at once."""
    held = preview.held(scene)
    if not held.blend.maps_views(held.shown.lights):
        _NOW.job = held.blend.map_views_steps(held.shown.lights, work.PACE)
        _NOW.maps, _NOW.mapped = True, False


def _steps(scene, held, asked):
    """Colours of the light that is shown, seen from elsewhere, on a scene's meshes."""
    uid, start = scene.session_uid, time.perf_counter()
    radiance = yield from asked.steps(held, work.PACE)
    scene = by_uid(bpy.data.scenes, uid)
    if scene is None:
        return
    _adapt(time.perf_counter() - start, asked.every)
    if preview.missing(scene, held):
        # Objects that were renamed are found by what they are.
        yield from freshness.check_steps(scene, held, work.PACE)
        scene = by_uid(bpy.data.scenes, uid)
    with own_changes(scene):
        preview.write(scene, held, radiance, asked)
    frames.append((time.perf_counter() - start, asked.every))
    del frames[:-1000]
    written[0] += 1


def _adapt(seconds, every):
    """Evaluate fewer points next time where it took too long and that helps, more where it fits."""
    took = _NOW.took
    took[every] = seconds
    if every != _NOW.moving:
        return
    finer, coarser = every // 2, 2 * every
    if every > 1 and seconds > _WORTH * took.get(finer, np.inf):
        _NOW.moving = finer
    elif seconds > _MOMENT and every < _MOST and took.get(coarser, 0) < _WORTH * seconds:
        _NOW.moving = coarser
    elif seconds < _MOMENT / 3 and every > 1:
        _NOW.moving = finer
