import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import harmonics
from prt_core.reflectance import F82Tint, Lambert, Microfacet, Phong
from prt_core.reflectance.harmonic import HarmonicReflectance
from prt_core.sphere import CubeMap

CUBE = CubeMap(48)


def projected(evaluate, outgoing, order):
    """(n_channels, order^2), summed over the texels of a fine cube map."""
    above = CUBE.directions[:, 2] > 0
    incoming = CUBE.directions[above]
    values = evaluate(incoming, outgoing[None]) * (CUBE.vectors[above, 2])[:, None]
    return values.T @ harmonics(incoming, order)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.4, -2.9])
def test_turned_coefficients_are_the_projection_of_that_view(angle):
    tilt = 0.6
    view = np.array([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), np.cos(tilt)])
    form = HarmonicReflectance(Phong(6).eval, 5, hemisphere=False)
    wanted = projected(Phong(6).eval, view, 5)
    np.testing.assert_allclose(form.vectors(view[None])[0], wanted, atol=4e-3)
    assert np.abs(wanted).max() > 0.3


def test_colours_and_backs():
    metal = Microfacet(0.4, 0.4, F82Tint((0.9, 0.5, 0.2)))
    form = HarmonicReflectance(metal.eval, 4)
    vectors = form.vectors([[0, 0.6, 0.8], [0, 0.6, -0.8]])
    assert vectors.shape == (2, 3, 16) and not vectors[1].any()
    assert (vectors[0, 0, 0] > vectors[0, 2, 0] > 0).all()
    assert form.n_channels == 3 and form.nbytes == 64 * 3 * 16 * 8


def test_fitted_above_the_horizon_it_is_nearer_there():
    view = np.array([[0.6, 0, 0.8]])
    above = CUBE.directions[:, 2] > 0
    incoming, weight = CUBE.directions[above], CUBE.solid_angles[above]
    truth = Phong(6).eval(incoming, view)[:, 0] * incoming[:, 2]
    errors = []
    for hemisphere in (False, True):
        form = HarmonicReflectance(Phong(6).eval, 5, hemisphere=hemisphere)
        values = harmonics(incoming, 5) @ form.vectors(view)[0, 0]
        errors.append(np.sqrt((weight * (values - truth) ** 2).sum() / (weight * truth**2).sum()))
    assert errors[1] < 0.85 * errors[0]
    # A cosine is the harmonics of degree 1 there, exactly.
    values = harmonics(incoming, 5) @ HarmonicReflectance(Lambert(0.5).eval).vectors(view)[0, 0]
    np.testing.assert_allclose(values, 0.5 / np.pi * incoming[:, 2], atol=2e-3)


def test_what_does_not_fit_is_said():
    with pytest.raises(PRTError, match="order: expected a whole number"):
        HarmonicReflectance(Phong(6).eval, 0)
    with pytest.raises(PRTError, match="reflectance_eval: expected a callable"):
        HarmonicReflectance(None)
