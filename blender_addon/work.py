"""Long work: a generator driven to its end at once, or a little at a time by a modal operator."""

import time

import bpy

from prt_core.blender.identity import by_uid
from prt_core.errors import PRTError, expect
from prt_core.runtime.progress import run

# Seconds: between two timer events, of work in one event, of one step, between redraws.
_TIMER, _BUDGET, PACE, _REDRAW = 0.002, 0.04, 0.025, 0.5
_RUNNING = []

# What goes wrong outside of Blender, and is said in one line.
FAILURES = (PRTError, OSError, MemoryError)

# How long each turn of the main thread took, and its stage, of the last work (for measuring).
turns = []


def status():
    """The window manager's `PRTStatus`."""
    return bpy.context.window_manager.prt


def say(message, failed=False, notes=()):
    """Show a line in the panel, and what else there is to say in lines below it."""
    state = status()
    state.message, state.failed = message, failed
    state.notes = "\n".join(notes)
    redraw()


def note(message):
    """Show a line in the panel while the work goes on."""
    state = status()
    if state.message != message:
        state.message, state.failed = message, False
        redraw()


def redraw():
    """Draw the panel anew, but not the 3D view: that can take longer than the work."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def stop_all():
    """End whatever runs, before the file, or the add-on, goes away."""
    for operator in list(_RUNNING):
        try:
            operator.end()
        except ReferenceError:
            pass  # Blender has freed it without a word
    _RUNNING.clear()
    status().running = status().cancel = False


def forget():
    """Another file: nothing that was said or listed is of it."""
    say("")
    state = status()
    state.bakes_folder = ""
    state.fields.clear()
    state.active_bake = state.active_field = state.active_object = 0


def _status_text(text):
    if bpy.context.workspace is not None:
        bpy.context.workspace.status_text_set(text)


def has_window(context):
    """Whether somebody looks on, so that work must not hold the window."""
    return not bpy.app.background and context.window is not None


class LongWork:
    """An operator whose work is a generator of `Progress`.

    A subclass has `title`, `steps(context, pace)` and `finish(context, result)`, and
    `when_stopped` says what is so after a stop.
    """

    when_stopped = "the same button goes on where it was"

    _steps = _timer = _manager = _uid = None
    _stage, _drawn = "", 0.0

    def begin(self, context):
        """Remember the scene that the work is about; returns it."""
        self._uid = context.scene.session_uid
        return context.scene

    @property
    def scene(self):
        """The scene that the work is about, whatever it is called by now."""
        scene = by_uid(bpy.data.scenes, self._uid)
        expect(scene is not None, f"{self.title}: its scene was removed meanwhile")
        return scene

    def execute(self, context):
        """All at once: for scripts and without a window."""
        if status().running:
            self.report({"ERROR"}, f"{status().title} is still under way; wait or cancel it")
            return {"CANCELLED"}
        try:
            result = run(self.steps(context, None))
        except FAILURES as error:
            return self._fail(error)
        return self._finish(context, result)

    def invoke(self, context, _event):
        if not has_window(context):
            return self.execute(context)
        if status().running:
            self.report({"ERROR"}, f"{status().title} is still under way; wait or cancel it")
            return {"CANCELLED"}
        turns.clear()
        self._steps, self._drawn = self.steps(context, PACE), 0.0
        state = status()
        state.running, state.cancel = True, False
        state.title, state.stage, state.done = self.title, "", 0.0
        say("")
        _RUNNING.append(self)
        # The first steps read the context as it is while the button is pressed. What they end
        # must not become a handler: Blender would call an operator that is gone, and crash.
        turned = self._turn(context)
        if turned == {"RUNNING_MODAL"}:
            self._manager = context.window_manager
            self._timer = self._manager.event_timer_add(_TIMER, window=context.window)
            self._manager.modal_handler_add(self)
        return turned

    def modal(self, context, event):
        if self._steps is None:
            return {"CANCELLED"}
        escape = event.type == "ESC" and event.value == "PRESS"
        if escape or status().cancel:
            try:
                self.end()
                self.stopped(context)
            except FAILURES as error:
                return self._fail(error)
            say(f"{self.title} stopped; {self.when_stopped}")
            self.report({"INFO"}, f"{self.title} stopped")
            return {"CANCELLED"}
        return self._turn(context) if event.type == "TIMER" else {"PASS_THROUGH"}

    def _turn(self, context):
        """A little work; what the modal operator returns."""
        start = time.perf_counter()
        try:
            while time.perf_counter() - start <= _BUDGET - PACE:
                progress = next(self._steps)
                self._stage = progress.stage
                self._show(progress)
        except StopIteration as end:
            self._stage = "end"
            self.end()
            return self._finish(context, end.value)
        except FAILURES as error:
            self.end()
            return self._fail(error)
        except Exception:
            self._say_unknown()
            self.end()
            raise
        finally:
            turns.append((time.perf_counter() - start, self._stage))
        return {"RUNNING_MODAL"}

    def _show(self, progress):
        now, state = time.perf_counter(), status()
        if now - self._drawn < _REDRAW:
            return
        self._drawn = now
        if progress.total:
            state.done = progress.done / progress.total
        elif progress.stage != state.stage:
            state.done = 0.0
        state.stage = progress.stage
        _status_text(f"{self.title}: {state.stage} {state.done:.0%}   (Esc stops, nothing is lost)")
        redraw()

    def _finish(self, context, result):
        try:
            self.finish(context, result)
        except FAILURES as error:
            return self._fail(error)
        except Exception:
            self._say_unknown()
            raise
        return {"FINISHED"}

    def _say_unknown(self):
        say(f"{self.title} failed; the system console has the details", True)

    def _fail(self, error):
        text = str(error) or type(error).__name__
        say(text, True)
        self.report({"ERROR"}, text)
        return {"CANCELLED"}

    def stopped(self, context):
        """What is left to do when a person stopped the work."""

    def cancel(self, _context):
        """Blender ends the operator: a window closes, a file loads."""
        self.end()

    def end(self):
        """The one place where the work ends, however it ends."""
        steps, self._steps = self._steps, None
        try:
            if steps is not None:
                steps.close()
        finally:
            # Whatever goes wrong while it stops: no button may stay grey.
            state = status()
            state.running = state.cancel = False
            if self in _RUNNING:
                _RUNNING.remove(self)
            if self._timer is not None:
                self._manager.event_timer_remove(self._timer)
                self._timer = None
            _status_text(None)
            redraw()
