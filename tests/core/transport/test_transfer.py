import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import harmonics
from prt_core.compress import ClusteredPCA
from prt_core.compress.transfer import CompressedTransfer
from prt_core.evaluate import colour_error
from prt_core.reflectance import Lambert, Phong
from prt_core.reflectance.harmonic import HarmonicReflectance
from prt_core.scene import Scene
from prt_core.sphere import CubeMap, tangent_frames
from prt_core.transport import (
    Transport,
    View,
    gather_directions,
    gather_hits,
    gather_operator,
    visibility_bits,
)
from prt_core.transport.dense_gloss import dense_reflection
from prt_core.transport.transfer import (
    TransferMatrices,
    interreflected_transfer,
    negative_share,
    sent_harmonics,
    shadowed_transfer,
    unshadowed_transfer,
)
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(16)
ORDER = 5


def sky():
    d = CUBE.directions
    return np.stack([1.1 + d[:, 2], 1 + 0.5 * np.sin(3 * d[:, 0]), 1 + 0.8 * d[:, 1]], axis=1)


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6), albedo=0.7), plane(9, albedo=0.6)])


@pytest.fixture(scope="module")
def transport(scene):
    caster, every = caster_of(scene), slice(0, len(scene.points))
    bits = visibility_bits(scene, CUBE, caster, every)
    hits = [gather_hits(scene, caster, every, 0, r).hits for r in range(4)]
    gather = gather_operator(np.concatenate(hits, axis=1), len(scene.points))
    return Transport(CUBE, bits, gather, scene.points.normals, scene.points.albedo)


@pytest.fixture(scope="module")
def outgoing(scene):
    return View(position=(2, -3, 2)).outgoing(scene.to_world(scene.points.positions))


def test_unshadowed_light_is_turned_into_the_frame():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(7, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = rng.normal(size=ORDER**2)
    local = harmonics(CUBE.directions, ORDER) @ (unshadowed_transfer(normals)[:, 0] @ light).T
    for column, frame in zip(local.T, tangent_frames(normals), strict=True):
        there = harmonics(CUBE.directions @ frame, ORDER) @ light
        np.testing.assert_allclose(column, there, atol=1e-5)


def test_shadowed_light_is_the_sum_over_what_is_seen():
    rng = np.random.default_rng(1)
    normals = np.array([[0, 0, 1.0], [0.6, 0, -0.8]])
    seen = rng.random((2, CUBE.n_directions)) < 0.4
    bits = np.packbits(seen, axis=1, bitorder="little")
    fine = CubeMap(64)
    whole = seen.reshape(2, 6, 16, 1, 16, 1).repeat(4, axis=3).repeat(4, axis=5).reshape(2, -1)
    result = shadowed_transfer(bits, normals, CUBE)
    for matrix, row, frame in zip(result[:, 0], whole, tangent_frames(normals), strict=True):
        local = harmonics(fine.directions @ frame.T, ORDER)
        weight = (row * fine.solid_angles)[:, None]
        wanted = local.T @ (weight * harmonics(fine.directions, ORDER))
        np.testing.assert_allclose(matrix, wanted, atol=2e-3)


def test_light_from_all_around_arrives_as_it_leaves(scene):
    """Every ray meets something that sends the first harmonic: what arrives is constant above."""
    caster, every = caster_of(scene), slice(0, len(scene.points))
    n = len(scene.points)
    normals = scene.points.normals
    transport = Transport(
        CUBE, np.zeros((n, CUBE.n_directions // 8), np.uint8), None, normals, scene.points.albedo
    )
    hits = np.zeros((n, 256), np.int32)
    directions = [gather_directions(scene, every, 0, r) for r in range(8)]
    sent = np.zeros((n, 3, ORDER**2), np.float32)
    sent[:, :, 0] = 2
    matrices = interreflected_transfer(
        transport, hits, np.concatenate(directions, axis=1), every, sent=sent
    )
    fine = CubeMap(64)
    above = fine.directions[:, 2] > 0
    wanted = 2 * fine.solid_angles[above] @ harmonics(fine.directions[above], ORDER)
    mean = matrices[:, 0, :, 0].mean(axis=0)
    np.testing.assert_allclose(mean, wanted, atol=0.03 * wanted[0])
    assert not matrices[:, :, :, 1:].any()
    assert caster.name


def test_diffuse_surfaces_see_what_the_bounces_bring(scene, transport):
    """A white diffuse lobe of the transferred light is what a point receives, all bounces in."""
    caster, every = caster_of(scene), slice(0, len(scene.points))
    rounds = [gather_hits(scene, caster, every, 0, r).hits for r in range(4)]
    directions = [gather_directions(scene, every, 0, r) for r in range(4)]
    sent = sent_harmonics(transport)
    matrices = shadowed_transfer(transport.bits, transport.normals, CUBE)
    matrices = matrices + interreflected_transfer(
        transport, np.concatenate(rounds, axis=1), np.concatenate(directions, axis=1), every,
        sent=sent,
    )  # fmt: skip
    diffuse = HarmonicReflectance(Lambert(1.0).eval)
    form = TransferMatrices(matrices, transport.normals, CUBE, diffuse).set_light(sky())
    wanted = transport.product(sky().astype(np.float32))
    assert colour_error(form.toward(transport.normals), wanted)["l2"] < 0.02
    # The transfer vectors of the diffuse surfaces themselves.
    light = form.project(sky())
    radiance = np.einsum("ncl,lc->nc", sent, light)
    assert colour_error(radiance, transport.radiance(sky().astype(np.float32)))["l2"] < 0.02


@pytest.mark.parametrize("exponent, most", [(5, 0.008), (10, 0.03), (50, 0.12)])
def test_wide_lobes_are_near_the_dense_sum(transport, outgoing, exponent, most):
    lobe = Phong(exponent).eval
    parts = transport.bits, transport.normals, CUBE
    wanted = dense_reflection(*parts, sky(), lobe, outgoing)
    form = TransferMatrices.from_transport(transport, HarmonicReflectance(lobe))
    error = colour_error(form.set_light(sky()).toward(outgoing), wanted)["l2"]
    assert most / 4 < error < most


def test_hard_light_makes_rings(transport, outgoing):
    light = np.zeros((CUBE.n_directions, 3))
    light[CUBE.texel_of([[0.3, 0.5, 0.8]])] = 100
    form = TransferMatrices.from_transport(transport, HarmonicReflectance(Phong(10).eval))
    assert negative_share(form.set_light(light).toward(outgoing)) > 0.2
    assert negative_share(np.ones((3, 3))) == 0


def test_clusters_hold_the_matrices(transport, outgoing):
    lobe = HarmonicReflectance(Phong(5).eval)
    whole = TransferMatrices.from_transport(transport, lobe).set_light(sky())
    wanted = whole.toward(outgoing)
    errors = []
    for n_components in (4, 16, 200):
        model = ClusteredPCA(n_clusters=3, n_components=n_components)
        form = CompressedTransfer(whole, model).set_light(sky())
        errors.append(colour_error(form.toward(outgoing), wanted)["l2"])
    assert errors[2] < 2e-4 < errors[1] < 0.03 < errors[0] < 0.2


def test_matrices_of_each_channel_are_compressed_alike(transport, outgoing):
    lobe = HarmonicReflectance(Phong(5).eval)
    matrices = shadowed_transfer(transport.bits, transport.normals, CUBE)
    colours = matrices * np.array([1, 0.5, 2], np.float32).reshape(1, 3, 1, 1)
    whole = TransferMatrices(colours, transport.normals, CUBE, lobe).set_light(sky())
    form = CompressedTransfer(whole, ClusteredPCA(2, 160)).set_light(sky())
    np.testing.assert_allclose(form.toward(outgoing), whole.toward(outgoing), atol=2e-3)
    single = TransferMatrices(matrices, transport.normals, CUBE, lobe).set_light(sky())
    ratio = whole.toward(outgoing) - single.toward(outgoing) * [1, 0.5, 2]
    assert np.abs(ratio).max() < 1e-5


def test_what_does_not_fit_is_said(transport, outgoing):
    lobe = HarmonicReflectance(Phong(5).eval, 4)
    with pytest.raises(PRTError, match=r"matrices: expected an array of shape \(n, n, 16, 16\)"):
        TransferMatrices(np.zeros((3, 1, 25, 25)), np.eye(3), CUBE, lobe)
    form = TransferMatrices.from_transport(transport, lobe)
    with pytest.raises(PRTError, match="light: none is set"):
        form.toward(outgoing)
    with pytest.raises(PRTError, match=r"light: expected an array of shape \(1536, n\)"):
        form.set_light(np.ones((5, 3)))
