"""Relighting clusters of rows in milliseconds: plan once, apply for each light.

The bases lie term by term, so that a light cut to its most important few hundred terms reads
only their rows; points lie cluster by cluster, so that each cluster is one small product. A light's
few brightest texels, which no small basis can follow, are looked up in the visibility bits.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from threadpoolctl import ThreadpoolController

from prt_core.compress.light_terms import heaviest
from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_offers,
    expect_whole,
)
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.cores import n_cores
from prt_core.transport import Transport

# Slots of a cluster that are one product at most, and what their number is rounded up to.
_CHUNK, _ROUND = 256, 16
# Slots of a product at most, and points whose bright texels are looked up at once.
_BATCH, _PIECE = 4096, 8192


class ClusterEvaluator:
    """Relights a fitted `ClusterCompressor`, as fast as memory can be read.

    Parameters
    ----------
    model : ClusterCompressor
    transport : Transport, optional
        The bake: gives the direct light of the brightest texels exactly.
    n_terms : int or None
        Terms of the light at most; None: all.
    error : float
        Terms are left out while their expected share of the colours stays below this.
    n_exact : int
        Texels looked up in the bits at most (with `transport`).
    bright : float
        Share of the light's power from which a texel is bright.
    """

    def __init__(self, model, transport=None, n_terms=512, error=1e-3, n_exact=16, bright=2e-3):
        expect_offers("model", model, ("affine_", "code_"), "a fitted compressor of clusters")
        if transport is not None:
            expect_kind("transport", transport, Transport)
        if n_terms is not None:
            expect_whole("n_terms", n_terms, 1)
        expect_whole("n_exact", n_exact, 0)
        self.model, self.n_terms = model, n_terms
        self.error = expect_number("error", error, 0, 1)
        self.bright = expect_number("bright", bright, 0, 1)
        # Rows that do not know direct light apart have no place for it.
        apart = transport is not None and any(group.direct for group in model.code_.groups)
        self.n_exact = min(n_exact, model.n_directions_) if apart else 0
        self._n_others = n_cores() - 1
        self._pool = ThreadPoolExecutor(max(self._n_others, 1))
        # Products of this size are over before BLAS has woken its threads.
        self._blas = ThreadpoolController()
        self._plan_bases()
        self._plan_parts()
        if self.n_exact:
            self._plan_bits(transport)

    def product(self, light):
        """(n_points, n_outputs) float32 under (n_directions, n_channels) light.

        See `Compressor.product`.
        """
        model = self.model
        shape = model.n_directions_, model.n_channels_
        light = expect_array("light", light, shape, np.float32, -BRIGHTEST, BRIGHTEST)
        with self._blas.limit(limits=1):
            bright, rest = self._split(light)
            # Texels are looked up by the other threads while this one multiplies bases.
            texels = self._pieces if bright is not None else ()
            finish = self._begin(lambda piece: self._add_bright(piece, bright, light), texels)
            products = self._products(light, rest)
            finish()
            self._begin(lambda batch: self._clusters(batch, products), self._batches)()
        result = self._blend @ self._slots
        if bright is not None:
            result += self._lit
        return result

    def _begin(self, work, jobs):
        """Let the other threads begin with some jobs; what is returned helps them, and waits."""
        # Whoever is free takes the next one: an iterator over a list gives each job once.
        jobs = iter(jobs)

        def some():
            for job in jobs:
                work(job)

        others = [self._pool.submit(some) for _ in range(self._n_others)]

        def finish():
            some()
            for future in others:
                future.result()

        return finish

    def terms(self, light):
        """Number of terms that a light is cut to, for each group of the code."""
        _, rest = self._split(np.asarray(light, np.float32))
        code = self.model.code_
        coded = [code.light(light), code.light(rest)]
        return [len(self._chosen(i, coded[g.direct])) for i, g in enumerate(code.groups)]

    @property
    def nbytes(self):
        """Bytes of what is read when relighting, the visibility bits included."""
        blend = self._blend
        arrays = [blend.data, blend.indices, blend.indptr, self._slots, *self._bases]
        arrays += [batch.weights for batch in self._batches]
        arrays += [self._bits] if self.n_exact else []
        return sum(array.nbytes for array in arrays)

    def _plan_parts(self):
        """What is done at once: clusters cut into chunks of points, slots, points."""
        model = self.model
        self._batches, own = batches_of(model, chunks_of(model.starts_))
        slots = np.zeros(len(model.order_), np.int64)
        slots[own[own >= 0]] = np.flatnonzero(own >= 0)
        self._blend = _blending(model, slots, len(own))
        self._slots = np.empty((len(own), model.n_outputs_), np.float32)
        self._lit = np.empty((model.n_points_, model.n_outputs_), np.float32)
        self._pieces = [
            slice(first, min(first + _PIECE, model.n_points_))
            for first in range(0, model.n_points_, _PIECE)
        ]

    def _plan_bases(self):
        """Bases with a row for each term of the light, and how much each term matters."""
        model, code = self.model, self.model.code_
        vectors = np.concatenate([p for a in model.affine_ for p in (a.mean[None], a.basis)])
        energies = np.concatenate(
            [e for a in model.affine_ for e in ([float(len(a.weights))], a.energies)]
        )
        self._bases, self._inner, self._importance = [], [], []
        for group, part in zip(code.groups, code.slices, strict=True):
            own = np.ascontiguousarray(vectors[:, part].T)
            self._bases.append(own)
            squares = np.einsum("jr,r,jr->j", own, energies, own, optimize=True)
            if group.basis is not None:
                # Terms of the light meet the group's basis first; what that passes matters.
                self._inner.append(np.ascontiguousarray(group.basis.T))
                self._importance.append(squares @ group.basis**2)
            else:
                self._inner.append(None)
                self._importance.append(squares)

    def _plan_bits(self, transport):
        """Visibility, a row of bits for each direction, and normals by component."""
        wanted = self.model.n_points_, self.model.n_directions_
        expect(
            transport.shape == wanted,
            f"transport: expected {wanted} as was compressed, got {transport.shape}",
        )
        self._bits = np.empty((transport.n_directions, -(-transport.n_points // 8)), np.uint8)
        for byte in range(transport.bits.shape[1]):
            spread = np.unpackbits(transport.bits[:, byte, None], axis=1, bitorder="little")
            rows = slice(8 * byte, min(8 * byte + 8, transport.n_directions))
            packed = np.packbits(spread[:, : rows.stop - rows.start].T, axis=1, bitorder="little")
            self._bits[rows] = packed
        self._normals = np.ascontiguousarray(transport.normals.T)
        self._vectors = (transport.cube_map.vectors / np.pi).astype(np.float32)
        self._solid_angles = transport.cube_map.solid_angles.astype(np.float32)

    def _split(self, light):
        """The brightest texels, and the light without them."""
        if not self.n_exact:
            return None, light
        power = np.abs(light).sum(axis=1) * self._solid_angles
        bright = np.argpartition(power, -self.n_exact)[-self.n_exact :]
        bright = np.sort(bright[power[bright] > self.bright * power.sum()])
        if not len(bright):
            return None, light
        rest = light.copy()
        rest[bright] = 0
        return bright, rest

    def _products(self, light, rest):
        """(rows of all bases, n_outputs): what each basis row gives under the light."""
        code, n_channels = self.model.code_, light.shape[1]
        both = code.light(light if rest is light else np.hstack([light, rest]))
        coded = {False: both[:, :n_channels], True: both[:, -n_channels:]}
        result = np.zeros((code.n_outputs, self._bases[0].shape[1]), np.float32)
        for i, group in enumerate(code.groups):
            used = np.flatnonzero(group.shares)
            coded_part = coded[group.direct]
            chosen = self._chosen(i, coded_part)
            shares = np.asarray(group.shares, np.float32)[used]
            values = coded_part[chosen][:, code.reads[used]] * shares
            if self._inner[i] is not None:
                result[used] += values.T @ self._inner[i][chosen] @ self._bases[i]
            else:
                result[used] += _sparse_times(values, chosen, self._bases[i])
        return np.ascontiguousarray(result.T)

    def _chosen(self, index, coded):
        """Terms of the light that matter most for one group, in storage order."""
        code = self.model.code_
        squares = np.zeros(coded.shape[1], np.float32)
        np.add.at(squares, code.reads, np.asarray(code.groups[index].shares, np.float32) ** 2)
        weight = (coded**2 @ squares) * self._importance[index]
        return heaviest(weight, self.n_terms, self.error)

    def _clusters(self, batch, products):
        """What clusters give to their points."""
        out = self._slots[batch.slots].reshape(*batch.weights.shape[:2], -1)
        np.matmul(batch.weights, products[batch.rows], out=out)

    def _add_bright(self, piece, bright, light):
        """Direct light of the brightest texels; pieces begin with a byte of the bits."""
        bits = self._bits[bright, piece.start // 8 : -(-piece.stop // 8)]
        lit = self._vectors[bright] @ self._normals[:, piece]
        lit *= np.unpackbits(bits, axis=1, count=lit.shape[1], bitorder="little")
        bright_light = np.take(light[bright], self.model.reads_, axis=1)
        np.matmul(lit.T, bright_light, out=self._lit[piece])


def _blending(model, slots, n_slots):
    """(n_points, n_slots) CSR: each point's own slot, mixed with its second where it has one."""
    point, border = model.border_points_.T
    own = np.ones(model.n_points_, np.float32)
    own[point] -= model.shares_
    rows = np.concatenate([np.arange(model.n_points_), point])
    columns = slots[np.concatenate([model.place_, border])]
    values = np.concatenate([own, model.shares_]).astype(np.float32)
    return sp.csr_matrix((values, (rows, columns)), shape=(model.n_points_, n_slots))


def _sparse_times(values, chosen, basis):
    """values.T @ basis[chosen], (n_outputs, n_rows), each row of the basis read once."""
    starts = np.zeros(len(basis) + 1, np.int32)
    starts[chosen + 1] = values.shape[1]
    channels = np.tile(np.arange(values.shape[1], dtype=np.int32), len(chosen))
    shape = values.shape[1], len(basis)
    return sp.csc_matrix((values.ravel(), channels, np.cumsum(starts)), shape=shape) @ basis


@dataclass
class Chunks:
    """Consecutive slots of one cluster each.

    Attributes
    ----------
    first, size, cluster : (n,) int
    """

    first: np.ndarray
    size: np.ndarray
    cluster: np.ndarray

    def some(self, which):
        """Those of them."""
        return Chunks(self.first[which], self.size[which], self.cluster[which])


def chunks_of(starts, most=_CHUNK):
    """Clusters cut into equal pieces of at most `most` slots."""
    first, size, cluster = [], [], []
    for c, (a, b) in enumerate(zip(starts[:-1], starts[1:], strict=True)):
        cuts = np.linspace(a, b, -(-int(b - a) // most) + 1).astype(np.int64)
        first.append(cuts[:-1])
        size.append(np.diff(cuts))
        cluster.append(np.full(len(cuts) - 1, c))
    return Chunks(*(np.concatenate(part) for part in (first, size, cluster)))


@dataclass
class Batch:
    """Chunks of one rank and size, which are one product.

    A call for each cluster would cost more than its arithmetic, and threads would queue for it.

    Attributes
    ----------
    slots : slice
        Padded ones, chunk by chunk.
    weights : (k, n_slots, n_rows) float32
    rows : (k, n_rows) int
        Of the products, that belong to each chunk.
    """

    slots: slice
    weights: np.ndarray
    rows: np.ndarray


def batches_of(model, chunks):
    """Chunks padded so that many are alike, and done at once.

    Returns
    -------
    batches : list of Batch
    own : (n_slots,) int64
        The model's slot of each, -1 where it is padding.
    """
    ranks = 1 + model.ranks_
    starts = np.cumsum([0, *ranks])
    rank = ranks[chunks.cluster]
    padded = -(-chunks.size // _ROUND) * _ROUND
    batches, own, first = [], [], 0
    for r, n in sorted(set(zip(rank.tolist(), padded.tolist(), strict=True))):
        same = np.flatnonzero((rank == r) & (padded == n))
        most = max(1, _BATCH // n)
        for batch in (same[i : i + most] for i in range(0, len(same), most)):
            alike = chunks.some(batch)
            slot = alike.first[:, None] + np.minimum(np.arange(n), alike.size[:, None] - 1)
            weights = np.ones((len(slot), n, r), np.float32)
            for i, (c, here) in enumerate(zip(alike.cluster, slot, strict=True)):
                weights[i, :, 1:] = model.affine_[c].weights[here - model.starts_[c]]
            rows = starts[alike.cluster][:, None] + np.arange(r)
            batches.append(Batch(slice(first, first + slot.size), weights, rows))
            first += slot.size
            own.append(np.where(np.arange(n) < alike.size[:, None], slot, -1).ravel())
    return batches, np.concatenate(own)
