"""What holds for every BRDF: samplers and densities, energy, reciprocity, shapes, ugly input."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.reflectance import (
    AshikhminShirley,
    AshikhminShirleyDiffuse,
    Constant,
    Dielectric,
    F82Tint,
    Lambert,
    Microfacet,
    OrenNayar,
    Phong,
    RealSchlick,
    Reflectance,
    Sum,
    alphas,
    directional_albedo,
    local_frames,
)
from tests.chi_squared import chi_squared, integral
from tests.core.reflectance.directions import hemisphere, mirror, towards

GOLD = (0.9, 0.6, 0.2)
LOBES = {
    "lambert": Lambert(0.8),
    "oren-nayar": OrenNayar((0.8, 0.5, 1), 0.7),
    "phong 0": Phong(0, 0.9),
    "phong 10": Phong(10, GOLD),
    "phong 3000": Phong(3000),
    "ashikhmin-shirley": AshikhminShirley(10, 100, GOLD),
    "ashikhmin-shirley diffuse": AshikhminShirleyDiffuse(GOLD, 0.1),
    "ggx 1.0": Microfacet(1, 1),
    "ggx 0.5": Microfacet(0.25, 0.25, Constant(GOLD)),
    "ggx 0.1": Microfacet(0.01, 0.01, Dielectric(1.5)),
    "ggx anisotropic": Microfacet(*alphas(0.5, 0.8), F82Tint(GOLD, 0.5)),
    "ggx single": Microfacet(0.16, 0.36, RealSchlick(0.04, 1, 1.45), multiple=False),
    "sum": Sum([Lambert(0.5), Phong(10, (0.5, 0.4, 0.3))], [1, 3]),
}
# Those that scale the lobe by the view alone are not reciprocal.
RECIPROCAL = [
    name for name in LOBES if not name.startswith("ggx") or not LOBES[name].multiple
]  # fmt: skip


# Where half vectors are seen from the edge, Ashikhmin and Shirley's density has a pole.
SEEN = [
    (name, cosine)
    for name in LOBES
    for cosine in (1.0, 0.6, 0.25)
    if name != "ashikhmin-shirley" or cosine > 0.5
]


@pytest.mark.parametrize(("name", "cosine"), SEEN)
def test_samples_fall_as_densely_as_the_pdf_says(name, cosine):
    lobe, outgoing = LOBES[name], towards(cosine)
    p, share = chi_squared(
        lambda uv: lobe.sample(outgoing, uv), lambda d: lobe.pdf(d, outgoing), mirror(outgoing)
    )
    # Densities are of the whole sphere: what falls below the horizon is counted as well.
    assert share == pytest.approx(1, abs=1e-3)
    assert p > 1e-3


def test_a_wrong_density_is_seen():
    lobe, outgoing = Phong(10), towards(0.6)
    for wrong in (Phong(11), Phong(9)):
        p, _ = chi_squared(
            lambda uv: lobe.sample(outgoing, uv),
            lambda d, wrong=wrong: wrong.pdf(d, outgoing),
            mirror(outgoing),
        )
        assert p < 1e-6


@pytest.mark.parametrize("name", LOBES)
def test_no_more_light_leaves_than_came(name):
    lobe = LOBES[name]
    for cosine in (1.0, 0.7, 0.2):
        outgoing = towards(cosine)
        albedo = integral(
            lambda d, o=outgoing: lobe.eval(d, o) * np.maximum(d[:, 2:], 0), mirror(outgoing)
        )
        assert albedo.shape == (lobe.n_channels,)
        # Cycles' tables are read between their nodes: a thousandth too much here and there.
        assert (albedo > 0).all() and (albedo <= 1.0015).all()
        # By samples: the same, so that the sampler reaches all of the lobe.
        np.testing.assert_allclose(directional_albedo(lobe, outgoing), albedo, rtol=2.5e-3)


@pytest.mark.parametrize("name", RECIPROCAL)
def test_light_and_viewer_may_change_places(name):
    lobe, first, second = LOBES[name], hemisphere(500), hemisphere(500, 5)
    np.testing.assert_allclose(lobe.eval(first, second), lobe.eval(second, first), rtol=1e-9)


@pytest.mark.parametrize("name", LOBES)
def test_nothing_below_the_horizon_and_no_nan_anywhere(name):
    lobe, up = LOBES[name], hemisphere(40)
    down = up * [1, 1, -1]
    for first, second in ((down, up), (up, down), (down, down)):
        assert not lobe.eval(first, second).any()
    ugly = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 1e-7], [-1, 0, 1e-7],
                     [0, 0, -1], [1, 0, -1e-7]], np.float32)  # fmt: skip
    with np.errstate(all="raise", under="ignore"):
        value = lobe.eval(ugly[:, None], ugly[None])
        density = lobe.pdf(ugly[:, None], ugly[None])
    assert np.isfinite(value).all() and np.isfinite(density).all()
    assert value.min() >= 0 and density.min() >= 0
    corners = np.float32([[0, 0], [0, 1 - 1e-7], [1 - 1e-7, 0], [1 - 1e-7, 1 - 1e-7]])
    drawn = lobe.sample(ugly[:6, None], corners)
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=-1), 1, atol=1e-5)


@pytest.mark.parametrize("name", LOBES)
def test_single_precision_is_as_good_and_stays_single(name):
    lobe, outgoing = LOBES[name], hemisphere(300)
    uv = np.random.default_rng(7).random((300, 2))
    incoming = lobe.sample(outgoing, uv)
    narrow = incoming.astype(np.float32), outgoing.astype(np.float32)
    # The same directions in both: what is left is the arithmetic.
    wide = [d.astype(np.float64) for d in narrow]
    value, exact = lobe.eval(*narrow), lobe.eval(*wide)
    assert value.dtype == lobe.pdf(*narrow).dtype == np.float32 and exact.dtype == np.float64
    assert lobe.sample(narrow[1], uv.astype(np.float32)).dtype == np.float32
    rtol = 2e-2 if name == "phong 3000" else 2e-3
    np.testing.assert_allclose(value, exact, rtol=rtol, atol=1e-5 * exact.max())
    np.testing.assert_allclose(
        lobe.pdf(*narrow), lobe.pdf(*wide), rtol=rtol, atol=1e-5 * lobe.pdf(*wide).max()
    )


def test_points_have_parameters_of_their_own():
    rng = np.random.default_rng(1)
    n, m = 5, 7
    rough, colour = rng.uniform(0.2, 1, (n, 1)), rng.random((n, 1, 3))
    exponents = rng.uniform(1, 50, (2, n, 1))
    incoming, outgoing = hemisphere(n * m).reshape(n, m, 3), hemisphere(n, 9)[:, None]
    made = {
        "lambert": lambda i: Lambert(colour[i]),
        "oren-nayar": lambda i: OrenNayar(colour[i], rough[i]),
        "phong": lambda i: Phong(exponents[0][i], colour[i]),
        "ashikhmin-shirley": lambda i: AshikhminShirley(*exponents[:, i], colour[i]),
        "metal": lambda i: Microfacet(*alphas(rough[i], 0.3), F82Tint(colour[i], 0.7)),
        "glass": lambda i: Microfacet(rough[i], rough[i], Dielectric(1 + rough[i])),
    }
    uv = rng.random((n, m, 2))
    for make in made.values():
        together = make(slice(None))
        value = together.eval(incoming, outgoing)
        density = together.pdf(incoming, outgoing)
        drawn = together.sample(outgoing, uv)
        assert value.shape == (n, m, together.n_channels)
        assert density.shape == (n, m) and drawn.shape == (n, m, 3)
        for i in range(n):
            alone = make(i)
            np.testing.assert_allclose(value[i], alone.eval(incoming[i], outgoing[i]), rtol=1e-12)
            np.testing.assert_allclose(density[i], alone.pdf(incoming[i], outgoing[i]), rtol=1e-12)
            np.testing.assert_allclose(drawn[i], alone.sample(outgoing[i], uv[i]), rtol=1e-9)


def test_what_is_a_brdf():
    assert all(isinstance(lobe, Reflectance) for lobe in LOBES.values())
    assert not isinstance(Constant(1), Reflectance)


def test_a_sum_is_the_sum_and_says_the_narrowest_roughness():
    first, second = Lambert(GOLD), Microfacet(0.09, 0.09)
    both, incoming, outgoing = Sum([first, second]), hemisphere(9), hemisphere(9, 2)
    value = first.eval(incoming, outgoing) + second.eval(incoming, outgoing)
    np.testing.assert_allclose(both.eval(incoming, outgoing), value)
    assert both.n_channels == 3 and both.roughness == pytest.approx(0.3)
    assert Sum([first]).roughness == 1


def test_albedo_keeps_the_axes_of_parameters():
    lobe = Lambert(np.array([[[0.2, 0.5]], [[0.3, 0.7]]]))
    outgoing = hemisphere(6).reshape(2, 3, 3)
    albedo = directional_albedo(lobe, outgoing, power=4)
    expected = np.broadcast_to(lobe.albedo, (2, 3, 2))
    np.testing.assert_allclose(albedo, expected, rtol=1e-12)


def test_frames_follow_the_tangent_and_bear_its_absence():
    normals = hemisphere(50) * np.where(np.arange(50) % 2, 1, -1)[:, None]
    tangent = np.tile([0.3, -0.8, 2.0], (50, 1))
    tangent[3], tangent[4] = 0, 7 * normals[4]
    frames = local_frames(normals, tangent)
    eye = np.tile(np.eye(3), (50, 1, 1))
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), eye, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-12)
    np.testing.assert_allclose(frames[:, 2], normals, atol=1e-12)
    local = np.einsum("nij,nj->ni", frames, tangent)
    has = np.setdiff1d(np.arange(50), [3, 4])
    # In the plane of normal and tangent: nothing along y, and along x what is not the normal's.
    np.testing.assert_allclose(local[has, 1], 0, atol=1e-12)
    assert (local[has, 0] > 0).all()
    np.testing.assert_allclose(local_frames(normals)[[3, 4]], frames[[3, 4]])


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: Lambert(-0.1), "albedo: expected 0 or more, got -0.1"),
        (lambda: Phong(np.nan), "exponent: expected finite numbers only, got nan"),
        (lambda: Phong("two"), "exponent: expected an array of numbers, got 'two'"),
        (lambda: AshikhminShirley(1, 1, 1.5), "reflectance: expected 1 or less, got 1.5"),
        (lambda: OrenNayar(1, 1.1), "roughness: expected 1 or less, got 1.1"),
        (lambda: alphas(0.5, -0.1), "anisotropy: expected 0 or more, got -0.1"),
        (lambda: Sum([]), "lobes: expected one or more BRDFs, got none"),
        (lambda: Sum([3]), "lobes: expected a list of BRDFs, got [3]"),
        (lambda: Sum([Phong(1)], [0]), "shares: expected 1 numbers, not all of them 0, got"),
        (
            lambda: Sum([Lambert((1, 1)), Lambert((1, 1, 1))]),
            "lobes: expected one number of channels, or 1, got [2, 3]",
        ),
        (
            lambda: Lambert().eval(np.ones((4, 3)), np.ones((5, 3))),
            "incoming, outgoing: expected leading axes that broadcast, got (4,) and (5,); give one",
        ),
        (
            lambda: Phong(np.ones(4)).eval(np.ones((4, 5, 3)), np.ones(3)),
            "incoming, outgoing: expected leading axes that broadcast with the parameters of the "
            "lobe, (4,), (), got (4, 5); give parameters an axis of length 1 for each further one",
        ),
        (
            lambda: F82Tint((1, 1), (1, 1, 1)),
            "f0, tint, weight: expected shapes that broadcast, got (2,), (3,), (1,)",
        ),
        (
            lambda: Lambert().pdf(np.ones((4, 2)), np.ones(3)),
            "incoming: expected directions of shape (..., 3), got (4, 2)",
        ),
        (
            lambda: Phong(1).sample(np.ones((4, 3)), np.ones((5, 2))),
            "outgoing, uv: expected leading axes that broadcast, got (4,) and (5,); give one of",
        ),
        (
            lambda: Phong(1).sample(np.ones(3), np.ones(3)),
            "uv: expected numbers of shape (..., 2), got (3,)",
        ),
        (
            lambda: local_frames(np.ones((2, 3)), np.ones((3, 3))),
            "tangent: expected one for each normal, (2, 3), got (3, 3)",
        ),
    ],
)
def test_wrong_input_is_said_in_a_line(call, line):
    with pytest.raises(PRTError) as error:
        call()
    assert str(error.value).startswith(line)
