"""Rows that are compressed have the bounces of the bake: no more, no fewer."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core.compress import TransportRows
from prt_core.compress.rows.indirect import indirect_factors
from prt_core.runtime.progress import run
from tests.core.compress.conftest import relative


@pytest.mark.parametrize("bounces", [0, 1, 2, None])
def test_rows_are_those_of_as_many_bounces(transport, bounces):
    transport = replace(transport, bounces=bounces)
    rows = TransportRows(transport, rank=60)
    subset = np.array([3, 50, 7, 120, 180])
    direct = transport.rows(subset, False)
    result = rows.block(subset) * transport.albedo[subset, None]
    wanted = transport.rows(subset)
    if bounces == 0:
        assert relative(result, direct) < 1e-6
    else:
        # What bounces alone, which is a small part of the whole.
        assert relative(result - direct, wanted - direct) < 0.05
    under = transport.rows(subset).sum(axis=1)
    np.testing.assert_allclose(result.sum(axis=1), under, rtol=0.01)


@pytest.mark.parametrize("bounces", [1, 3, None])
def test_factors_of_indirect_light_are_the_best_of_their_rank(transport, bounces):
    # K T of all points, written out; its own singular values tell how near a rank can come.
    transport = replace(transport, bounces=bounces)
    every = np.arange(transport.n_points)
    direct = transport.direct(every).astype(np.float64)
    gather = transport.gather.toarray().astype(np.float64)
    for channel in (2,):
        albedo = transport.albedo[:, [channel]].astype(np.float64)
        sent = term = albedo * direct
        for _ in range((bounces or 1) - 1):
            term = albedo * (gather @ term)
            sent = sent + term
        if bounces is None:
            sent = np.linalg.solve(np.eye(len(gather)) - albedo * gather, term)
        wanted = gather @ sent
        left, right = run(indirect_factors(transport, [channel], 30))
        assert left[0].shape == (transport.n_points, 30)
        np.testing.assert_allclose(left[0].T @ left[0], np.eye(30), atol=1e-4)
        rest = np.linalg.norm(wanted - left[0] @ right[0])
        values = np.linalg.svd(wanted, compute_uv=False)
        assert rest < 2.5 * np.linalg.norm(values[30:])
        # Within the range that was found nothing is nearer.
        np.testing.assert_allclose(right[0], left[0].T @ wanted, atol=1e-3 * values[0])
