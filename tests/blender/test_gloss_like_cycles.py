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
    # Noise of so few samples is 0.4 to 0.9 %. Blender 4.2 has another coat over metal: 1.5 % away
    # at 4,096 samples, 1.7 % with this noise; the golden numbers are of 5.0.
    assert difference(CASES[name], radiance, GOLDEN[name]["radiance"]) < 0.02
