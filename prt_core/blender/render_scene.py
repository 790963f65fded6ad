"""The scene as renders have it: a tiny render by an engine of our own, which reads its input.

Blender evaluates a scene for renders (subdivision, modifiers, simplify, switches of visibility)
only where something renders. What renders here is a copy of the scene, which shares its objects:
the user's scene, its last picture and its evaluated state in the window stay as they are, nothing
is written to disk and no undo step is made.
"""

import atexit
from contextlib import ExitStack, contextmanager

import bpy
from bpy.app.handlers import persistent

from prt_core.blender.casters import is_temporary, mark_temporary, remove_blocks
from prt_core.blender.operator_context import context_of
from prt_core.blender.stand_ins import originals_render
from prt_core.errors import PRTError

_RESULT = "Render Result"
# What a render would do besides evaluating the scene.
_RENDER = {
    # No smaller: where a scene's output is a movie, Blender refuses to render.
    "resolution_x": 16,
    "resolution_y": 16,
    "resolution_percentage": 100,
    "use_border": False,
    "use_compositing": False,
    "use_sequencer": False,
    "use_freestyle": False,
    "use_multiview": False,
    "use_motion_blur": False,
    "use_render_cache": False,
    "use_single_layer": False,
    "use_persistent_data": False,
    "use_lock_interface": False,
}
# While a scene is read: its `session_uid`s, and those of the scenes made for that. And the scenes
# that are being rendered, also without a window, where no job tells of it.
_READING, _RENDERED = set(), set()


def as_rendered(scene, read):
    """Call a function with a scene as it is evaluated for renders.

    It holds the window for as long as Blender takes to evaluate the scene anew, which is what a
    render takes until its first pixel, and for as long as the function takes: so that should copy
    what it needs and no more. A viewport in Rendered mode begins its picture again.

    Parameters
    ----------
    scene : bpy.types.Scene
    read : callable(depsgraph)
        Is given the `bpy.types.Depsgraph` of mode RENDER, of which nothing may be kept. Its scene
        may be a copy of the user's, its view layer then as well.

    Returns
    -------
    object
        What the function returns; what it raises is raised.

    Raises
    ------
    PRTError
        A render is under way, or Blender cannot render the scene.
    """
    if is_rendering():
        raise PRTError(f"scene '{scene.name}': a render is under way; wait for its end")
    outcome = []

    class Engine(bpy.types.RenderEngine):
        bl_idname, bl_label = "PRT_READ_SCENE", "PRT reads the scene"
        bl_use_preview = False

        def render(self, depsgraph):
            try:
                outcome.append((read(depsgraph), None))
            except BaseException as error:
                # Blender would print it and go on.
                outcome.append((None, error))

    had_result = _RESULT in bpy.data.images
    with ExitStack() as undo:
        _READING.add(scene.session_uid)
        undo.callback(_READING.clear)
        bpy.utils.register_class(Engine)
        undo.callback(bpy.utils.unregister_class, Engine)
        undo.enter_context(originals_render(scene))
        target = undo.enter_context(_renderable(scene, Engine.bl_idname))
        # The operator evaluates the scene that it is called from, before and after.
        start = scene
        if target != scene:
            start = undo.enter_context(_temporary(bpy.data.scenes.new("prt idle")))
            # It also renders the frame of that scene.
            start.frame_set(scene.frame_current)
        _READING.update((target.session_uid, start.session_uid))
        try:
            with context_of(start):
                bpy.ops.render.render(scene=target.name)
        except RuntimeError as error:
            reason = " ".join(str(error).split())
            raise PRTError(f"scene '{scene.name}': Blender cannot render it ({reason})") from error
        finally:
            if not had_result and _RESULT in bpy.data.images:
                bpy.data.images.remove(bpy.data.images[_RESULT])
    if not outcome:
        raise PRTError(f"scene '{scene.name}': Blender did not render it")
    result, error = outcome[0]
    if error is not None:
        raise error
    return result


def is_rendering():
    """Whether something renders, so that no scene can be read, and Cycles not be asked."""
    _RENDERED.intersection_update(scene.session_uid for scene in bpy.data.scenes)
    return bool(_RENDERED or _READING) or bpy.app.is_job_running("RENDER")


@contextmanager
def reading(*scenes):
    """While it lasts, what Blender says of these scenes is ours, and nothing else is read."""
    uids = {scene.session_uid for scene in scenes}
    _READING.update(uids)
    try:
        yield
    finally:
        _READING.difference_update(uids)


def register():
    """Listen for the user's renders: to begin another within one would crash Blender."""
    handlers = bpy.app.handlers
    handlers.render_pre.append(_render_begins)
    for ends in (handlers.render_complete, handlers.render_cancel):
        ends.append(_render_ends)
    if not bpy.app.binary_path:
        atexit.register(_stop_listening)


def _stop_listening():
    """Take the listeners away before Python ends.

    Where some are left, Blender as a module crashes then (4.2), or never ends (4.5).
    """
    handlers = bpy.app.handlers
    for name in ("render_pre", "render_complete", "render_cancel"):
        listeners = getattr(handlers, name)
        listeners[:] = [each for each in listeners if each not in (_render_begins, _render_ends)]


@persistent
def _render_begins(scene, *_):
    if not (is_reading(scene) or is_temporary(scene)):
        _RENDERED.add(scene.session_uid)


@persistent
def _render_ends(*_):
    _RENDERED.clear()


def is_reading(scene):
    """Whether what Blender says of a scene comes from `as_rendered`, not from the user."""
    return scene.session_uid in _READING


def rendered_layer(scene):
    """The view layer of a scene that is baked, and the names of others that render as well.

    The one that is looked at where it is used in renders, else the first that is, else the one
    that is looked at.
    """
    shown = None
    if scene == bpy.context.scene:
        shown = bpy.context.view_layer
    layers = [layer for layer in scene.view_layers if layer.use]
    first = shown if shown is not None and (shown.use or not layers) else None
    first = first or (layers or scene.view_layers)[0]
    return first, [layer.name for layer in layers if layer != first]


def rendered_world(scene):
    """The world of the layer of a scene that is baked, which may have one of its own, or None."""
    # Since 4.3.
    return getattr(rendered_layer(scene)[0], "world_override", None) or scene.world


@contextmanager
def _temporary(block):
    """A data-block that is removed again."""
    mark_temporary(block)
    try:
        yield block
    finally:
        remove_blocks([block])


@contextmanager
def _renderable(scene, engine):
    """A scene that shows what `scene` does and renders a few pixels with an engine."""
    with ExitStack() as undo:
        if scene.rigidbody_world is None:
            target = scene.copy()
            target.name = "prt render"
            undo.enter_context(_temporary(target))
        else:
            # Of a copy Blender would begin the simulation anew.
            target = scene
        settings = [(target.render, "engine", engine)]
        settings += [(target.render, name, value) for name, value in _RENDER.items()]
        wanted = rendered_layer(scene)[0].name
        for layer in target.view_layers:
            settings.append((layer, "use", layer.name == wanted))
            if hasattr(layer, "use_grease_pencil"):
                settings.append((layer, "use_grease_pencil", False))
        if target.camera is None:
            camera = bpy.data.cameras.new("prt render")
            undo.enter_context(_temporary(camera))
            item = bpy.data.objects.new("prt render", camera)
            undo.enter_context(_temporary(item))
            settings.append((target, "camera", item))
        for holder, name, value in settings:
            if target == scene:
                undo.callback(setattr, holder, name, getattr(holder, name))
            setattr(holder, name, value)
        yield target
