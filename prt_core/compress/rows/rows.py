"""What compressors read: rows of a transport matrix, in blocks, as feature vectors.

A row is a small matrix, (n_directions, n_outputs), each of whose outputs reads one channel of a
light: a product is `sum_d row[d, o] light[d, reads[o]]`. Whether its directions are texels of a
cube map or anything else matters only where `resolution` says so.
"""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from prt_core.compress.rows.indirect import indirect_factors
from prt_core.compress.rows.row_code import Group, RowCode, expect_reads, natural_scale
from prt_core.errors import (
    expect,
    expect_array,
    expect_flag,
    expect_indices,
    expect_kind,
    expect_numbers,
    expect_seed,
    expect_whole,
)
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress, run
from prt_core.transport import Transport
from prt_core.transport.visibility import unpack

_BLOCK = 512
# What is left out of the colour differences of indirect light, as a share of all of it.
_OPPONENT_ERROR = 1e-2


class Rows(ABC):
    """Rows of a matrix, read in blocks. Subclasses give `block`; the rest follows.

    Attributes
    ----------
    n_points, n_directions, n_outputs : int
    reads : (n_outputs,) int
        The light's channel that each output is multiplied with; default: each its own.
    resolution : int or None
        Of the cube map whose texels the directions are, else None.
    """

    resolution = None

    @abstractmethod
    def block(self, points):
        """(n, n_directions, n_outputs) float32 for (n,) int points."""

    @cached_property
    def reads(self):
        """See the class; a subclass may set its own."""
        return np.arange(self.n_outputs)

    @cached_property
    def code(self):
        """The `RowCode` of the features."""
        return RowCode.plain(self.n_directions, self.n_outputs, self.resolution, reads=self.reads)

    def features(self, points):
        """(n, n_features) float32 of some `points`: `block` in the code of these rows."""
        return self.code.encode(self.block(points))

    def blocks(self, size=_BLOCK):
        """Consecutive (n,) int blocks of all points, of at most `size`."""
        for first in range(0, self.n_points, size):
            yield np.arange(first, min(first + size, self.n_points))


class ArrayRows(Rows):
    """Rows that are in memory.

    Parameters
    ----------
    array : (n_points, n_directions) or (n_points, n_directions, n_outputs) float
    resolution : int, optional
    reads : (n_outputs,) int, optional
        Default: each output a channel of its own.
    """

    def __init__(self, array, resolution=None, reads=None):
        array = expect_numbers("rows", array)
        array = array[..., None] if array.ndim == 2 else array
        array = expect_array("rows", array, (None, None, None), np.float32, -BRIGHTEST, BRIGHTEST)
        expect(array.size, f"rows: expected some, got an array of shape {array.shape}")
        self.array = array
        self.n_points, self.n_directions, self.n_outputs = array.shape
        if reads is not None:
            self.reads = expect_reads(reads, self.n_outputs)
        if resolution is not None:
            expect_whole("resolution", resolution, 1)
            expect(
                6 * resolution**2 == self.n_directions,
                f"resolution: {resolution} has {6 * resolution**2} directions, "
                f"the rows have {self.n_directions}",
            )
        self.resolution = resolution

    def block(self, points):
        return self.array[points]


class TransportRows(Rows):
    """Rows of a baked transport, with all bounces, without the albedo of the point itself.

    `R = D + K T` is what a point receives for unit radiance from each texel; colours are albedo
    times that (see `ExitRadiance`), so that textures stay exact and are not compressed. D is exact
    and the same in every channel; the light between surfaces, K T, is smooth and held as a product
    of thin factors, so that its features are few.

    Parameters
    ----------
    transport : Transport
    rank : int
        Of the factors; 0: direct light only.
    natural : bool
        Weigh wavelets by how strong they are in natural light (see `row_code`).
    seed : int
    """

    def __init__(self, transport, rank=128, natural=True, seed=0):
        self.transport = expect_kind("transport", transport, Transport)
        expect_whole("rank", rank, 0)
        expect_flag("natural", natural)
        expect_seed(seed)
        self.n_points, self.n_directions = transport.shape
        self.n_outputs = 3
        self.resolution = transport.cube_map.resolution
        self.rank, self.natural, self.seed = rank, natural, seed
        self._prepared = None

    def prepare_steps(self):
        """These rows with their factors made now; a generator of `Progress`.

        Else they are made when needed.
        """
        if self._prepared is None:
            self._prepared = yield from self._prepare()
        return self

    def _prepare(self):
        transport = self.transport
        scale = natural_scale(self.resolution) if self.natural else None
        even = (3**-0.5,) * 3
        groups, lefts = [Group(even, direct=True)], []
        if self.rank and transport.gather is not None and transport.bounces != 0:
            albedo = transport.bounced_albedo
            through = transport.bounced_materials.translucency
            grey = all((x == x[:, :1]).all() for x in (albedo, through))
            channels = [0] if grey else [0, 1, 2]
            factors = yield from indirect_factors(transport, channels, self.rank, self.seed)
            left, right = factors
            code = RowCode(self.n_directions, self.reads, tuple(groups), self.resolution, scale)
            right = [code.code(part) for part in right]
            more, lefts = opponent_groups(*(x * 3 if grey else x for x in (left, right)))
            groups += more
        return RowCode(self.n_directions, self.reads, tuple(groups), self.resolution, scale), lefts

    @property
    def _ready(self):
        if self._prepared is None:
            run(self.prepare_steps())
        return self._prepared

    @property
    def code(self):
        return self._ready[0]

    def features(self, points):
        code, lefts = self._ready
        points = expect_indices("points", points, self.n_points)
        result = np.empty((len(points), code.n_features), np.float32)
        # The same direct light in three channels is sqrt(3) of it in the first mixed one.
        result[:, code.slices[0]] = code.code(self.direct(points) * np.float32(3**0.5))
        for part, left in zip(code.slices[1:], lefts, strict=True):
            result[:, part] = left[points]
        return result

    def indirect(self, points):
        """Features of the light between surfaces of some `points`, of each group but the first."""
        return [left[points] for left in self._ready[1]]

    def direct(self, points):
        """(n, n_directions) float32 of some `points`: received light of unit texels, no bounces."""
        transport = self.transport
        vectors = (transport.cube_map.vectors.T / np.pi).astype(np.float32)
        result = transport.normals[points] @ vectors
        result *= unpack(transport.bits[points], self.n_directions, np.uint8)
        return result

    def block(self, points):
        return self.code.decode(self.features(points))


class SomeRows(Rows):
    """Some rows of others, in the same code: what a choice is tried on.

    Parameters
    ----------
    rows : Rows
    points : (n,) int
    """

    def __init__(self, rows, points):
        expect_kind("rows", rows, Rows)
        points = expect_indices("points", points, rows.n_points)
        if isinstance(rows, SomeRows):
            rows, points = rows.rows, rows.points[points]
        self.rows, self.points, self._features = rows, points, None
        self.n_points, self.n_directions = len(self.points), rows.n_directions
        self.n_outputs, self.reads, self.resolution = rows.n_outputs, rows.reads, rows.resolution

    @property
    def code(self):
        return self.rows.code

    def features(self, points):
        # Several models are fitted to a sample: made once, before threads ask for them.
        if self._features is None:
            return self.rows.features(self.points[points])
        return self._features[points]

    def prepare_steps(self):
        """Hold the features of all rows from now on."""
        if self._features is None:
            yield from getattr(self.rows, "prepare_steps", lambda: ())()
            done, parts = 0, []
            for part in in_parallel(lambda p: self.rows.features(self.points[p]), self.blocks()):
                parts.append(part)
                done += len(part)
                yield Progress("sample", done, self.n_points)
            self._features = np.concatenate(parts)
        return self

    def block(self, points):
        return self.rows.block(self.points[points])


def opponent_groups(left, right, error=_OPPONENT_ERROR):
    """Groups of the indirect light: luminance and two differences of channels.

    Parameters
    ----------
    left : sequence of three (n_points, k_c) float32
    right : sequence of three (k_c, n_directions) float32
        Coded; channel c is left[c] @ right[c].
    error : float
        Share of the whole that the two differences may lose.

    Returns
    -------
    groups : list of Group
    lefts : list of (n_points, k_i) float32
        The features of each group.
    """
    mix = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
    sizes, right = [len(part) for part in right], np.concatenate(right).astype(np.float64)
    rank, allowed = max(sizes), error * np.linalg.norm(right)
    if not rank:
        # No light from far away is bounced, as in a room without windows.
        return [], []
    along, across = np.linalg.qr(right.T)
    stacked = np.hstack(left)
    gram = sum(
        part.T.astype(np.float64) @ part
        for part in (stacked[first : first + 8192] for first in range(0, len(stacked), 8192))
    )
    groups, lefts = [], []
    for shares in mix:
        weights = np.repeat(shares, sizes)
        # Eigenvectors of what the group's rows give, squared, within the span of `right`.
        squares, vectors = np.linalg.eigh(across @ (weights[:, None] * gram * weights) @ across.T)
        squares, vectors = np.maximum(squares[::-1], 0), vectors[:, ::-1]
        rest = np.cumsum(squares[::-1])[::-1]
        kept = rank if not groups else int((rest > allowed**2).sum())
        kept = min(kept, rank, int((squares > 1e-12 * max(squares[0], 1e-300)).sum()))
        turned = weights[:, None] * (across.T @ vectors[:, :kept])
        basis = (vectors[:, :kept].T @ along.T).astype(np.float32)
        if kept:
            groups.append(Group(tuple(shares), basis))
            lefts.append(stacked @ turned.astype(np.float32))
    return groups, lefts
