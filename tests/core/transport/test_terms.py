import numpy as np
import pytest

from prt_core import PRTError
from prt_core.compress import PCA
from prt_core.compress.rows.term_rows import TermRows
from prt_core.compress.terms import CompressedTerms, fit_terms_steps
from prt_core.reflectance import Lambert, Microfacet, Phong, Sum, in_out_factors
from prt_core.runtime.progress import run
from prt_core.sampling.huang import HuangSettings, sample_huang
from prt_core.sampling.tracer import count_bits
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import View, visibility_bits
from prt_core.transport.dense_gloss import dense_reflection
from prt_core.transport.lobe_samples import LobeSamples
from prt_core.transport.terms import InOutTransport, TermFactor
from prt_core.transport.visibility import unpack
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(12)
HALF_DIFFUSE = Sum([Lambert(0.5), Phong(10, 0.5)])


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6)), plane(13)])


@pytest.fixture(scope="module")
def bits(scene):
    return visibility_bits(scene, CUBE, caster_of(scene), slice(0, len(scene.points)))


@pytest.fixture(scope="module")
def outgoing(scene):
    return View(position=(2, -3, 2)).outgoing(scene.to_world(scene.points.positions))


@pytest.fixture(scope="module")
def factors():
    return in_out_factors(HALF_DIFFUSE, 20)


def lights():
    d = CUBE.directions
    soft = np.stack([1.1 + d[:, 2], 1 + 0.5 * d[:, 0], 1 + 0.8 * d[:, 1]], axis=1)
    return {"soft": soft, "sun": 0.5 + 10 * (d @ [[0.3], [0.5], [0.81]] > 0.95) * np.ones(3)}


def off(result, wanted):
    return np.linalg.norm(result - wanted) / np.linalg.norm(wanted)


def test_what_terms_receive_is_the_sum_over_seen_texels(scene, bits, factors):
    form = InOutTransport(bits, scene.points.normals, CUBE, factors)
    light = lights()["sun"]
    received = form.set_light(light).received
    assert received.shape == (len(bits), 20, 3)
    points = np.array([0, 3, 31, 77, 150])
    for k in (0, 1, 7, 19):
        factor = TermFactor(factors, k, scene.points.normals, CUBE)
        rows = factor(points, slice(None)) * unpack(bits[points], CUBE.n_directions)
        np.testing.assert_allclose(rows @ light, received[points, k], rtol=1e-4, atol=2e-5)
        some = np.tile([5, 400, 77], (5, 1))
        np.testing.assert_array_equal(factor(points, some), factor(points, some[0]))


@pytest.mark.parametrize(
    "lobe, n_terms, most",
    [
        (HALF_DIFFUSE, 4, 0.2),
        (Microfacet(0.36, 0.36), 20, 0.05),
        (Microfacet(0.25, 0.25), 48, 0.05),
    ],
    ids=["Phong 10, half diffuse", "GGX 0.6", "GGX 0.5"],
)
def test_so_many_terms_are_near_the_reflectance(lobe, n_terms, most, scene, bits, outgoing):
    normals = scene.points.normals
    form = InOutTransport(bits, normals, CUBE, in_out_factors(lobe, n_terms))
    less = InOutTransport(bits, normals, CUBE, form.factors.first(2))
    light = lights()["soft"]
    wanted = dense_reflection(bits, normals, CUBE, light, lobe.eval, outgoing)
    result = form.set_light(light).toward(outgoing)
    error = off(result, wanted)
    assert error < most and error < 0.7 * off(less.set_light(light).toward(outgoing), wanted)
    facing = np.einsum("ni,ni->n", normals, outgoing) > 0
    assert (~facing).any() and not result[~facing].any()


def test_narrow_lobes_are_warned_of():
    assert "below 0.45" in in_out_factors(Microfacet(0.16, 0.16), 4).warning
    assert in_out_factors(Microfacet(0.25, 0.25), 4).warning is None


def test_all_components_of_each_term_are_the_terms(scene, bits, outgoing, factors):
    normals, two = scene.points.normals, factors.first(2)
    exact = InOutTransport(bits, normals, CUBE, two)
    whole = run(fit_terms_steps(exact, lambda: PCA(90)))
    part = run(fit_terms_steps(exact, lambda: PCA(6)))
    for light in lights().values():
        wanted = exact.set_light(light).toward(outgoing)
        assert off(whole.set_light(light).toward(outgoing), wanted) < 8e-3
        assert 1e-2 < off(part.set_light(light).toward(outgoing), wanted) < 0.3
    assert part.nbytes < whole.nbytes
    rows = TermRows(bits, CUBE, TermFactor(two, 1, normals, CUBE))
    block = rows.block(np.array([2, 50]))
    np.testing.assert_allclose(block[..., 2], rows.values(np.array([2, 50])), atol=1e-5)
    with pytest.raises(PRTError, match="one for each of 2 terms, got 1"):
        CompressedTerms(exact, part.models[:1])


def test_a_sampler_runs_on_each_term(scene, bits, outgoing, factors):
    normals, caster = scene.points.normals, caster_of(scene)
    settings = HuangSettings(features=60, radius=0.3)
    truth = InOutTransport(bits, normals, CUBE, factors.first(3))
    received = []
    for k in range(3):
        factor = TermFactor(factors, k, normals, CUBE)
        sampled = run(sample_huang(scene, CUBE, caster, settings, factor=factor))
        assert count_bits(sampled.traced) < 0.35 * 8 * bits.size
        # Traced entries are what they are.
        np.testing.assert_array_equal(sampled.bits & sampled.traced, bits & sampled.traced)
        one = InOutTransport(sampled.bits, normals, CUBE, factors.only(k))
        received.append(one.set_light(lights()["soft"]).received)
    wanted = truth.set_light(lights()["soft"]).toward(outgoing)
    result = truth.receive(np.concatenate(received, axis=1)).toward(outgoing)
    assert off(result, wanted) < 0.06
    with pytest.raises(PRTError, match="factor: expected a function"):
        bad = HuangSettings(quantity="visibility")
        run(sample_huang(scene, CUBE, caster, bad, factor=factor))


def test_more_samples_of_lobes_are_nearer(scene, bits, outgoing):
    normals, lobe = scene.points.normals, Microfacet(0.25, 0.25)
    light = lights()["soft"]
    wanted = dense_reflection(bits, normals, CUBE, light, lobe.eval, outgoing)
    errors = [
        off(LobeSamples(bits, normals, CUBE, lobe, power).set_light(light).toward(outgoing), wanted)
        for power in (2, 5, 8)
    ]
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.05


def test_bad_input_is_said(scene, bits, factors, outgoing):
    normals = scene.points.normals
    form = InOutTransport(bits, normals, CUBE, factors)
    with pytest.raises(PRTError, match="light: none is set"):
        form.toward(outgoing)
    with pytest.raises(PRTError, match="normals: expected"):
        InOutTransport(bits, normals[1:], CUBE, factors)
    with pytest.raises(PRTError, match="factors: expected"):
        InOutTransport(bits, normals, CUBE, HALF_DIFFUSE)
    with pytest.raises(PRTError, match="k: expected"):
        TermFactor(factors, 20, normals, CUBE)
    with pytest.raises(PRTError, match="light: none is set"):
        LobeSamples(bits, normals, CUBE, HALF_DIFFUSE).toward(outgoing)
