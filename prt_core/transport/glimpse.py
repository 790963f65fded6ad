"""Glimpses: about what lobes send, for light that one glossy surface throws on another.

One point stands for all that a reflection meets in a block, so its lobe need not be summed as for
a viewer. A few facets of it mirror the blocks that they face; the brightest texels, of which few
facets would find one, are exact.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.reflectance.fresnel_powers import powers_at, powers_used
from prt_core.runtime.halves import halves, wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points, tangent_frames
from prt_core.transport.bright_lobes import BrightLobes

# Facets of each lobe, and points worked on at once, at facets and at bright texels: so many that
# threads seldom wait for Python's lock.
_FACETS, _MANY, _BRIGHT = 4, 1 << 14, 1 << 12
# Glimpses whose facets are kept: 32 bytes each.
_MOST_KEPT = 3_000_000
# Least alpha: the lobe of the one point stands for those of all that is met in a block.
LEAST = np.float32(0.1)
# Least cosine of a view: smooth normals may face away from who sees the surface.
_GRAZING = 0.05
# Shifts of a sequence that are spread evenly, one after the other.
_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])


class Glimpses:
    """About what lobes send: quick, and right in the mean over many points and directions.

    A few facets of each lobe mirror the blocks that they face, which are the same under every
    light. Bright texels are exact.

    Parameters
    ----------
    field : IncomingField
    normals : (n, 3) float32
        Of the points of the field.
    rows : (k,) int
        Points of the field, in any order and number.
    outgoing : (k, 3) float32, or what gives as much for a slice
        Unit vectors towards the viewer, in the world.
    kinds : (n,) int32
        Points of the field that have the same lobes are of one kind, but for what no one sees.
    lobes_at : callable(kinds (m,) int, cosine (m,) float) -> list of (alpha, powers)
        Lobes towards views along a cosine with the normal, by roughness, as
        `GlossyView.reflected` takes them.
    """

    def __init__(self, field, normals, rows, outgoing, kinds, lobes_at):
        self._field, self._normals = field, normals
        self._rows, self._outgoing = rows, outgoing
        self._kinds, self._lobes_at, self._kept = kinds, lobes_at, {}
        self._keeps = len(self._rows) <= _MOST_KEPT

    def _of_bright(self):
        """(k, 3) float32: what is sent of the bright texels of the field's light."""
        bright = BrightLobes(self._field.merged, self._kinds, self._lobes_of)
        result = np.zeros((len(self._rows), 3), np.float32)

        def one(first):
            part = slice(first, first + _BRIGHT)
            rows, outgoing = self._rows[part], self._outgoing[part]
            normals = self._normals.take(rows, axis=0)
            cosine = np.einsum("kx,kx->k", outgoing, normals)
            work = rows, normals, lifted(outgoing, normals), cosine
            result[part] = bright.reflected(*work)

        on_all_cores(one, range(0, len(self._rows), _BRIGHT))
        return result

    def _lobes_of(self, kinds, cosine):
        """Lobes of kinds as `BrightLobes` takes them: round ones, and not too narrow."""
        return [(_width(alpha), powers) for alpha, powers in self._lobes_at(kinds, cosine)]

    def reflected(self):
        """(k, 3) float32: what is sent of the field as it is, and of the bright texels."""
        result = self._of_bright()
        values, n_nodes = self._field.values.reshape(-1), len(self._field.nodes)

        def one(first):
            part = slice(first, first + _MANY)
            start = self._rows[part].astype(np.int64) * (3 * n_nodes)
            for some, block, factor in self._facets_at(first):
                index = start[some] + block
                for channel in range(3):
                    light = wholes(factor[channel])
                    light *= wholes(values.take(index + channel * n_nodes))
                    result[part, channel][some] += light.sum(axis=0)

        on_all_cores(one, range(0, len(self._rows), _MANY))
        return result

    def returned(self, entries, which, n):
        """What glimpses show of what some entries of the reflections send, as matrices.

        Parameters
        ----------
        entries : (m,) int
            Ascending.
        which : (m,) int
            Whose radiance each sends.
        n : int
            Of how many.

        Returns
        -------
        list of (k, n) scipy.sparse.csr_matrix, float32
            Of each channel: times their radiance (n,) this is what is seen of it.
        """
        reflections = self._field.reflections
        n_blocks = len(reflections.blocks)
        row = np.searchsorted(reflections.start, entries, side="right") - 1
        keys, share = row * n_blocks + reflections.block[entries], reflections.share[entries]

        def one(first):
            places = []
            for some, block, factor in self._facets_at(first):
                mine = first + some.astype(np.int64)
                wanted = self._rows[mine].astype(np.int64) * n_blocks + block
                place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
                facet, lobe = np.nonzero(keys[place] == wanted)
                place = place[facet, lobe]
                weight = share[place] * np.float32(1 / 255)
                values = [wholes(each[facet, lobe]) * weight for each in factor]
                places.append((mine[lobe], which[place], values))
            return places

        chunks = range(0, len(self._rows) if len(keys) else 0, _MANY)
        every = [place for places in on_all_cores(one, chunks) for place in places]
        shape = len(self._rows), n
        if not every:
            return [sp.csr_matrix(shape, dtype=np.float32)] * 3
        rows, columns, values = zip(*every, strict=True)
        rows = np.concatenate(rows)
        order = np.argsort(rows, kind="stable")
        start = np.cumsum(np.bincount(rows + 1, minlength=shape[0] + 1)).astype(np.int32)
        columns = np.concatenate(columns)[order].astype(np.int32)
        # Where entries are is in memory once for the three.
        return [
            sp.csr_matrix((np.concatenate([each[c] for each in values])[order], columns, start),
                          shape)
            for c in range(3)
        ]  # fmt: skip

    def _facets_at(self, first):
        """`_facets_of`, kept."""
        facets = self._kept.get(first)
        if facets is None:
            facets = self._facets_of(first)
            if self._keeps:
                self._kept[first] = facets
        return facets

    def _facets_of(self, first):
        """Of some of the glimpses, for each roughness: which have lobes (m,), the blocks that
        facets mirror (n_facets, m), and what they reflect (3, n_facets, m), as `halves`."""
        rows = self._rows[first : first + _MANY]
        frame = tangent_frames(self._normals.take(rows, axis=0)).astype(np.float32)
        ways = lifted(self._outgoing[first : first + _MANY], frame[:, 2])
        view = np.einsum("kx,kax->ak", ways, frame)
        places = sobol_points(int(np.log2(_FACETS))).astype(np.float32).T[:, :, None]
        # Each has a shift of its own, so that errors go away in the mean.
        shift = np.arange(first, first + len(rows)) * _GOLDEN[:, None] % 1
        shift = shift.astype(np.float32)
        height = (places[0] + shift[0]) % np.float32(1)
        result = []
        cosine = np.einsum("kx,kx->k", self._outgoing[first : first + _MANY], frame[:, 2])
        for alpha, powers in self._lobes_at(self._kinds.take(rows), cosine):
            some = np.flatnonzero(powers.any(axis=(1, 2)))
            if not len(some):
                continue
            own = [part[some] for part in view]
            width = _width(alpha[some])
            facets = _facets(own, width, height[:, some], places[1], shift[1, some])
            cosine = sum(a * b for a, b in zip(own, facets, strict=True))
            incoming = [2 * cosine * facet - way for facet, way in zip(facets, own, strict=True)]
            square = width * width
            here, there = (
                np.sqrt(1 - square + square / np.maximum(z, 1e-3) ** 2)
                for z in (own[2], incoming[2])
            )
            weight = np.where(incoming[2] > 0, (1 + here) / (here + there), 0)
            weight *= np.float32(1 / _FACETS)
            world = [sum(incoming[a] * frame[some, a, x] for a in range(3)) for x in range(3)]
            block = self._field.reflections.blocks.along(*world).astype(np.uint16)
            n_powers = powers_used(powers)
            each = [power * weight for power in powers_at(cosine)[:n_powers]]
            fresnel = powers[some, :n_powers].transpose(1, 2, 0)
            factor = [sum(a * b[k] for a, b in zip(each, fresnel, strict=True)) for k in range(3)]
            result.append((some.astype(np.uint16), block, halves(np.maximum(factor, 0))))
        return result

    @property
    def nbytes(self):
        """Of what is kept."""
        kept = [array for facets in self._kept.values() for parts in facets for array in parts]
        return sum(array.nbytes for array in kept)


def _width(alpha):
    """Alphas (k,) or (k, 2) as one, (k,) float32, that is not too small."""
    width = alpha if alpha.ndim == 1 else np.sqrt(alpha.prod(axis=1))
    return np.maximum(width.astype(np.float32), LEAST)


def _facets(view, alpha, height, turn, shift):
    """Normals of GGX facets that are seen from `view` (3, k): three (n_facets, k) arrays.

    Source: Dupuy and Benyoub 2023, Sampling visible GGX normals with spherical caps.
    """
    x, y, z = view[0] * alpha, view[1] * alpha, view[2]
    length = 1 / np.sqrt(x * x + y * y + z * z)
    x, y, z = x * length, y * length, z * length
    # Of the cap that is mirrored from the stretched view, around at a turn that each has.
    up = 1 - height * (1 + z)
    aside = np.sqrt(np.maximum(1 - up * up, 0))
    (cos, sin), (c, s) = (
        (np.cos(angle), np.sin(angle)) for angle in (2 * np.pi * shift, 2 * np.pi * turn)
    )
    x = alpha * (x + aside * (cos * c - sin * s))
    y = alpha * (y + aside * (sin * c + cos * s))
    z = np.maximum(up + z, 1e-6)
    length = 1 / np.sqrt(x * x + y * y + z * z)
    return x * length, y * length, z * length


def lifted(directions, normals):
    """Directions (k, 3) lifted to `_GRAZING` above the surface where they are below that."""
    cosine = np.einsum("kx,kx->k", directions, normals)[:, None]
    lifted = directions + np.maximum(_GRAZING - cosine, 0) * normals
    return (lifted / np.linalg.norm(lifted, axis=1, keepdims=True)).astype(np.float32)
