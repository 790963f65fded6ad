"""Relighting clusters of rows in milliseconds: plan once, apply for each light.

The bases lie term by term, so that a light cut to its most important few hundred terms reads
only their rows; points lie cluster by cluster, so that each cluster is one small product. A light's
few brightest texels, which no small basis can follow, are looked up in the visibility bits.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from threadpoolctl import ThreadpoolController

from prt_core.errors import expect, expect_array

_TERMS_AT_ONCE = 64


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
        self._plan_points()
        if self.n_exact:
            self._plan_bits(transport)

    def relight(self, light):
        """(n_points, n_channels) float32 under (n_directions, n_channels) light."""
        model = self.model
        light = expect_array("light", light, (model.n_directions_, model.n_channels_), np.float32)
        with self._blas.limit(limits=1):
            bright, rest = self._split(light)
            products = self._products(light, rest)
            first, *others = [(part, products, light, bright) for part in self._parts]
            done = [self._pool.submit(self._part, *arguments) for arguments in others]
            self._part(*first)
            for future in done:
                future.result()
        return self.model.gather_slots(self._sorted)

    def terms(self, light):
        """Number of terms that a light is cut to, for each group of the code."""
        _, rest = self._split(np.asarray(light, np.float32))
        code = self.model.code_
        coded = [code.light(light), code.light(rest)]
        return [len(self._chosen(i, coded[g.direct])) for i, g in enumerate(code.groups)]

    @property
    def nbytes(self):
        """Bytes of what is read when relighting, the visibility bits included."""
        arrays = [*self._bases, *self._weights, self.model.place_, self._sorted]
        arrays += [self._bits] if self.n_exact else []
        return sum(array.nbytes for array in arrays)

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
        self._total = sum(float(values.sum()) for values in self._importance)

    def _plan_points(self):
        model = self.model
        self._weights = [
            np.column_stack([np.ones(len(a.weights), np.float32), a.weights]) for a in model.affine_
        ]
        self._rows = np.cumsum([0, *(w.shape[1] for w in self._weights)])
        self._gain = None if model.gain_ is None else model.gain_[model.order_]
        self._sorted = np.empty((len(model.order_), model.n_channels_), np.float32)
        n_threads = os.cpu_count() or 1
        targets = np.linspace(0, len(model.order_), n_threads + 1)[1:-1]
        cuts = [0, *np.searchsorted(model.starts_, targets), len(model.affine_)]
        self._parts = [(a, b) for a, b in zip(cuts[:-1], cuts[1:], strict=True) if b > a]

    def _plan_bits(self, transport):
        """Visibility, a row of bits for each direction, and normals in the order of clusters."""
        order, wanted = self.model.order_, (self.model.n_points_, self.model.n_directions_)
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
        code = self.model.code_
        coded = {False: code.light(light)}
        coded[True] = coded[False] if rest is light else code.light(rest)
        result = np.zeros((light.shape[1], int(self._rows[-1])), np.float32)
        for i, group in enumerate(code.groups):
            used = np.flatnonzero(group.shares)
            some = coded[group.direct]
            chosen = self._chosen(i, some)
            values = np.ascontiguousarray(some[chosen][:, used].T)
            values *= np.asarray(group.shares, np.float32)[used, None]
            if self._inner[i] is not None:
                total = values @ self._inner[i][chosen] @ self._bases[i]
            else:
                total = np.zeros((len(used), result.shape[1]), np.float32)
                for first in range(0, len(chosen), _TERMS_AT_ONCE):
                    terms = slice(first, first + _TERMS_AT_ONCE)
                    total += values[:, terms] @ self._bases[i][chosen[terms]]
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

    def _part(self, clusters, products, light, bright):
        starts, order = self.model.starts_, slice(None)
        first, last = clusters
        order = slice(int(starts[first]), int(starts[last]))
        out = self._sorted[order]
        for c in range(first, last):
            rows = products[self._rows[c] : self._rows[c + 1]]
            np.matmul(self._weights[c], rows, out=self._sorted[starts[c] : starts[c + 1]])
        if bright is not None:
            self._add_bright(order, bright, light[bright], out)
        if self._gain is not None:
            out *= self._gain[order]

    def _add_bright(self, points, bright, radiance, out, size=8192):
        vectors = self._vectors[bright]
        begin = points.start // 8 * 8
        for first in range(begin, points.stop, size):
            stop = min(first + size, points.stop)
            spread = np.unpackbits(
                self._bits[bright, first // 8 : -(-stop // 8)],
                axis=1, count=stop - first, bitorder="little",
            )  # fmt: skip
            inside = slice(max(first, points.start), stop)
            skip = inside.start - first
            light = vectors @ self._normals[:, inside]
            light *= spread[:, skip:]
            out[inside.start - points.start : stop - points.start] += light.T @ radiance
