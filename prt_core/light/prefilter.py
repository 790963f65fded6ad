"""Reflection maps: a light that was blurred by a lobe, looked up along the mirror direction.

What surfaces of one gloss reflect, where nothing is in the way, is a map over directions; a new
light costs a convolution, a view a look-up (Miller and Hoffman 1984). Shadows come in as a factor
at best: how much of the lobe is not hidden (see `PhongMap.toward`).

Phong's lobe depends on the mirror direction alone, but for the cosine; that is linear in the
normal, so a map of vectors has it too, and only the horizon is left out. GGX's lobe depends on
more: the split sum (Karis 2013) blurs with the lobe of a view from straight above, and scales by
what the surface reflects in all.
"""

from functools import lru_cache

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_numbers,
    expect_whole,
    shown,
)
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import FACES, CubeMap, sobol_points, square_to_ggx_normals

_BLOCK = 256
# 2 to this many normals of facets are summed over for each node of the table of shares.
_POWER = 10
# Cosines below this are taken as this: nothing that is seen, of any lobe that is one.
_DARK = np.float32(1e-30)


class ReflectionMap:
    """Values at the crossings of a grid on each face of a cube, mixed linearly between them.

    Crossings on a face's edges are those of its neighbour, so no seam is seen.

    Parameters
    ----------
    values : (6, n + 1, n + 1, ...) float
        Face, row, column; see `reflection_nodes`.
    """

    def __init__(self, values):
        values = expect_numbers("values", values)
        n = values.shape[1] if values.ndim > 2 else 0
        expect(
            n > 1 and values.shape[:3] == (6, n, n),
            f"values: expected (6, n + 1, n + 1, ...), got {values.shape}",
        )
        self.values = values

    def at(self, directions):
        """Values (m, ...) along `directions` (m, 3), of any length but zero."""
        directions = expect_array("directions", directions, (None, 3), np.float64)
        n = self.values.shape[1] - 1
        axis = np.abs(directions).argmax(axis=1)
        main = np.take_along_axis(directions, axis[:, None], axis=1)[:, 0]
        face = 2 * axis + (main < 0)
        local = np.einsum("mij,mj->mi", FACES[face], directions)
        place = (local[:, 1:] / local[:, :1] + 1) / 2 * n
        first = np.clip(place.astype(int), 0, n - 1)
        part = (place - first).astype(self.values.dtype)
        shape = -1, *(1,) * (self.values.ndim - 3)
        x, y = part[:, 0].reshape(shape), part[:, 1].reshape(shape)
        column, row = first.T
        v = self.values
        above = (1 - x) * v[face, row, column] + x * v[face, row, column + 1]
        below = (1 - x) * v[face, row + 1, column] + x * v[face, row + 1, column + 1]
        return (1 - y) * above + y * below


def reflection_nodes(n):
    """Directions (6, n + 1, n + 1, 3) float64, unit vectors, of the crossings of a map."""
    place = np.linspace(-1, 1, expect_whole("n", n, 1, 512) + 1)
    v, u = np.meshgrid(place, place, indexing="ij")
    local = np.stack([np.ones_like(u), u, v], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return np.stack([local @ face for face in FACES])


def blurred(cube_map, quantities, kernel, n):
    """Sums over the texels of a cube map, weighted by a function of the angle to each node.

    Parameters
    ----------
    cube_map : CubeMap
    quantities : (n_directions, k) float
        Of the texels; their solid angles are a part of them.
    kernel : callable
        Weights of cosines, an array of any shape.
    n : int
        Of the map's grid.

    Returns
    -------
    (6, n + 1, n + 1, k) float32
    """
    expect_kind("cube_map", cube_map, CubeMap)
    shape = cube_map.n_directions, None
    quantities = expect_array("quantities", quantities, shape).astype(np.float32)
    nodes = reflection_nodes(n)
    flat = nodes.reshape(-1, 3).astype(np.float32)
    ways = cube_map.directions.T.astype(np.float32)
    result = np.empty((len(flat), quantities.shape[1]), np.float32)

    def one(first):
        part = slice(first, first + _BLOCK)
        weights = kernel(np.minimum(flat[part] @ ways, 1))
        result[part] = weights.astype(np.float32) @ quantities

    with one_blas_thread():
        on_all_cores(one, range(0, len(flat), _BLOCK))
    return result.reshape(*nodes.shape[:3], -1)


class PhongMap:
    """What surfaces with one Phong lobe reflect, as a map.

    Parameters
    ----------
    cube_map : CubeMap
    exponent : float
        Of the lobe, (n + 2) / 2 pi times the cosine to the power n (see `Phong`).
    n : int, optional
        Of the map's grid; default: fine enough for the lobe.
    """

    def __init__(self, cube_map, exponent, n=None):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.exponent = expect_number("exponent", exponent, 0, 1e6)
        # Between crossings a linear mixture is off by exponent / 8 times the square of their gap.
        self.n = min(256, max(16, int(6 * np.sqrt(exponent)))) if n is None else n
        expect_whole("n", self.n, 1, 512)
        self.map = None

    def set_light(self, light):
        """Blur a light, (n_directions, n_channels). Returns self."""
        shape = self.cube_map.n_directions, None
        light = expect_array("light", light, shape, np.float64, 0, BRIGHTEST)
        vectors = self.cube_map.vectors[:, :, None] * light[:, None]
        scale = np.float32((self.exponent + 2) / (2 * np.pi))
        exponent = np.float32(self.exponent)

        def lobe(cosine):
            # The logarithm is much quicker than the power, and as good here.
            return scale * np.exp(exponent * np.log(np.maximum(cosine, _DARK)))

        values = blurred(self.cube_map, vectors.reshape(len(light), -1), lobe, self.n)
        self.map = ReflectionMap(values.reshape(*values.shape[:3], 3, -1))
        return self

    def toward(self, normals, outgoing, visibility=None):
        """Radiance toward a view.

        Parameters
        ----------
        normals, outgoing : (n_points, 3) float
        visibility : (n_points,) float, optional
            Share of the lobe that is not hidden (see `lobe_visibility`); default: all of it.

        Returns
        -------
        (n_points, n_channels) float32
        """
        normals, outgoing, cosine = _expect_views(self.map, normals, outgoing)
        vectors = self.map.at(2 * cosine[:, None] * normals - outgoing)
        result = np.einsum("ni,nic->nc", normals, vectors).astype(np.float32)
        return _seen(np.maximum(result, 0), cosine, visibility)

    @property
    def nbytes(self):
        """Of the map; 0 before a light is set."""
        return 0 if self.map is None else self.map.values.nbytes


class SplitSum:
    """What surfaces with GGX lobes reflect: maps for some roughnesses, and a table of shares.

    Parameters
    ----------
    cube_map : CubeMap
    roughness : sequence of float
        Sliders (roots of alpha) of the maps, ascending; between them maps are mixed.
    n : int, optional
        Of the maps' grids; default: as fine as each lobe needs, 64 at most.
    """

    def __init__(self, cube_map, roughness=(0.1, 0.2, 0.3, 0.45, 0.65, 1.0), n=None):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.roughness = expect_array("roughness", roughness, (None,), np.float64, 0.01, 1)
        ascending = len(self.roughness) and (np.diff(self.roughness) > 0).all()
        expect(ascending, "roughness: expected one or more numbers that ascend")
        alpha = self.roughness**2
        sizes = np.clip(4.2 / alpha, 16, 64).astype(int) if n is None else n + 0 * alpha
        self.sizes = [expect_whole("n", int(size), 1, 512) for size in sizes]
        self.maps = None

    def set_light(self, light):
        """Blur a light, (n_directions, n_channels), for each roughness. Returns self."""
        shape = self.cube_map.n_directions, None
        light = expect_array("light", light, shape, np.float64, 0, BRIGHTEST)
        weighed = np.column_stack([light, np.ones(len(light))])
        weighed *= self.cube_map.solid_angles[:, None]
        self.maps = []
        for roughness, n in zip(self.roughness, self.sizes, strict=True):
            values = blurred(self.cube_map, weighed, _ggx_kernel(roughness**2), n)
            self.maps.append(ReflectionMap(values[..., :-1] / values[..., -1:]))
        return self

    def toward(self, normals, outgoing, roughness, f0, visibility=None):
        """Radiance toward a view.

        Parameters
        ----------
        normals, outgoing : (n_points, 3) float
        roughness : float or (n_points,) float
            Slider, within those of the maps.
        f0 : float, (n_channels,) or (n_points, n_channels) float
            What is reflected straight back, with Schlick's curve to white.
        visibility : (n_points,) float, optional
            See `PhongMap.toward`.

        Returns
        -------
        (n_points, n_channels) float32
        """
        normals, outgoing, cosine = _expect_views(self.maps, normals, outgoing)
        low, high = self.roughness[[0, -1]]
        roughness = np.broadcast_to(np.asarray(roughness, np.float64), (len(normals),))
        roughness = expect_array("roughness", roughness, (len(normals),), None, low, high)
        ways = self._ways(normals, 2 * cosine[:, None] * normals - outgoing, roughness)
        place = np.interp(roughness, self.roughness, np.arange(len(self.roughness)))
        blurred_light = 0
        for index, one in enumerate(self.maps):
            share = np.maximum(1 - np.abs(place - index), 0)
            if share.any():
                blurred_light = blurred_light + share[:, None] * one.at(ways)
        scale, bias = environment_share(np.maximum(cosine, 0), roughness)
        f0 = np.atleast_1d(expect_numbers("f0", f0))
        good = f0.shape[:-1] in ((), (len(normals),)) and ((f0 >= 0) & (f0 <= 1)).all()
        expect(good, f"f0: expected numbers from 0 to 1, one a channel, got {shown(f0)}")
        reflected = f0 * scale[:, None] + bias[:, None]
        return _seen((blurred_light * reflected).astype(np.float32), cosine, visibility)

    @staticmethod
    def _ways(normals, mirror, roughness):
        """Where lobes are strongest: rough ones lean from the mirror direction to the normal.

        Source: Lagarde and de Rousiers 2014, Moving Frostbite to physically based rendering.
        """
        alpha = roughness[:, None] ** 2
        share = (1 - alpha) * (np.sqrt(1 - alpha) + alpha)
        ways = normals + share * (mirror - normals)
        # Opposite directions have no middle: a view from the horizon.
        return np.where((ways * ways).sum(axis=1, keepdims=True) > 1e-12, ways, normals)

    @property
    def nbytes(self):
        """Of the maps; 0 before a light is set."""
        return sum(one.values.nbytes for one in self.maps or ())


def environment_share(cosine, roughness):
    """What GGX with Schlick's curve reflects of even light: `f0 * scale + bias`.

    Parameters
    ----------
    cosine : (n,) float
        Between viewer and normal, 0 to 1.
    roughness : (n,) float
        Slider, 0 to 1.

    Returns
    -------
    scale, bias : (n,) float64

    Source: Karis 2013, Real shading in Unreal Engine 4.
    """
    table = _share_table()
    n = table.shape[0] - 1
    x, y = (np.clip(v, 0, 1) * n for v in (roughness, cosine))
    i, j = (np.minimum(v.astype(int), n - 1) for v in (x, y))
    x, y = (x - i)[:, None], (y - j)[:, None]
    low = (1 - y) * table[i, j] + y * table[i, j + 1]
    high = (1 - y) * table[i + 1, j] + y * table[i + 1, j + 1]
    return tuple(((1 - x) * low + x * high).T)


@lru_cache(maxsize=1)
def _share_table(n=32):
    """(n + 1, n + 1, 2) scale and bias over roughness and cosine; made once."""
    uv = sobol_points(_POWER) + 0.5 / (1 << _POWER)
    cosine = np.maximum(np.arange(n + 1) / n, 1e-3)
    outgoing = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)[:, None]
    table = []
    for roughness in np.maximum(np.arange(n + 1) / n, 0.01):
        alpha = roughness**2
        half = square_to_ggx_normals(uv[None], outgoing, alpha, alpha)
        along = np.maximum((half * outgoing).sum(axis=-1), 0)
        height = np.maximum(2 * along * half[..., 2] - outgoing[..., 2], 0)
        # Of normals as the viewer sees them: what is masked on both ways, over one way.
        root_in, root_out = (
            np.sqrt(alpha**2 + (1 - alpha**2) * z**2) for z in (height, outgoing[..., 2])
        )
        both = height * (outgoing[..., 2] + root_out)
        masked = both / np.maximum(height * root_out + outgoing[..., 2] * root_in, 1e-12)
        curve = (1 - along) ** 5
        table.append([(masked * (1 - curve)).mean(axis=1), (masked * curve).mean(axis=1)])
    return np.moveaxis(np.array(table), 1, 2)


def _ggx_kernel(alpha):
    """Weights of light for a lobe whose view, normal and mirror direction are one, to a factor."""
    square = np.float32(alpha * alpha)

    def kernel(cosine):
        # D of the vector half way, from the squares of its sine and cosine.
        sine = (1 - cosine) / 2
        density = square * (1 - sine) + sine
        return np.maximum(cosine, 0) / (density * density)

    return kernel


def _expect_views(maps, normals, outgoing):
    expect(maps is not None, "light: none is set; call set_light first")
    normals = expect_array("normals", normals, (None, 3), np.float64)
    outgoing = expect_array("outgoing", outgoing, normals.shape, np.float64)
    return normals, outgoing, np.einsum("ni,ni->n", normals, outgoing)


def _seen(radiance, cosine, visibility):
    """Radiance of points that face the viewer, times the visibility of their lobes."""
    shape = (len(radiance),)
    if visibility is not None:
        visibility = expect_array("visibility", visibility, shape, np.float32, 0, 1.0001)
        radiance = radiance * visibility[:, None]
    return np.where(cosine[:, None] > 0, radiance, np.float32(0))
