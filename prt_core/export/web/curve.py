"""Points along a curve that fills space: neighbours along it are neighbours in the scene.

Hilbert's curve, by its transposed index (Skilling 2004): what differs little between neighbours,
as visibility does, then lies in long runs, which deflate well.
"""

import numpy as np

_BITS = 16


def hilbert_index(positions):
    """Where points lie along Hilbert's curve through their box.

    Parameters
    ----------
    positions : (n, 3) float

    Returns
    -------
    (n,) uint64
    """
    low = positions.min(axis=0)
    size = max(float(np.ptp(positions, axis=0).max()), 1e-300)
    cells = (positions - low) / size * ((1 << _BITS) - 1)
    axes = [np.clip(column, 0, (1 << _BITS) - 1).astype(np.int64) for column in cells.T]
    # From the coarsest bit on: undo the turn of the cube that each point lies in.
    bit = 1 << (_BITS - 1)
    while bit > 1:
        for axis in range(3):
            flips = (axes[axis] & bit) != 0
            swapped = np.where(flips, 0, (axes[0] ^ axes[axis]) & (bit - 1))
            axes[0] = np.where(flips, axes[0] ^ (bit - 1), axes[0] ^ swapped)
            axes[axis] = axes[axis] ^ swapped if axis else axes[0]
        bit >>= 1
    for axis in (1, 2):
        axes[axis] = axes[axis] ^ axes[axis - 1]
    # Gray code to number.
    turned, bit = np.zeros_like(axes[0]), 1 << (_BITS - 1)
    while bit > 1:
        turned = np.where((axes[2] & bit) != 0, turned ^ (bit - 1), turned)
        bit >>= 1
    axes = [axis ^ turned for axis in axes]
    index = np.zeros(len(positions), np.uint64)
    for place in reversed(range(_BITS)):
        for axis in axes:
            index = (index << np.uint64(1)) | ((axis >> place) & 1).astype(np.uint64)
    return index
