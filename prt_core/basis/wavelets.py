"""Two-dimensional wavelet transforms of images, step by step, with PyWavelets' filters.

Haar and Daubechies 4, 6, 8 are orthonormal, with periodic borders; LeGall 5/3 and CDF 9/7 are
biorthogonal and symmetric, with mirrored borders, as in JPEG 2000. Each step is products with
small matrices, so that stacks of images are transformed at the speed of BLAS.
"""

from functools import lru_cache

import numpy as np

from prt_core.basis.haar import expect_rows, haar_levels, haar_rows
from prt_core.errors import (
    PRTError,
    expect,
    expect_flag,
    expect_numbers,
    expect_one_of,
    expect_pair,
    expect_whole,
    shown,
)

# Our name: PyWavelets' name.
WAVELETS = {
    "haar": "haar",
    "d4": "db2",
    "d6": "db3",
    "d8": "db4",
    "5/3": "bior2.2",
    "9/7": "bior4.4",
}
ORTHONORMAL = ("haar", "d4", "d6", "d8")
# Results that are made from the samples around them by one product.
_TOGETHER = 32
_MOST_SIDE = 1 << 24


class ImageWavelet:
    """The transform of images whose pixels are a vector in reading order.

    After `d` steps the scaling coefficients are in the corner of `height / 2^d` x `width / 2^d`.

    Parameters
    ----------
    shape : (int, int)
        Height and width.
    wavelet : str
        See `WAVELETS`.

    Attributes
    ----------
    n : int
        Pixels.
    depth : int
        Steps that the size allows.
    orthonormal : bool
    name : str
        What it is called in settings: `wavelet`.
    """

    # There is no other transform on the same order, as points have.
    haar = None

    def __init__(self, shape, wavelet="haar"):
        self.shape = expect_pair("shape", shape, 1, _MOST_SIDE)
        self.wavelet = self.name = expect_one_of("wavelet", wavelet, WAVELETS)
        step_matrices(2, wavelet)
        self.orthonormal = wavelet in ORTHONORMAL
        self.n = self.shape[0] * self.shape[1]
        self.depth = min(haar_levels(size) for size in self.shape)

    def forward_step(self, vectors, level):
        """One step down, in place: (m, n) vectors after `level` steps to `level` + 1."""
        return self._step(vectors, level, 0)

    def inverse_step(self, vectors, level):
        """Undo `forward_step(vectors, level)`, in place."""
        return self._step(vectors, level, 1)

    def forward(self, vectors, depth=None):
        """Copy of (..., n) vectors after `depth` steps; default: all."""
        return all_steps(self, vectors, depth, False)

    def inverse(self, vectors, depth=None):
        """Undo `forward`."""
        return all_steps(self, vectors, depth, True)

    def head(self, vectors, depth):
        """The part of (m, n) vectors that step `depth` changes: (m, height, width), no copy."""
        height, width = (size >> depth for size in self.shape)
        return vectors.reshape(-1, *self.shape)[:, :height, :width]

    def weights(self, depth):
        """(n,) float32: energy of what a coefficient of one after `depth` steps stands for."""
        result = np.ones(self.shape, np.float32)
        if self.orthonormal:
            return result.ravel()
        for level in range(depth):
            height, width = (size >> level for size in self.shape)
            scaling, detail = _energies(self.wavelet, level + 1)
            result[:height, width // 2 : width] = result[height // 2 : height, :width] = (
                scaling * detail
            )
            result[height // 2 : height, width // 2 : width] = detail**2
            result[: height // 2, : width // 2] = scaling**2
        return result.ravel()

    def scales(self, depth):
        """(n,) int: 0 for scaling coefficients after `depth` steps, 1 for the details beside
        them, one more for each finer level."""
        result = np.zeros(self.shape, int)
        for level in range(depth):
            height, width = (size >> level for size in self.shape)
            band = np.ones((height, width), bool)
            band[: height // 2, : width // 2] = False
            result[:height, :width][band] = depth - level
        return result.ravel()

    def _step(self, vectors, level, inverse):
        images = self.head(vectors, level)
        height, width = images.shape[1:]
        down, across = (_bands(n, self.wavelet, inverse, vectors.dtype) for n in (height, width))
        flat, turned = images.reshape(-1, width), np.empty_like(images)
        out = turned.reshape(-1, width)
        for rows, samples, matrix in across:
            out[:, rows] = flat[:, samples] @ matrix.T
        for rows, samples, matrix in down:
            np.matmul(matrix, turned[:, samples], out=images[:, rows])
        return vectors


def wavelet_rows(rows, resolution, wavelet, inverse=False):
    """All steps of a wavelet on the faces of a cube map.

    Parameters
    ----------
    rows : (..., 6 resolution^2) float
    resolution : int
    wavelet : str
        An orthonormal one, so that products of rows and lights stay what they are.
    inverse : bool

    Returns
    -------
    (..., 6 resolution^2) float
    """
    rows = expect_rows(rows, resolution)
    expect_flag("inverse", inverse)
    expect(
        isinstance(wavelet, str) and wavelet in ORTHONORMAL,
        f"wavelet: expected one of {', '.join(ORTHONORMAL)} for rows, got {wavelet!r}",
    )
    if wavelet == "haar":
        return haar_rows(rows, resolution, inverse)
    faces = ImageWavelet((resolution, resolution), wavelet)
    flat = np.ascontiguousarray(rows).reshape(-1, resolution * resolution)
    return (faces.inverse if inverse else faces.forward)(flat).reshape(rows.shape)


@lru_cache(maxsize=256)
def step_matrices(n, wavelet):
    """One step on n samples, and its inverse: two (n, n) float64 matrices.

    The first half of the result are scaling coefficients, the second details.
    """
    expect_one_of("wavelet", wavelet, WAVELETS)
    pywt = _pywavelets(wavelet)
    filters = pywt.Wavelet(WAVELETS[wavelet])
    if wavelet in ORTHONORMAL:
        low, high = (_periodic(np.array(f), n) for f in (filters.dec_lo, filters.dec_hi))
        forward = np.concatenate([low, high])
        return forward, forward.T.copy()
    low, high = (np.trim_zeros(np.array(f)) for f in (filters.dec_lo, filters.dec_hi))
    forward = np.concatenate([_mirrored(low, n, 0), _mirrored(high, n, 1)])
    inverse = np.linalg.inv(forward)
    # Rounding errors that fade along the rows to 1e-324: products with such are a hundred times
    # slower than others.
    inverse[np.abs(inverse) < 1e-14] = 0
    return forward, inverse


@lru_cache(maxsize=256)
def _bands(n, wavelet, inverse, kind):
    """A step matrix in bands: (slice of results, samples they are made from, matrix)."""
    whole = step_matrices(n, wavelet)[inverse].astype(kind)
    bands = []
    for first in range(0, n, _TOGETHER):
        rows = slice(first, first + _TOGETHER)
        used = np.flatnonzero(whole[rows].any(axis=0))
        samples = used
        if used[-1] - used[0] == len(used) - 1:
            samples = slice(int(used[0]), int(used[-1]) + 1)
        bands.append((rows, samples, np.ascontiguousarray(whole[rows, samples])))
    return bands


@lru_cache(maxsize=64)
def _energies(wavelet, steps):
    """Of the signals that a scaling and a detail coefficient of step `steps` stand for."""
    # From the fourth step on they are the same but for their width.
    steps = min(steps, 4)
    n = 32 << steps
    pair = np.zeros((2, n))
    pair[0, 16], pair[1, 48] = 1, 1
    for level in reversed(range(steps)):
        size = n >> level
        pair[:, :size] = pair[:, :size] @ step_matrices(size, wavelet)[1].T
    return tuple((pair**2).sum(axis=1))


def _periodic(taps, n):
    result = np.zeros((n // 2, n))
    for k in range(n // 2):
        np.add.at(result[k], (2 * k + 1 - np.arange(len(taps)) + len(taps) // 2 - 1) % n, taps)
    return result


def _mirrored(taps, n, first):
    """Odd symmetric taps centred on every second sample; samples mirrored about the ends."""
    result = np.zeros((n // 2, n))
    reach = np.arange(len(taps)) - len(taps) // 2
    for k in range(n // 2):
        place = np.abs(2 * k + first + reach) % max(2 * n - 2, 1)
        np.add.at(result[k], np.where(place < n, place, 2 * n - 2 - place), taps)
    return result


def all_steps(transform, vectors, depth, inverse):
    """Copy of (..., n) vectors after so many steps of a transform (None: all), or back."""
    most = transform.depth
    depth = most if depth is None else expect_whole("depth", depth, 0, most)
    result = np.array(expect_array_of(vectors, transform.n))
    flat = result.reshape(-1, transform.n)
    for level in reversed(range(depth)) if inverse else range(depth):
        (transform.inverse_step if inverse else transform.forward_step)(flat, level)
    return result


def expect_array_of(vectors, n):
    """(..., n) floats."""
    vectors = expect_numbers("vectors", vectors)
    expect(
        vectors.ndim and vectors.shape[-1] == n and vectors.dtype.kind == "f",
        f"vectors: expected (..., {n}) floats, got {shown(vectors)}",
    )
    return vectors


def _pywavelets(wavelet):
    # The add-on does without it: a hierarchy of points needs no filters.
    try:
        import pywt
    except ImportError as error:
        raise PRTError(
            f"wavelet: '{wavelet}' needs PyWavelets; run 'pip install PyWavelets'"
        ) from error
    return pywt
