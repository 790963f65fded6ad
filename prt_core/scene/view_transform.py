"""How a scene's display shows radiance: its view transform, look, exposure and curves.

Radiance is looked up in a table that Blender's own colour management has written (see
`blender.view_transform`), so whatever a scene's configuration has, no transform is rebuilt here.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_number, shown

# Entries of the table along each channel; they are spaced as logarithms beyond _KNEE, up to _TOP.
# Exposure is multiplied in before, so every transform is white there.
_SIDE, _KNEE, _TOP = 41, 2.0**-9, 2.0**8
_LAST = np.log2(_TOP / _KNEE + 1)
_WHITE = 65535


class ViewTransform:
    """What a scene makes of radiance on its display.

    Parameters
    ----------
    table : (3, n, n, n) uint16
        What each channel of the display is sent, of linear Rec.709 whose red, green and blue are
        at `steps`, in 65535ths.
    exposure : float
        Stops that radiance is brightened by before.
    name : str
        As artists know it: 'AgX', 'Filmic', 'Standard'.

    Attributes
    ----------
    table, exposure, name
    """

    def __init__(self, table, exposure=0.0, name=""):
        self.table = expect_array("view transform", table, (3, _SIDE, _SIDE, _SIDE))
        expect(
            self.table.dtype == np.uint16,
            f"view transform: expected a table of uint16, got {shown(table)}",
        )
        self.exposure = expect_number("exposure", exposure, -64, 64)
        self.name = expect_kind("name", name, str)

    @staticmethod
    def steps():
        """(n,) float32: the radiance along each side of a table, after exposure."""
        return ((2 ** np.linspace(0, _LAST, _SIDE) - 1) * _KNEE).astype(np.float32)

    def display(self, radiance, exposure=0.0):
        """What the display is sent.

        Parameters
        ----------
        radiance : (n, 3) float
            Linear Rec.709.
        exposure : float
            Stops beside the scene's own.

        Returns
        -------
        (n, 3) float32
            0 to 1, as encoded for the display.
        """
        from scipy.ndimage import map_coordinates

        radiance = expect_array("radiance", radiance, (None, 3), np.float32)
        stops = self.exposure + expect_number("exposure", exposure, -64, 64)
        with np.errstate(over="ignore"):
            exposed = np.clip(radiance * np.float32(2.0**stops), 0, _TOP)
        places = np.log2(exposed / np.float32(_KNEE) + 1).T * np.float32((_SIDE - 1) / _LAST)
        shown = [map_coordinates(each, places, np.float32, order=1) for each in self.table]
        return np.stack(shown, axis=1) / np.float32(_WHITE)

    def for_solid(self, radiance):
        """(n, 3) float32 linear colours that Solid mode, which encodes them only, shows alike.

        Parameters
        ----------
        radiance : (n, 3) float
            Linear Rec.709.
        """
        shown = self.display(radiance)
        return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)

    def __str__(self):
        stops = f" at {self.exposure:+.2g} stops" if self.exposure else ""
        return f"{self.name}{stops}"
