"""Refinement in a thread, for a window: the same meshes, rays where they may be cast, and stops."""

import threading

import numpy as np
import pytest

from prt_core import Lamp, run
from prt_core.bake.refine import refine_meshes_steps
from prt_core.rays import BruteForceCaster
from prt_core.rays import caster as casters
from prt_core.sampling import RefineSettings, edge_errors
from prt_core.transport import place_light
from tests.meshes import plane, wall

SETTINGS = RefineSettings(tolerance=0.01, vertices="1.5x")
SUN = Lamp("sun", [3.0] * 3, axes=[[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]], name="sun")


@pytest.fixture(autouse=True)
def few_rays(monkeypatch):
    monkeypatch.setattr(edge_errors, "_LEAST", 100)
    monkeypatch.setattr(place_light, "SKY", 2)


@pytest.fixture
def alone(monkeypatch):
    """The name of a caster that one thread alone may call; notes whether it was closed."""

    class Alone(BruteForceCaster):
        threads, made = 1, []

        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.owner, self.is_closed = threading.get_ident(), False
            Alone.made.append(self)

        def occluded(self, *arguments):
            assert threading.get_ident() == self.owner
            return super().occluded(*arguments)

        def close(self):
            self.is_closed = True

    monkeypatch.setitem(casters._FACTORIES, "alone", Alone)
    return Alone


def steps(pace):
    meshes = [plane(5), wall(0.63, 0.8, 0.41, 3)]
    return refine_meshes_steps(meshes, [SUN], None, SETTINGS, "alone", pace)


def test_meshes_are_the_same(alone):
    (one, _), told = run(steps(None))
    (two, _), same = run(steps(0.01))
    assert told == same and told.added > 0
    np.testing.assert_array_equal(one.vertices, two.vertices)
    assert len(alone.made) == 4 and all(each.is_closed for each in alone.made)


def test_a_stop_leaves_nothing_open(alone):
    work = steps(0.01)
    for _ in range(3):
        next(work)
    work.close()
    assert all(each.is_closed for each in alone.made)
    assert not [t for t in threading.enumerate() if t.name.startswith("ThreadPoolExecutor")]
