"""Colours while a bake runs: those of what it knows, under the light as it is, ever nearer.

The bake hands out pictures (see `prt_core.bake.pictures`); the one timer of `live` relights the
newest and writes it on the meshes. While the light is turned the picture of few points follows it.
Nothing of it stays: the finished bake takes its place, or what was there before comes back.
"""

import time

import bpy

from prt_core.bake.pictures import Pictures
from prt_core.blender.identity import by_uid

from . import preview, views, work
from .idle_work import IdleWork
from .own_changes import own_changes
from .request import request

# Of the time of a bake, what pictures after the first may take before another waits, and how much
# of showing them is time of the bake, which goes on beside; seconds: of work in one call of the
# timer, of quiet after which a light that was turned gets all that is known; shadow rays a lamp.
_SHARE, _BESIDE, _BUDGET, _QUIET, _RAYS = 0.06, 0.5, 0.03, 0.3, 4
# Seconds from the button for which the bake waits for its first colours, at most.
_PATIENCE = 3.0
_NOW = []
# Seconds from a picture's arrival, or a change of the light, to its colours; and what it was of:
# (seconds, known percent, error, whether the light was turned), of the last bake.
delays = []


class _Showing(IdleWork):
    """One bake's pictures on the meshes of its scene."""

    def __init__(self, scene, pictures):
        super().__init__()
        self.uid, self.pictures, self.caster = scene.session_uid, pictures, scene.prt.caster
        self.began, self.had_views = time.perf_counter(), views.shown()
        self.newest = self.shown = None
        self.is_new = self.is_draft = False
        self.seen = None
        self.written = self.failed = False

    @property
    def scene(self):
        return by_uid(bpy.data.scenes, self.uid)

    def tick(self, touched):
        """Some work; the seconds until it wants to be called again, None: nothing is to be done."""
        newest = self.pictures.take()
        if newest is not None:
            self.newest, self.is_new = newest, True
        if self.newest is None or self.scene is None or bpy.context.mode != "OBJECT":
            return None
        self.seen = touched if self.seen is None else self.seen
        if self.job is None:
            quiet = time.perf_counter() - touched > _QUIET
            if touched != self.seen and self.scene.prt.live:
                self.job, self.is_draft = self._steps(self.newest.coarse or self.newest, True), True
                self.seen = touched
            elif self.is_new or (self.is_draft and quiet):
                self.job = self._steps(self.newest, False)
                self.is_new = self.is_draft = False
        try:
            self.go_on(_BUDGET)
        except work.FAILURES as error:
            # What is wrong with the light, or the scene, may be right again with the next.
            self.job, self.failed = None, True
            work.note(str(error))
        return 0.0 if self.job is not None else None

    def _steps(self, bake, turned):
        start = time.perf_counter()
        if self.shown is None:
            self.shown = preview.Preview("", bake, self.caster)
        self.shown.bake = bake
        self.shown.blend.replace(bake)
        asked = request(self.scene, _RAYS, shown=self.shown)
        # What takes a moment only is not worth the way into a thread and back.
        quick = turned and self.shown.blend.has_lamps(asked.lights)
        radiance = yield from asked.steps(self.shown, None if quick else work.PACE)
        scene = self.scene
        if scene is None or self not in _NOW:
            return
        with own_changes(scene):
            preview.write(scene, self.shown, radiance, asked)
        if not self.written:
            self.written = True
            views.show()
        now = time.perf_counter()
        self.pictures.spent(0 if turned else _BESIDE * (now - start))
        work.note(
            f"Shown from {bake.known_percent:.3g} % of the points: within about {bake.error:.1%}"
        )
        delays.append((now - start, now - self.began, bake.known_percent, bake.error, turned))

    def close(self, finished):
        self.stop()
        if self.shown is not None:
            self.shown.blend.close()
        scene = self.scene
        if finished or not self.written or scene is None:
            return
        held = preview.held(scene)
        with own_changes(scene):
            if held is not None and held.radiance is not None:
                preview.write(scene, held, held.radiance, held.shown)
            elif not scene.prt.loaded:
                preview.clear(scene)
        if not self.had_views:
            views.restore()


def begin(scene):
    """A bake of a scene begins, in a window; returns the `Pictures` that it is to be given."""
    end(False)
    delays.clear()
    pictures = Pictures(_SHARE, to_the_end=False)
    _NOW.append(_Showing(scene, pictures))
    return pictures


def end(finished):
    """The bake has ended; where it is not finished what was shown before comes back."""
    while _NOW:
        showing = _NOW.pop()
        try:
            showing.close(finished)
        except work.FAILURES as error:
            work.say(str(error), True)


def awaits_first():
    """Whether the first colours are about to be there: what else there is to do waits a moment."""
    if not _NOW or bpy.context.mode != "OBJECT":
        return False
    showing = _NOW[0]
    late = time.perf_counter() - showing.began > _PATIENCE
    return not (showing.written or showing.failed or late)


def forget():
    """Another file: what was shown went with its own."""
    _NOW.clear()


def tick(touched):
    """Called by the one timer; `touched`: when the light changed last. See `_Showing.tick`."""
    return _NOW[0].tick(touched) if _NOW else None
