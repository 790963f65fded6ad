"""A hand for Blender's window: mouse, keys, pictures, and `play`, which runs a story with it.

A story is a generator: it does something and yields how long, or for what, it waits. What it
finds goes into report.json; an error ends it, with a traceback there and a picture.
"""

import json
import os
import subprocess
import time
import traceback
from pathlib import Path

import bpy

FOLDER = Path(os.getcwd())
_TICK = 0.02


class Until:
    """Wait until `condition()` holds; after `seconds` it is an error."""

    def __init__(self, what, condition, seconds=60.0):
        self.what, self.condition, self.seconds = what, condition, seconds


class Hand:
    """Moves the mouse, clicks, types, and finds buttons the way a person does: by looking.

    What lies under the mouse is asked of Blender: an operator's button answers with its Python
    command, that of a property with its path. Methods that take time are generators.
    """

    def __init__(self):
        self.mouse = 0, 0
        self._known = {}

    @property
    def window(self):
        return bpy.context.window_manager.windows[0]

    @property
    def view(self):
        """The area of the 3D viewport."""
        return next(area for area in self.window.screen.areas if area.type == "VIEW_3D")

    @property
    def sidebar(self):
        return next(region for region in self.view.regions if region.type == "UI")

    def event(self, kind, value, **more):
        x, y = self.mouse
        self.window.event_simulate(kind, value, x=x, y=y, **more)

    def move(self, x, y):
        self.mouse = int(x), int(y)
        self.event("MOUSEMOVE", "NOTHING")
        yield _TICK
        yield _TICK

    def to_view(self):
        """Over the viewport's middle, clear of every region that lies upon it."""
        yield from self.move(self.view.x + self.view.width * 0.4, self.view.y + 60)

    def key(self, kind, **more):
        self.event(kind, "PRESS", **more)
        yield _TICK
        self.event(kind, "RELEASE", **{k: v for k, v in more.items() if k != "unicode"})
        yield 5 * _TICK

    def type(self, text):
        names = dict(zip("0123456789.-", ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX",
                                          "SEVEN", "EIGHT", "NINE", "PERIOD", "MINUS"),
                         strict=True))  # fmt: skip
        for letter in text:
            yield from self.key(names[letter], unicode=letter)

    def click(self, name, at=0.45):
        """Find a button and press it."""
        x, y = yield from self.find(name, at)
        yield from self.move(x, y)
        yield from self.key("LEFTMOUSE")

    def drag(self, name, by, steps=8, at=0.45):
        """Drag a number's field sideways by some pixels."""
        x, y = yield from self.find(name, at)
        yield from self.move(x, y)
        self.event("LEFTMOUSE", "PRESS")
        yield 5 * _TICK
        for step in range(1, steps + 1):
            yield from self.move(x + by * step / steps, y)
        self.event("LEFTMOUSE", "RELEASE")
        yield 5 * _TICK

    def find(self, name, at=0.45):
        """(x, y) of the button `name` ("prt.bake", "prt.rotation") in the sidebar.

        at : where across the sidebar to look, 0 to 1.
        """
        if name in self._known:
            yield from self.move(*self._known[name])
            if self.under_mouse() == name:
                return self._known[name]
        seen = []
        yield from self.wheel("WHEELUPMOUSE", 30)
        for _ in range(8):
            region = self.sidebar
            x = region.x + int(region.width * at)
            # Where a button meets the border of the area a click would move that.
            for y in range(region.y + region.height - 8, region.y + 12, -9):
                yield from self.move(x, y)
                result = self.under_mouse()
                if result:
                    seen.append(result)
                    self._known[result] = x, y
                if result == name:
                    return x, y
            yield from self.wheel("WHEELDOWNMOUSE", 6)
        raise AssertionError(f"no button {name} in the sidebar; there are {sorted(set(seen))}")

    def wheel(self, kind, notches):
        # Beside the lists, which take the wheel for themselves.
        yield from self.move(self.sidebar.x + self.sidebar.width * 0.83, self.sidebar.y + 100)
        for _ in range(notches):
            self.event(kind, "PRESS")
            yield _TICK

    def under_mouse(self):
        """Name of the button under the mouse, or None."""
        manager = bpy.context.window_manager
        result = None
        with bpy.context.temp_override(window=self.window, area=self.view, region=self.sidebar):
            for ask in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
                if result is None and ask.poll():
                    ask()
                    result = manager.clipboard.removeprefix("bpy.ops.").partition("(")[0]
        return result

    def picture(self, name):
        """A picture of the window as it is drawn, NAME.png; it stands in the screen's corner."""
        crop = f"{self.window.width}x{self.window.height}+0+0"
        command = ["import", "-window", "root", "-gravity", "SouthWest", "-crop", crop, "+repage"]
        subprocess.run([*command, FOLDER / f"{name.replace(' ', '_')}.png"], check=True)


def play(story, limit=600.0):
    """Run a story's generator by a timer; quits Blender when it ends."""
    report, hand = {"error": None}, Hand()
    steps = story(hand, report)
    wait, began, since = None, time.monotonic(), 0.0

    def end(error):
        report["error"] = error
        report["seconds"] = time.monotonic() - began
        if error:
            try:
                hand.picture("error")
            except Exception:
                report["error"] += traceback.format_exc()
        (FOLDER / "report.json").write_text(json.dumps(report, default=float))
        bpy.ops.wm.quit_blender()

    def tick():
        nonlocal wait, since
        try:
            if wait is not None:
                if not wait.condition():
                    late = time.monotonic() - since
                    if late > wait.seconds or time.monotonic() - began > limit:
                        steps.throw(AssertionError(f"waited {late:.0f} s until {wait.what}"))
                    return _TICK
                wait = None
            asked = next(steps)
            if isinstance(asked, Until):
                wait, since = asked, time.monotonic()
                return _TICK
            return asked
        except StopIteration:
            end(None)
        except BaseException:
            end(traceback.format_exc())
        return None

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)
