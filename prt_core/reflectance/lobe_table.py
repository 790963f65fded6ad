"""A table of one reflectance's lobes in wavelets, so that a frame does not make lobes.

A lobe is reflectance times cosine, over the texels of a cube map in the world. An isotropic one
depends on four angles: the mirror direction, along which it changes fast, the angle between mirror
direction and normal (the tilt), and the turn of the normal about the mirror direction, on which it
depends little. So mirror directions are the texels of a cube map, between which lobes are mixed,
and tilts and turns are cells; a lobe is scaled to the exact share that the surface reflects.

What a cube's symmetries do to wavelets is to move them and to change signs (see `turned_wavelets`),
so lobes are made for one mirror direction of 48. (After Ng et al. 2004, section 5, whose tables are
of all directions.)
"""

import numpy as np
import scipy.sparse as sp

from prt_core.basis.cube_symmetry import cube_symmetries, turned_wavelets
from prt_core.basis.haar import haar_rows
from prt_core.errors import expect, expect_array, expect_number, expect_whole
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import FACES, CubeMap, tangent_frames

# Directions along an edge of a block at which lobes are looked up; heights and turns of directions
# over which the reflected share is summed.
_SAMPLES, _HEIGHTS, _TURNS = 2, 256, 48
# Angles at which the reflected share is known.
_SHARES = 64
_N_SYMMETRIES = 48


class LobeTable:
    """Lobes of one isotropic reflectance, as the wavelets that are largest.

    Parameters
    ----------
    reflectance_eval : callable
        See `dense_reflection`; of one material. Channels are told apart by the share that is
        reflected in all; the shape of a lobe is that of their mean.
    n_kept : int
        Wavelets of each lobe.
    n_blocks : int
        Blocks along an edge of a cube's face: a lobe is even within each.
    n_mirrored : int
        Mirror directions along an edge of a cube's face.
    n_tilts : int
        Steps of the tilt, from 0 to a right angle.

    Attributes
    ----------
    places : (n_lobes, n_kept) int32
        Of wavelets in a row of `n_blocks`, for one mirror direction of 48.
    values : (n_lobes, n_kept) float32
    """

    def __init__(self, reflectance_eval, n_kept=246, n_blocks=16, n_mirrored=32, n_tilts=9):
        expect(callable(reflectance_eval), "reflectance_eval: expected a callable")
        self.cube_map = CubeMap(expect_whole("n_blocks", n_blocks, 1, 128))
        n_texels = self.cube_map.n_directions
        self.n_kept = min(expect_whole("n_kept", n_kept, 1), n_texels)
        self.n_mirrored = expect_whole("n_mirrored", n_mirrored, 2, 256)
        self.n_tilts = expect_whole("n_tilts", n_tilts, 1, 64)
        self._set_cells()
        self._set_mirrored()
        self._symmetries = turned_wavelets(self.cube_map)
        self._set_shares(reflectance_eval)
        self._fill(reflectance_eval)

    def _set_cells(self):
        """Rings of equal tilt, cut into turns of about the same width."""
        step = np.pi / 2 / self.n_tilts
        tilts = (np.arange(self.n_tilts) + 0.5) * step
        counts = np.maximum(1, np.rint(2 * np.pi * np.sin(tilts) / step)).astype(int)
        self._ring_counts, self._ring_starts = counts, np.cumsum(counts) - counts
        self.n_cells = int(counts.sum())
        ring = np.repeat(np.arange(self.n_tilts), counts)
        turn = (np.arange(self.n_cells) - self._ring_starts[ring]) / counts[ring] * 2 * np.pi
        tilt = tilts[ring]
        # Normals of the cells about a mirror direction that is z.
        self._cell_normals = np.stack(
            [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=1
        )

    def _set_mirrored(self):
        """For each mirror direction the one for which lobes are made, the way back, a frame."""
        cube_map = CubeMap(self.n_mirrored)
        matrices = cube_symmetries()
        images = np.stack([cube_map.texel_of(cube_map.directions @ m.T) for m in matrices])
        symmetry = images.argmin(axis=0)
        made, base = np.unique(images.min(axis=0), return_inverse=True)
        inverse = (matrices[:, None] == matrices.swapaxes(1, 2)).all(axis=(2, 3)).argmax(axis=1)
        self._base, self._way = base, inverse[symmetry]
        self._made = tangent_frames(cube_map.directions[made])
        back = matrices[self._way]
        self._frames = np.einsum("tij,tkj->tki", back, self._made[base][:, :2])

    def _set_shares(self, evaluate):
        """The share that is reflected, for views along cosines from 0 to 1."""
        z = ((np.arange(_HEIGHTS) + 0.5) / _HEIGHTS)[:, None]
        turn = (np.arange(_TURNS) + 0.5) / _TURNS * 2 * np.pi
        radius = np.sqrt(1 - z * z)
        incoming = np.stack(
            [radius * np.cos(turn), radius * np.sin(turn), z + 0 * turn], axis=-1
        ).reshape(-1, 3)
        self._cosines = (np.arange(_SHARES) + 0.5) / _SHARES
        shares = []
        for cosine in self._cosines:
            outgoing = np.array([[np.sqrt(1 - cosine**2), 0, cosine]])
            values = evaluate(incoming, outgoing) * incoming[:, 2:]
            shares.append(values.mean(axis=0) * 2 * np.pi)
        self._shares = np.array(shares)
        self.n_channels = self._shares.shape[1]

    def share(self, cosine):
        """Reflected share of light from all sides, (n, n_channels), seen along `cosine` (n,)."""
        return np.stack([np.interp(cosine, self._cosines, s) for s in self._shares.T], axis=1)

    def _fill(self, evaluate):
        n = self.cube_map.resolution
        fine = CubeMap(n * _SAMPLES)
        n_lobes = len(self._made) * self.n_cells
        self.places = np.empty((n_lobes, self.n_kept), np.int32)
        self.values = np.empty((n_lobes, self.n_kept), np.float32)
        vectors, directions = fine.vectors.astype(np.float32), fine.directions.astype(np.float32)

        def one(base):
            normals = self._cell_normals @ self._made[base]
            mirror = self._made[base, 2]
            views = 2 * (normals @ mirror)[:, None] * normals - mirror
            frames = tangent_frames(normals)
            lobes = np.zeros((self.n_cells, fine.n_directions), np.float32)
            for lobe, frame, view in zip(lobes, frames.astype(np.float32), views, strict=True):
                cosine = vectors @ frame[2]
                seen = np.flatnonzero(cosine > 0)
                incoming = directions[seen] @ frame.T
                outgoing = (frame @ view)[None].astype(np.float32)
                lobe[seen] = evaluate(incoming, outgoing).mean(axis=1) * cosine[seen]
            faces = lobes.reshape(-1, 6, n, _SAMPLES, n, _SAMPLES).sum(axis=(3, 5))
            rows = haar_rows(faces.reshape(self.n_cells, -1), n)
            kept = np.argpartition(-np.abs(rows), self.n_kept - 1, axis=1)[:, : self.n_kept]
            part = slice(base * self.n_cells, (base + 1) * self.n_cells)
            self.places[part] = kept
            self.values[part] = np.take_along_axis(rows, kept, axis=1)

        on_all_cores(one, range(len(self._made)))

    def look_up(self, normals, outgoing):
        """Which lobes mix into that of each point.

        Parameters
        ----------
        normals, outgoing : (n, 3) float
            Unit vectors; the viewer is above the horizon.

        Returns
        -------
        keys : (n, 4) int64
            Of lobes (see `rows`).
        weights : (n, 4) float64
        patch : (n,) int64
            The square of mirror directions that the point's is in: points of one share lobes.
        scale : (n, n_channels, 4) float64
            By which each lobe is to be multiplied, its weight included.
        """
        normals = expect_array("normals", normals, (None, 3), np.float64)
        outgoing = expect_array("outgoing", outgoing, (len(normals), 3), np.float64)
        cosine = np.clip(np.einsum("ni,ni->n", normals, outgoing), 0, 1)
        mirror = 2 * cosine[:, None] * normals - outgoing
        texels, weights, patch = self._around(mirror)
        step = np.pi / 2 / self.n_tilts
        ring = np.minimum((np.arccos(cosine) / step).astype(int), self.n_tilts - 1)
        at = np.einsum("nckj,nj->nck", self._frames[texels], normals)
        count = self._ring_counts[ring][:, None]
        turn = np.arctan2(at[..., 1], at[..., 0]) / (2 * np.pi) * count
        cell = self._ring_starts[ring][:, None] + np.rint(turn).astype(int) % count
        keys = (self._base[texels] * self.n_cells + cell) * _N_SYMMETRIES + self._way[texels]
        # The mean of channels has the lobe's shape; of channels without light there is no lobe.
        made = self.share(np.cos((ring + 0.5) * step)).mean(axis=1)
        scale = self.share(cosine) / np.maximum(made, 1e-30)[:, None]
        return keys, weights, patch, scale[:, :, None] * weights[:, None]

    def _around(self, mirror):
        """Texels (n, 4) about mirror directions on the same face, their weights, the square."""
        n = self.n_mirrored
        axis = np.abs(mirror).argmax(axis=1)
        face = 2 * axis + (np.take_along_axis(mirror, axis[:, None], axis=1)[:, 0] < 0)
        local = np.einsum("nij,nj->ni", FACES[face], mirror)
        place = (local[:, 1:] / local[:, :1] + 1) / 2 * n - 0.5
        place = np.clip(place, 0, n - 1)
        first = np.minimum(place.astype(np.int64), n - 2)
        part = place - first
        texels, weights = [], []
        for down in (0, 1):
            for right in (0, 1):
                texels.append((face * n + first[:, 1] + down) * n + first[:, 0] + right)
                x = part[:, 0] if right else 1 - part[:, 0]
                y = part[:, 1] if down else 1 - part[:, 1]
                weights.append(x * y)
        return np.stack(texels, axis=1), np.stack(weights, axis=1), texels[0]

    def rows(self, keys):
        """Lobes as rows of wavelets.

        Parameters
        ----------
        keys : (m,) int64
            Of `look_up`.

        Returns
        -------
        (m, 6 n_blocks^2) CSR float32
            Of what each block brings for a light of one.
        """
        keys = expect_array("keys", keys, (None,), np.int64, 0)
        lobe, way = np.divmod(keys, _N_SYMMETRIES)
        expect(not len(keys) or lobe.max() < len(self.places), "keys: expected those of look_up")
        places, signs = self._symmetries
        kept = self.places[lobe]
        columns = places[way[:, None], kept]
        values = self.values[lobe] * signs[way[:, None], kept]
        pointer = np.arange(len(keys) + 1) * self.n_kept
        shape = len(keys), self.cube_map.n_directions
        return sp.csr_matrix((values.ravel(), columns.ravel(), pointer), shape=shape)

    @property
    def nbytes(self):
        """Of places and values."""
        return self.places.nbytes + self.values.nbytes


def kept_wavelets(share, n_directions):
    """How many wavelets a share of all is: at least one."""
    share = expect_number("share", share, above=0, most=1)
    return max(1, round(share * n_directions))
