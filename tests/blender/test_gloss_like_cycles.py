"""The Cycles at hand against the golden numbers of lobes: that they are of this version too."""

import pytest

from tests.benchmarks.gloss_lobes import cycles_radiance
from tests.conformance.quiet import quiet
from tests.gloss_cases import CASES, difference, read_golden

GOLDEN, _ = read_golden()


@pytest.mark.parametrize("name", ["coat over metal", "diffuse below specular"])
def test_cycles_at_hand_bakes_the_golden_numbers(name):
    with quiet():
        radiance, albedo = cycles_radiance(CASES[name], 256, seed=3)
    assert albedo == pytest.approx(GOLDEN[name]["albedo"], abs=2e-3)
    # The noise of so few samples.
    assert difference(CASES[name], radiance, GOLDEN[name]["radiance"]) < 0.02
