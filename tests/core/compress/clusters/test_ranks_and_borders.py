"""How many components each cluster gets, and how its border points are mixed, by brute force."""

from itertools import product

import numpy as np
import pytest

from prt_core.compress import PCA, ArrayRows, ClusteredPCA, neighbour_pairs, seam
from prt_core.compress.clusters.affine import Affine
from prt_core.compress.clusters.clusters import ranks_within
from prt_core.compress.clusters.seams import border_points


def affine(n_points, energies, rest=0.0, n_features=7):
    energies = np.array(energies, np.float64)
    basis = np.eye(len(energies), n_features, dtype=np.float32)
    weights = np.zeros((n_points, len(energies)), np.float32)
    energy = float(energies.sum() + rest)
    return Affine(np.zeros(n_features, np.float32), basis, weights, energies, energy)


def cost(models, ranks):
    """Numbers that the components take: a row of the basis, and a weight for each point."""
    return sum(rank * (m.mean.size + len(m.weights)) for m, rank in zip(models, ranks, strict=True))


def left(models, ranks):
    return sum(m.energy - m.energies[:rank].sum() for m, rank in zip(models, ranks, strict=True))


def test_components_that_cost_little_are_taken_before_those_that_gain_most():
    models = [affine(1000, [4, 1]), affine(5, [3.5, 3, 2.5])]
    np.testing.assert_array_equal(ranks_within(models, 5.1), [0, 3])
    # Where all are as large the gain decides.
    models = [affine(10, [4, 1]), affine(10, [3.5, 3, 2.5])]
    np.testing.assert_array_equal(ranks_within(models, 5.1), [1, 2])
    # A row of the basis counts as well as the weights: of few points it is most of the cost.
    models = [affine(1, [2.0], n_features=100), affine(3, [2.1], n_features=100)]
    np.testing.assert_array_equal(ranks_within(models, 2.5), [0, 1])


@pytest.mark.parametrize("seed", range(5))
def test_nothing_cheaper_leaves_as_little(seed):
    rng = np.random.default_rng(seed)
    models = [
        affine(int(rng.integers(1, 90)), np.sort(rng.exponential(size=3))[::-1], rng.random())
        for _ in range(4)
    ]
    every = list(product(range(4), repeat=4))
    total, least = left(models, [0] * 4), left(models, [3] * 4)
    for allowed in np.linspace(least, 1.1 * total, 9):
        ranks = ranks_within(models, allowed)
        reached = left(models, ranks)
        assert reached <= allowed + 1e-12
        cheapest = min(cost(models, subset) for subset in every if left(models, subset) <= reached)
        assert cost(models, ranks) == cheapest
        # The last one was needed.
        if ranks.any():
            assert (
                reached
                + max(m.energies[rank - 1] for m, rank in zip(models, ranks, strict=True) if rank)
                > allowed
            )
    # All of them where even they leave more.
    np.testing.assert_array_equal(ranks_within(models, 0.5 * least), [3] * 4)


def test_the_tolerance_is_relative_to_all_of_the_rows():
    rng = np.random.default_rng(3)
    rows = 10 + rng.standard_normal((60, 24)) * 0.7 ** np.arange(24)
    model = PCA(24, tolerance=0.01).fit(rows)
    result = model.reconstruct(np.arange(60))[..., 0]
    error = np.linalg.norm(result - rows) / np.linalg.norm(rows)
    assert error == pytest.approx(model.matrix_error_, rel=1e-3)
    assert 0.007 < error <= 0.01


def test_guests_go_to_the_cluster_that_most_neighbours_are_in():
    labels = np.array([0, 0, 1, 1, 2, 2, 2, 0])
    pairs = np.array([[0, 2], [0, 4], [0, 5], [1, 3], [1, 4], [2, 3], [6, 7]])
    points, clusters = border_points(labels, pairs)
    wanted = {}
    for a, b in [*pairs, *pairs[:, ::-1]]:
        if labels[a] != labels[b]:
            wanted.setdefault(int(a), []).append(int(labels[b]))
    assert points.tolist() == sorted(wanted)
    for point, cluster in zip(points, clusters, strict=True):
        others = wanted[int(point)]
        # Among equals the smaller number.
        assert cluster == min(others, key=lambda c, others=others: (-others.count(c), c))
    assert clusters[0] == 2 and clusters[1] == 1


def test_shares_at_borders_tell_who_knows_a_point_better():
    # Three lines that cross: clusters about means cut across them, and many a point is nearer to
    # the line of the next cluster.
    rng = np.random.default_rng(5)
    lines = np.linalg.qr(rng.standard_normal((24, 3)))[0].T
    matrix = lines[np.arange(70) % 3] * rng.standard_normal((70, 1))
    matrix = (matrix + 0.2 * rng.standard_normal((70, 24))).astype(np.float32)
    rows = ArrayRows(matrix)
    model = ClusteredPCA(5, 1).fit(rows)
    pairs = np.column_stack([np.arange(69), np.arange(1, 70)])
    before = [(a.mean.astype(np.float64), a.basis.astype(np.float64)) for a in model.affine_]
    labels = model.labels_.copy()
    own = model.reconstruct(np.arange(70))[..., 0].astype(np.float64)
    model.blend_borders(rows, pairs)
    points, clusters = border_points(labels, pairs)
    shares = dict(zip(model.border_points_[:, 0].tolist(), model.shares_.tolist(), strict=True))
    assert sorted(shares) == points.tolist() and len(points) >= 8
    result = model.reconstruct(np.arange(70))[..., 0]
    wanted = own.copy()
    for point, cluster in zip(points, clusters, strict=True):
        mean, basis = before[cluster]
        row = matrix[point].astype(np.float64)
        other = mean + ((row - mean) @ basis.T) @ basis
        here, present = ((row - own[point]) ** 2).sum(), ((row - other) ** 2).sum()
        share = min(0.5, here / (here + present))
        assert shares[int(point)] == pytest.approx(share, abs=1e-4)
        wanted[point] = (1 - share) * own[point] + share * other
    np.testing.assert_allclose(result, wanted, atol=1e-3)
    assert min(shares.values()) < 0.3 and max(shares.values()) == 0.5


def test_neighbours_are_near_alike_and_of_one_object():
    rng = np.random.default_rng(2)
    positions, turn = rng.random((40, 3)), rng.uniform(-1.5, 1.5, 40)
    normals = np.column_stack([np.sin(turn), np.zeros(40), np.cos(turn)])
    groups = rng.integers(0, 2, 40)
    result = {tuple(pair) for pair in neighbour_pairs(positions, normals, groups, k=5).tolist()}
    wanted = set()
    for a in range(40):
        nearest = np.argsort(np.linalg.norm(positions - positions[a], axis=1))[1:6]
        for b in nearest:
            alike = np.degrees(np.arccos(np.clip(normals[a] @ normals[b], -1, 1))) < 60
            if alike and groups[a] == groups[b]:
                wanted.add((min(a, int(b)), max(a, int(b))))
    assert result == wanted and 20 < len(wanted)
    every = {tuple(pair) for pair in neighbour_pairs(positions, k=5).tolist()}
    assert wanted < every


def test_seams_are_jumps_of_the_error_relative_to_the_mean_of_the_truth():
    rng = np.random.default_rng(4)
    truth = 5 * rng.random((9, 3))
    colours = truth + 0.1 * rng.standard_normal((9, 3))
    pairs = np.array([[0, 3], [2, 7], [4, 8]])
    jumps = []
    for a, b in pairs:
        jumps.append(np.sqrt((((colours[a] - truth[a]) - (colours[b] - truth[b])) ** 2).sum()))
    size = np.mean([np.sqrt((row**2).sum()) for row in truth])
    result = seam(colours, truth, pairs)
    assert result["largest"] == pytest.approx(max(jumps) / size)
    assert result["rms"] == pytest.approx(np.sqrt(np.mean(np.square(jumps))) / size)
    assert seam(truth, truth, pairs) == {"largest": 0, "rms": 0}
