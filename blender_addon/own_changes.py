"""Tells Blender's notes of what we do ourselves from those of what the user does."""

from contextlib import contextmanager

from prt_core.blender import casters
from prt_core.blender.render_scene import is_reading

_UNDER_WAY = []


@contextmanager
def own_changes(scene):
    """What is written on a scene's meshes while this lasts is no change of the user's."""
    _UNDER_WAY.append(scene)
    try:
        yield
        # Evaluated now, so that the handlers know whose change it is.
        for layer in scene.view_layers:
            layer.update()
    finally:
        _UNDER_WAY.pop()


def are_own():
    """Whether what Blender tells of now was written by us."""
    return bool(_UNDER_WAY)


def is_own(scene):
    """Whether Blender tells of a scene because rays are cast or a scene is read there."""
    return casters.is_temporary(scene) or is_reading(scene)
