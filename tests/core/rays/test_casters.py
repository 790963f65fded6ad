"""Embree against the brute-force oracle, and the table of back-ends."""

import threading

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.rays import RelayCaster, make_caster, relay
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import Progress, run


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
    expected, result = brute.intersect(origins, directions), embree.intersect(origins, directions)
    assert 0.2 < (expected.triangle >= 0).mean() < 0.9
    np.testing.assert_array_equal(result.triangle, expected.triangle)
    np.testing.assert_allclose(result.barycentric, expected.barycentric, atol=1e-5)
    np.testing.assert_allclose(result.distance, expected.distance, rtol=1e-4)
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


def test_relayed_rays_are_cast_in_the_serving_thread_a_part_at_a_time(soup, monkeypatch):
    vertices, triangles, origins, directions, distances = soup
    caster = make_caster("brute", vertices, triangles)
    wanted = caster.intersect(origins, directions), caster.occluded(origins, directions, distances)
    monkeypatch.setattr(relay, "_FEWEST", 700)
    calls, threads, sizes = MainThreadCalls(), set(), []

    class Watched:
        name, batch, threads = "watched", 1 << 20, 1

        def intersect(self, origins, directions):
            threads.add(threading.get_ident())
            sizes.append(len(origins))
            return caster.intersect(origins, directions)

        def occluded(self, origins, directions, distances=None):
            threads.add(threading.get_ident())
            return caster.occluded(origins, directions, distances)

    def work():
        yield Progress("rays", 0, 1)
        relayed = RelayCaster(Watched(), calls, 1e-4)
        return (
            relayed.intersect(origins, directions),
            relayed.occluded(origins, directions, distances),
            RelayCaster(Watched(), calls, 1).intersect(origins[:0], directions[:0]),
        )

    hits, blocked, none = run(steps_in_thread(work(), calls, "rays"))
    assert threads == {threading.get_ident()} and max(sizes) == 700 and sum(sizes) == len(origins)
    for name in ("triangle", "barycentric", "distance"):
        np.testing.assert_array_equal(getattr(hits, name), getattr(wanted[0], name))
    np.testing.assert_array_equal(blocked, wanted[1])
    assert len(none.triangle) == 0
