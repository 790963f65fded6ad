"""In-out terms: what is separable, what is not, errors that are what they say."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.reflectance import (
    AshikhminShirley,
    Constant,
    F82Tint,
    Lambert,
    Microfacet,
    OrenNayar,
    Phong,
    Sum,
    in_out_factors,
    principled_lobes,
)
from prt_core.sphere import hemisphere_directions
from tests.core.reflectance.directions import hemisphere, towards
from tests.core.reflectance.test_principled import METAL, materials


def together(factors, incoming, outgoing):
    """The sum over all terms, (n, n_channels)."""
    every = slice(None)
    taken, sent = factors.incoming_factor(every, incoming), factors.outgoing_factor(every, outgoing)
    return np.einsum("nk,nkc->nc", taken, sent)


def test_lambert_is_one_term():
    factors = in_out_factors(Lambert((0.2, 0.5, 0.7)), 1, size=16)
    assert factors.error < 1e-3 and factors.warning is None
    incoming, outgoing = hemisphere(200), hemisphere(200, 4)
    expected = np.array([0.2, 0.5, 0.7]) / np.pi * incoming[:, 2:]
    np.testing.assert_allclose(together(factors, incoming, outgoing), expected, rtol=1e-4)


def test_more_terms_are_closer_and_the_error_says_it():
    lobe = Microfacet(0.36, 0.36, Constant(0.8))
    factors = in_out_factors(lobe, 40, size=24)
    errors = [factors.first(n).error for n in (1, 5, 20, 40)]
    assert (np.diff(errors) < 0).all() and errors[-1] == factors.error
    # Against the grid itself: what the error is of.
    middles = (np.arange(24) + 0.5) / 24
    grid = hemisphere_directions(*np.meshgrid(middles, middles, indexing="ij")).reshape(-1, 3)
    exact = lobe.eval(grid[:, None], grid[None])[..., 0] * grid[:, None, 2]
    for n in (5, 40):
        part = factors.first(n)
        taken = part.incoming_factor(slice(None), grid)
        sent = part.outgoing_factor(slice(None), grid)[..., 0]
        off = np.linalg.norm(taken @ sent.T - exact) / np.linalg.norm(exact)
        assert off == pytest.approx(part.error, abs=2e-3)
    # Nothing of this number is closer: the values are those of a full decomposition.
    values = np.linalg.svd(exact, compute_uv=False)[:40]
    np.testing.assert_allclose(factors.values, values, rtol=2e-2)


def test_all_terms_are_the_lobe():
    # As many as directions: what is left is the grid's, between its texels.
    lobe = Sum([Lambert(0.3), Phong(5, (0.5, 0.4, 0.3))])
    factors = in_out_factors(lobe, 144, size=12)
    assert factors.error < 1e-3
    incoming, outgoing = hemisphere(300), hemisphere(300, 4)
    exact = lobe.eval(incoming, outgoing) * incoming[:, 2:]
    off = np.linalg.norm(together(factors, incoming, outgoing) - exact) / np.linalg.norm(exact)
    assert off < 0.06


def test_azimuth_is_part_of_it():
    lobe, factors = AshikhminShirley(2, 20), in_out_factors(AshikhminShirley(2, 20), 150, size=24)
    outgoing = np.broadcast_to(towards(0.8, 0.0), (3, 3))
    incoming = np.array([towards(0.8, turn) for turn in (np.pi, 2.2, 0.0)])
    exact = lobe.eval(incoming, outgoing) * incoming[:, 2:]
    np.testing.assert_allclose(together(factors, incoming, outgoing), exact, rtol=0.06)
    assert exact[0, 0] > 1.9 * exact[2, 0]


def test_single_terms_are_those_of_slices():
    factors = in_out_factors(OrenNayar((0.5, 0.6), 1.0), 3, size=8)
    directions = hemisphere(12).reshape(3, 4, 3)
    every = factors.incoming_factor(slice(None), directions)
    sent = factors.outgoing_factor(slice(1, 3), directions)
    assert every.shape == (3, 4, 3) and sent.shape == (3, 4, 2, 2)
    np.testing.assert_array_equal(factors.incoming_factor(2, directions), every[..., 2])
    np.testing.assert_array_equal(factors.outgoing_factor(1, directions), sent[..., 0, :])
    below = directions * [1, 1, -1]
    assert not factors.incoming_factor(0, below).any()
    assert not factors.outgoing_factor(0, below).any()


def test_narrow_lobes_are_said():
    wide = in_out_factors(Microfacet(0.25, 0.25), 5, size=8)
    narrow = in_out_factors(Microfacet(0.09, 0.09), 5, size=8)
    assert wide.warning is None
    assert narrow.warning == (
        f"roughness 0.30: 5 terms are {narrow.error:.0%} off the reflectance; below 0.45 lobes are "
        "too narrow for terms, evaluate them instead"
    )
    assert in_out_factors(OrenNayar(1.0, 0.1), 2, size=8).warning is None
    assert in_out_factors(Phong(100), 2, size=8).warning.startswith("roughness 0.32: ")


def test_lobes_of_a_point_and_colours():
    point = principled_lobes(materials({**METAL, "roughness": 0.8}))
    factors = in_out_factors(point, 20, size=12)
    assert factors.n_channels == 3 and factors.warning is None
    metal = in_out_factors(Microfacet(0.64, 0.64, F82Tint((0.9, 0.6, 0.2))), 20, size=12)
    assert metal.outgoing.shape == (12, 12, 20, 3) and metal.error < 0.1
    black = in_out_factors(Lambert(0.0), 2, size=8)
    assert black.error == 0 and not black.outgoing.any()


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: in_out_factors(3, 5), "reflectance: expected a BRDF, got 3"),
        (
            lambda: in_out_factors(Phong(1), 65, size=8),
            "n_terms: expected a whole number from 1 to 64, got 65",
        ),
        (
            lambda: in_out_factors(Lambert(np.ones((2, 64, 64, 1))), 2, size=8),
            "reflectance: expected one point, whose parameters are numbers; its values are of "
            "shape (2, 64, 64, 1), expected (64, 64, 1)",
        ),
        (
            lambda: in_out_factors(Lambert(), 1, size=8).incoming_factor(1, np.ones(3)),
            "k: expected a whole number from 0 to 0, got 1",
        ),
    ],
)
def test_wrong_input_is_said_in_a_line(call, line):
    with pytest.raises(PRTError) as error:
        call()
    assert str(error.value) == line
