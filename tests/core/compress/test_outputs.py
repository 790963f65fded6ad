"""Outputs of a form read channels of a light: more outputs than channels, and in any order."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import PointHaar
from prt_core.compress import (
    PCA,
    ArrayRows,
    BlockPCA,
    ClusteredPCA,
    ClusterEvaluator,
    HaarLighting,
    Harmonics,
    IncrementalLighting,
    RowCode,
    SomeRows,
    SparseClusteredPCA,
    TransportRows,
    VectorQuantisation,
    Wavelet4D,
    method_names,
)
from prt_core.compress.rows.row_code import Group
from tests.core.compress.conftest import relative

RNG = np.random.default_rng(5)
N_POINTS, N_DIRECTIONS, READS = 11, 24, [0, 1, 2, 0, 2]
MATRIX = RNG.standard_normal((N_POINTS, N_DIRECTIONS, 5))
LIGHT = RNG.random((N_DIRECTIONS, 3)).astype(np.float32)
DENSE = np.arange(0, N_POINTS, 2)
PLACES = PointHaar(RNG.random((N_POINTS, 3)))
# So near that only rounding is left.
FORMS = {
    "cpca": ClusteredPCA(2, 9),
    "pca": PCA(10),
    "vq": VectorQuantisation(N_POINTS),
    "haar": HaarLighting(None, step=1e-7),
    "wavelet4d": Wavelet4D(PLACES, error=0, bits=None, mode="4d"),
    "harmonics": Harmonics(1),
    "block_pca": BlockPCA((1, N_POINTS), 4, 9),
    "sparse_cpca": SparseClusteredPCA(DENSE, DENSE[np.arange(N_POINTS) // 2][:, None], 2, 9),
}


def rows(reads=READS):
    return ArrayRows(MATRIX, 2, reads)


def dense(light, reads=READS):
    """The product written out."""
    return np.einsum("pdo,do->po", MATRIX, light[:, reads].astype(np.float64))


def test_each_registered_method_is_here():
    # Irradiance is made of normals, not of rows.
    assert set(FORMS) | {"irradiance"} == set(method_names())


@pytest.mark.parametrize("name", FORMS)
def test_five_outputs_of_three_channels_are_the_dense_product(name):
    model = FORMS[name].fit(rows())
    assert (model.n_outputs_, model.n_channels_) == (5, 3)
    # One harmonic holds an even light of any colour.
    light = np.tile(LIGHT[0], (N_DIRECTIONS, 1)) if name == "harmonics" else LIGHT
    wanted = dense(light)
    assert model.product(light).shape == (N_POINTS, 5)
    # Integrals of harmonics over texels are sums themselves.
    assert relative(model.product(light), wanted) < (1e-4 if name == "harmonics" else 1e-5)
    again = type(model).from_state(model.state())
    np.testing.assert_array_equal(again.product(light), model.product(light))
    if hasattr(model, "affine_"):
        quick = ClusterEvaluator(model, n_terms=None, error=0)
        assert relative(quick.product(light), wanted) < 1e-5
        assert relative(model.reconstruct(np.arange(N_POINTS)), MATRIX) < 1e-5
    if name == "haar":
        assert relative(IncrementalLighting(model).product(light), wanted) < 1e-5


def test_a_channel_counts_as_often_as_it_is_read():
    """All outputs but one read the green: of few terms those of green are kept."""
    reads = [1, 1, 1, 1, 0]
    light = np.zeros((N_DIRECTIONS, 2), np.float32)
    same = np.repeat(MATRIX[:, :1, :1], N_DIRECTIONS, 1) * np.ones(5)
    model = HaarLighting(1, "unweighted", 1e-6).fit(ArrayRows(same, 2, reads))
    light[0, 1], light[5, 0] = 1.0, 1.5
    chosen, coefficients = model.terms(light)
    assert coefficients[chosen, 1].any() and not coefficients[chosen, 0].any()
    form = Wavelet4D(PLACES, error=0, bits=None, n_terms=1).fit(ArrayRows(same, 2, reads))
    kept = form.choose(light)
    assert kept[:, 1].any() and not kept[:, 0].any()
    quick = ClusterEvaluator(PCA(1).fit(ArrayRows(same, None, reads)), n_terms=1, error=0)
    result = quick.product(light)
    # One term for each group, and each output is a group of its own.
    assert relative(result[:, :4], same[:, 0, :4]) < 1e-5 and result[:, 4].any()


def test_a_light_has_the_channels_that_are_read():
    model = PCA(3).fit(rows([1, 1, 1, 1, 1]))
    assert model.n_channels_ == 2
    with pytest.raises(PRTError, match=r"light: expected an array of shape \(24, 2\)"):
        model.product(LIGHT)
    for reads, message in (
        ([0, 1], "reads: expected an array of shape"),
        ([0, 1, 2, 0, -1], "reads: expected values from 0"),
        ([0, 1, 2, 0, 0.5], "reads: expected an array of whole numbers"),
    ):
        with pytest.raises(PRTError, match=message):
            rows(reads)
    with pytest.raises(PRTError, match="reads"):
        RowCode.plain(24, 3, reads=[0, 1])


def test_some_rows_read_what_all_read(transport):
    assert SomeRows(rows(), np.array([3, 5])).reads.tolist() == READS
    assert TransportRows(transport, 0).reads.tolist() == [0, 1, 2]


def test_a_form_that_did_not_name_its_channels_is_read():
    """Forms of before knew channels only, each output its own."""
    model = Harmonics(2).fit(ArrayRows(MATRIX[..., :3], 2))
    state = model.state()
    del state["reads"]
    again = Harmonics.from_state({**state, "n_channels": 3})
    np.testing.assert_array_equal(again.product(LIGHT), model.product(LIGHT))
    for wrong in (0, 10**15, "a", None):
        with pytest.raises(PRTError, match="'n_channels' is wrong"):
            Harmonics.from_state({**state, "n_channels": wrong})
    for wrong in ([], [0, -1], "a", 3, [[0]], None):
        with pytest.raises(PRTError, match="'reads' is wrong"):
            Harmonics.from_state({**state, "reads": wrong})


def test_bright_texels_are_looked_up_only_where_rows_know_direct_light_apart(transport, light):
    shape = transport.n_points, transport.n_directions
    model = PCA(3).fit(ArrayRows(np.random.default_rng(1).random((*shape, 3)), 8))
    quick = ClusterEvaluator(model, transport, None, 0)
    assert relative(quick.product(light), model.product(light)) < 1e-4


class DirectOfFive(TransportRows):
    """Direct light in five outputs."""

    def __init__(self, transport):
        super().__init__(transport, rank=0)
        self.n_outputs, self.reads = 5, np.array(READS)

    @property
    def code(self):
        plain = super().code
        return replace(plain, reads=self.reads, groups=(Group((1.0,) * 5, direct=True),))

    def features(self, points):
        return self.code.code(self.direct(points))


def test_bright_texels_are_those_of_the_channel_that_is_read(transport, light):
    model = PCA(2).fit(DirectOfFive(transport))
    sun = np.zeros_like(light)
    sun[100] = light[100]
    result = ClusterEvaluator(model, transport).product(sun)
    assert relative(result, transport.product(sun, bounces=0)[:, READS]) < 1e-5
