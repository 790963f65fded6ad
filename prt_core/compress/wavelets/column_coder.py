"""Columns as few quantised terms, and the limit that gives the error or the size asked for."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from prt_core.compress.wavelets.column_depth import (
    invert_from,
    transform_to_best,
    transform_to_better,
)
from prt_core.compress.wavelets.limit_search import LimitSearch
from prt_core.compress.wavelets.quantise import dequantise, quantise
from prt_core.compress.wavelets.sparse_columns import TERMS_A_PLACE, column_bytes
from prt_core.errors import expect
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

# Columns, and entries, from which the first limit is found.
_SAMPLE, _SAMPLE_ENTRIES = 240, 1 << 24
# Of the squared error, what terms below the limit must at least make up.
_LEAST_CUT = 0.1


@dataclass
class Column:
    """Terms of one column: places (sorted) and values, times `size` if they are integers.

    Integers at the same place add up. A depth below zero counts steps of the transform's `haar`.
    `lost` is the squared error, of it `cut` what is below the limit; the rest is quantising's.
    """

    name: int
    depth: int
    size: float
    places: np.ndarray
    values: np.ndarray
    lost: float = 0.0
    cut: float = 0.0


class ColumnCoder:
    """Cuts columns to their large terms, each at the depth that suits it.

    Parameters
    ----------
    transform : ImageWavelet, PointHaar or PointMultiwavelet
    least, most : int
        Depths that are allowed.
    bits : int or None
    scaling : str
    dither : bool
        See `quantise`.
    memory : int
        Bytes for what is worked on.
    seed : int
    """

    def __init__(self, transform, least, most, bits, scaling, dither, memory, seed):
        self.transform, self.least, self.most = transform, least, most
        self.bits, self.scaling, self.dither = bits, scaling, dither
        self.memory, self.seed = memory, seed
        self._levels, self._weights = cache(self._scales), cache(transform.weights)

    def encode(self, names, columns, limit):
        """A `Column` for each of (m, n_points) columns, which are overwritten."""
        transform, allowed = self.transform, (self.least, self.most)
        if self.least < self.most and transform.haar:
            depths = transform_to_better(transform, transform.haar, columns, limit, *allowed)
        else:
            depths, _ = transform_to_best(transform, columns, limit, *allowed)
        encoded = []
        for name, column, depth in zip(names, columns, depths, strict=True):
            encoded.append(self._cut(int(name), column, int(depth), np.float32(limit)))
        # What is left of the columns now is what was lost.
        rest = columns if transform.orthonormal else invert_from(transform, columns, depths)
        for column, left in zip(encoded, rest, strict=True):
            column.lost = float(np.einsum("p,p->", left, left, dtype=np.float64))
        return encoded

    def _cut(self, name, column, depth, limit):
        """A `Column` of the terms above the limit, which are taken out of the array."""
        squares = self._squares(column, depth)
        places = np.flatnonzero(squares > limit).astype(np.int32)
        cut = float(squares[squares <= limit].sum(dtype=np.float64))
        if self.bits is None:
            values = column[places]
            column[places] = 0
            return Column(name, depth, 1.0, places, values, cut=cut)
        rng = generator(self.seed, Stage.DITHER, name) if self.dither else None
        terms, size = [], None
        for _ in range(TERMS_A_PLACE):
            levels = self._levels(depth)[places]
            integers, size = quantise(column[places], levels, self.bits, self.scaling, rng, size)
            column[places] -= dequantise(integers, levels, size, self.scaling)
            terms.append((places[integers != 0], integers[integers != 0]))
            # What quantising leaves of a large term may be worth a term itself.
            places = places[self._squares(column, depth, places) > limit]
        places, values = map(np.concatenate, zip(*terms, strict=True))
        order = np.argsort(places, kind="stable")
        return Column(name, depth, size, places[order], values[order], cut=cut)

    def _squares(self, column, depth, places=slice(None)):
        """What terms are worth, of some places or all."""
        squares = column[places] ** 2
        if not self.transform.orthonormal:
            squares *= self._weights(depth)[places]
        return squares

    def _scales(self, depth):
        transform = self.transform.haar if depth < 0 else self.transform
        return transform.scales(abs(depth))

    def all_steps(self, file, limit):
        """All columns of a `ColumnFile`; a generator of `Progress`.

        Returns
        -------
        encoded : list of Column
            Those that keep a term.
        error : float
            Relative L2 of the whole matrix.
        nbytes : int
        """
        n_columns, n_points = file.shape
        total = file.energies.sum()
        # A column with less energy than the smallest term has no term.
        kept_columns = np.flatnonzero(
            file.energies > limit * (1 if self.transform.orthonormal else 0.25)
        )
        lost = total - file.energies[kept_columns].sum()
        per = int(np.clip(self.memory / (160 * n_points), 1, 16))

        def read():
            for first in range(0, len(kept_columns), per):
                names = kept_columns[first : first + per]
                yield names, file.read(names)

        encoded, done = [], 0
        for part in in_parallel(lambda item: self.encode(*item, limit), read()):
            lost += sum(column.lost for column in part)
            done += len(part)
            encoded += [column for column in part if len(column.places)]
            yield Progress("columns", done, len(kept_columns))
        error = float(np.sqrt(max(lost, 0.0) / total)) if total else 0.0
        return encoded, error, int(self._bytes(encoded, n_points).sum())

    def fitting_steps(self, file, strata, error, nbytes):
        """All columns at the limit that gives an error, or so many bytes.

        Parameters
        ----------
        file : ColumnFile
        strata : (n_columns,) int
            Columns of the same number are alike.
        error : float
            0: every term is kept.
        nbytes : int or None
            Instead of `error`.

        Returns
        -------
        found, error
            As from `all_steps`.
        limit : float
        """
        total = file.energies.sum()
        if not total or (error == 0 and nbytes is None):
            encoded, reached, _ = yield from self.all_steps(file, 1e-37)
            return encoded, reached, 1e-37
        wanted = error if nbytes is None else nbytes
        search = _search(self._sampled(file, strata, wanted, nbytes), wanted, nbytes, total)
        best = None
        while search.limit is not None:
            limit = search.limit
            encoded, reached, size = yield from self.all_steps(file, limit)
            if search.tell(reached if nbytes is None else size) and encoded:
                best = encoded, reached, limit
        expect(
            best is not None,
            self._too_few_bits(error)
            if nbytes is None
            else f"nbytes_wanted: {nbytes} is too little for any column; allow more",
        )
        return best

    def _too_few_bits(self, error):
        return f"error: {error:g} is out of reach of {self.bits} bits a coefficient; allow more"

    def _sampled(self, file, strata, wanted, nbytes):
        """The limit that is right for some columns of each stratum."""
        alive = file.energies > 1e-14 * file.energies.sum()
        groups = [np.flatnonzero(alive & (strata == value)) for value in np.unique(strata[alive])]
        each = max(1, min(_SAMPLE, _SAMPLE_ENTRIES // file.shape[1]) // len(groups))
        rng = generator(self.seed, Stage.COLUMN_SAMPLE)
        chosen = [np.sort(rng.choice(g, min(len(g), each), replace=False)) for g in groups]
        names = np.concatenate(chosen)
        weights = np.repeat(
            [len(g) / len(c) for g, c in zip(groups, chosen, strict=True)],
            [len(c) for c in chosen],
        )
        columns = np.concatenate([file.read(part) for part in chosen])
        total = weights @ file.energies[names]
        search = _search(total * 1e-8, wanted, nbytes, total, near=0.995, most=30)
        parts = np.array_split(np.arange(len(names)), -(-len(names) // 16))
        while search.limit is not None:
            limit = search.limit
            tried = in_parallel(
                lambda part, at=limit: self.encode(names[part], columns[part], at), parts
            )
            sample = [column for part in tried for column in part]
            if nbytes is None:
                lost, cut = weights @ [(column.lost, column.cut) for column in sample]
                search.tell(float(np.sqrt(lost / total)))
            else:
                search.tell(float(weights @ self._bytes(sample, file.shape[1])))
        if nbytes is None:
            # Ever smaller terms would have to make up for what quantising loses of all.
            strained = lost > 0.9 * wanted**2 * total and cut < _LEAST_CUT * lost
            expect(not strained, self._too_few_bits(wanted))
        return limit

    def _bytes(self, columns, n_points):
        counts = np.array([len(column.places) for column in columns], np.int64)
        return column_bytes(counts, n_points, self.bits)[0]


def _search(start, wanted, nbytes, total, **options):
    least = 1e-16 * total if nbytes is None else 1e-37
    return LimitSearch(start, wanted, rising=nbytes is None, least=least, **options)
