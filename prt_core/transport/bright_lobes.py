"""What lobes reflect of the brightest texels of a light, evaluated for a view.

What reflects, but for its shape, is looked up: of each kind of lobes the Fresnel terms are known
at some cosines of the view, as they are for maps of views (see `transport.view_map`).
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_used
from prt_core.runtime.halves import wholes
from prt_core.transport.lobe_values import lobe_values

# Cosines at which terms are known, closer where views graze, and kinds of which they are.
_COSINES, _MOST = 49, 2048


class BrightLobes:
    """Lobes at bright texels.

    Parameters
    ----------
    bright : BrightLight
        What n points see of them.
    kinds : (n,) int32
        Points of one kind have the same lobes; negative: a point that is not asked for.
    lobes_of : callable(kind (k,) int, cosine (k,) float) -> list of (alpha, powers)
        See `ViewMap`.
    lobe : callable, optional
        See `ViewMap`.
    """

    def __init__(self, bright, kinds, lobes_of, lobe=None):
        self._bright, self._kinds = bright, kinds
        self._lobes_of, self._lobe = lobes_of, lobe
        self._ways = np.ascontiguousarray(bright.directions.T)
        self._lit = bright.values.any(axis=(1, 2))
        self._known = []
        n_kinds = int(kinds.max(initial=-1)) + 1
        if 0 < n_kinds <= _MOST and len(bright.spread):
            cosines = np.linspace(0, 1, _COSINES, dtype=np.float32) ** 2
            every = np.repeat(np.arange(n_kinds), _COSINES)
            for alpha, powers in lobes_of(every, np.tile(np.maximum(cosines, 1e-4), n_kinds)):
                used = powers_used(powers) if lobe is None else 1
                powers = np.ascontiguousarray(powers[:, :used]).astype(np.float32)
                if powers.any():
                    self._known.append((alpha[::_COSINES].astype(np.float32), powers))

    @property
    def nbytes(self):
        """Of what is known of lobes."""
        return sum(alpha.nbytes + powers.nbytes for alpha, powers in self._known)

    def reflected(self, rows, normals, outgoing, cosine):
        """Radiance that points send towards a viewer of the bright texels.

        Parameters
        ----------
        rows : (k,) int
        normals, outgoing : (k, 3) float32
        cosine : (k,) float32
            Between both.

        Returns
        -------
        (k, 3) float32
        """
        result = np.zeros((len(rows), 3), np.float32)
        lit = np.flatnonzero(self._lit.take(rows))
        if not len(lit):
            return result
        rows, cosine = rows.take(lit), cosine.take(lit)
        light = wholes(self._bright.values.take(rows, axis=0))
        total = np.zeros((len(lit), 3), np.float32)
        places = normals.take(lit, axis=0), outgoing.take(lit, axis=0)
        for alpha, powers in self._lobes_at(rows, cosine):
            if self._lobe is None:
                n_powers, spread = powers.shape[1], self._bright.spread
                lobes = lobe_values(self._ways, *places, alpha, None, n_powers, spread)
            else:
                lobes = [self._lobe(self._ways, *places)]
            for power, values in enumerate(lobes):
                total += np.einsum("kcm,km->kc", light, values) * powers[:, power]
        result[lit] = total
        return result

    def _lobes_at(self, rows, cosine):
        """Of points towards views along a cosine: (alpha (k,), powers (k, n_powers, 3)), each."""
        kinds = self._kinds.take(rows)
        if not self._known:
            return [
                (alpha.astype(np.float32), powers[:, : powers_used(powers)])
                for alpha, powers in self._lobes_of(kinds, cosine)
            ]
        place = np.sqrt(np.clip(cosine, 0, 1)) * np.float32(_COSINES - 1)
        low = np.minimum(place.astype(np.int32), _COSINES - 2)
        part, index = (place - low)[:, None, None], kinds * np.int32(_COSINES) + low
        lobes = []
        for alpha, powers in self._known:
            below = powers.take(index, axis=0)
            lobes.append(
                (alpha.take(kinds), below + (powers.take(index + 1, axis=0) - below) * part)
            )
        return lobes
