"""What Blender's operators take for the scene that they are called from."""

from contextlib import contextmanager

import bpy

from prt_core.runtime.stillness import others_still


@contextmanager
def context_of(scene, **members):
    """A context of a scene of ours and its first view layer; our other threads keep still.

    Parameters
    ----------
    scene : bpy.types.Scene
    **members
        What else the context has, as for `temp_override`.
    """
    here = {"scene": scene, "view_layer": scene.view_layers[0], **members}
    with others_still(), bpy.context.temp_override(**here):
        yield
