"""Files and undo steps: what points into the data goes with them, what shows them follows.

Views, messages, lists and the bake in memory are no part of a file or of an undo step.
"""

import bpy
from bpy.app.handlers import persistent

from prt_core.blender import casters
from prt_core.blender.stand_ins import arrange

from . import (
    following,
    gloss,
    light_fields,
    live,
    naming,
    plan,
    preview,
    reflections,
    rendering,
    saving,
    views,
    work,
)


@persistent
def _before_file(*_):
    """Another file comes: everything that points into this one goes."""
    work.stop_all()
    live.stop()
    preview.forget()
    light_fields.forget()
    plan.forget()


@persistent
def _after_file(*_):
    live.another_file()
    following.another_file()
    gloss.another_file()
    rendering.another_file()
    reflections.another_file()
    naming.another_file()
    work.forget()
    casters.remove_left_over()
    if not live.note_preview()[1]:
        views.restore()  # the windows of the file before
    for scene in bpy.data.scenes:
        # What no file keeps: that linked objects are hidden.
        arrange(scene)


@persistent
def _before_undo(*_):
    """Undo must not keep the casters' data-blocks; they make them again."""
    casters.release_all()


@persistent
def _before_save(path="", *_):
    """Files must not keep the casters' data-blocks; bakes are found from a new folder as well."""
    casters.release_all()
    if path:
        try:
            saving.before(path)
        except work.FAILURES as error:
            work.say(f"the bake could not be saved with the file: {error}", True)


@persistent
def _after_save(path="", *_):
    saving.after(path or None)


@persistent
def _save_failed(*_):
    saving.after()


@persistent
def _after_undo(*_):
    """Views and messages are no part of an undo step: they follow the data."""
    casters.remove_left_over()
    for scene in bpy.data.scenes:
        live.look_again(scene)
    before, now = live.note_preview()
    work.say("")
    if before and not now:
        views.restore()
        work.say("The preview is undone; its bake stays on the disk")
    elif now and not before:
        views.show()
    live.touch(bpy.context.scene, show=True)


_HANDLERS = (
    ("load_pre", _before_file),
    ("load_post", _after_file),
    ("save_pre", _before_save),
    ("save_post", _after_save),
    ("save_post_fail", _save_failed),
    ("undo_pre", _before_undo),
    ("redo_pre", _before_undo),
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
)


def register():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
