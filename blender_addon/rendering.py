"""Whether something renders: then colours are those of its frames, and no timer works."""

import bpy
from bpy.app.handlers import persistent

from prt_core.blender import casters

from .own_changes import is_own

# What is done with a scene before its first frame renders, in this order.
begins = []
_NOW = [False]


def is_under_way():
    """Whether a scene of the user's renders now."""
    return _NOW[0]


def another_file():
    """No render outlives the file."""
    _NOW[0] = False


@persistent
def _begins(scene, *_):
    if is_own(scene):
        return
    _NOW[0] = True
    for prepare in begins:
        prepare(scene)


@persistent
def _ends(scene=None, *_):
    if scene is not None and casters.is_temporary(scene):
        return
    _NOW[0] = False


_HANDLERS = (("render_init", _begins), ("render_complete", _ends), ("render_cancel", _ends))


def register():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    another_file()
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
