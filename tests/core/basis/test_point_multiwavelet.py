import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import PointHaar, PointMultiwavelet

RNG = np.random.default_rng(8)


def grid(*sizes):
    axes = np.meshgrid(*map(np.arange, sizes), indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, len(sizes)) @ np.eye(len(sizes), 3)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


UP = np.tile([0.0, 0.0, 1.0], (100, 1))
CLOUDS = {
    "sphere": (unit(RNG.standard_normal((100, 3))),) * 2,
    "no normals": (RNG.random((100, 3)), None),
    "flat": (grid(10, 10), UP),
    "one line": (grid(100), UP),
    "one place": (np.ones((100, 3)), UP),
    "one place, many normals": (np.ones((100, 3)), unit(RNG.standard_normal((100, 3)))),
    "pairs": (np.repeat(RNG.random((50, 3)), 2, axis=0), UP),
    "zero normals": (RNG.random((100, 3)), 0 * UP),
    "tiny": (1e-20 * RNG.random((100, 3)), UP),
    "huge": (1e20 * RNG.random((100, 3)), UP),
    "far": (1e6 + RNG.random((100, 3)), UP),
}


def check_basis(transform):
    n = transform.n
    functions = RNG.standard_normal((4, n))
    for depth in range(transform.depth + 1):
        coefficients = transform.forward(functions, depth)
        assert np.abs(transform.inverse(coefficients, depth) - functions).max() < 1e-12
        assert transform.head(coefficients, depth).shape[1] == (transform.scales(depth) == 0).sum()
    basis = transform.forward(np.eye(n))
    assert np.abs(basis @ basis.T - np.eye(n)).max() < 1e-12


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 11, 64, 101])
def test_functions_come_back_and_the_basis_is_orthonormal(n):
    check_basis(PointMultiwavelet(RNG.random((n, 3)), unit(RNG.standard_normal((n, 3)))))


@pytest.mark.parametrize("cloud", CLOUDS)
def test_also_on_degenerate_clouds(cloud):
    check_basis(PointMultiwavelet(*CLOUDS[cloud]))


def test_what_is_linear_in_a_plane_has_three_coefficients():
    # 17 x 9 of odd counts, so that some nodes are without partners.
    transform = PointMultiwavelet(grid(17, 9), np.tile([0.0, 0.6, 0.8], (153, 1)))
    x, y = transform.features.T.astype(float)
    for depth in range(2, transform.depth + 1):
        coefficients = transform.forward((2 + 0.3 * x - 0.7 * y)[None], depth)[0]
        details = transform.scales(depth) > 0
        assert np.abs(coefficients[details]).max() < 1e-11
    assert details.sum() == 150


def test_light_on_a_bumpy_surface_is_sparser_than_in_haar_wavelets():
    positions = RNG.random((500, 3)) * [1, 1, 0]
    slopes = 0.4 * np.cos(9 * positions @ RNG.standard_normal((3, 2)))
    normals = unit(np.insert(slopes, 2, 1.0, axis=1))
    lit = (normals @ unit(RNG.standard_normal((20, 3)) + [0, 0, 3]).T).T
    terms = [
        (np.abs(kind(positions, normals).forward(lit)) > 0.01).sum()
        for kind in (PointHaar, PointMultiwavelet)
    ]
    assert terms[1] < 0.5 * terms[0]


@pytest.mark.parametrize("cloud", CLOUDS)
def test_rounding_decides_nothing(cloud):
    # Another machine's products differ in the last digits; its basis must not.
    transform = PointMultiwavelet(*CLOUDS[cloud])
    other = PointMultiwavelet(*CLOUDS[cloud])
    noise = 1 + 1e-14 * RNG.standard_normal(transform.features.shape)
    other._plant(transform.order, transform.features * noise)
    functions = RNG.standard_normal((4, 100))
    assert np.abs(other.forward(functions) - transform.forward(functions)).max() < 1e-8
    assert other.check() == pytest.approx(transform.check(), abs=1e-7)


def test_order_and_features_make_it_again():
    transform = PointMultiwavelet(*CLOUDS["sphere"])
    again = PointMultiwavelet.from_order(transform.order, transform.features)
    functions = RNG.standard_normal((2, 100)).astype(np.float32)
    np.testing.assert_array_equal(again.forward(functions), transform.forward(functions))
    assert transform.forward(functions).dtype == np.float32
    assert again.check() == transform.check()
    turned = transform.features.copy()
    turned[7, 0] ^= 64
    changed = PointMultiwavelet.from_order(transform.order, turned)
    assert abs(changed.check() - transform.check()) > 1e-4
    for wrong in (turned[:-1], turned.astype(np.float32), turned[:, 0]):
        with pytest.raises(PRTError, match="features"):
            PointMultiwavelet.from_order(transform.order, wrong)
    with pytest.raises(PRTError, match="normals"):
        PointMultiwavelet(np.ones((4, 3)), np.full((4, 3), np.nan))
