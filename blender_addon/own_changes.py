"""Tells Blender's notes of our own colours from those of what the user changed."""

from contextlib import contextmanager

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
