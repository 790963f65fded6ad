"""Embree against the brute-force oracle, and the table of back-ends."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.rays import make_caster


@pytest.fixture(scope="module")
def soup():
    rng = np.random.default_rng(5)
    vertices = rng.random((303, 3)).astype(np.float32)
    triangles = np.arange(303, dtype=np.int32).reshape(-1, 3)
    origins = rng.random((5003, 3)).astype(np.float32)
    directions = rng.normal(size=(5003, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distances = rng.random(5003).astype(np.float32)
    return vertices, triangles, origins, directions.astype(np.float32), distances


def test_embree_equals_brute_force(soup):
    pytest.importorskip("embreex")
    vertices, triangles, origins, directions, distances = soup
    brute, embree = (make_caster(n, vertices, triangles) for n in ("brute", "embree"))
    expected, found = brute.intersect(origins, directions), embree.intersect(origins, directions)
    assert 0.2 < (expected.triangle >= 0).mean() < 0.9
    np.testing.assert_array_equal(found.triangle, expected.triangle)
    np.testing.assert_allclose(found.barycentric, expected.barycentric, atol=1e-5)
    np.testing.assert_allclose(found.distance, expected.distance, rtol=1e-4)
    for limit in (None, distances):
        np.testing.assert_array_equal(
            embree.occluded(origins, directions, limit), brute.occluded(origins, directions, limit)
        )


def test_unknown_back_end_is_named():
    with pytest.raises(PRTError, match="caster: 'optix' is not available here"):
        make_caster("optix", np.zeros((3, 3)), np.zeros((1, 3), int))


def test_rays_with_nan_are_refused(soup):
    vertices, triangles, origins, directions, _ = soup
    broken = directions.copy()
    broken[3, 1] = np.nan
    with pytest.raises(PRTError, match="directions: 1 values are NaN"):
        make_caster("brute", vertices, triangles).occluded(origins, broken)
