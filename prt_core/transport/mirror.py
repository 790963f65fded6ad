"""Mirrors: lobes narrower than a texel show what stands in one direction."""

import numpy as np

from prt_core.errors import expect_array
from prt_core.reflectance.fresnel_powers import powers_at
from prt_core.transport.visibility import expect_bits


class Mirror:
    """What is seen from glossy points in single directions.

    Parameters
    ----------
    field : IncomingField
    bits : (n_points, n_bytes) uint8
    """

    def __init__(self, field, bits):
        self._field = field
        self._bits = expect_bits("bits", bits, field.reflections.blocks.cube_map.n_directions)
        reflections = field.reflections
        counts = np.diff(reflections.start)
        row = np.repeat(np.arange(len(reflections)), counts)
        self._keys = row * len(reflections.blocks) + reflections.block
        self._texels = self._sent = self._sky = None
        self._resent = []

    def update(self, texels, sent, sky=None):
        """Take in a light, as `IncomingField.update` does.

        Parameters
        ----------
        texels : (n_directions, 3) float32, or None
        sent : (n_points, 3) float32
        sky : callable((m, 3) directions) -> (m, 3), optional
            Radiance of the sky; default: that of the texels.
        """
        n_directions = self._field.reflections.blocks.cube_map.n_directions
        if texels is None:
            texels = np.zeros((n_directions, 3), np.float32)
        self._texels = expect_array("texels", texels, (n_directions, 3), np.float32)
        self._sent, self._sky = np.concatenate([sent, np.zeros((2, 3), np.float32)]), sky
        self._resent = []

    def resend(self, entries, which, change):
        """Take in what some entries send beyond what they did, as `IncomingField.resend` does."""
        if len(entries):
            self._resent.append((entries, which, change))

    def reflected(self, rows, normals, outgoing, powers):
        """Radiance that mirrors send towards a viewer.

        Parameters
        ----------
        rows : (k,) int
            Points of the field, which face the viewer.
        normals, outgoing : (k, 3) float32
        powers : (k, n_powers, 3) float32
            See `fresnel_powers`.

        Returns
        -------
        (k, 3) float32
        """
        facing = np.einsum("kx,kx->k", normals, outgoing)
        seen = self.seen(rows, 2 * facing[:, None] * normals - outgoing)
        return seen * mirrored_share(facing, powers)

    def seen(self, rows, directions):
        """(k, 3) float32 radiance that comes to points by `rows` from a direction (k, 3) each."""
        reflections = self._field.reflections
        texel = reflections.blocks.cube_map.texel_along(*directions.T)
        point = reflections.points[rows]
        open_ = (self._bits[point, texel >> 3] >> (texel & 7).astype(np.uint8)) & 1 == 1
        result = np.zeros((len(rows), 3), np.float32)
        if open_.any():
            result[open_] = (
                self._texels[texel[open_]] if self._sky is None else self._sky(directions[open_])
            )
        shut = np.flatnonzero(~open_)
        if len(self._keys) and len(shut):
            key = rows[shut] * len(reflections.blocks) + reflections.blocks.of_texel[texel[shut]]
            place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
            known = self._keys[place] == key
            result[shut[known]] = self._sent_by(place[known])
        return result

    def _sent_by(self, entries):
        """(k, 3) float32: what entries of the reflections send."""
        result = self._sent[self._field.reflections.met[entries]]
        for changed, which, change in self._resent:
            place = np.minimum(np.searchsorted(changed, entries), len(changed) - 1)
            hit = changed[place] == entries
            result[hit] += change[which[place[hit]]]
        return result


def mirrored_share(cosine, powers):
    """How much of the light a mirror reflects.

    Parameters
    ----------
    cosine : (k,) float32
        Between view and normal.
    powers : (k, n_powers, 3) float32
        See `fresnel_powers`.

    Returns
    -------
    (k, 3) float32
    """
    each = powers_at(cosine[:, None])
    return np.maximum(sum(power * powers[:, k] for k, power in enumerate(each)), 0)
