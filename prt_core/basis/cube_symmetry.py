"""The 48 turns and reflections of a cube, and what they do to texels and to their wavelets.

Each of them hands squares of texels to squares of texels, so a Haar wavelet becomes a Haar wavelet,
perhaps with the other sign. What is symmetric, a reflectance or the solid angles of texels, has to
be worked out for one direction of 48 alone.
"""

from itertools import permutations, product

import numpy as np

from prt_core.basis.haar import haar_rows
from prt_core.errors import expect_kind
from prt_core.sphere import CubeMap


def cube_symmetries():
    """(48, 3, 3) float64: matrices that hand a cube's faces to its faces; first the identity."""
    matrices = [
        np.diag(signs)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return np.array(matrices)


def turned_wavelets(cube_map):
    """Where each wavelet of a cube map goes, under each of `cube_symmetries`.

    Parameters
    ----------
    cube_map : CubeMap

    Returns
    -------
    places : (48, n_directions) int32
        Coefficient i of a function becomes coefficient `places[s, i]` of the function that
        symmetry s turned, f(matrix^T d),
    signs : (48, n_directions) int8
        times `signs[s, i]`.
    """
    expect_kind("cube_map", cube_map, CubeMap)
    n = cube_map.n_directions
    places, signs = np.empty((48, n), np.int32), np.empty((48, n), np.int8)
    # A function all of whose coefficients differ shows where each of them went.
    known = np.arange(1.0, n + 1)
    texels = haar_rows(known, cube_map.resolution, inverse=True)
    for index, matrix in enumerate(cube_symmetries()):
        turned = texels[cube_map.texel_of(cube_map.directions @ matrix)]
        moved = haar_rows(turned, cube_map.resolution)
        came_from = np.rint(np.abs(moved)).astype(np.int64) - 1
        places[index, came_from] = np.arange(n)
        signs[index, came_from] = np.sign(moved)
    return places, signs
