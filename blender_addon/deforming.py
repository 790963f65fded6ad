"""Which objects deform over time: by keys of their shape or geometry, or by what modifies them."""

import numpy as np

from prt_core.blender.compat import curves_of

# Modifiers whose result depends on the frame without any keys.
_OF_TIME = {
    "BUILD", "CLOTH", "DYNAMIC_PAINT", "EXPLODE", "FLUID", "MESH_CACHE", "MESH_SEQUENCE_CACHE",
    "OCEAN", "SOFT_BODY", "WAVE",
}  # fmt: skip


def deforms(item):
    """Whether an object's geometry may be another one at another frame.

    Keys that all have one value, drivers, and what nodes do with the time are not looked at.

    Parameters
    ----------
    item : bpy.types.Object
    """
    if any(map(_is_animated, (item.data, getattr(item.data, "shape_keys", None)))):
        return True
    shown = [modifier for modifier in item.modifiers if modifier.show_render]
    if not shown:
        return False
    if _is_animated(item, "modifiers["):
        return True
    return any(m.type in _OF_TIME or _is_animated(getattr(m, "object", None)) for m in shown)


def _is_animated(block, within=""):
    """Whether curves of a data-block change over time, of properties whose path begins so."""
    data = getattr(block, "animation_data", None)
    if data is None:
        return False
    if any(not track.mute for track in data.nla_tracks):
        return True
    return any(
        _changes(curve) for curves in curves_of(block) for curve in curves
        if curve.data_path.startswith(within) and not curve.mute
    )  # fmt: skip


def _changes(curve):
    keys = np.empty((len(curve.keyframe_points), 2), np.float32)
    curve.keyframe_points.foreach_get("co", keys.ravel())
    return len(curve.modifiers) > 0 or (len(keys) > 0 and np.ptp(keys[:, 1]) > 0)
