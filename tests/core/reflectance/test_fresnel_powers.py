import numpy as np
import pytest

from prt_core import PRTError
from prt_core.reflectance import Constant, Dielectric, F82Tint, RealSchlick
from prt_core.reflectance.fresnel_powers import fresnel_powers

COSINE = np.linspace(0.15, 1, 200)


def summed(term):
    powers, rest = fresnel_powers(term), 1 - COSINE
    each = np.stack([np.ones_like(rest), rest**5, rest**2, COSINE * rest**6], axis=1)
    return np.einsum("mk,nkc->nmc", each, powers)


@pytest.mark.parametrize(
    "term",
    [
        Constant(np.array([[[0.9, 0.5, 0.1]]])),
        F82Tint(np.array([[[0.9, 0.5, 0.1]]]), np.array([[[1.0, 0.4, 0.7]]])),
        F82Tint(np.array([[[0.4, 0.2, 0.1]]]), 1.0, np.array([[[0.5]]])),
    ],
)
def test_constants_and_metals_are_sums_of_powers(term):
    wanted = np.broadcast_to(term(COSINE[None]), (1, len(COSINE), 3))
    np.testing.assert_allclose(summed(term), wanted, atol=1e-6)


@pytest.mark.parametrize("ior", [1.33, 1.5, 1.8])
def test_curves_of_dielectrics_are_near(ior):
    curve = Dielectric(np.array([[ior]]))
    wanted = curve(COSINE[None])
    assert np.abs(summed(curve) / wanted - 1).max() < 0.06
    # Seen from straight on it is exact.
    np.testing.assert_allclose(summed(curve)[0, -1], wanted[0, -1].repeat(3), rtol=1e-9)
    layer = RealSchlick(np.full((1, 1, 3), 0.05), 1.0, np.array([[ior]]))
    assert np.abs(summed(layer) / layer(COSINE[None]) - 1).max() < 0.06


def test_without_refraction_nothing_is_reflected():
    assert not summed(Dielectric(np.array([[1.0]]))).any()


def test_another_term_is_refused():
    with pytest.raises(PRTError, match="fresnel: expected a known term, got float"):
        fresnel_powers(0.5)
