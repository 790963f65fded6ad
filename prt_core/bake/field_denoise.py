"""Which parts of a light field are taken denoised: those whose energy it keeps.

A denoiser takes a highlight narrower than its cells for noise. So of each light and object the sum
of the denoised field is compared with that of the noisy one, which is right in the mean; where
they differ the noisy one stays.
"""

import numpy as np

from prt_core.runtime.progress import Progress

# The two fields while both are there.
NOISY, DENOISED, RADIANCE = "noisy", "denoised", "radiance"
# How far the sum of a denoised field may be from that of the noisy one.
_ENERGY = 0.01
# Pixels that are denoised at once: about a second.
_PIXELS = 1 << 18


def denoise_steps(camera, radiance, points, samples, progress):
    """Radiance without its noise, a light and some points at a time.

    A generator of `Progress`: the denoiser works in the main thread.

    Parameters
    ----------
    camera : object
        Its `denoise` does it.
    radiance : (n_lights, n, rows, columns, 3) float32
    points : FieldPoints
    samples : int
    progress : Progress
        Of the work that this is a part of.

    Returns
    -------
    (n_lights, n, rows, columns, 3) float32
    """
    clean = np.empty_like(radiance)
    count = max(1, _PIXELS // (radiance.shape[2] * radiance.shape[3]))
    for light in range(len(radiance)):
        for first in range(0, len(points), count):
            some = slice(first, first + count)
            noisy = radiance[light : light + 1, some]
            clean[light, some] = camera.denoise(noisy, points[some], samples)[0]
            yield progress
    return clean


def keep_denoised(store, lights, objects, messages):
    """Make the field of a store from its noisy and its denoised one; a generator of `Progress`.

    Parameters
    ----------
    store : BakeStore
    lights : sequence of str
    objects : list of (str, (n,) int)
        Names, and the points of each.
    messages : list of str
        Told what is kept noisy.

    Returns
    -------
    float
        The share of lights and points whose denoised field was taken.
    """
    noisy, smooth = store.array(NOISY), store.array(DENOISED)
    sums = np.zeros((2, *noisy.shape[:2]))
    for turn, field in enumerate((noisy, smooth)):
        for block, values in by_blocks(field):
            sums[turn, :, block] = values.sum(axis=(2, 3, 4), dtype=np.float64)
            yield Progress("denoise", block.stop, noisy.shape[1])
    taken = np.zeros(noisy.shape[:2], bool)
    for name, points in objects:
        before, after = sums[:, :, points].sum(axis=2)
        for number, light in enumerate(lights):
            ratio = after[number] / before[number] if before[number] else 1.0
            taken[number, points] = abs(ratio - 1) <= _ENERGY
            if abs(ratio - 1) > _ENERGY:
                messages.append(
                    f"{name}: denoising changes the light of '{light}' by {ratio - 1:+.1%}; it is "
                    "kept as it was rendered"
                )
    radiance = store.create(RADIANCE, noisy.shape, "float32", noisy.chunks)
    for block, values in by_blocks(smooth):
        chosen = taken[:, block, None, None, None]
        radiance[:, block] = np.where(chosen, values, noisy[:, block])
        yield Progress("denoise", block.stop, noisy.shape[1])
    store.remove(NOISY)
    store.remove(DENOISED)
    return float(taken.mean())


def by_blocks(array):
    """(slice of points, values) of a field (n_lights, n_points, rows, columns, 3) on disk."""
    size, n_points = array.chunks[1], array.shape[1]
    for first in range(0, n_points, size):
        block = slice(first, min(first + size, n_points))
        yield block, array[:, block]
