"""Rows as wavelets over directions, of luminance and differences instead of outputs."""

import numpy as np

from prt_core.basis import haar_rows, wavelet_rows
from prt_core.compress.wavelets.haar_lighting import OPPONENTS


def mixed_wavelets(rows, wavelet):
    """How rows become wavelets of mixed outputs: of three, luminance and two differences.

    Returns
    -------
    mixed : (k, n_outputs) float32
        Orthonormal; mixtures that no row has are left out.
    encode : callable
        (n,) int points to (n, k n_directions) float32.
    """
    code = rows.code
    every = OPPONENTS if rows.n_outputs == 3 else np.eye(rows.n_outputs)
    shares = every @ np.array([group.shares for group in code.groups]).T
    shares[np.abs(shares) < 1e-9] = 0
    used = shares.any(axis=1)
    mixed, shares = every[used].astype(np.float32), shares[used].astype(np.float32)

    def convert(coded):
        plain = coded if code.scale is None else coded / code.scale
        if wavelet == "haar":
            return plain
        return wavelet_rows(
            haar_rows(plain, rows.resolution, inverse=True), rows.resolution, wavelet
        )

    bases = [None if group.basis is None else convert(group.basis) for group in code.groups]

    def encode(points):
        features = rows.features(points)
        # The background of a picture is often most of it.
        lit = features.any(axis=1)
        mixed_block = np.zeros((np.count_nonzero(lit), len(mixed), rows.n_directions), np.float32)
        features = features if lit.all() else features[lit]
        for part, basis, share in zip(code.slices, bases, shares.T, strict=True):
            coded = convert(features[:, part]) if basis is None else features[:, part] @ basis
            for mixture in np.flatnonzero(share):
                mixed_block[:, mixture] += share[mixture] * coded
        if lit.all():
            return mixed_block.reshape(len(points), -1)
        result = np.zeros((len(points), *mixed_block.shape[1:]), np.float32)
        result[lit] = mixed_block
        return result.reshape(len(points), -1)

    return mixed, encode
