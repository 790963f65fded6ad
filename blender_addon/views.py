"""How 3D views in Solid mode show the colours, and how they looked before."""

import bpy

_KEPT = "prt_shading_before"


def _solid_views():
    for window in bpy.context.window_manager.windows:
        for index, area in enumerate(window.screen.areas):
            if area.type == "VIEW_3D":
                yield window.screen, str(index), area.spaces.active.shading


def show():
    """Let Solid mode show vertex colours as they are; how many views changed."""
    changed = 0
    for screen, key, shading in _solid_views():
        if (shading.color_type, shading.light) == ("VERTEX", "FLAT"):
            continue
        kept = dict(screen.get(_KEPT, {}))
        kept.setdefault(key, [shading.color_type, shading.light])
        screen[_KEPT] = kept
        shading.color_type, shading.light = "VERTEX", "FLAT"
        changed += 1
    return changed


def restore():
    """Give the views back what `show` took; how many changed."""
    changed = 0
    for screen, key, shading in _solid_views():
        before = dict(screen.get(_KEPT, {})).get(key)
        if before is not None:
            shading.color_type, shading.light = before
            changed += 1
    for window in bpy.context.window_manager.windows:
        if _KEPT in window.screen:
            del window.screen[_KEPT]
    return changed


def in_solid():
    """Whether a view is in Solid mode, which knows no view transform."""
    return any(shading.type in {"SOLID", "WIREFRAME"} for *_, shading in _solid_views())


def shown():
    """Whether a view of these windows was changed by `show`."""
    return any(_KEPT in window.screen for window in bpy.context.window_manager.windows)
