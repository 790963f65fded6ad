"""Wrong calls of `prt_core.basis` and `prt_core.reconstruct`."""

import numpy as np
import pytest

from prt_core import basis, reconstruct, sphere

from .calls import RNG, Call, any_of, directions, faults_of, plain

CALLS = {
    "haar_forward": plain(basis.haar_forward, any_of("faces"), faces=np.ones((3, 4, 4)), levels=1),
    "haar_inverse": plain(
        basis.haar_inverse, any_of("coefficients"), coefficients=np.ones((3, 4, 4)), levels=1
    ),
    "haar_texels": plain(basis.haar_texels, texels=np.array([0, 23]), resolution=2),
    "haar_rows": plain(
        basis.haar_rows, any_of("rows"), rows=np.ones((5, 24)), resolution=2, inverse=True
    ),
    "haar_areas": plain(basis.haar_areas, resolution=4),
    "haar_levels": plain(basis.haar_levels, size=4),
    "harmonics": plain(
        basis.harmonics, ("directions another axis",), directions=directions(), order=3
    ),
    "texel_harmonics": plain(
        basis.texel_harmonics, resolution=2, order=2, faces=sphere.FACES, n_nodes=2
    ),
    "rotation_of_harmonics": plain(basis.rotation_of_harmonics, matrix=np.eye(3), order=2),
    "ImageWavelet": lambda t: Call(
        lambda shape, wavelet, vectors, depth: basis.ImageWavelet(shape, wavelet).forward(
            vectors, depth
        ),
        {"shape": (4, 8), "wavelet": "d4", "vectors": np.ones((3, 32)), "depth": 1},
        ("depth None", *any_of("vectors")),
    ),
    "wavelet_rows": plain(
        basis.wavelet_rows,
        any_of("rows"),
        rows=np.ones((5, 24)),
        resolution=2,
        wavelet="haar",
        inverse=True,
    ),
    "PointHaar": lambda t: Call(
        lambda positions, normals, groups, vectors: basis.PointHaar(
            positions, normals, groups
        ).forward(vectors),
        {
            "positions": RNG.random((7, 3)),
            "normals": directions(7),
            "groups": np.arange(7) % 2,
            "vectors": RNG.random((2, 7)),
        },
        ("normals None", "groups None", "positions 3e38", *any_of("vectors")),
    ),  # fmt: skip
    "PointHaar.from_order": plain(basis.PointHaar.from_order, order=np.array([2, 0, 1])),
    "PointMultiwavelet": lambda t: Call(
        lambda positions, normals, groups, vectors: basis.PointMultiwavelet(
            positions, normals, groups
        ).forward(vectors),
        {
            "positions": RNG.random((7, 3)),
            "normals": directions(7),
            "groups": np.arange(7) % 2,
            "vectors": RNG.random((2, 7)),
        },
        ("normals None", "groups None", "positions 3e38", *any_of("vectors")),
    ),  # fmt: skip
    "gram": plain(reconstruct.gram, columns=RNG.random((2, 3, 5)), targets=RNG.random((2, 5))),
    "least_squares": plain(
        reconstruct.least_squares,
        ("grams negative",),
        grams=np.stack([np.eye(3)] * 2),
        moments=np.ones((2, 3)),
    ),
    "l1_batched": plain(
        reconstruct.l1_batched,
        ("start",),
        grams=np.stack([np.eye(3)] * 2),
        moments=np.ones((2, 3)),
        squares=np.full(2, 5.0),
        strengths=np.full(2, 0.1),
        start=np.zeros((2, 3)),
        most_iterations=20,
    ),
    "l1_certificate": plain(
        reconstruct.l1_certificate,
        grams=np.stack([np.eye(3)] * 2),
        moments=np.ones((2, 3)),
        squares=np.full(2, 5.0),
        strengths=np.full(2, 0.1),
        weights=np.zeros((2, 3)),
    ),
    "l1_interior_point": plain(
        reconstruct.l1_interior_point,
        columns=RNG.random((3, 5)),
        target=RNG.random(5),
        strength=0.1,
        tolerance=1e-6,
        most_iterations=20,
        solver="cholesky",
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
