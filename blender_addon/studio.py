"""Blender's own studio lights: their files, and a list with thumbnails."""

from pathlib import Path

import bpy

# Blender keeps no reference to the strings of a list: it must live on.
_ITEMS, _PREVIEWS = [], {}


def studio_lights():
    """Paths of Blender's own world lights by name."""
    lights = bpy.context.preferences.studio_lights
    return {light.name: light.path for light in lights if light.type == "WORLD"}


def items(_settings, _context):
    """Items of an `EnumProperty`."""
    if not _ITEMS:
        for index, (name, path) in enumerate(sorted(studio_lights().items())):
            label = Path(name).stem.replace("_", " ").title()
            about = f"Blender's studio light {label}"
            _ITEMS.append((name, label, about, _thumbnail(name, path), index))
    return _ITEMS


def _thumbnail(name, path):
    if bpy.app.background:
        return 0
    from bpy.utils import previews

    if "lights" not in _PREVIEWS:
        _PREVIEWS["lights"] = previews.new()
    return _PREVIEWS["lights"].load(name, path, "IMAGE").icon_id


def forget():
    """Free the thumbnails."""
    _ITEMS.clear()
    if _PREVIEWS:
        from bpy.utils import previews

        previews.remove(_PREVIEWS.pop("lights"))
