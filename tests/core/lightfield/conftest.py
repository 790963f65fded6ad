"""A small glossy field: a sphere under two lamps, by Phong's formula, so that it is exact."""

import numpy as np
import pytest

from prt_core.lightfield import HRDFLayout, frames_along

LAMPS = np.array([[0.6, -0.3, 0.8], [-0.7, 0.5, 0.4]])
COLOURS = np.array([[3.0, 2.6, 2.0], [0.7, 1.0, 2.2]])


def glossy_field(n_points=61, rows=8, columns=6, exponent=12.0):
    """Radiance (2, n_points, rows, columns, 3), frames, positions of points of a unit sphere."""
    turn = np.arange(n_points) * 2.39996
    z = 1 - 2 * (np.arange(n_points) + 0.5) / n_points
    flat = np.sqrt(1 - z**2)
    normals = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    frames = frames_along(normals, np.stack([-normals[:, 1], normals[:, 0], 0 * z], axis=1))
    out = np.einsum("dk,nkx->ndx", HRDFLayout(rows, columns).directions, frames)
    lights = []
    for place, colour in zip(LAMPS, COLOURS, strict=True):
        way = place / np.linalg.norm(place)
        facing = normals @ way
        mirrored = 2 * facing[:, None] * normals - way
        lobe = np.maximum(np.einsum("ndx,nx->nd", out, mirrored), 0) ** exponent
        seen = (np.maximum(facing, 0)[:, None] * 0.2 + lobe) * (facing[:, None] > 0)
        lights.append(seen[..., None] * colour)
    radiance = np.stack(lights).reshape(2, n_points, rows, columns, 3)
    return radiance.astype(np.float32), frames, normals


@pytest.fixture(scope="package")
def field():
    return glossy_field()
