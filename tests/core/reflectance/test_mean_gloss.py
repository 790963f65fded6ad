"""What materials send in the mean of all views, against sums of their lobes over the hemisphere."""

import numpy as np
import pytest

from prt_core.reflectance import Materials, principled_lobes
from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.sphere import CubeMap

COLOUR = (0.6, 0.35, 0.2)
KINDS = {
    "dielectric": {"albedo": COLOUR, "dielectric": 1, "ior": 1.5, "roughness": 0.4},
    "tinted": {"albedo": COLOUR, "dielectric": 1, "ior": 1.8, "roughness": 0.6, "tint": COLOUR},
    "metal": {"albedo": COLOUR, "stand_in": COLOUR, "metal": COLOUR, "roughness": 0.5},
    "coat": {"albedo": COLOUR, "coat": 1, "coat_roughness": 0.4, "coat_tint": (1, 0.8, 0.6)},
}


def materials(names):
    quantities = {name for kind in names for name in KINDS[kind]}
    default = Materials(albedo=np.zeros((1, 3)))
    return Materials(
        **{
            name: np.stack(
                [
                    np.broadcast_to(KINDS[kind].get(name, getattr(default, name)[0]),
                                    getattr(default, name)[0].shape)
                    for kind in names
                ]
            ).astype(float)
            for name in quantities
        }
    )  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_it_is_the_sum_of_lobes_over_light_and_views(name):
    own = materials([name])
    lobes, cube_map = principled_lobes(own), CubeMap(40)
    above = cube_map.directions[:, 2] > 0
    incoming = cube_map.directions[above][None]
    weights = incoming[0, :, 2] * cube_map.solid_angles[above]
    places, shares = np.polynomial.legendre.leggauss(12)
    cosines, total = (places + 1) / 2, np.zeros(3)
    for cosine, share in zip(cosines, shares * cosines, strict=True):
        view = np.array([[[np.sqrt(1 - cosine**2), 0, cosine]]])
        values = lobes.eval(incoming, view) + lobes.diffuse_eval(incoming, view)
        total += share * (weights @ values[0])
    sent = with_mean_gloss(own)
    np.testing.assert_allclose(sent.albedo[0], total, rtol=0.01)
    # What is truly diffuse is what it was.
    even = np.asarray(own.albedo) - own.stand_in
    np.testing.assert_allclose(sent.albedo - sent.stand_in, even, atol=1e-12)


def test_each_place_has_that_of_its_own_material_and_matte_ones_none():
    alone = [with_mean_gloss(materials([name])).albedo[0] for name in KINDS]
    names = [*KINDS, *KINDS]
    together = with_mean_gloss(materials(names)).albedo
    np.testing.assert_allclose(together, [*alone, *alone], rtol=1e-9)
    assert (np.abs(together - np.asarray(COLOUR)) > 1e-3).any(axis=1).all()
    matte = Materials(albedo=np.full((4, 3), 0.5))
    assert with_mean_gloss(matte) is matte
    nothing = with_mean_gloss(Materials(albedo=np.zeros((2, 3)), dielectric=np.ones((2, 1))))
    assert ((nothing.albedo > 0.01) & (nothing.albedo < 0.1)).all()
