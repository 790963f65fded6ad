"""What a light field is made of, read one light at a time and checked."""

import numpy as np

from prt_core.errors import expect, expect_array, expect_numbers

# Radiance is below this, so that squares and their sums are numbers.
_MOST = 1e12


class LightRadiance:
    """The radiance of one or several lights; iterated over, it is that of each.

    Parameters
    ----------
    radiance : (n_points, m1, m2, 3) or (n_lights, n_points, m1, m2, 3) float
        Anything with a shape that can be indexed by the light.

    Attributes
    ----------
    n_lights, n_points : int
    shape : (int, int)
        Rows m1 and columns m2.
    """

    def __init__(self, radiance):
        shape = getattr(radiance, "shape", None)
        if shape is None:
            radiance = expect_numbers("radiance", radiance)
            shape = radiance.shape
        good = len(shape) in (4, 5) and shape[-1] == 3 and all(shape)
        expect(
            good,
            "radiance: expected an array of shape (n_points, m1, m2, 3) or "
            f"(n_lights, n_points, m1, m2, 3), none of them 0, got {tuple(shape)}",
        )
        self._radiance, self._single = radiance, len(shape) == 4
        self.n_lights = 1 if self._single else shape[0]
        self.n_points, self.shape = shape[-4], tuple(shape[-3:-1])

    def __iter__(self):
        return map(self.__getitem__, range(self.n_lights))

    def __getitem__(self, light):
        name = "radiance" if self._single else f"radiance of light {light}"
        wanted = self.n_points, *self.shape, 3
        part = self._radiance if self._single else self._radiance[light]
        return expect_array(name, part, wanted, np.float32, -_MOST, _MOST)

    def largest(self):
        """The largest radiance; 1 where all is dark."""
        return max(float(np.max(light)) for light in self) or 1.0
