"""Light from behind that leaves the front: closed forms, and all ways to read the transport."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.compress import TransportRows
from prt_core.compress.rows.image_rows import image_rows
from prt_core.reflectance import Materials
from prt_core.runtime.progress import run
from prt_core.scene import Camera, Scene, with_camera_image
from prt_core.transport.sent import Sent
from tests.meshes import caster_of, plane

ALBEDO, THROUGH = (0.3, 0.5, 0.2), (0.7, 0.5, 0.6)


def leaf(name="leaf", through=THROUGH, albedo=ALBEDO, **options):
    mesh = plane(name=name, albedo=albedo, **options)
    shares = np.broadcast_to(np.float64(through), (len(mesh.materials), 3))
    mesh.materials = mesh.materials.replaced(translucency=shares)
    return mesh


def baked(path, meshes, camera=None, **settings):
    scene = Scene.from_meshes(meshes, max_hidden=0)
    if camera is not None:
        scene = with_camera_image(scene, caster_of(scene), camera, 3, 5, 1)
    settings = {"resolution": 8, "tolerance": 0.02, "caster": "auto", **settings}
    run(bake_steps(scene, path / "leaf.prt", BakeSettings(**settings)))
    return load(path / "leaf.prt")


def above(name, z):
    return leaf(name, z=z, n=4, low=-0.8, high=0.8)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two leaves above each other, and what a camera sees of the lower one from below."""
    matrix = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix[2, 3] = -3
    camera = Camera(matrix, 0.2)
    return baked(tmp_path_factory.mktemp("two"), [leaf(n=5), above("second", 0.4)], camera)


def test_a_leaf_shows_what_both_sides_receive(tmp_path):
    bake = baked(tmp_path, [leaf(n=3)])
    assert len(bake.scene.points) == 18
    directions = bake.cube_map.directions
    for side, share in ((1, ALBEDO), (-1, THROUGH)):
        light = np.repeat((directions[:, 2:] * side > 0).astype(np.float32), 3, axis=1)
        seen = bake.transport.radiance(light)[bake.scene.points.visible]
        np.testing.assert_allclose(seen, np.broadcast_to(share, seen.shape), rtol=2e-3)


def test_in_a_white_furnace_what_absorbs_nothing_is_white(tmp_path):
    meshes = [leaf(n=5, through=(0.7, 0.5, 0.8)), above("second", 0.4)]
    meshes[1].materials = Materials(
        albedo=np.full((len(meshes[1].materials), 3), 0.4),
        translucency=np.full((len(meshes[1].materials), 3), 0.6),
    )
    bake = baked(tmp_path, meshes, tolerance=0.005)
    seen = bake.transport.radiance(np.ones((bake.cube_map.n_directions, 3), np.float32))
    np.testing.assert_allclose(seen, 1, atol=0.02)


def test_rows_columns_and_products_are_one_matrix(two):
    transport = two.transport
    assert isinstance(transport.sends, Sent) and isinstance(transport.bounces_by, Sent)
    rng = np.random.default_rng(2)
    light = np.zeros((transport.n_directions, 3), np.float32)
    subset = rng.choice(transport.n_directions, 7, replace=False)
    light[subset] = rng.random((7, 3)).astype(np.float32)
    whole = transport.radiance(light)
    points = np.array([2, 3, 11, 29, transport.n_points - 1])
    rows = transport.rows(points)
    np.testing.assert_allclose(np.einsum("pdc,dc->pc", rows, light), whole[points], atol=2e-4)
    columns = transport.columns(subset)
    np.testing.assert_allclose(np.einsum("pdc,dc->pc", columns, light[subset]), whole, atol=2e-4)
    direct = np.einsum("pdc,dc->pc", transport.rows(points, indirect=False), light)
    np.testing.assert_allclose(direct, transport.radiance(light, bounces=0)[points], atol=1e-5)


def test_rows_for_compressors_have_the_light_of_the_backs(two):
    transport = two.transport
    rng = np.random.default_rng(3)
    light = rng.random((transport.n_directions, 3)).astype(np.float32)
    arrived = transport.product(light)
    rows = TransportRows(transport, rank=64)
    block = rows.block(np.arange(transport.n_points))
    received = np.einsum("pdc,dc->pc", block, light)
    assert np.linalg.norm(received - arrived) < 0.01 * np.linalg.norm(arrived)
    pixels = image_rows(rows, two.scene.image, transport.sends).block(np.arange(15))
    shown = np.einsum("pdc,dc->pc", pixels, light)
    exact = two.image(transport.radiance(light)).reshape(-1, 3)
    assert np.linalg.norm(shown - exact) < 0.01 * np.linalg.norm(exact)


def test_pixels_have_their_other_side(two):
    scene = two.scene
    shown = scene.image.point
    behind = scene.opposite[shown]
    assert (behind >= 0).all() and not np.isin(behind, shown).any()
    np.testing.assert_array_equal(scene.points.positions[shown], scene.points.positions[behind])
    normals = scene.points.normals
    assert np.einsum("px,px->p", normals[shown], normals[behind]).max() < -0.99
    # The adjoint is the transposed map.
    a, b, albedo, through = np.random.default_rng(4).random((4, len(scene.points), 3))
    sends = Sent(albedo, through, two.transport.opposite)
    assert np.isclose((sends(a) * b).sum(), (a * sends.adjoint(b)).sum())
    opaque = replace(two.transport, opposite=None)
    assert opaque.sends is opaque.albedo and opaque.fingerprint() != two.transport.fingerprint()
