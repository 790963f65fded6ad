"""Every lobe against Cycles: dense sums over a sky beside golden numbers of Cycles' own bakes."""

import numpy as np
import pytest

from prt_core.reflectance import principled_lobes
from tests.gloss_cases import (
    CASES,
    compared,
    dense_sum,
    difference,
    materials_of,
    places,
    radiance_of,
    read_golden,
    sampled_sum,
)

GOLDEN, _ = read_golden()


@pytest.mark.parametrize("name", CASES)
def test_sums_over_the_sky_are_what_cycles_bakes(name):
    case, golden = CASES[name], GOLDEN[name]
    assert golden["noise"] < case.bound / 5
    values = radiance_of(case, golden["albedo"], 48)
    assert difference(case, values, golden["radiance"]) < case.bound - golden["noise"]
    # A wrong scale would hide in no error of places.
    seen = compared(case)
    ratio = values[seen].sum() / golden["radiance"][seen].sum()
    assert ratio == pytest.approx(1, abs=case.bound / 2)


@pytest.mark.parametrize(
    "name", ["glossy 0.5 anisotropic 0.5", "coat over metal", "dielectric 0.3"]
)
def test_samples_of_lobes_find_what_texels_do(name):
    case, golden = CASES[name], GOLDEN[name]
    values = sampled_sum(case, golden["albedo"], 12)
    assert difference(case, values, golden["radiance"]) < 0.005


def test_the_golden_file_has_all_cases_and_no_others():
    assert set(GOLDEN) == set(CASES)


@pytest.mark.parametrize(
    ("name", "quantities", "least"),
    [
        ("metal 0.5", {"roughness": 0.55}, 0.02),
        ("metal 0.8 edge", {"metal_edge": 1}, 0.03),
        ("metal 0.4 anisotropic 0.8", {"tangent": (0.3, -0.9, 0.2)}, 0.1),
        ("coat over metal", {"coat_tint": 1}, 0.2),
        ("dielectric 0.7 tint", {"tint": 1}, 0.1),
        ("rough diffuse", {"diffuse_roughness": 0}, 0.05),
    ],
)
def test_a_wrong_quantity_is_seen(name, quantities, least):
    case = CASES[name]
    wrong = type(case)(**{**vars(case), "quantities": {**case.quantities, **quantities}})
    values = dense_sum(wrong, GOLDEN[name]["albedo"], 24)
    assert difference(case, values, GOLDEN[name]["radiance"]) > least


@pytest.mark.parametrize("name", ["diffuse below specular", "diffuse below coat"])
def test_diffuse_light_without_the_factor_of_the_view_is_off(name):
    case, golden = CASES[name], GOLDEN[name]
    lobes = principled_lobes(materials_of(case, golden["albedo"]))
    normals, views = places()
    outgoing = np.einsum("nij,nj->ni", lobes.frames(normals), views)[:, None]
    weight = lobes.diffuse_weight(outgoing)[:, 0]
    values = dense_sum(case, golden["albedo"], 48)
    assert difference(case, values, golden["radiance"]) < 0.005
    assert difference(case, values / weight, golden["radiance"]) > 0.015
    assert weight.min() < 0.9 and weight.max() <= 1
