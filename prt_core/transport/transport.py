"""`Transport`: T factored into visibility bits, the gather operator K and the materials."""

import hashlib
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from prt_core.errors import (
    expect,
    expect_array,
    expect_flag,
    expect_indices,
    expect_kind,
    expect_number,
    expect_whole,
)
from prt_core.reflectance import Materials, expect_materials
from prt_core.runtime.renamed import renamed
from prt_core.sphere import CubeMap
from prt_core.transport.bounce import (
    MOST_RECEIVED,
    bounce_series,
    expect_gather,
    received_with_bounces,
)
from prt_core.transport.exit_radiance import ExitRadiance
from prt_core.transport.sent import Sent, of_channels, sent_of
from prt_core.transport.visibility import UNIT, expect_bits, received_light, unpack

_BLOCK = 1024


@dataclass
class Transport:
    """The transport matrix T of a scene, never stored: made from its factors on demand.

    `B = albedo (E + K B)` with `E = D L`, so `T = (I - A K)^-1 A D`.

    Attributes
    ----------
    cube_map : CubeMap
    bits : (n_points, n_bytes) uint8
        Visibility (see `visibility_bits`).
    gather : (n_points, n_points) CSR float32, or None
        K; None where only direct light was baked.
    normals : (n_points, 3) float32
    materials : Materials, or (n_points, 3) float32
        May be replaced after the bake: T follows. An array is the albedo alone.
    tolerance : float
        Of the bounces (see `all_bounces`).
    bounces : int or None
        Exactly so many; None: as many as the tolerance needs.
    mean_materials : Materials, (n_points, 3) float32, or None
        Of the area that each point stands for, with which it bounces; None: `materials`. Replace
        them as well where those are replaced.
    opposite : (n_points,) int32, or None
        The point on the other side of the same place, -1 where there is none: whose light shines
        through what is translucent.
    """

    cube_map: CubeMap
    bits: np.ndarray
    gather: sp.csr_matrix | None
    normals: np.ndarray
    materials: Materials
    tolerance: float = 1e-3
    bounces: int | None = None
    mean_materials: Materials | None = None
    opposite: np.ndarray | None = None

    def __post_init__(self):
        expect_kind("cube_map", self.cube_map, CubeMap)
        expect_bits("bits", self.bits, self.directions_of_rows.n_directions)
        n_points = self.n_points
        self.normals = expect_array("normals", self.normals, (n_points, 3), None, -UNIT, UNIT)
        self.materials = expect_materials(
            "materials", self.materials, n_points, rounded=True, bounced=self.mean_materials is None
        )
        if self.mean_materials is not None:
            self.mean_materials = expect_materials(
                "mean_materials", self.mean_materials, n_points, rounded=True, bounced=True
            )
        if self.opposite is not None:
            self.opposite = expect_array(
                "opposite", self.opposite, (n_points,), np.int32, -1, n_points - 1
            )
        expect_gather(self.gather, n_points)
        expect_number("tolerance", self.tolerance, above=0, below=1)
        if self.bounces is not None:
            expect_whole("bounces", self.bounces, 0)

    @property
    def directions_of_rows(self):
        """The `CubeMap` of `bits`."""
        return self.cube_map

    @property
    def is_coarse(self):
        """Whether points take their rows from others, so that light need not be exact either."""
        return False

    @property
    def n_points(self):
        """Rows of T."""
        return len(self.bits)

    @property
    def n_directions(self):
        """Columns of T."""
        return self.cube_map.n_directions

    @property
    def shape(self):
        """(n_points, n_directions); each entry has three channels."""
        return self.n_points, self.n_directions

    @property
    def albedo(self):
        """(n_points, 3) float32: what points reflect towards the viewer; may be replaced."""
        return self.materials.albedo

    @albedo.setter
    def albedo(self, albedo):
        self.materials = self.materials.replaced(albedo=albedo)

    @property
    def mean_albedo(self):
        """(n_points, 3) float32 of `mean_materials`, None where there are none."""
        return None if self.mean_materials is None else self.mean_materials.albedo

    @property
    def bounced_albedo(self):
        """(n_points, 3) float32: what points reflect towards others."""
        return self.bounced_materials.albedo

    @property
    def sends(self):
        """What points send towards the viewer of what they receive: albedo, or `Sent`."""
        return sent_of(self.materials, self.opposite)

    @property
    def bounces_by(self):
        """What points send towards others of what they receive: albedo, or `Sent`."""
        return sent_of(self.bounced_materials, self.opposite)

    @property
    def bounced_materials(self):
        """`Materials` with which points reflect towards others."""
        return self.materials if self.mean_materials is None else self.mean_materials

    def fingerprint(self):
        """A digest of all that the colours depend on: the same for the same transport only."""
        digest = hashlib.blake2b(digest_size=16)
        arrays = [self.bits, self.normals]
        arrays += self.materials.digested() + self.bounced_materials.digested()
        if self.gather is not None:
            arrays += [self.gather.data, self.gather.indices, self.gather.indptr]
        for array in arrays:
            digest.update(f"{array.shape} {array.dtype};".encode())
            digest.update(np.ascontiguousarray(array))
        if isinstance(self.sends, Sent):
            digest.update(np.ascontiguousarray(self.opposite))
        digest.update(f"{self.cube_map.resolution} {self.tolerance} {self.bounces}".encode())
        return digest.hexdigest()

    def received(self, light):
        """Direct irradiance / pi, (n_points, 3) float32, under `light` (n_directions, 3)."""
        light = expect_array("light", light, (self.n_directions, None), np.float32)
        # Of light without colour one channel is made: rounding would tell three of them apart.
        narrow = light[:, :1] if is_grey(light) else light
        received = received_light(self.bits, self.normals, self.cube_map, narrow)
        return np.broadcast_to(received, (self.n_points, light.shape[1])).copy()

    def radiance(self, light, lamps=None, bounces="baked"):
        """Outgoing radiance of every point under a light, exactly (nothing is compressed).

        Parameters
        ----------
        light : (n_directions, 3) float32, or None
            Radiance of the environment.
        lamps : (n_points, 3) float32, optional
            Irradiance / pi of lamps (see `lamp_light`), added to that of the environment.
        bounces : int or None
            Default: as baked. 0 is direct light.

        Returns
        -------
        (n_points, 3) float32
            Linear Rec.709 radiance.
        """
        return self.exit_radiance(self.product(light, lamps, bounces)).toward()

    relight = renamed("relight", "radiance")

    def product(self, light, lamps=None, bounces="baked"):
        """What every point receives under a light, with all bounces: the light stage.

        The same read as that of compressed forms (see `Compressor.product`).

        Parameters
        ----------
        light, lamps, bounces
            As `radiance` takes them.

        Returns
        -------
        (n_points, 3) float32
            Irradiance / pi, without the albedo of the point itself.
        """
        received = np.zeros((self.n_points, 3), np.float32)
        if light is not None:
            received = received + self.received(light)
        if lamps is not None:
            received = received + expect_array("lamps", lamps, (self.n_points, 3), np.float32)
        return self.with_bounces(received, bounces)

    def with_bounces(self, received, bounces="baked"):
        """What points receive with the light between surfaces, for any direct light.

        Parameters
        ----------
        received : (n_points, n_channels) float32
            Irradiance / pi of light that arrives straight from where it is made.
        bounces : int or None
            As `radiance` takes them.

        Returns
        -------
        (n_points, n_channels) float32
        """
        shape = self.n_points, None
        received = expect_array(
            "received", received, shape, least=-MOST_RECEIVED, most=MOST_RECEIVED
        )
        is_baked = isinstance(bounces, str) and bounces == "baked"
        if not is_baked and bounces is not None:
            expect_whole("bounces", bounces, 0)
        bounces = self.bounces if is_baked else bounces
        if self._same_channel(1) == self._same_channel(2) == 0 and is_grey(received):
            # Grey surfaces under grey light: one channel says it all.
            one = np.ascontiguousarray(received[:, :1])
            one = self._bounced(self.gather, one, bounces, slice(0, 1))
            return np.repeat(one, received.shape[1], axis=1)
        return self._bounced(self.gather, received, bounces, slice(None))

    def exit_radiance(self, received):
        """What points send out: the view stage of what they received.

        Parameters
        ----------
        received : (n_points, ..., 3) float32
            With all bounces: of `product` of this transport or of a compressed form of it.

        Returns
        -------
        ExitRadiance
        """
        return ExitRadiance(received, self.sends)

    def _bounced(self, gather, received, bounces, channels):
        albedo = of_channels(self.bounces_by, channels)
        return received_with_bounces(gather, albedo, received, self.tolerance, bounces)[0]

    def direct(self, points):
        """(n, n_directions) float32, rows of D at points: irradiance / pi for unit radiance."""
        points = expect_indices("points", points, self.n_points)
        cosine = self.normals[points] @ self.cube_map.vectors.T.astype(np.float32) / np.pi
        return unpack(self.bits[points], self.n_directions) * cosine

    def rows(self, points, indirect=True):
        """Rows of T.

        Parameters
        ----------
        points : (n,) int
        indirect : bool
            With all bounces; by the adjoint series, so that only these rows are made.

        Returns
        -------
        (n, n_directions, 3) float32
        """
        points = expect_indices("points", points, self.n_points)
        points = np.arange(self.n_points)[points]
        expect(len(points), "points: expected at least one")
        expect_flag("indirect", indirect)
        if isinstance(self.sends, Sent):
            # What shines through is received on the other side: rows of both, then what is sent.
            behind = self.opposite[points]
            both = np.union1d(points, behind[behind >= 0])
            received = self._received_rows(both, indirect)
            return self.sends[both](received)[np.searchsorted(both, points)]
        received = self._received_rows(points, indirect)
        return ExitRadiance(received, self.albedo[points]).toward()

    def _received_rows(self, points, indirect):
        """(n, n_directions, 3) float32: what points receive for unit radiance of each texel."""
        if not indirect or self.gather is None:
            return self.direct(points)[..., None].repeat(3, axis=2)
        transposed = self.gather.T.tocsr()
        result = np.empty((len(points), self.n_directions, 3), np.float32)
        for channel in range(3):
            same = self._same_channel(channel)
            if same is not None:
                result[:, :, channel] = result[:, :, same]
                continue
            start = np.zeros((self.n_points, len(points)), np.float32)
            start[points, np.arange(len(points))] = 1
            # w = e + A K^T w: how much each point's received light adds to the wanted rows.
            albedo = self.bounced_albedo[:, [channel]]
            sends = of_channels(self.bounces_by, [channel])
            back = sends.adjoint if isinstance(sends, Sent) else albedo.__mul__
            weights, _ = bounce_series(
                lambda term, back=back: back(transposed @ term),
                start, albedo, self.tolerance, self.bounces,
            )  # fmt: skip
            result[:, :, channel] = self._times_direct(weights)
        return result

    def _times_direct(self, weights):
        """weights^T D, (n, n_directions) float32, in blocks of points."""
        n = weights.shape[1]
        sums = np.zeros((3 * n, self.n_directions), np.float32)
        for first in range(0, self.n_points, _BLOCK):
            part = slice(first, first + _BLOCK)
            left = (self.normals[part][:, :, None] * weights[part][:, None]).reshape(-1, 3 * n)
            sums += left.T @ unpack(self.bits[part], self.n_directions)
        vectors = self.cube_map.vectors.T.astype(np.float32) / np.float32(np.pi)
        return (sums.reshape(3, n, -1) * vectors[:, None]).sum(axis=0)

    def columns(self, directions, indirect=True):
        """Columns of T: the scene under unit radiance from single texels.

        Parameters
        ----------
        directions : (m,) int
        indirect : bool

        Returns
        -------
        (n_points, m, 3) float32
        """
        directions = expect_indices("directions", directions, self.n_directions)
        expect_flag("indirect", indirect)
        byte, bit = directions // 8, directions % 8
        seen = (self.bits[:, byte] >> bit.astype(np.uint8)) & 1
        cosine = self.normals @ self.cube_map.vectors[directions].T.astype(np.float32) / np.pi
        received = (seen * cosine).astype(np.float32)
        return self.exit_radiance(self._in_channels(received, indirect)).toward()

    def _in_channels(self, received, indirect=True):
        """(n_points, m) light that is the same in all channels to (n_points, m, 3) with bounces."""
        result = np.empty((*received.shape, 3), np.float32)
        gather = self.gather if indirect else None
        for channel in range(3):
            same = self._same_channel(channel)
            if same is not None:
                result[:, :, channel] = result[:, :, same]
            else:
                result[:, :, channel] = self._bounced(
                    gather, received, self.bounces, slice(channel, channel + 1)
                )
        return result

    def _same_channel(self, channel):
        """An earlier channel in which every albedo is the same, or None."""
        both = [self.materials.front, self.bounced_albedo]
        if isinstance(self.sends, Sent):
            both += [self.materials.through, self.bounced_materials.through]
        for other in range(channel):
            if all((albedo[:, other] == albedo[:, channel]).all() for albedo in both):
                return other
        return None


def is_grey(received):
    """Whether all channels of (n, n_channels) light are the same."""
    return bool((received == received[:, :1]).all())
