"""Relighting clusters of rows in milliseconds: plan once, apply for each light.

The bases lie term by term, so that a light cut to its most important few hundred terms reads
only their rows; points lie cluster by cluster, so that each cluster is one small product. A light's
few brightest texels, which no small basis can follow, are looked up in the visibility bits.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from threadpoolctl import ThreadpoolController

from prt_core.compress.clusters import blended
from prt_core.errors import expect, expect_array

# Slots of a cluster that are one product at most, and what their number is rounded up to.
_CHUNK, _ROUND = 256, 16


class ClusterRelighter:
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
        self.model, self.n_terms, self.error = model, n_terms, error
        self.n_exact, self.bright = n_exact if transport is not None else 0, bright
        self._pool = ThreadPoolExecutor(max((os.cpu_count() or 1) - 1, 1))
        # Products of this size are over before BLAS has woken its threads.
        self._blas = ThreadpoolController()
        self._plan_bases()
        self._plan_parts()
        if self.n_exact:
            self._plan_bits(transport)

    def relight(self, light):
        """(n_points, n_channels) float32 under (n_directions, n_channels) light."""
        model = self.model
        light = expect_array("light", light, (model.n_directions_, model.n_channels_), np.float32)
        with self._blas.limit(limits=1):
            bright, rest = self._split(light)
            # Texels are looked up by the other threads while this one multiplies bases.
            ahead = [self._pool.submit(self._add_bright, p, bright, light) for p in self._parts]
            products = self._products(light, rest)
            for future in ahead:
                future.result()
            first, *others = self._parts
            done = [self._pool.submit(self._part, part, products, bright) for part in others]
            self._part(first, products, bright)
            for future in done:
                future.result()
        return blended(self._slots, self._place, self._guests, self.model.shares_)

    def terms(self, light):
        """Number of terms that a light is cut to, for each group of the code."""
        _, rest = self._split(np.asarray(light, np.float32))
        code = self.model.code_
        coded = [code.light(light), code.light(rest)]
        return [len(self._chosen(i, coded[g.direct])) for i, g in enumerate(code.groups)]

    @property
    def nbytes(self):
        """Bytes of what is read when relighting, the visibility bits included."""
        arrays = [self._place, self._slots, *self._bases]
        for part in self._parts:
            arrays += [weights for _, _, weights, _ in part.batches]
        arrays += [self._bits] if self.n_exact else []
        return sum(array.nbytes for array in arrays)

    def _plan_parts(self):
        """What each thread does: clusters cut into chunks of points."""
        model = self.model
        chunks = chunks_of(model.starts_)
        n_threads, total = os.cpu_count() or 1, len(model.order_)
        share = np.minimum(chunks.first * n_threads // max(total, 1), n_threads - 1)
        self._parts, slots, first = [], np.zeros(total, np.int64), 0
        order = []
        for thread in np.unique(share):
            part = _Part(model, chunks.some(share == thread), first)
            slots[part.own] = first + np.flatnonzero(part.real)
            order.append(part.order)
            first = part.last
            self._parts.append(part)
        self._order = np.concatenate(order)
        self._place = slots[model.place_]
        self._guests = model.guests_.copy()
        self._guests[:, 1] = slots[model.guests_[:, 1]]
        self._gain = None if model.gain_ is None else model.gain_[self._order]
        self._slots = np.empty((len(self._order), model.n_channels_), np.float32)
        self._lit = np.empty_like(self._slots)

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
        """Visibility, a row of bits for each direction, and normals in the order of clusters."""
        order, wanted = self._order, (self.model.n_points_, self.model.n_directions_)
        expect(
            transport.shape == wanted,
            f"transport: expected {wanted} as was compressed, got {transport.shape}",
        )
        self._bits = np.empty((transport.n_directions, -(-len(order) // 8)), np.uint8)
        for byte in range(transport.bits.shape[1]):
            spread = np.unpackbits(transport.bits[order, byte][:, None], axis=1, bitorder="little")
            rows = slice(8 * byte, min(8 * byte + 8, transport.n_directions))
            packed = np.packbits(spread[:, : rows.stop - rows.start].T, axis=1, bitorder="little")
            self._bits[rows] = packed
        self._normals = np.ascontiguousarray(transport.normals[order].T)
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
        """(rows of all bases, n_channels): what each basis row gives under the light."""
        code, n_channels = self.model.code_, light.shape[1]
        both = code.light(light if rest is light else np.hstack([light, rest]))
        coded = {False: both[:, :n_channels], True: both[:, -n_channels:]}
        result = np.zeros((n_channels, self._bases[0].shape[1]), np.float32)
        for i, group in enumerate(code.groups):
            used = np.flatnonzero(group.shares)
            some = coded[group.direct]
            chosen = self._chosen(i, some)
            values = some[chosen][:, used] * np.asarray(group.shares, np.float32)[used]
            if self._inner[i] is not None:
                total = values.T @ self._inner[i][chosen] @ self._bases[i]
            else:
                total = _sparse_times(values, chosen, self._bases[i])
            result[used] += total
        return np.ascontiguousarray(result.T)

    def _chosen(self, index, coded):
        """Terms of the light that matter most for one group, in storage order."""
        shares = np.asarray(self.model.code_.groups[index].shares, np.float32)
        weight = (coded**2 @ shares**2) * self._importance[index]
        most = len(weight) if self.n_terms is None else min(self.n_terms, len(weight))
        best = np.argpartition(weight, -most)[-most:] if most < len(weight) else np.arange(most)
        values = np.sort(weight[best])
        # Errors of different terms are as good as independent: their squares add up.
        spare = np.searchsorted(np.cumsum(values), self.error**2 * weight.sum())
        kept = best[weight[best] >= values[min(spare, most - 1)]]
        return np.sort(kept) if weight.any() else kept[:0]

    def _part(self, part, products, bright):
        for first, last, weights, rows in part.batches:
            out = self._slots[first:last].reshape(*weights.shape[:2], -1)
            np.matmul(weights, products[rows], out=out)
        order = slice(part.first, part.last)
        out = self._slots[order]
        if bright is not None:
            out += self._lit[order]
        if self._gain is not None:
            out *= self._gain[order]

    def _add_bright(self, part, bright, light, size=8192):
        """Direct light of the brightest texels on a part's points."""
        if bright is None:
            return
        vectors, radiance = self._vectors[bright], light[bright]
        for first in range(part.first // 8 * 8, part.last, size):
            stop = min(first + size, part.last)
            spread = np.unpackbits(
                self._bits[bright, first // 8 : -(-stop // 8)],
                axis=1, count=stop - first, bitorder="little",
            )  # fmt: skip
            inside = slice(max(first, part.first), stop)
            lit = vectors @ self._normals[:, inside]
            lit *= spread[:, inside.start - first :]
            np.matmul(lit.T, radiance, out=self._lit[inside])


def _sparse_times(values, chosen, basis):
    """values.T @ basis[chosen], (n_channels, n_rows), each row of the basis read once."""
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


class _Part:
    """What one thread does: chunks of slots, padded so that those alike are one product.

    A call for each cluster would cost more than its arithmetic, and threads would queue for it.

    Attributes
    ----------
    first, last : int
        Padded slots, counted over all parts.
    order : (last - first,) int64
        Point of each, any where it is padding.
    real : (last - first,) bool
    own : (n,) int64
        The model's slot of each real one.
    batches : list of (first slot, last slot, (k, n_slots, n_rows) weights, (k, n_rows) int)
        The last say which rows of the products belong to each chunk.
    """

    def __init__(self, model, chunks, first):
        ranks = 1 + model.ranks_
        rows = np.cumsum([0, *ranks])
        self.first, self.batches, order, real, own = first, [], [], [], []
        rank = ranks[chunks.cluster]
        # Chunks of one rank whose sizes round up to the same are done at once.
        padded = -(-chunks.size // _ROUND) * _ROUND
        for r, n in sorted(set(zip(rank.tolist(), padded.tolist(), strict=True))):
            alike = chunks.some((rank == r) & (padded == n))
            slot = alike.first[:, None] + np.minimum(np.arange(n), alike.size[:, None] - 1)
            there = np.arange(n) < alike.size[:, None]
            weights = np.ones((len(slot), n, r), np.float32)
            for i, (c, here) in enumerate(zip(alike.cluster, slot, strict=True)):
                weights[i, :, 1:] = model.affine_[c].weights[here - model.starts_[c]]
            which = rows[alike.cluster][:, None] + np.arange(r)
            self.batches.append((first, first + slot.size, weights, which))
            first += slot.size
            order.append(model.order_[slot].ravel())
            real.append(there.ravel())
            own.append(slot[there])
        self.last = first
        self.order, self.real = np.concatenate(order), np.concatenate(real)
        self.own = np.concatenate(own)
