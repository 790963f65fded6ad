"""A scene's colour management (AgX, Filmic, exposure, look, curves) as a `ViewTransform`.

Blender itself writes a table of colours through it. Solid mode, which shows colour attributes
without it, and pictures that are written apart from Blender look radiance up there.
"""

import tempfile
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np

from prt_core.errors import expect
from prt_core.scene import ViewTransform

# The display that pictures in files are for.
FILES = "sRGB"
# The last ones that were read, by what they depend on.
_KEPT, _MOST_KEPT = {}, 4


def view_transform_of(scene, display=None):
    """The `ViewTransform` of a scene as it is now.

    Parameters
    ----------
    scene : bpy.types.Scene
    display : str, optional
        The name of another display device than the scene's, where Blender has it.
    """
    # What the window shows and what files are for is one table on most displays.
    display = None if display == scene.display_settings.display_device else display
    key = display, *transform_key(scene)
    if key not in _KEPT:
        while len(_KEPT) >= _MOST_KEPT:
            _KEPT.pop(next(iter(_KEPT)))
        settings = scene.view_settings
        factor = 2.0**-settings.exposure
        table = _written_by_blender(scene, display, ViewTransform.steps() * np.float32(factor))
        _KEPT[key] = ViewTransform(table, settings.exposure, _named(settings))
    return _KEPT[key]


def transform_key(scene):
    """What a scene's `ViewTransform` depends on, as something that can be compared.

    Parameters
    ----------
    scene : bpy.types.Scene
    """
    settings = scene.view_settings
    names = ("view_transform", "look", "exposure", "gamma", "use_curve_mapping",
             "use_white_balance", "white_balance_temperature", "white_balance_tint")  # fmt: skip
    values = [getattr(settings, name, None) for name in names]
    if settings.use_curve_mapping:
        curves = settings.curve_mapping.curves
        values += [(*point.location, point.handle_type) for c in curves for point in c.points]
    return scene.display_settings.display_device, *values


def _named(settings):
    """The view transform and the look, of which some are called after theirs."""
    name, look = settings.view_transform, settings.look
    if look in ("", "None"):
        return name
    return look if look.startswith(name) else f"{name}, {look}"


def _written_by_blender(scene, display, steps):
    """(3, n, n, n) uint16: what Blender writes of the table's colours, at `steps` (n,)."""
    side = len(steps)
    colours = np.ones((side, side, side, 4), np.float32)
    colours[..., :3] = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    name = "prt view transform"
    copy, made = scene.copy(), []
    try:
        if display is not None:
            _to_display(copy, display)
        _write_png(copy.render.image_settings)
        made.append(bpy.data.images.new(name, side**2, side, float_buffer=True))
        made[0].pixels.foreach_set(colours.ravel())
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "table.png"
            made[0].save_render(str(path), scene=copy)
            expect(path.is_file(), "view transform: Blender could not write its table; is the "
                   "disk full?")  # fmt: skip
            made.append(bpy.data.images.load(str(path)))
            made[1].colorspace_settings.is_data = True
            made[1].pixels.foreach_get(colours.ravel())
    finally:
        bpy.data.scenes.remove(copy)
        bpy.data.batch_remove(made)
    whole = np.rint(np.moveaxis(colours[..., :3], -1, 0) * 65535)
    return np.ascontiguousarray(whole.astype(np.uint16))


def _to_display(scene, display):
    """Show a scene on another display by the same view transform, where Blender has both."""
    settings = scene.view_settings
    names = {name: getattr(settings, name) for name in ("view_transform", "look")}
    # Configurations of their own have displays by other names.
    with suppress(TypeError):
        scene.display_settings.display_device = display
        for name, value in names.items():
            setattr(settings, name, value)


def _write_png(settings):
    """Whole pictures of 16 bits, with the scene's own colour management."""
    if hasattr(settings, "media_type"):  # 5.0: movies have formats of their own
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "16"
    settings.compression, settings.color_management = 0, "FOLLOW_SCENE"
