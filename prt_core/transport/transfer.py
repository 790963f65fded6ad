"""Transfer matrices: how the light's harmonics arrive at each point, as harmonics in its frame.

A distant light of order n is n^2 coefficients; what arrives at a point x, past what is in the way
and from what else sends light, is n^2 more, in the frame of the surface: a matrix M_x takes the one
to the other (Sloan et al. 2002, section 5). A view is then a dot product with the harmonics of the
reflectance (see `HarmonicReflectance`). Nothing here is sharper than the harmonics are; rings that
they leave around bright light may make points negative (see `negative_share`). `BrightTexels` may
be taken out of the light first.
"""

import numpy as np

from prt_core.basis import (
    harmonic_products,
    rotations_of_harmonics,
    texel_harmonics,
)
from prt_core.basis.spherical_harmonics import harmonics
from prt_core.errors import expect, expect_array, expect_kind, expect_whole
from prt_core.light.environment import BRIGHTEST
from prt_core.reflectance.harmonic import HarmonicReflectance
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import FACES, CubeMap, tangent_frames
from prt_core.transport.gather import NOT_CAST
from prt_core.transport.operator import ray_ends
from prt_core.transport.transport import Transport
from prt_core.transport.visibility import UNIT, expect_bits, unpack

_BLOCK = 512
# Rays nearer to the horizon than this cosine count as if they were there.
_FLAT = 0.02


def unshadowed_transfer(normals, order=5):
    """M_x where nothing is in the way: a rotation.

    Light from below the horizon arrives as well, so the reflectance has to be one that was
    projected, not fitted above the horizon alone (see `HarmonicReflectance`).

    Parameters
    ----------
    normals : (n_points, 3) float
    order : int

    Returns
    -------
    (n_points, 1, order^2, order^2) float32
        Local coefficients (rows) of the light's (columns); one channel stands for all.
    """
    normals = expect_array("normals", normals, (None, 3), np.float64, -UNIT, UNIT)
    n = expect_whole("order", order, 1, 16) ** 2
    result = np.zeros((len(normals), 1, n, n), np.float32)
    for degree, block in enumerate(rotations_of_harmonics(tangent_frames(normals), order)):
        part = slice(degree**2, (degree + 1) ** 2)
        result[:, 0, part, part] = block
    return result


def shadowed_transfer(bits, normals, cube_map, order=5):
    """M_x with what is in the way: light arrives from the texels that a point sees.

    The product of two harmonics is a sum of harmonics, so all entries follow from the visibility's
    own coefficients of twice the order.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
    order : int

    Returns
    -------
    (n_points, 1, order^2, order^2) float32
    """
    expect_kind("cube_map", cube_map, CubeMap)
    bits = expect_bits("bits", bits, cube_map.n_directions)
    normals = expect_array("normals", normals, (len(bits), 3), np.float64, -UNIT, UNIT)
    order = expect_whole("order", order, 1, 16)
    integrals = texel_harmonics(cube_map.resolution, 2 * order - 1, FACES).astype(np.float32)
    products = harmonic_products(order).reshape(order**4, -1).T.astype(np.float32)
    result = np.empty((len(bits), 1, order**2, order**2), np.float32)

    def one(first):
        part = slice(first, first + _BLOCK)
        seen = unpack(bits[part], cube_map.n_directions) @ integrals
        world = (seen @ products).reshape(-1, order**2, order**2)
        result[part, 0] = _turned(world, normals[part], order)

    with one_blas_thread():
        on_all_cores(one, range(0, len(bits), _BLOCK))
    return result


def interreflected_transfer(transport, hits, directions, points, order=5, sent=None):
    """What to add to `shadowed_transfer`: light that diffuse surfaces send to the points.

    Parameters
    ----------
    transport : Transport
    hits : (n, n_rays) int32
        Where gather rays of the points ended (see `gather_hits`).
    directions : (n, n_rays, 3) float
        Of these rays, cosine-distributed (see `gather_directions`).
    points : (n,) int or slice
    order : int
    sent : (n_points, 3, order^2) float32, optional
        `sent_harmonics(transport, order)`, where it is there already.

    Returns
    -------
    (n, 3, order^2, order^2) float32
        A matrix for each channel.
    """
    expect_kind("transport", transport, Transport)
    order = expect_whole("order", order, 1, 16)
    normals = transport.normals[points]
    hits = expect_array("hits", hits, (len(normals), None), np.int32, most=transport.n_points - 1)
    shape = *hits.shape, 3
    directions = expect_array("directions", directions, shape, np.float64, -UNIT, UNIT)
    sent = sent_harmonics(transport, order) if sent is None else sent
    sent = expect_array("sent", sent, (transport.n_points, 3, order**2), np.float32)
    ends = ray_ends(hits)
    result = np.zeros((len(normals), 3, order**2, order**2), np.float32)
    frames = tangent_frames(normals)

    def one(first):
        part = slice(first, first + 64)
        local = np.einsum("nri,nji->nrj", directions[part], frames[part])
        cast = np.count_nonzero(ends[part] != NOT_CAST, axis=1)[:, None]
        weight = np.pi / np.maximum(local[..., 2], _FLAT) / np.maximum(cast, 1)
        weight = np.where(ends[part] >= 0, weight, 0)
        arriving = (harmonics(local, order) * weight[..., None]).astype(np.float32)
        for channel in range(3):
            from_there = sent[:, channel][np.maximum(ends[part], 0)]
            result[part, channel] = np.matmul(arriving.swapaxes(1, 2), from_there)

    with one_blas_thread():
        on_all_cores(one, range(0, len(normals), 64))
    return result


def sent_harmonics(transport, order=5):
    """Radiance that points send out under lights of one harmonic: (n_points, 3, order^2) float32.

    With all bounces between diffuse surfaces; also the transfer vectors of these surfaces
    themselves, shadowed and interreflected.

    Parameters
    ----------
    transport : Transport
    order : int
    """
    expect_kind("transport", transport, Transport)
    cube_map = transport.cube_map
    means = texel_harmonics(cube_map.resolution, order, FACES) / cube_map.solid_angles[:, None]
    result = np.empty((transport.n_points, 3, order**2), np.float32)
    for index, mean in enumerate(means.T):
        # Received light is cut at zero: each half of the harmonic by itself.
        halves = [np.repeat(np.maximum(s * mean, 0)[:, None], 3, axis=1) for s in (1, -1)]
        up, down = (transport.radiance(half.astype(np.float32)) for half in halves)
        result[:, :, index] = up - down
    return result


def _turned(world, normals, order):
    """Rows of matrices (n, order^2, order^2) turned into the frames of normals (n, 3)."""
    result = np.empty_like(world)
    for degree, block in enumerate(rotations_of_harmonics(tangent_frames(normals), order)):
        part = slice(degree**2, (degree + 1) ** 2)
        result[:, part] = np.matmul(block.astype(np.float32), world[:, part])
    return result


class TransferMatrices:
    """Glossy points under low-frequency light, from any side.

    Parameters
    ----------
    matrices : (n_points, 1 or 3, order^2, order^2) float32
        Of `unshadowed_transfer`, or of `shadowed_transfer`, with `interreflected_transfer` or not.
    normals : (n_points, 3) float
    cube_map : CubeMap
    reflectance : HarmonicReflectance
        Of the same order.
    """

    def __init__(self, matrices, normals, cube_map, reflectance):
        self.reflectance = expect_kind("reflectance", reflectance, HarmonicReflectance)
        n = reflectance.order**2
        self.matrices = expect_array("matrices", matrices, (None, None, n, n), np.float32)
        shape = len(matrices), 3
        self.normals = expect_array("normals", normals, shape, np.float64, -UNIT, UNIT)
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self._integrals = texel_harmonics(cube_map.resolution, reflectance.order, FACES)
        self._arrived = None

    @classmethod
    def from_transport(cls, transport, reflectance):
        """Of the bits of a transport: shadowed, no light between surfaces."""
        expect_kind("transport", transport, Transport)
        expect_kind("reflectance", reflectance, HarmonicReflectance)
        parts = transport.bits, transport.normals, transport.cube_map
        matrices = shadowed_transfer(*parts, reflectance.order)
        return cls(matrices, transport.normals, transport.cube_map, reflectance)

    def project(self, light):
        """Coefficients of a light (n_directions, n_channels): (order^2, n_channels) float32."""
        shape = self.cube_map.n_directions, None
        light = expect_array("light", light, shape, np.float64, -BRIGHTEST, BRIGHTEST)
        return (self._integrals.T @ light).astype(np.float32)

    def set_light(self, light):
        """Take a light, (n_directions, n_channels): what arrives at each point. Returns self."""
        coefficients = self.project(light)
        channels = self.matrices.shape[1]
        expect(
            channels in (1, coefficients.shape[1]),
            f"light: expected {channels} channels, as the matrices have, got "
            f"{coefficients.shape[1]}",
        )
        if channels == 1:
            self._arrived = self.matrices[:, 0] @ coefficients
        else:
            columns = [self.matrices[:, c] @ coefficients[:, c] for c in range(channels)]
            self._arrived = np.stack(columns, axis=2)
        return self

    @property
    def arrived(self):
        """(n_points, order^2, n_channels) float32: harmonics of the light that arrives."""
        expect(self._arrived is not None, "light: none is set; call set_light first")
        return self._arrived

    def toward(self, outgoing):
        """Radiance toward a view: (n_points, n_channels) float32; rings may make it negative.

        Parameters
        ----------
        outgoing : (n_points, 3) float
            Unit vectors from the points to the viewer (see `View.outgoing`).
        """
        return reflected_harmonics(self.arrived, self.normals, outgoing, self.reflectance)

    @property
    def nbytes(self):
        """Of matrices, normals and the reflectance."""
        return self.matrices.nbytes + self.normals.nbytes + self.reflectance.nbytes


def reflected_harmonics(arrived, normals, outgoing, reflectance):
    """Radiance toward a view of light that arrived, as harmonics in the frames of points.

    Parameters
    ----------
    arrived : (n_points, order^2, n_channels) float32
    normals, outgoing : (n_points, 3) float
    reflectance : HarmonicReflectance

    Returns
    -------
    (n_points, n_channels) float32
    """
    normals = expect_array("normals", normals, (len(arrived), 3), np.float64, -UNIT, UNIT)
    outgoing = expect_array("outgoing", outgoing, normals.shape, np.float64, -UNIT, UNIT)
    n_channels = max(arrived.shape[2], reflectance.n_channels)
    result = np.zeros((len(arrived), n_channels), np.float32)
    facing = np.flatnonzero(np.einsum("ni,ni->n", normals, outgoing) > 0)

    def one(first):
        points = facing[first : first + 4096]
        frames = tangent_frames(normals[points])
        local = np.einsum("nij,nj->ni", frames, outgoing[points])
        vectors = reflectance.vectors(local).astype(np.float32)
        result[points] = (vectors * arrived[points].swapaxes(1, 2)).sum(axis=2)

    on_all_cores(one, range(0, len(facing), 4096))
    return result


def negative_share(radiance):
    """Share of points (n, n_channels) that ringing has made negative in some channel."""
    radiance = expect_array("radiance", radiance, (None, None))
    return float((radiance < 0).any(axis=1).mean()) if len(radiance) else 0.0
