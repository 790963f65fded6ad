"""Rows as feature vectors in which equal distances mean about equal errors of relit colours.

On a cube map a row is Haar-transformed and each coefficient is multiplied by how strong light of
the real world is, on average, in that wavelet; a light is divided by the same, so that products of
row and light stay what they are. Least squares in the plain directions would prepare for white
noise, which no sky is.

A row has outputs: what a point receives in red, green and blue, or in several terms of each. Each
output names the light's channel that it reads.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from prt_core.basis import haar_areas, haar_rows, haar_texels
from prt_core.compress.state import array_of, expect_state
from prt_core.errors import expect, expect_array, expect_flag, expect_numbers, expect_whole

# Standard deviation of the wavelet coefficients of environments at level l, 0 the coarsest, is
# about sqrt(_SMOOTH 4^-l + _WHITE): smooth skies and small bright things.
_SMOOTH, _WHITE = 36.0, 0.5
_MOST_OUTPUTS = 1 << 10


@dataclass(frozen=True)
class Group:
    """Features that share a place in the outputs.

    Attributes
    ----------
    shares : (n_outputs,) float
        Output o of a row is the sum over groups of shares[o] times the group's part.
    basis : (k, n_directions) float32 or None
        Orthonormal rows that span the group's part of coded rows; None: all of them.
    direct : bool
        Light that arrives straight from its texel.
    """

    shares: tuple
    basis: np.ndarray | None = None
    direct: bool = False


@dataclass(frozen=True)
class RowCode:
    """How rows become features, and what features give under a light.

    Attributes
    ----------
    n_directions : int
    reads : (n_outputs,) int
        The light's channel that each output is multiplied with.
    groups : tuple of Group
    resolution : int or None
        Of the cube map; None: no transform.
    scale : (n_directions,) float32 or None
        See `natural_scale`.
    """

    n_directions: int
    reads: np.ndarray
    groups: tuple
    resolution: int | None = None
    scale: np.ndarray | None = field(default=None, repr=False)

    @classmethod
    def plain(cls, n_directions, n_outputs, resolution=None, natural=True, reads=None):
        """The code in which each output is a group of its own.

        Parameters
        ----------
        n_directions, n_outputs : int
        resolution : int, optional
            Of the cube map whose texels the directions are.
        natural : bool
            Whether wavelets are weighed by natural light (see `natural_scale`).
        reads : (n_outputs,) int, optional
            Default: each output a channel of its own.

        Returns
        -------
        RowCode
        """
        n_directions = expect_whole("n_directions", n_directions, 1)
        n_outputs = expect_whole("n_outputs", n_outputs, 1, _MOST_OUTPUTS)
        reads = np.arange(n_outputs) if reads is None else expect_reads(reads, n_outputs)
        expect_flag("natural", natural)
        if resolution is not None:
            expect_whole("resolution", resolution, 1)
            expect(6 * resolution**2 == n_directions, f"resolution: {resolution} does not fit")
        groups = tuple(Group(tuple(row)) for row in np.eye(n_outputs))
        scale = natural_scale(resolution) if resolution and natural else None
        return cls(n_directions, reads, groups, resolution, scale)

    def state(self):
        """Arrays from which `from_state` makes the same code."""
        empty = np.zeros((0, self.n_directions), np.float32)
        bases = [empty if g.basis is None else g.basis for g in self.groups]
        # A group without a basis spans everything.
        ranks = [-1 if g.basis is None else len(g.basis) for g in self.groups]
        state = {
            "code_shares": np.array([g.shares for g in self.groups], np.float64),
            "code_direct": np.array([g.direct for g in self.groups], bool),
            "code_ranks": np.array(ranks, np.int64),
            "code_basis": np.concatenate(bases),
        }
        return state if self.scale is None else {**state, "code_scale": self.scale}

    @classmethod
    def from_state(cls, state, n_directions, reads, resolution):
        """The code of a `state`; `PRTError` where its parts do not fit.

        Parameters
        ----------
        state : dict
            Of `RowCode.state`.
        n_directions : int
        reads : (n_outputs,) int
        resolution : int or None

        Returns
        -------
        RowCode
        """
        shares = array_of(state, "code_shares", (None, len(reads)), "float64")
        direct = array_of(state, "code_direct", (len(shares),), "bool")
        ranks = array_of(state, "code_ranks", (len(shares),), "int64")
        ends = np.cumsum(np.maximum(ranks, 0))
        n_rows = int(ends[-1]) if len(ends) else 0
        basis = array_of(state, "code_basis", (n_rows, n_directions), "float32")
        expect_state(
            len(shares) and (ranks >= -1).all()
            and (resolution is None or 6 * resolution**2 == n_directions),
            "the code of its rows does not fit",
        )  # fmt: skip
        scale = None
        if "code_scale" in state:
            scale = array_of(state, "code_scale", (n_directions,), "float32")
        groups = tuple(
            Group(tuple(map(float, share)), None if k < 0 else basis[end - k : end], bool(d))
            for share, d, k, end in zip(shares, direct, ranks, ends, strict=True)
        )
        return cls(n_directions, reads, groups, resolution, scale)

    @property
    def n_outputs(self):
        """Numbers of a row for each direction."""
        return len(self.reads)

    @cached_property
    def slices(self):
        """The features of each group."""
        sizes = [self.n_directions if g.basis is None else len(g.basis) for g in self.groups]
        ends = [int(end) for end in np.cumsum([0, *sizes])]
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]

    @property
    def n_features(self):
        """Length of a feature vector."""
        return self.slices[-1].stop

    def code(self, rows):
        """(..., n_directions) `rows` of one output: transformed and scaled."""
        coded = haar_rows(rows, self.resolution) if self.resolution else rows
        return coded if self.scale is None else coded * self.scale

    def encode(self, rows):
        """(n, n_features) of `rows` (n, n_directions, n_outputs), for codes made by `plain`."""
        coded = self.code(np.ascontiguousarray(np.moveaxis(rows, -1, 1)))
        return coded.reshape(len(rows), -1)

    def decode(self, features):
        """Rows (n, n_directions, n_outputs) of `features` (n, n_features)."""
        result = np.zeros((len(features), self.n_outputs, self.n_directions), features.dtype)
        for group, part in zip(self.groups, self.slices, strict=True):
            coded = features[:, part]
            coded = coded if group.basis is None else coded @ group.basis
            for output in np.flatnonzero(group.shares):
                result[:, output] += features.dtype.type(group.shares[output]) * coded
        if self.scale is not None:
            result /= self.scale
        if self.resolution:
            result = haar_rows(result, self.resolution, inverse=True)
        return np.moveaxis(result, 1, -1)

    def light(self, light):
        """(n_directions, n_channels) light: transformed, and divided by the scale."""
        coded = haar_rows(light.T, self.resolution).T if self.resolution else light
        return coded if self.scale is None else coded / self.scale[:, None]

    def texels(self, directions):
        """Lights that are 1 in one of (m,) `directions`, as `light` returns lights.

        Returns
        -------
        (n_directions, m) CSC float32
            With few entries a column: those of the wavelets above a texel.
        """
        if self.resolution:
            places, values = haar_texels(directions, self.resolution)
        else:
            places = np.asarray(directions)[:, None]
            values = np.ones(places.shape, np.float32)
        if self.scale is not None:
            values = values / self.scale[places]
        m, count = places.shape
        starts = np.arange(0, m * count + 1, count)
        shape = self.n_directions, m
        return sp.csc_matrix((values.ravel(), places.ravel(), starts), shape=shape)

    def products(self, vectors, light, rest=None):
        """What feature vectors give under a light, output by output.

        Parameters
        ----------
        vectors : (k, n_features) float
        light : (n_directions, n_channels) float
            As `RowCode.light` returns it.
        rest : (n_directions, n_channels) float, optional
            Instead of `light` for the groups that are direct.

        Returns
        -------
        (k, n_outputs)
        """
        result = np.zeros((len(vectors), self.n_outputs), np.result_type(vectors, light))
        for group, part in zip(self.groups, self.slices, strict=True):
            used = np.flatnonzero(group.shares)
            # Outputs that read the same channel are one product.
            channels, place = np.unique(self.reads[used], return_inverse=True)
            coded = (rest if group.direct and rest is not None else light)[:, channels]
            coded = coded if group.basis is None else group.basis @ coded
            shares = np.asarray(group.shares, result.dtype)[used]
            result[:, used] += (vectors[:, part] @ coded)[:, place] * shares
        return result

    def responses(self, vectors, lights):
        """What feature vectors give under many lights that are the same in each channel.

        Parameters
        ----------
        vectors : (k, n_features) float32
        lights : (n_directions, m) float32
            As `RowCode.light` or `RowCode.texels` returns them.

        Returns
        -------
        (k, m, n_outputs) float32
        """
        result = np.zeros((len(vectors), lights.shape[1], self.n_outputs), np.float32)
        for group, part in zip(self.groups, self.slices, strict=True):
            coded = lights if group.basis is None else group.basis @ lights
            products = vectors[:, part] @ coded
            for output in np.flatnonzero(group.shares):
                result[..., output] += np.float32(group.shares[output]) * products
        return result


def expect_reads(reads, n_outputs=None):
    """`reads` as (n_outputs,) int64: a channel of the light for each output."""
    reads = expect_numbers("reads", reads)
    reads = expect_array("reads", reads, (n_outputs,), np.int64, 0, _MOST_OUTPUTS - 1)
    expect(1 <= len(reads) <= _MOST_OUTPUTS, f"reads: expected 1 to {_MOST_OUTPUTS} outputs")
    return reads


def natural_scale(resolution):
    """Expected size of an environment's wavelet coefficients, (6 resolution^2,) float32.

    Measured on six captured environments; the finest level of 32 x 32 texels is about 1.
    """
    level, _ = haar_areas(resolution)
    return np.sqrt(_SMOOTH * 4.0**-level + _WHITE).astype(np.float32)
