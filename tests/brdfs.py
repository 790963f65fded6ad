"""Plain reflectances for tests and benchmarks: two directions in, a share a steradian out."""

import numpy as np


def above(incoming, outgoing):
    """1 where both directions are above the horizon."""
    return ((incoming[..., 2] > 0) & (outgoing[..., 2] > 0)).astype(np.float64)


def phong(exponent):
    """The normalised lobe about the mirror direction, without a cosine."""

    def evaluate(incoming, outgoing):
        mirror = outgoing * [-1, -1, 1]
        cosine = np.maximum((incoming * mirror).sum(axis=-1), 0)
        lobe = (exponent + 2) / (2 * np.pi) * cosine**exponent
        return (lobe * above(incoming, outgoing))[..., None]

    return evaluate


def lambert(albedo=1.0):
    """The same to all sides."""

    def evaluate(incoming, outgoing):
        return (albedo / np.pi * above(incoming, outgoing))[..., None]

    return evaluate


def ggx(roughness, f0=0.9):
    """Height-correlated Smith GGX with Schlick's Fresnel; alpha is the square of the roughness."""
    a2 = roughness**4

    def evaluate(incoming, outgoing):
        half = incoming + outgoing
        half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
        ci, co = np.maximum(incoming[..., 2], 1e-6), np.maximum(outgoing[..., 2], 1e-6)
        d = a2 / (np.pi * (half[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
        g = 0.5 / (ci * np.sqrt(a2 + (1 - a2) * co**2) + co * np.sqrt(a2 + (1 - a2) * ci**2))
        f = f0 + (1 - f0) * (1 - np.clip((half * outgoing).sum(axis=-1), 0, 1)) ** 5
        return (d * g * f * above(incoming, outgoing))[..., None]

    return evaluate
