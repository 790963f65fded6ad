"""The brightest texels of a light, apart: what they bring is summed exactly, from their bits.

A sun in a few texels is what smooth forms of transport get wrong; the rest of the light they hold
well. So a light is split: its brightest texels above the mean, which are few, and what is left.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_whole
from prt_core.light.environment import BRIGHTEST
from prt_core.sphere import CubeMap, tangent_frames
from prt_core.transport.visibility import UNIT, expect_bits


class BrightTexels:
    """What points reflect of the brightest texels.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
    reflectance_eval : callable
        See `dense_reflection`.
    count : int
        Texels that are taken out of each light.
    """

    def __init__(self, bits, normals, cube_map, reflectance_eval, count=16):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.bits = expect_bits("bits", bits, cube_map.n_directions)
        self.normals = expect_array("normals", normals, (len(bits), 3), np.float64, -UNIT, UNIT)
        expect(callable(reflectance_eval), "reflectance_eval: expected a callable")
        self._evaluate = reflectance_eval
        self.count = expect_whole("count", count, 0, cube_map.n_directions - 1)
        self._frames = tangent_frames(self.normals).astype(np.float32)
        self._seen = None

    def split(self, light):
        """Take a light.

        Parameters
        ----------
        light : (n_directions, n_channels) float

        Returns
        -------
        (n_directions, n_channels) float64
            What is left: the mean of all others in place of the brightest.
        """
        shape = self.cube_map.n_directions, None
        light = expect_array("light", light, shape, np.float64, 0, BRIGHTEST)
        power = light.max(axis=1) * self.cube_map.solid_angles
        texels = np.argsort(-power, kind="stable")[: self.count]
        rest = light.copy()
        rest[texels] = np.delete(light, texels, axis=0).mean(axis=0)
        self.texels, self.radiance = texels, (light - rest)[texels]
        self._seen = bits_of(self.bits, texels)
        return rest

    def toward(self, points, outgoing):
        """Radiance that some points reflect of these texels, above the rest.

        Parameters
        ----------
        points : (n,) int
        outgoing : (n, 3) float
            Unit vectors from these points to the viewer.

        Returns
        -------
        (n, n_channels) float64
            With one channel where neither light nor reflectance have more.
        """
        expect(self._seen is not None, "light: none is taken; call split first")
        point, which = np.nonzero(self._seen[points])
        if not len(point):
            return np.zeros((len(points), 1))
        frames = self._frames[points]
        ways = self.cube_map.directions[self.texels].astype(np.float32)
        incoming = np.einsum("mij,mj->mi", frames[point], ways[which])
        local = np.einsum("mij,mj->mi", frames, np.asarray(outgoing, np.float32))[point]
        vectors = self.cube_map.vectors[self.texels]
        cosine = np.einsum("mj,mj->m", self.normals[points][point], vectors[which])
        weight = np.maximum(cosine, 0)[:, None] * self._evaluate(incoming, local)
        brought = weight * self.radiance[which]
        sums = np.zeros((len(points), brought.shape[1]))
        starts = np.flatnonzero(np.diff(point, prepend=-1))
        sums[point[starts]] = np.add.reduceat(brought, starts, axis=0)
        return sums

    @property
    def nbytes(self):
        """Of bits and frames."""
        return self.bits.nbytes + self._frames.nbytes


def bits_of(bits, texels):
    """(n_points, m) bool: which of the texels (m,) points see."""
    shift = (texels % 8).astype(np.uint8)
    return (bits[:, texels // 8] >> shift & 1).astype(bool)


class BrightApart:
    """A form of view-dependent transport from whose lights the brightest texels are taken.

    Parameters
    ----------
    form : object
        With `set_light(light)`, `toward(outgoing)` and `nbytes`.
    bright : BrightTexels
        Of the same points and reflectance.
    """

    def __init__(self, form, bright):
        self.form, self.bright = form, expect_kind("bright", bright, BrightTexels)

    def set_light(self, light):
        """Take a light, (n_directions, n_channels). Returns self."""
        self.form.set_light(self.bright.split(light))
        return self

    def toward(self, outgoing):
        """Radiance toward a view, (n_points, n_channels) float32, of `outgoing` (n_points, 3)."""
        result = self.form.toward(outgoing)
        normals = self.bright.normals
        facing = np.flatnonzero(np.einsum("ni,ni->n", normals, outgoing) > 0)
        result[facing] += self.bright.toward(facing, outgoing[facing])
        return result

    @property
    def nbytes(self):
        """Of both."""
        return self.form.nbytes + self.bright.nbytes
