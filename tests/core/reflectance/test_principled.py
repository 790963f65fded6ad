"""Lobes of points: layers, mixtures, points without this or that; Cycles is in another file."""

from types import SimpleNamespace

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.reflectance import GLOSSY_LOBES, Reflectance, principled_lobes
from tests.chi_squared import chi_squared, integral
from tests.core.reflectance.directions import hemisphere, mirror, towards

DEFAULTS = {
    "albedo": (0.5, 0.4, 0.3), "stand_in": (0, 0, 0), "glossy": (0, 0, 0), "metal": (0, 0, 0),
    "metal_edge": (1, 1, 1), "dielectric": 0, "tint": (1, 1, 1), "ior": 1.5, "roughness": 1,
    "anisotropy": 0, "tangent": (0, 0, 0), "single": 0, "coat": 0, "coat_roughness": 0.03,
    "coat_ior": 1.5, "coat_tint": (1, 1, 1), "diffuse_roughness": 0, "opacity": 1,
}  # fmt: skip
UP = np.array([[[0, 0, 1.0]]])
PLASTIC = {"dielectric": 1, "roughness": 0.4}
METAL = {
    "albedo": (0.9, 0.6, 0.2), "stand_in": (0.9, 0.6, 0.2), "metal": (0.9, 0.6, 0.2),
    "roughness": 0.3, "anisotropy": 0.7, "tangent": (1, 0.5, 0),
}  # fmt: skip
VARNISHED = {**PLASTIC, "coat": 0.8, "coat_tint": (0.9, 0.5, 0.3), "coat_roughness": 0.1}
PAPER = {"diffuse_roughness": 0.7}
GLOSSY = {"glossy": (0.3, 0.2, 0.1), "roughness": 0.5}


def materials(*points):
    """Something with the quantities of `Materials`, a point for each dict."""
    return SimpleNamespace(**{
        name: np.array([np.atleast_1d({**DEFAULTS, **point}[name]) for point in points], float)
        for name in DEFAULTS
    })  # fmt: skip


MIXED = (PLASTIC, METAL, VARNISHED, PAPER, GLOSSY, {})


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_are_what_they_are_alone(dtype):
    n, m = len(MIXED), 7
    together = principled_lobes(materials(*MIXED))
    incoming = hemisphere(n * m).reshape(n, m, 3).astype(dtype)
    outgoing = hemisphere(n, 9)[:, None].astype(dtype)
    uv = np.random.default_rng(2).random((n, m, 2)).astype(dtype)
    glossy, diffuse = (f(incoming, outgoing) for f in (together.eval, together.diffuse_eval))
    density, drawn = together.pdf(incoming, outgoing), together.sample(outgoing, uv)
    weight = together.diffuse_weight(outgoing)
    assert glossy.shape == diffuse.shape == drawn.shape == (n, m, 3)
    assert density.shape == (n, m) and weight.shape == (n, 1, 3)
    assert {a.dtype for a in (glossy, diffuse, density, drawn, weight)} == {np.dtype(dtype)}
    rtol = 1e-4 if dtype == np.float32 else 1e-12
    for i, point in enumerate(MIXED):
        alone, part = principled_lobes(materials(point)), slice(i, i + 1)
        here = incoming[part], outgoing[part]
        np.testing.assert_allclose(glossy[part], alone.eval(*here), rtol=rtol, atol=1e-7)
        np.testing.assert_allclose(diffuse[part], alone.diffuse_eval(*here), rtol=rtol)
        np.testing.assert_allclose(weight[part], alone.diffuse_weight(here[1]), rtol=rtol)
        if alone.lobes[0].name != "diffuse":
            np.testing.assert_allclose(density[part], alone.pdf(*here), rtol=rtol, atol=1e-7)
            np.testing.assert_allclose(drawn[part], alone.sample(here[1], uv[part]), atol=1e-5)
    # What is not glossy has no gloss, and no direction that it would be sampled in.
    assert not glossy[[3, 5]].any() and not density[[3, 5]].any()
    assert (drawn[[3, 5]] == [0, 0, 1]).all() and not diffuse[1].any()


def test_lobes_have_names_and_sum_to_all():
    lobes = principled_lobes(materials(*MIXED))
    assert [lobe.name for lobe in lobes.lobes] == [*GLOSSY_LOBES, "diffuse"]
    assert isinstance(lobes, Reflectance)
    incoming, outgoing = hemisphere(11)[None], hemisphere(6, 4)[:, None]
    each = sum(lobes.lobe_eval(name, incoming, outgoing) for name in GLOSSY_LOBES)
    np.testing.assert_allclose(each, lobes.eval(incoming, outgoing), rtol=1e-12)
    diffuse = lobes.lobe_eval("diffuse", incoming, outgoing)
    np.testing.assert_array_equal(diffuse, lobes.diffuse_eval(incoming, outgoing))
    only = principled_lobes(materials(PAPER, {}))
    assert [lobe.name for lobe in only.lobes] == ["diffuse"] and only.roughness == 1
    assert not only.lobe_eval("coat", incoming, outgoing[:2]).any()
    assert lobes.roughness == pytest.approx(0.1)


def test_diffuse_light_is_what_the_bake_holds_straight_above_and_less_aslant():
    lobes = principled_lobes(materials(PLASTIC, VARNISHED, {}))
    np.testing.assert_allclose(lobes.diffuse_weight(UP)[:, 0], 1, rtol=1e-12)
    up = np.broadcast_to(UP, (3, 1, 3))
    np.testing.assert_allclose(lobes.diffuse_eval(up, up)[:, 0] * np.pi,
                               [DEFAULTS["albedo"]] * 3, rtol=1e-12)  # fmt: skip
    views = np.array([[towards(c) for c in (0.9, 0.5, 0.25)]])
    weight = lobes.diffuse_weight(views)
    assert (np.diff(weight[:2], axis=1) < 0).all() and (weight[2] == 1).all()
    # The tint of the coat grows with the way through it, most where it takes most.
    assert weight[1, 2, 2] < weight[1, 2, 0] and (weight[0] == weight[0][:, :1]).all()


def test_a_coat_takes_from_what_lies_below():
    plain, coated = principled_lobes(materials(METAL)), principled_lobes(
        materials({**METAL, "coat": 1, "coat_ior": 1.6}))  # fmt: skip
    incoming, outgoing = hemisphere(50)[None], np.array([[towards(0.8)]])
    below = coated.lobe_eval("metal", incoming, outgoing) / plain.eval(incoming, outgoing)
    # All directions alike: by the view, what a varnish of 1.6 reflects.
    np.testing.assert_allclose(below, below[0, 0, 0], rtol=1e-9)
    assert below[0, 0, 0] == pytest.approx(1 - (0.6 / 2.6) ** 2, abs=0.01)


@pytest.mark.parametrize("point", [PLASTIC, METAL, VARNISHED, GLOSSY, {**VARNISHED, **METAL}])
def test_no_more_light_leaves_than_came(point):
    below = (0.65, 0.7, 0.8) if "glossy" in point else (0.95, 0.9, 0.8)
    lobes = principled_lobes(materials({"albedo": below, **point}))
    for cosine in (1.0, 0.6, 0.25):
        outgoing = np.array([[towards(cosine)]])

        def value(d, outgoing=outgoing):
            brdf = lobes.eval(d[None], outgoing) + lobes.diffuse_eval(d[None], outgoing)
            return brdf[0] * np.maximum(d[:, 2:], 0)

        albedo = integral(value, mirror(outgoing[0, 0]))
        # Tables of albedos are rounded, and a stretched lobe has the factor of a round one.
        assert (albedo > 0.1).all() and (albedo < 1.02).all()


@pytest.mark.parametrize("point", [PLASTIC, METAL, VARNISHED, GLOSSY])
def test_samples_fall_as_densely_as_the_pdf_says(point):
    lobes, outgoing = principled_lobes(materials(point)), towards(0.6)
    p, share = chi_squared(
        lambda uv: lobes.sample(outgoing[None, None], uv[None])[0],
        lambda d: lobes.pdf(d[None], outgoing[None, None])[0],
        mirror(outgoing),
    )
    assert share == pytest.approx(1, abs=2e-3) and p > 1e-3


def test_without_a_tangent_there_is_no_anisotropy():
    round_, lost = (
        principled_lobes(materials({**METAL, **change}))
        for change in ({"anisotropy": 0}, {"tangent": (0, 0, 0)})
    )
    incoming, outgoing = hemisphere(20)[None], UP
    np.testing.assert_array_equal(round_.eval(incoming, outgoing), lost.eval(incoming, outgoing))
    stretched = principled_lobes(materials(METAL)).eval(incoming, outgoing)
    assert np.abs(stretched - lost.eval(incoming, outgoing)).max() > 0.1
    frames = principled_lobes(materials(METAL)).frames(np.array([[0, 0, 1.0]]))
    np.testing.assert_allclose(frames[0, 0], np.array([1, 0.5, 0]) / np.hypot(1, 0.5), atol=1e-12)


def test_half_a_metal_reflects_half_of_white_near_the_horizon():
    base = np.array((0.9, 0.6, 0.2))
    half = materials({
        "metal": base / 2, "stand_in": base / 2, "albedo": base / 2 + base / 2 * 0.96,
        "dielectric": 0.5, "roughness": 0.5,
    })  # fmt: skip
    whole = materials({"metal": base, "stand_in": base, "albedo": base, "roughness": 0.5})
    incoming, outgoing = np.array([[towards(0.05, 3.8)]]), np.array([[towards(0.05)]])
    values = [principled_lobes(m).lobe_eval("metal", incoming, outgoing) for m in (half, whole)]
    np.testing.assert_allclose(values[0], values[1] / 2, rtol=1e-6)


def test_ugly_quantities_give_numbers():
    ugly = [
        {"metal": (1, 1, 1), "roughness": 0}, {"metal": (1e-3, 0, 0), "metal_edge": (0, 0, 0)},
        {"dielectric": 1, "ior": 1}, {"dielectric": 1, "ior": 1000, "tint": (0, 0, 0)},
        {"coat": 1, "coat_ior": 1, "coat_tint": (0, 0, 0), "coat_roughness": 0},
        {"albedo": (0, 0, 0), "dielectric": 1, "tint": (9, 9, 9), "ior": 3, "roughness": 0},
        {"glossy": (3, 0, 1), "anisotropy": 1, "tangent": (0, 0, 1)}, {"opacity": 0},
        {"albedo": (30, 30, 30), "diffuse_roughness": 1, "dielectric": 1, "opacity": 0.5},
    ]  # fmt: skip
    lobes = principled_lobes(materials(*ugly))
    edge = np.float32([[0, 0, 1], [1, 0, 0], [0, 1, 1e-7], [-1, 0, 1e-7], [0, 0, -1]])[None]
    for outgoing in edge[0]:
        view = outgoing[None, None]
        with np.errstate(all="raise", under="ignore"):
            values = [lobes.eval(edge, view), lobes.diffuse_eval(edge, view),
                      lobes.diffuse_weight(view), lobes.pdf(edge, view)]  # fmt: skip
        assert all(np.isfinite(v).all() and v.min() >= 0 for v in values)


def test_no_points_are_no_error():
    none = principled_lobes(SimpleNamespace(**{
        name: np.zeros((0, np.size(value))) for name, value in DEFAULTS.items()
    }))  # fmt: skip
    assert none.lobes == () and none.eval(np.zeros((0, 5, 3)), np.zeros((0, 1, 3))).shape == (
        0,
        5,
        3,
    )


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (
            lambda: principled_lobes(SimpleNamespace(albedo=np.ones((2, 3)))),
            "materials: expected the quantity 'stand_in', which it does not have",
        ),
        (
            lambda: principled_lobes(
                SimpleNamespace(**{**vars(materials({})), "ior": np.ones((2, 1))})
            ),
            "materials.ior: expected an array of shape (1, 1), got (2, 1)",
        ),
        (
            lambda: principled_lobes(materials(PLASTIC, METAL)).eval(np.ones((3, 1, 3)), UP),
            "incoming: expected shape (2, m, 3) or (1, m, 3), got (3, 1, 3)",
        ),
        (
            lambda: principled_lobes(materials(PAPER)).sample(UP, np.ones((1, 1, 2))),
            "materials: no point has a glossy lobe to sample",
        ),
        (
            lambda: principled_lobes(materials(PAPER)).lobe_eval("sheen", UP, UP),
            "name: expected one of metal, dielectric, glossy, coat, diffuse, got 'sheen'",
        ),
    ],
)
def test_wrong_input_is_said_in_a_line(call, line):
    with pytest.raises(PRTError) as error:
        call()
    assert str(error.value) == line
