"""Whether a bake is still of the scene: looked at in full by every button, noted for the panel.

In between Blender's notes of what changed outdate the last reading of the scene (see `plan`), and
frames compare with it what can be compared quickly.
"""

from pathlib import Path

import bpy

from prt_core import PRTError
from prt_core.blender.render_scene import is_rendering
from prt_core.scene import Changes

from . import plan, preview, work


def check_steps(scene, held, pace=None):
    """How the scene differs from a bake (`Changes`): all its meshes are read.

    While something renders that cannot be; then it is as when last read.
    """
    uid = scene.session_uid
    if is_rendering():
        read = plan.reading_of(uid)
        return Changes({}, (), (), ()) if read is None else held.compare(read)[0]
    try:
        yield from plan.read_steps(scene, pace=pace, gloss=held.gloss)
    except PRTError:
        pass  # nothing there can be baked: all is gone
    return held.compare(plan.reading_of(uid))[0]


def warn_steps(operator, scene, held, pace=None):
    """As `check_steps`; an operator says in one line where something differs."""
    differences = yield from check_steps(scene, held, pace)
    held.warned = line(held, differences)
    if held.warned:
        operator.report({"WARNING"}, held.warned)


def frame_steps(scene, held, depsgraph=None, aloud=False):
    """Say what is not as it was baked in a frame: by what has moved since it was last read.

    The first frame without a window is read in full, before its render begins. In a window the
    timer has done so.
    """
    if bpy.app.background and plan.reading(scene)[0] is None:
        yield from check_steps(scene, held)
    names = plan.moved(scene, depsgraph)
    few = ", ".join(names[:3]) + (" …" if len(names) > 3 else "")
    note(scene, f"{few} changed" if names else "", aloud)


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
    held = None if scene is None else preview.held(scene)
    if held is None:
        return ""
    read, _ = plan.reading(scene)
    differences = None if read is None else held.compare(read)[0]
    text = line(held, differs if differences is None or differences.fresh else differences)
    if (aloud or bpy.app.background) and text and text != held.warned:
        work.say(text, True)
        print(f"PRT: WARNING: {text}")
    held.warned = text
    return text


def line(held, differs):
    """The line that says how a scene differs from its bake; empty where it does not.

    Parameters
    ----------
    held : preview.Preview
    differs : Changes or str
    """
    if not differs or getattr(differs, "fresh", False):
        return ""
    name = Path(held.path).name
    return f"{name}: the scene is not the one that was baked ({differs}); bake again"
