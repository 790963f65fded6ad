"""What a scene's view transform (AgX, Filmic, exposure, look, curves) makes of radiance.

Solid mode shows colour attributes without it. So what is written for that mode carries it: Blender
itself writes a table of colours through the scene's colour management, and radiance is looked up
there. No transform is rebuilt here, whatever the scene's configuration has.
"""

import tempfile
from pathlib import Path

import bpy
import numpy as np

from prt_core.errors import expect, expect_array

# Entries of the table along each channel; they are spaced as logarithms beyond _KNEE, up to _TOP.
# Exposure is multiplied in before, so every transform is white there.
_SIDE, _KNEE, _TOP = 41, 2.0**-9, 2.0**8
_LAST = np.log2(_TOP / _KNEE + 1)


class ViewTransform:
    """How a scene shows radiance on its display.

    Parameters
    ----------
    scene : bpy.types.Scene

    Attributes
    ----------
    key : tuple
        What it depends on (see `transform_key`).
    """

    def __init__(self, scene):
        self.key = transform_key(scene)
        self._factor = np.float32(2.0**scene.view_settings.exposure)
        self._table = _written_by_blender(scene, 1 / self._factor)

    def display(self, radiance):
        """What the display is sent.

        Parameters
        ----------
        radiance : (n, 3) float
            Linear Rec.709.

        Returns
        -------
        (n, 3) float32
            0 to 1, as encoded for the display.
        """
        from scipy.ndimage import map_coordinates

        radiance = expect_array("radiance", radiance, (None, 3), np.float32)
        exposed = np.clip(radiance * self._factor, 0, _TOP)
        places = np.log2(exposed / np.float32(_KNEE) + 1).T * np.float32((_SIDE - 1) / _LAST)
        shown = [map_coordinates(channel, places, order=1) for channel in self._table]
        return np.stack(shown, axis=1)

    def encode(self, picture):
        """(height, width, 3) uint8 of a picture as the display shows it.

        Parameters
        ----------
        picture : (height, width, 3) float32
            Linear Rec.709.
        """
        shown = self.display(picture.reshape(-1, 3)).reshape(picture.shape)
        return (shown * 255 + 0.5).astype(np.uint8)

    def for_solid(self, radiance):
        """(n, 3) float32 linear colours that Solid mode, which encodes them only, shows alike.

        Parameters
        ----------
        radiance : (n, 3) float
            Linear Rec.709.
        """
        shown = self.display(radiance)
        return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


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


def _written_by_blender(scene, factor):
    """(3, n, n, n) float32: what Blender writes of the table's colours times `factor`."""
    axis = ((2 ** np.linspace(0, _LAST, _SIDE) - 1) * _KNEE * factor).astype(np.float32)
    colours = np.ones((_SIDE, _SIDE, _SIDE, 4), np.float32)
    colours[..., :3] = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    name = "prt view transform"
    copy, made = scene.copy(), []
    try:
        _write_png(copy.render.image_settings)
        made.append(bpy.data.images.new(name, _SIDE**2, _SIDE, float_buffer=True))
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
    return np.ascontiguousarray(np.moveaxis(colours[..., :3], -1, 0))


def _write_png(settings):
    """Whole pictures of 16 bits, with the scene's own colour management."""
    if hasattr(settings, "media_type"):  # 5.0: movies have formats of their own
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "16"
    settings.compression, settings.color_management = 0, "FOLLOW_SCENE"
