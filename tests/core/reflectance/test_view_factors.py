import numpy as np

from prt_core.reflectance import Materials, principled_lobes
from prt_core.reflectance.view_factors import ViewFactors


def lacquer(n, rng):
    one = np.ones((n, 1))
    return Materials(
        albedo=rng.uniform(0.1, 0.8, (n, 3)),
        metal=np.where(np.arange(n)[:, None] % 2, rng.uniform(0.3, 0.9, (n, 3)), 0),
        dielectric=(np.arange(n)[:, None] % 2 == 0) * one,
        roughness=rng.uniform(0.2, 1, (n, 1)),
        coat=0.7 * one,
        coat_roughness=0.2 * one,
        coat_tint=np.tile((0.9, 0.6, 0.3), (n, 1)),
    )


def test_factors_are_those_of_the_lobes():
    rng = np.random.default_rng(5)
    materials = lacquer(12, rng)
    lobes, factors = principled_lobes(materials), ViewFactors(materials)
    cosine = rng.uniform(0.05, 1, 12)
    view = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)[:, None]
    found = factors.at(np.arange(12), cosine)
    assert set(found) == {"metal", "dielectric", "coat", "diffuse"}
    for lobe in lobes.lobes:
        if lobe.name == "diffuse":
            wanted = lobes.diffuse_weight(view)[:, 0]
            np.testing.assert_allclose(found["diffuse"], wanted, rtol=0.02, atol=2e-3)
            continue
        wanted = lobe.reflectance.gain(view[lobe.rows]) * lobes.reaching(lobe, view)
        wanted = np.broadcast_to(wanted, (len(wanted), 1, 3))
        np.testing.assert_allclose(found[lobe.name][lobe.rows], wanted[:, 0], rtol=0.02)


def test_many_materials_share_tables():
    materials = lacquer(6000, np.random.default_rng(6))
    factors = ViewFactors(materials)
    lobes = principled_lobes(materials)
    cosine = np.full(6000, 0.6)
    view = np.array([[[0.8, 0, 0.6]]])
    wanted = lobes.diffuse_weight(view)[:, 0]
    found = factors.at(np.arange(6000), cosine)["diffuse"]
    assert np.abs(found / wanted - 1).mean() < 0.03
