"""Some samples of each lobe: light of a width that fits the sample, seen if its bit says so.

Samples of the lobe's own density, each of which stands for a piece of the sphere, so light is read
where it is averaged over squares of about that size (Krivanek and Colbert 2008, Real-time shading
with filtered importance sampling). The visibility of the one texel stands for that of the piece.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_whole
from prt_core.reflectance.brdf import Reflectance
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import Blocks, CubeMap, sobol_points, tangent_frames
from prt_core.transport.visibility import UNIT, expect_bits

# Points worked on at once.
_PART = 256


class LobeSamples:
    """Glossy points of one isotropic reflectance, from any side.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
    reflectance : Reflectance
        Of one material.
    power : int
        2 to this many samples of each lobe.
    """

    def __init__(self, bits, normals, cube_map, reflectance, power=4):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.bits = expect_bits("bits", bits, cube_map.n_directions)
        self.normals = expect_array("normals", normals, (len(bits), 3), np.float64, -UNIT, UNIT)
        self.reflectance = expect_kind("reflectance", reflectance, Reflectance, "a BRDF")
        n_samples = 2 ** expect_whole("power", power, 0, 12)
        self.uv = (sobol_points(power) + 0.5 / n_samples).astype(np.float32)
        self.frames = tangent_frames(self.normals).astype(np.float32)
        # Cube maps half as fine each, down to the last whole one.
        sides = [cube_map.resolution]
        while sides[-1] % 2 == 0:
            sides.append(sides[-1] // 2)
        self._maps = [CubeMap(side) for side in sides]
        self._blocks = [Blocks(cube_map, side) for side in sides]
        self._starts = np.cumsum([0, *(m.n_directions for m in self._maps)])
        self._light = None

    def set_light(self, light):
        """Take a light, (n_directions, n_channels): its means over squares. Returns self."""
        shape = self.cube_map.n_directions, None
        light = expect_array("light", light, shape, np.float64)
        angles = self.cube_map.solid_angles[:, None]
        levels = [b.sums(light * angles) / b.solid_angles[:, None] for b in self._blocks]
        self._light = np.concatenate(levels).astype(np.float32)
        return self

    def toward(self, outgoing):
        """Radiance toward a view, (n_points, n_channels) float32, of `outgoing` (n_points, 3)."""
        expect(self._light is not None, "light: none is set; call set_light first")
        outgoing = expect_array("outgoing", outgoing, self.normals.shape, np.float64, -UNIT, UNIT)
        n_channels = max(self._light.shape[1], self.reflectance.n_channels)
        result = np.zeros((len(outgoing), n_channels), np.float32)
        facing = np.flatnonzero(np.einsum("ni,ni->n", self.normals, outgoing) > 0)

        def one(first):
            points = facing[first : first + _PART]
            frames = self.frames[points]
            local = np.einsum("ni,nji->nj", outgoing[points], frames).astype(np.float32)
            incoming = self.reflectance.sample(local, self.uv[:, None])
            density = self.reflectance.pdf(incoming, local)
            weight = incoming[..., 2] / np.where(density > 0, density, np.inf) / len(self.uv)
            ways = np.einsum("knj,nji->ikn", incoming, frames)
            texel = self.cube_map.texel_along(*ways)
            seen = self.bits[points, texel >> 3] >> (texel & 7).astype(np.uint8) & 1
            value = self.reflectance.eval(incoming, local) * (weight * seen)[..., None]
            result[points] = (value * self._light[self._place(ways, density)]).sum(axis=0)

        on_all_cores(one, range(0, len(facing), _PART))
        return result

    def _place(self, ways, density):
        """(k, n) int: where the light of samples is, at the level of their width."""
        texel = 4 * np.pi / self.cube_map.n_directions
        area = 1 / np.maximum(len(self.uv) * density * texel, 1e-9)
        level = np.rint(np.log2(np.maximum(area, 1)) / 2).astype(int)
        level = np.minimum(level, len(self._maps) - 1)
        place = np.zeros(level.shape, np.int64)
        for index in np.unique(level):
            mine = level == index
            texels = self._maps[index].texel_along(*ways[:, mine])
            place[mine] = self._starts[index] + texels
        return place

    @property
    def nbytes(self):
        """Of bits, frames and normals."""
        return self.bits.nbytes + self.frames.nbytes + self.normals.nbytes
