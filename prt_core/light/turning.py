"""An environment on the texels of a cube map, turned in milliseconds.

It is cut once into parts finer than the texels; a rotation hands each part to the texel that it
falls into.
"""

import numpy as np

from prt_core.errors import expect_kind
from prt_core.light.environment import EnvironmentMap, pixel_parts, sums_on_texels
from prt_core.sphere import CubeMap, rotation_matrix

# How much finer than the texels the parts are that are turned: of what is even, what is bright.
_EVEN, _BRIGHT, _SAMPLES = 3, 8, 16
# The brightest pixels are cut as finely as if they were not to be turned: suns.
_HOT, _HOT_SAMPLES = 384, 4000


class TurningLight:
    """An environment cut into parts once, which any rotation hands to the texels they fall into.

    Parameters
    ----------
    environment : EnvironmentMap
    cube_map : CubeMap
    """

    def __init__(self, environment, cube_map):
        expect_kind("environment", environment, EnvironmentMap)
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        even, bright = environment.layers
        self._even = self._coarse(_EVEN, even)
        self._bright = None if bright is None else self._suns(*bright)

    def at(self, rotation=None):
        """The mean radiance of every texel, (n_directions, 3) float32.

        As `EnvironmentMap.to_cube_map`, but for parts at a texel's rim, which are not cut.
        """
        matrix = rotation_matrix(rotation)
        light = self._onto(matrix, *self._even)
        light = light[:, :3] / np.maximum(light[:, 3:], 1e-30)
        if self._bright is not None:
            light += self._onto(matrix, *self._bright) / self.cube_map.solid_angles[:, None]
        return light.astype(np.float32)

    def _coarse(self, factor, layer):
        """Directions (3, n) of parts, and power of three channels and solid angle of each."""
        fine = CubeMap(min(self.cube_map.resolution * factor, 1024))
        power, area = sums_on_texels(fine, np.eye(3), *layer, _SAMPLES)
        used = np.flatnonzero(area)
        directions = np.ascontiguousarray(fine.directions[used].T, np.float32)
        return directions, np.column_stack([power, area])[used]

    def _suns(self, rows, columns, shape, values):
        """Parts of the bright pixels: small ones of the brightest."""
        power = values.sum(axis=1) * np.cos((rows + 0.5) / shape[0] * np.pi - np.pi / 2)
        order = np.argsort(-power, kind="stable")
        hot, rest = order[:_HOT], order[_HOT:]
        parts = self.cube_map.n_directions, _HOT_SAMPLES
        directions, area, pixel = pixel_parts(rows[hot], columns[hot], shape, *parts)
        suns = [(directions.T.astype(np.float32), area[:, None] * values[hot][pixel])]
        if len(rest):
            directions, sums = self._coarse(
                _BRIGHT, (rows[rest], columns[rest], shape, values[rest])
            )
            suns.append((directions, sums[:, :3]))
        directions, sums = zip(*suns, strict=True)
        return np.hstack(directions), np.concatenate(sums)

    def _onto(self, matrix, directions, values):
        texel = self.cube_map.texel_along(*(matrix.astype(np.float32) @ directions))
        n = self.cube_map.n_directions
        return np.column_stack([np.bincount(texel, column, n) for column in values.T])
