"""How 3D views in Solid mode show the colours, and how they looked before."""

import bpy

_KEPT = "prt_shading_before"
# How Solid mode shows colours as they are, and nothing of its own.
_SHOWS = {
    "color_type": "VERTEX", "light": "FLAT", "show_object_outline": False, "show_cavity": False,
    "show_shadows": False,
}  # fmt: skip


def of_windows():
    """(screen, number of the area as text, shading) of all 3D views."""
    for window in bpy.context.window_manager.windows:
        for index, area in enumerate(window.screen.areas):
            if area.type == "VIEW_3D":
                yield window.screen, str(index), area.spaces.active.shading


def show():
    """Let Solid mode show vertex colours as they are; how many views changed."""
    changed = 0
    for screen, key, shading in of_windows():
        before = {name: getattr(shading, name) for name in _SHOWS}
        if before == _SHOWS:
            continue
        kept = screen[_KEPT].to_dict() if _KEPT in screen else {}
        kept.setdefault(key, before)
        screen[_KEPT] = kept
        for name, value in _SHOWS.items():
            setattr(shading, name, value)
        changed += 1
    return changed


def restore():
    """Give the views back what `show` took; how many changed."""
    changed = 0
    for screen, key, shading in of_windows():
        before = screen[_KEPT].get(key) if _KEPT in screen else None
        if before is not None:
            for name, value in _named(before).items():
                setattr(shading, name, type(getattr(shading, name))(value))
            changed += 1
    for window in bpy.context.window_manager.windows:
        if _KEPT in window.screen:
            del window.screen[_KEPT]
    return changed


def _named(before):
    """What was kept of a view by its names; files of earlier versions have two values in a list."""
    return dict(before) if hasattr(before, "keys") else dict(zip(_SHOWS, before, strict=False))


def in_solid():
    """Whether a view is in Solid mode, which knows no view transform."""
    return any(shading.type in {"SOLID", "WIREFRAME"} for *_, shading in of_windows())


def shown():
    """Whether a view of these windows was changed by `show`."""
    return any(_KEPT in window.screen for window in bpy.context.window_manager.windows)
