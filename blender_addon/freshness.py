"""Whether a bake is still of the scene: looked at in full by every button, noted for the panel.

In between Blender's notes of what changed outdate the last reading of the scene (see `plan`), and
frames compare with it what can be compared quickly.
"""

from pathlib import Path

import bpy

from prt_core import PRTError

from . import plan, preview, work


def check_steps(scene, there, pace=None):
    """How the scene differs from a bake (`Changes`): all its meshes are read."""
    uid = scene.session_uid
    try:
        yield from plan.read_steps(scene, pace=pace)
    except PRTError:
        pass  # nothing there can be baked: all is gone
    return there.compare(plan.reading_of(uid))[0]


def warn_steps(operator, scene, there, pace=None):
    """As `check_steps`; an operator says in one line where something differs."""
    found = yield from check_steps(scene, there, pace)
    there.warned = line(there, found)
    if there.warned:
        operator.report({"WARNING"}, there.warned)


def frame_steps(scene, there, depsgraph=None, aloud=False):
    """Say what is not as it was baked in a frame: by what has moved since it was last read.

    The first frame without a window is read in full. In a window the timer has done so; there the
    thread that renders may not.
    """
    if bpy.app.background and plan.reading(scene)[0] is None:
        yield from check_steps(scene, there)
    names = plan.moved(scene, depsgraph)
    some = ", ".join(names[:3]) + (" …" if len(names) > 3 else "")
    note(scene, f"{some} changed" if names else "", aloud)


def note(scene, differs="", aloud=False):
    """Note for the panel whether a scene is still the one that was baked; the line that says not.

    Parameters
    ----------
    scene : bpy.types.Scene, or None where it is gone
    differs : str
        What differs, where more is known than from the last reading.
    aloud : bool
        Print the line as well, where it is new; so it is without a window.
    """
    there = None if scene is None else preview.held(scene)
    if there is None:
        return ""
    read, _ = plan.reading(scene)
    found = None if read is None else there.compare(read)[0]
    text = line(there, differs if found is None or found.fresh else found)
    if (aloud or bpy.app.background) and text and text != there.warned:
        work.say(text, True)
        print(f"PRT: WARNING: {text}")
    there.warned = text
    return text


def line(there, differs):
    """The line that says how a scene differs from its bake; empty where it does not.

    Parameters
    ----------
    there : preview.Preview
    differs : Changes or str
    """
    if not differs or getattr(differs, "fresh", False):
        return ""
    name = Path(there.path).name
    return f"{name}: the scene is not the one that was baked ({differs}); bake again"
