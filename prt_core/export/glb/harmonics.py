"""Nine spherical harmonics a vertex: a game's low road (Sloan et al. 2002).

A vertex has what it shows under a light that is one harmonic, in all channels; its colour is the
sum of these times the light's coefficients. Directions are glTF's, y up, so that an engine
projects its own environment as it is.
"""

import numpy as np

from prt_core.basis import harmonics, rotation_of_harmonics, texel_harmonics
from prt_core.export.glb.placement import TO_GLTF
from prt_core.runtime.progress import Progress
from prt_core.sphere import FACES

ORDER = 3
NAMES = tuple(f"_PRT_SH{i}" for i in range(ORDER**2))


def coefficients_steps(transport, of_light):
    """What points show under each harmonic; a generator of `Progress`.

    Parameters
    ----------
    transport : Transport
    of_light : bool
        Whether it is what they receive, without their own colours.

    Returns
    -------
    (order^2, n_points, 3) float32
    """
    cube = transport.cube_map
    integrals = texel_harmonics(cube.resolution, ORDER, FACES)
    means = (integrals / cube.solid_angles[:, None]).astype(np.float32)
    shown = np.empty((ORDER**2, transport.n_points, 3), np.float32)
    for number, light in enumerate(means.T):
        yield Progress("harmonics", number, ORDER**2)
        received = _product(transport, light)
        shown[number] = received if of_light else transport.exit_radiance(received).toward()
    # A light of glTF's is one of Blender's, turned.
    return np.einsum("ij,jpc->ipc", _turn(), shown, optimize=True).astype(np.float32)


def _product(transport, light):
    """What points receive of light (n_directions,) that is negative in places, as no real one."""
    parts = (np.maximum(sign * light, 0)[:, None].repeat(3, axis=1) for sign in (1, -1))
    positive, negative = (transport.product(part) for part in parts)
    return positive - negative


def light_coefficients(light, cube_map):
    """(order^2, 3) float64: coefficients of light on texels, in glTF's axes."""
    integrals = texel_harmonics(cube_map.resolution, ORDER, FACES)
    return _turn() @ (integrals.T @ light.astype(np.float64))


def basis_formula():
    """How an engine evaluates the nine functions, for the file's own description (list of str)."""
    degree_2 = np.sqrt(15 / np.pi) / 2
    centre = harmonics([[0.0, 0, 1]], ORDER)[0]
    return [
        f"{centre[0]:.9f}",
        *(f"{centre[2]:.9f} * {axis}" for axis in "yzx"),
        f"{degree_2:.9f} * x * y",
        f"{degree_2:.9f} * y * z",
        f"{centre[6] / 2:.9f} * (3 * z * z - 1)",
        f"{degree_2:.9f} * x * z",
        f"{degree_2 / 2:.9f} * (x * x - y * y)",
    ]


def _turn():
    """(order^2, order^2) float64: coefficients in glTF's axes of those in Blender's."""
    return rotation_of_harmonics(TO_GLTF, ORDER)
