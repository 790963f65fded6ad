"""From where a scene is looked at: the 3D view that moved last, or the scene's camera.

Views tell of no move. Whoever wants to follow them compares where they stand from time to time.
"""

import bpy
import numpy as np

from prt_core import PRTError
from prt_core.transport import View

# Of the 3D views of all windows: how they stood when looked at last; which of them moved last.
_STOOD, _LEADING = {}, [None]


def look_around():
    """Note which 3D view has moved since this was called last: that one leads."""
    views = {area.as_pointer(): _stands(area.spaces.active) for _, area in _areas()}
    moved = [key for key, stands in views.items() if _STOOD.get(key, stands) != stands]
    _STOOD.clear()
    _STOOD.update(views)
    if moved:
        _LEADING[0] = moved[-1]


def view_of(scene, follow, rendered=False, depsgraph=None):
    """The `View` from where a scene is looked at.

    Parameters
    ----------
    scene : bpy.types.Scene
    follow : {"VIEW", "CAMERA"}
        What the panel says: the 3D view, or a camera; the scene's own where none is named.
    rendered : bool
        Whether a render wants it, which looks through the camera.
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated.

    Raises
    ------
    PRTError
        It follows a camera that is not there, or no window shows the scene.
    """
    if not rendered and follow == "VIEW":
        space = _leading(scene)
        if space is not None and space.region_3d.view_perspective != "CAMERA":
            matrix = np.array(space.region_3d.view_matrix.inverted(), np.float64)
            return _from(matrix, space.region_3d.is_perspective)
        if space is not None and space.use_local_camera and space.camera is not None:
            return _through(space.camera)
    chosen = None if rendered or follow == "VIEW" else scene.prt.seen_by
    # One that was deleted, or moved to another scene, is not looked through.
    if chosen is not None and chosen.name in scene.objects:
        return _through(chosen)
    if scene.camera is None:
        raise PRTError(
            f"view: the scene '{scene.name}' has no camera to look through; add one, or choose "
            "the 3D view"
        )
    return _through(scene.camera if depsgraph is None else scene.camera.evaluated_get(depsgraph))


def place_of(view):
    """What a `View` depends on, as something that can be compared."""
    place = view.direction if view.position is None else view.position
    return view.position is None, tuple(place)


def _through(item):
    """The `View` of an object that a view looks through."""
    parallel = item.type == "CAMERA" and item.data.type == "ORTHO"
    return _from(np.array(item.matrix_world, np.float64), not parallel)


def _from(matrix, is_perspective):
    """The `View` of what looks along its -z."""
    if is_perspective:
        return View(position=matrix[:3, 3])
    return View(direction=matrix[:3, 2])


def _leading(scene):
    """The space of the 3D view that moved last, or else of the largest, or None."""
    areas = [area for window, area in _areas() if window.scene == scene]
    for area in areas:
        if area.as_pointer() == _LEADING[0]:
            return area.spaces.active
    largest = max(areas, key=lambda area: area.width * area.height, default=None)
    return None if largest is None else largest.spaces.active


def _areas():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                yield window, area


def _stands(space):
    region = space.region_3d
    return region.view_perspective, tuple(map(tuple, region.view_matrix))
