"""Dilation of masks on the cube map, in packed bits, across the edges of its faces."""

from functools import lru_cache

import numpy as np

from prt_core.sphere import CubeMap


def dilate(bits, resolution, corners=True):
    """Each mask and the eight texels around every texel of it, or the four beside it.

    At the eight corners of the cube three faces meet, and a texel there has seven neighbours.

    Parameters
    ----------
    bits : (n, n_bytes) uint8
        Masks over the 6 x resolution^2 directions, little bit order.
    resolution : int
    corners : bool
        Whether texels that only touch at a corner count.

    Returns
    -------
    (n, n_bytes) uint8
    """
    beside = _beside(resolution)
    rows = _to_rows(bits, resolution)
    n, word = len(bits), rows.dtype.type
    # What lies beyond the four edges of each face, one bit for each texel of the edge.
    outside = (bits.take(beside >> 3, axis=1) >> (beside & 7).astype(np.uint8)) & 1
    outside = outside.reshape(n, 4, 6, resolution)
    wide = _widen(rows)
    # The last texel of a row may lie inside its last word.
    last = word((resolution - 1) % (8 * rows.itemsize))
    wide[..., 0] |= outside[:, 2]
    wide[..., -1] |= outside[:, 3].astype(rows.dtype) << last
    # Above and below a texel at the edge of its row: the texels beyond the face's side edges.
    result = wide.copy() if corners else wide
    upright = wide if corners else rows
    result[:, :, 1:] |= upright[:, :, :-1]
    result[:, :, :-1] |= upright[:, :, 1:]
    ends = np.packbits(outside[:, :2], axis=-1, bitorder="little").view(rows.dtype)
    ends = ends.reshape(n, 2, 6, 1, -1)
    if corners:
        ends = _widen(ends)
    result[:, :, :1] |= ends[:, 0]
    result[:, :, -1:] |= ends[:, 1]
    return _from_rows(result, resolution, bits.shape[1])


@lru_cache(maxsize=8)
def chequer(resolution):
    """Every other texel of each face, as on a chequerboard: (n_bytes,) uint8."""
    face, row, column = np.indices((6, resolution, resolution))
    return np.packbits(((row + column) % 2 == 0).ravel(), bitorder="little")


def _widen(rows):
    """Rows of bits, each with its left and right neighbours set as well."""
    one = rows.dtype.type(1)
    wide = rows << one
    wide |= rows >> one
    wide |= rows
    if rows.shape[-1] > 1:
        # Along all bytes at once: a loop over the few of each row would take most of the time.
        flat, wide = rows.reshape(len(rows), -1), wide.reshape(len(rows), -1)
        inside = np.full(flat.shape[1] - 1, 1, np.uint8)
        inside[rows.shape[-1] - 1 :: rows.shape[-1]] = 0
        wide[:, 1:] |= (flat[:, :-1] >> 7) & inside
        wide[:, :-1] |= (flat[:, 1:] & inside) << 7
        wide = wide.reshape(rows.shape)
    return wide


# Rows of texels that are one word of the machine.
_WORDS = {8: "u1", 16: "<u2", 32: "<u4", 64: "<u8"}


def _to_rows(bits, resolution):
    """(n, 6, resolution, words of a row): every row of texels begins a word."""
    shape = (len(bits), 6, resolution, -1)
    if resolution in _WORDS:
        return np.ascontiguousarray(bits).view(_WORDS[resolution]).reshape(shape)
    spread = np.unpackbits(bits, axis=1, count=6 * resolution**2, bitorder="little")
    return np.packbits(spread.reshape(shape), axis=-1, bitorder="little")


def _from_rows(rows, resolution, n_bytes):
    if resolution in _WORDS:
        return rows.reshape(len(rows), -1).view(np.uint8)
    spread = np.unpackbits(rows, axis=-1, count=resolution, bitorder="little")
    return np.packbits(spread.reshape(len(rows), -1), axis=1, bitorder="little")


@lru_cache(maxsize=8)
def _beside(resolution):
    """(4 x 6 x resolution,) int: the texels beyond the upper, lower, left and right edges."""
    step = 2 / resolution
    along = (np.arange(resolution) + 0.5) * step - 1
    beyond = np.full(resolution, 1 + step / 2)
    cube_map = CubeMap(resolution)
    edges = []
    for u, v in ((along, -beyond), (along, beyond), (-beyond, along), (beyond, along)):
        edges.append(cube_map.texel_of(cube_map.on_faces(u, v)))
    return np.concatenate(edges).astype(np.int64)
