"""The choice among methods, on methods whose errors and sizes are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.bake.measure import met
from prt_core.compress import (
    PCA,
    ArrayRows,
    ClusteredPCA,
    Limits,
    Method,
    Task,
    method_named,
    register_method,
)
from prt_core.compress.choice import methods
from prt_core.compress.choice.choose import choose_steps
from prt_core.runtime.progress import run
from prt_core.transport import ExitRadiance

N_POINTS, N_DIRECTIONS = 9000, 6
LIGHTS = {"one": np.ones((N_DIRECTIONS, 3), np.float32), "two": np.eye(6, 3, dtype=np.float32)}


class FakeTask(Task):
    """As `Task`; colours are sums of random rows."""

    def __init__(self, points=None):
        self.points = np.arange(N_POINTS) if points is None else points
        self.seed = 0
        matrix = 1 + np.random.default_rng(0).random((N_POINTS, N_DIRECTIONS))
        self.matrix = matrix[self.points]
        self.transport = SimpleNamespace(
            radiance=lambda light: self.matrix @ light,
            exit_radiance=lambda received: ExitRadiance(received, np.ones((len(received), 1))),
            cube_map=SimpleNamespace(n_directions=N_DIRECTIONS),
        )
        self.rows = SimpleNamespace(prepare_steps=lambda: iter(()), n_points=len(self.points))

    def colours(self, lights):
        return {name: self.transport.radiance(light) for name, light in lights.items()}

    def some(self, points):
        return FakeTask(self.points[points])

    def sample(self, n_points, n_patches):
        return np.arange(0, self.n_points, -(-self.n_points // n_points))


class Known:
    """A form of a known relative error, so many bytes a point."""

    def __init__(self, error, size):
        self.error, self.size = error, size

    def get_params(self):
        return {"error": self.error}

    def fit_steps(self, rows):
        self.n_points_ = rows.n_points
        return self
        yield

    @property
    def nbytes(self):
        return self.size * self.n_points_


def evaluator(model, transport):
    return SimpleNamespace(product=lambda light: transport.radiance(light) * (1 + model.error))


@pytest.fixture
def known(monkeypatch):
    monkeypatch.setattr(methods, "_METHODS", {})

    def register(name, budgets):
        kind = Method(
            name, Known, lambda task: [Known(*budget) for budget in budgets], evaluator, local=False
        )
        register_method(kind)

    return register


BUDGETS = [(0.2, 10), (0.1, 20), (0.05, 30), (0.02, 40), (0.01, 50), (0.005, 60), (0.002, 70)]


def chosen(names, **limits):
    ranked, trials = run(choose_steps(FakeTask(), names, Limits(**limits), LIGHTS))
    return *ranked[0], trials


@pytest.mark.parametrize("tolerance, budget", [(0.3, 0), (0.13, 1), (0.03, 3), (0.0066, 5)])
def test_the_first_budget_that_is_near_enough_is_found_in_few_trials(known, tolerance, budget):
    # A fifth nearer than was asked for.
    known("many", BUDGETS)
    best, _, trials = chosen(["many"], tolerance=tolerance)
    assert best.budget == budget and best.error == pytest.approx(BUDGETS[budget][0], rel=1e-4)
    assert len(trials) <= 3 and [t.budget for t in trials] == sorted(t.budget for t in trials)
    # Of all points, not of those it was tried on.
    assert best.megabytes == pytest.approx(BUDGETS[budget][1] * N_POINTS / 1e6)


def test_the_smallest_of_those_that_are_near_enough_is_taken(known):
    known("large", BUDGETS)
    known("small", [(0.3, 12), (0.02, 31), (0.001, 300)])
    known("rough", [(0.4, 1), (0.2, 2)])
    best, why, _ = chosen(["large", "small", "rough"], tolerance=0.03)
    assert (best.method, best.budget) == ("small", 1) and "smallest" in why
    best, why, _ = chosen(["rough"], tolerance=0.03)
    assert best.budget == 1 and "nearest" in why


def test_within_a_size_the_least_error_is_taken(known):
    known("large", BUDGETS)
    known("small", [(0.3, 12), (0.03, 31), (0.001, 300)])
    best, why, _ = chosen(["large", "small"], megabytes=45 * N_POINTS / 1e6)
    assert (best.method, best.budget) == ("large", 3) and "least error" in why
    with pytest.raises(PRTError, match="0.045 cannot be kept; the least is 0.09 MB, by large"):
        chosen(["large", "small"], megabytes=5 * N_POINTS / 1e6)


def test_samples_are_patches_of_neighbours_or_spread_evenly():
    rng = np.random.default_rng(1)
    positions = rng.random((3000, 3)) * [1, 1, 0]
    normals, groups = np.tile([0.0, 0, 1], (3000, 1)), np.zeros(3000, int)
    task = Task(None, SimpleNamespace(n_points=3000), positions, normals, groups)
    patches, even = task.sample(600, 6), task.sample(600, None)
    assert len(np.unique(patches)) == len(patches) == 600 == len(np.unique(even))
    for points in (patches, even):
        assert (np.diff(points) > 0).all()

    def near(points):
        away = np.linalg.norm(positions[points][:, None] - positions[points], axis=2)
        return np.median(np.sort(away, axis=1)[:, 1])

    # In a patch neighbours are as near as in the whole.
    everywhere = np.median(0.5 / np.sqrt(3000))
    assert near(patches) < 1.5 * everywhere < 2 * everywhere < near(even)
    np.testing.assert_array_equal(task.sample(9999, 6), np.arange(3000))


@pytest.mark.parametrize(
    "error, worst, kept", [(0.01, 0.02, True), (0.0101, 0.02, False), (0.005, 0.0201, False)]
)
def test_a_tolerance_is_kept_in_the_mean_and_twice_of_it_in_the_worst_light(error, worst, kept):
    result = {"error": error, "worst": worst}
    assert met(Limits(tolerance=0.01), result) is kept
    assert met(Limits(megabytes=1), result) is None


@pytest.mark.parametrize("name", ["pca", "cpca"])
def test_sizes_for_all_points_are_told_from_some(name):
    rng = np.random.default_rng(2)
    few, many = (ArrayRows(rng.standard_normal((n, 24))) for n in (60, 600))
    if name == "pca":
        # One basis for all, weights for each.
        one, all_of_them = PCA(5).fit(few), PCA(5).fit(many)
    else:
        # A cluster for so many points each.
        one, all_of_them = ClusteredPCA(3, 4).fit(few), ClusteredPCA(30, 4).fit(many)
    printed = method_named(name).size(one, 600)
    assert printed == pytest.approx(all_of_them.nbytes, rel=0.06)
