"""Tables of albedos: the numbers that Cycles has, and closed forms."""

import numpy as np
import pytest

from prt_core.reflectance import Dielectric, Microfacet, directional_albedo
from prt_core.reflectance.energy import ggx_albedo, ggx_fresnel_share, ggx_mean_albedo
from tests.core.reflectance.directions import towards

# Of Cycles 5.0 (`table_ggx_E`): roughness and cosine in parts of 31.
CYCLES = [
    (31, 31, 0.306853), (31, 0, 0.999079), (31, 1, 0.888202), (15, 31, 0.926694),
    (15, 5, 0.861611), (8, 1, 0.917411), (8, 16, 0.987348), (3, 2, 0.987331), (0, 7, 1.0),
    (22, 11, 0.726289), (1, 0, 0.980405),
]  # fmt: skip
# `table_ggx_Eavg`.
CYCLES_MEAN = [(31, 0.409137), (20, 0.761345), (10, 0.970160), (0, 1.0)]
# `table_ggx_gen_schlick_ior_s`: index, roughness and cosine in parts of 15.
CYCLES_SHARE = [(8, 0, 0, 0.999384), (8, 1, 1, 0.667239), (8, 3, 2, 0.409359), (8, 2, 3, 0.3125)]


def test_albedos_are_those_that_cycles_has():
    for rough, cosine, value in CYCLES:
        assert ggx_albedo(rough / 31, cosine / 31) == pytest.approx(value, abs=6e-4)
    for rough, value in CYCLES_MEAN:
        assert ggx_mean_albedo(rough / 31) == pytest.approx(value, abs=3e-4)


def test_shares_of_fresnel_are_those_that_cycles_has():
    for index, rough, cosine, value in CYCLES_SHARE:
        root = (index / 15) ** 2
        ior = (1 + root) / (1 - root)
        # By the index the other way round: it is found again from the quotient.
        share = ggx_fresnel_share(rough / 15, cosine / 15, ior)
        assert share == pytest.approx(value, abs=4e-4)


def test_tables_are_read_linearly_and_broadcast():
    rough = np.array([[0.3], [0.3 + 1 / 31]])
    between = ggx_albedo(rough, np.array([0.2, 0.5, 0.8]))
    assert between.shape == (2, 3)
    low, high = ggx_albedo(9 / 31, 0.5), ggx_albedo(10 / 31, 0.5)
    share = 0.3 * 31 - 9
    assert between[0, 1] == pytest.approx(low + share * (high - low), rel=1e-12)
    # Outside they are as at their ends.
    assert ggx_albedo(1.5, -1.0) == ggx_albedo(1.0, 0.0)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_tables_are_what_a_lobe_reflects(roughness):
    alpha = roughness**2
    single = Microfacet(alpha, alpha, multiple=False)
    for cosine in (0.2, 0.5, 1.0):
        albedo = directional_albedo(single, towards(cosine))[0]
        assert ggx_albedo(roughness, cosine) == pytest.approx(albedo, abs=3e-3)
        # The share is of normals, not of light: close to the lobe's albedo where it is smooth.
        glass = directional_albedo(Microfacet(alpha, alpha, Dielectric(1.5)), towards(cosine))[0]
        share = ggx_fresnel_share(roughness, cosine, 1.5)
        assert 0.04 + 0.96 * share == pytest.approx(glass, abs=0.03)
