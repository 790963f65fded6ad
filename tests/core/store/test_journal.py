import sys
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.store import BakeStore, JournalMismatch, RayJournal
from tests.core.store.conftest import Cut
from tests.meshes import plane, sphere

_CHUNK = 4096
METHOD = BakeSettings(resolution=6, tolerance=0.05, bounces=0, method="agreement")


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.store.journal"], "CHUNK", _CHUNK)


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(8, 0.5, (0, 0, 0.6), name="ball"), plane(13)])


class Counting:
    """Blocked where the ray's direction has an even last digit; counts what it is asked."""

    name, batch, threads = "counting", 100, 1

    def __init__(self):
        self.rays = 0

    def occluded(self, origins, directions):
        self.rays += len(origins)
        return np.rint(directions[:, 0] * 100) % 2 == 0


def rays(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.random((n, 3)).astype(np.float32), rng.random((n, 3)).astype(np.float32)


def asked(journal, origins, directions, size):
    parts = [slice(first, first + size) for first in range(0, len(origins), size)]
    return np.concatenate([journal.occluded(origins[p], directions[p]) for p in parts])


def test_answers_are_given_again_however_the_rays_are_cut(tmp_path):
    store = BakeStore(tmp_path / "a.prt", "a")
    origins, directions = rays(3 * _CHUNK + 164)
    first, second = Counting(), Counting()
    wanted = asked(RayJournal(first, store), origins, directions, 997)
    result = asked(RayJournal(second, store), origins, directions, 3331)
    np.testing.assert_array_equal(wanted, result)
    np.testing.assert_array_equal(wanted, Counting().occluded(origins, directions))
    # Whole chunks were written; the last, partly filled one is cast again.
    assert first.rays == 3 * _CHUNK + 164 and second.rays == 164


def test_other_rays_are_not_answered_from_the_journal(tmp_path):
    store = BakeStore(tmp_path / "a.prt", "a")
    asked(RayJournal(Counting(), store), *rays(_CHUNK + 600), 100)
    journal = RayJournal(Counting(), store)
    with pytest.raises(JournalMismatch):
        asked(journal, *rays(_CHUNK + 600, seed=1), 100)
    caster = Counting()
    asked(RayJournal(caster, store), *rays(_CHUNK + 600, seed=1), 100)
    assert caster.rays == _CHUNK + 600


def arrays(path):
    return {name: BakeStore(path).read(name) for name in ("visibility", "traced")}


COUNTED = replace(METHOD, caster="counted")


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.95])
@pytest.mark.parametrize("pace", [None, 1e-4])
def test_a_sampled_bake_that_broke_goes_on_to_the_same_bytes(scene, tmp_path, counted, share, pace):
    whole, resumed = tmp_path / "a.prt", tmp_path / "b.prt"
    run(bake_steps(scene, whole, COUNTED))
    counted.limit, counted.rays = share * counted.rays, 0
    with pytest.raises(Cut):
        run(bake_steps(scene, resumed, COUNTED, pace=pace))
    with pytest.raises(PRTError, match="not finished"):
        load(resumed)
    counted.limit = np.inf
    run(bake_steps(scene, resumed, COUNTED, pace=pace))
    for name, array in arrays(whole).items():
        np.testing.assert_array_equal(array, arrays(resumed)[name], err_msg=name)
    reports = [load(path).report for path in (whole, resumed)]
    for key in ("certificate", "rays", "entries_percent", "visibility_error"):
        assert reports[0][key] == reports[1][key], key
    assert "ray_journal" not in BakeStore(resumed)


def test_a_broken_bake_casts_no_ray_twice(scene, tmp_path, counted):
    run(bake_steps(scene, tmp_path / "a.prt", COUNTED))
    whole, counted.limit, counted.rays = counted.rays, counted.rays / 2, 0
    with pytest.raises(Cut):
        run(bake_steps(scene, tmp_path / "b.prt", COUNTED))
    counted.limit = np.inf
    run(bake_steps(scene, tmp_path / "b.prt", COUNTED))
    assert whole <= counted.rays <= whole + _CHUNK
