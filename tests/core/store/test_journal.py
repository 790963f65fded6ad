import sys

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.store import BakeStore, JournalMismatch, RayJournal
from tests.meshes import plane, sphere

_CHUNK = 4096
METHOD = BakeSettings(resolution=6, tolerance=0.05, bounces=0, method="agreement")


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.store.journal"], "CHUNK", _CHUNK)
    monkeypatch.setattr(sys.modules["prt_core.bake_visibility"], "BLOCK", 64)


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
    found = asked(RayJournal(second, store), origins, directions, 3331)
    np.testing.assert_array_equal(wanted, found)
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


@pytest.mark.parametrize("stop", [3, 17, 40, 70])
def test_a_sampled_bake_that_was_stopped_goes_on_to_the_same_bytes(scene, tmp_path, stop):
    whole, resumed = tmp_path / "a.prt", tmp_path / "b.prt"
    run(bake_steps(scene, whole, METHOD))
    steps = bake_steps(scene, resumed, METHOD, pace=1e-4)
    for _ in range(stop):
        next(steps)
    steps.close()
    with pytest.raises(PRTError, match="not finished"):
        load(resumed)
    run(bake_steps(scene, resumed, METHOD))
    for name, array in arrays(whole).items():
        np.testing.assert_array_equal(array, arrays(resumed)[name], err_msg=name)
    reports = [load(path).report for path in (whole, resumed)]
    for key in ("certificate", "rays", "entries_percent", "visibility_error"):
        assert reports[0][key] == reports[1][key], key
    assert "ray_journal" not in BakeStore(resumed)


def test_a_stopped_bake_casts_no_ray_twice(scene, tmp_path, monkeypatch):
    from prt_core.rays import caster as casters

    asked_rays = []
    make = casters._FACTORIES["brute" if "embree" not in casters._FACTORIES else "embree"]

    def counted(vertices, triangles):
        caster = make(vertices, triangles)
        cast = caster.occluded
        caster.occluded = lambda o, d, far=None: asked_rays.append(len(o)) or cast(o, d, far)
        return caster

    monkeypatch.setitem(casters._FACTORIES, "counted", counted)
    settings = BakeSettings(**{**METHOD.__dict__, "caster": "counted"})
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    whole = sum(asked_rays)
    asked_rays.clear()
    steps = bake_steps(scene, tmp_path / "b.prt", settings, pace=1e-4)
    while sum(asked_rays) < whole / 2:
        next(steps)
    steps.close()
    run(bake_steps(scene, tmp_path / "b.prt", settings))
    assert whole <= sum(asked_rays) <= whole + _CHUNK
