"""Transport by in-out terms: what each term of the reflectance takes of the light, once a light.

`B(x, o) = sum_k G_k(o) R_k(x)`, where `R_k(x) = sum_d F_k(d) V_d(x) L_d cos_x(d)` is a transport
matrix of its own for each term k (Huang and Ramamoorthi 2010, equations 2 and 3; the factors are
those of `in_out_factors`). A view weighs what is received and looks at nothing else. Few terms are
enough for wide lobes only, see `InOutFactors.warning`.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_whole
from prt_core.light.environment import BRIGHTEST
from prt_core.reflectance import InOutFactors
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap, tangent_frames
from prt_core.transport.visibility import UNIT, expect_bits, unpack

# Points whose light is spread over the factors' grid at once, and whose views are.
_TOGETHER, _VIEWED = 32, 256


class TermView:
    """Points that have received light in terms, from any side.

    Parameters
    ----------
    factors : InOutFactors
    normals : (n_points, 3) float
    frames : (n_points, 3, 3) float, optional
        Tangent, bitangent and normal of each point, as rows; default: `tangent_frames(normals)`,
        good for what is isotropic.
    """

    def __init__(self, factors, normals, frames=None):
        self.factors = expect_kind("factors", factors, InOutFactors)
        self.normals = expect_array("normals", normals, (None, 3), np.float64, -UNIT, UNIT)
        frames = tangent_frames(self.normals) if frames is None else frames
        shape = len(self.normals), 3, 3
        self.frames = expect_array("frames", frames, shape, np.float32, -UNIT, UNIT)
        self._received = None

    @property
    def received(self):
        """(n_points, n_terms, n_channels) float32: R_k of the light that was set."""
        expect(self._received is not None, "light: none is set; call set_light first")
        return self._received

    def receive(self, received):
        """Take what points have received, (n_points, n_terms, n_channels). Returns self."""
        shape = len(self.normals), self.factors.n_terms, None
        self._received = expect_array("received", received, shape, np.float32)
        return self

    def toward(self, outgoing):
        """Radiance toward a view.

        Parameters
        ----------
        outgoing : (n_points, 3) float
            Unit vectors from the points to the viewer (see `View.outgoing`).

        Returns
        -------
        (n_points, n_channels) float32
            Of the channels of the light or of the reflectance, whichever has more. Backs are black;
            where terms are few some of the others may be negative.
        """
        received = self.received
        outgoing = expect_array("outgoing", outgoing, self.normals.shape, np.float64, -UNIT, UNIT)
        n_channels = max(received.shape[2], self.factors.n_channels)
        result = np.zeros((len(outgoing), n_channels), np.float32)
        facing = np.flatnonzero(np.einsum("ni,ni->n", self.normals, outgoing) > 0)

        def one(first):
            some = facing[first : first + _VIEWED]
            local = np.einsum("ni,nji->nj", outgoing[some], self.frames[some])
            sent = self.factors.outgoing_factor(slice(None), local)
            result[some] = (sent * received[some]).sum(axis=1)

        on_all_cores(one, range(0, len(facing), _VIEWED))
        return result


class InOutTransport(TermView):
    """Terms of the light that the visibility lets through, exactly, from its bits.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
    factors : InOutFactors
    frames : (n_points, 3, 3) float, optional
        See `TermView`.

    Raises
    ------
    PRTError
        Shapes that do not fit each other.
    """

    def __init__(self, bits, normals, cube_map, factors, frames=None):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.bits = expect_bits("bits", bits, cube_map.n_directions)
        expect_array("normals", normals, (len(bits), 3), None, -UNIT, UNIT)
        super().__init__(factors, normals, frames)

    def set_light(self, light):
        """Take a light, (n_directions, n_channels): what each term receives. Returns self."""
        light = expect_array(
            "light", light, (self.cube_map.n_directions, None), np.float64, -BRIGHTEST, BRIGHTEST
        )
        shape = len(self.bits), self.factors.n_terms, light.shape[1]
        received = np.empty(shape, np.float32)
        directions = self.cube_map.directions.astype(np.float32)
        vectors = self.cube_map.vectors

        def one(first):
            part = slice(first, first + _TOGETHER)
            row, texel = np.nonzero(unpack(self.bits[part], len(light), np.uint8))
            local = np.matmul(directions[None], self.frames[part].swapaxes(1, 2))[row, texel]
            cosine = (self.normals[part] @ vectors.T)[row, texel]
            arriving = np.maximum(cosine, 0)[:, None] * light[texel]
            received[part] = self.factors.received(row, local, arriving, len(self.bits[part]))

        with one_blas_thread():
            on_all_cores(one, range(0, len(self.bits), _TOGETHER))
        return self.receive(received)

    @property
    def nbytes(self):
        """Of what lights and views read, without what is received."""
        factors = self.factors.incoming.nbytes + self.factors.outgoing.nbytes
        return self.bits.nbytes + self.frames.nbytes + self.normals.nbytes + factors


class TermFactor:
    """What one term takes of light at points: the rows of its transport where all is seen.

    Parameters
    ----------
    factors : InOutFactors
    k : int
        The term.
    normals : (n_points, 3) float
    cube_map : CubeMap
    frames : (n_points, 3, 3) float, optional
        See `TermView`.
    """

    def __init__(self, factors, k, normals, cube_map, frames=None):
        view = TermView(factors, normals, frames)
        self._term = expect_whole("k", k, 0, factors.n_terms - 1)
        self._factors, self._frames = factors, view.frames
        self._normals = view.normals.astype(np.float32)
        expect_kind("cube_map", cube_map, CubeMap)
        self._directions = cube_map.directions.astype(np.float32)
        self._vectors = cube_map.vectors.astype(np.float32)

    def __call__(self, points, directions):
        """The term times the cosine at points and directions.

        Parameters
        ----------
        points : (n,) int
        directions : slice, (m,) or (n, m) int
            The same for all points, or some for each.

        Returns
        -------
        (n, m) float32
            0 below the horizon; terms have both signs.
        """
        ways, vectors = self._directions[directions], self._vectors[directions]
        if ways.ndim == 2:
            # Points of flat parts share their frames, and all that follows from them.
            points, which = self._distinct(points)
            local = np.matmul(ways, self._frames[points].swapaxes(1, 2))
            cosine = self._normals[points] @ vectors.T
            return self._product(local, cosine)[which]
        local = np.matmul(ways, self._frames[points].swapaxes(1, 2))
        return self._product(local, np.matmul(vectors, self._normals[points][:, :, None])[..., 0])

    def _distinct(self, points):
        """Some of the points, one of each frame, and the (n,) place of each point's among them."""
        rows = self._frames[points].reshape(-1, 9).view("V36")[:, 0]
        _, first, which = np.unique(rows, return_index=True, return_inverse=True)
        return np.asarray(points)[first], which

    def _product(self, local, cosine):
        return self._factors.incoming_between(self._term, local) * np.maximum(cosine, 0)
