"""Pixels as bake points: where they lie, what they show, and that they survive the store."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.load import load
from prt_core.basis import ImageWavelet
from prt_core.compress import ImageRows, TransportRows, Wavelet4D
from prt_core.evaluate.view import CameraRays
from prt_core.rays import BruteForceCaster
from prt_core.reflectance import Materials
from prt_core.runtime.progress import run
from prt_core.scene import Camera, Scene, geometry_layout, with_camera_image, with_geometry_image
from tests.meshes import caster_of, plane, sphere


def camera(height, tangent):
    """Looks straight down."""
    matrix = np.eye(4)
    matrix[2, 3] = height
    return Camera(matrix, tangent)


def with_uv(mesh, scale=1.0):
    """Texture coordinates from x and y in -1..1."""
    uv = (mesh.vertices[mesh.corner_vertex][:, :2] * scale + 1) / 2
    return replace(mesh, corner_uv=uv)


def test_pixels_lie_where_the_camera_looks_and_edges_are_shares():
    scene = Scene.from_meshes([plane(3)])
    n = len(scene.points)
    # Sees x and y from -2 to 2: the plane is the middle of the picture.
    result = with_camera_image(scene, caster_of(scene), camera(4.0, 0.5), 10, 10, 2)
    image = result.image
    world = result.to_world(result.points.positions[image.point])
    row, column = np.divmod(image.pixel, 10)
    assert np.abs(world[:, 2]).max() < 1e-6
    assert np.abs(world[:, 0] - (column + 0.5 - 5) * 0.4).max() < 0.21
    assert np.abs(world[:, 1] - (5 - row - 0.5) * 0.4).max() < 0.21
    np.testing.assert_allclose(result.points.normals[n:], [[0, 0, 1]] * (len(result.points) - n))
    white = image.pixels(np.ones((len(result.points), 1), np.float32))[..., 0]
    assert white[5, 5] == 1 and white[0, 0] == 0 and white[2, 5] == 0.5
    # The points of the meshes are what they were.
    np.testing.assert_array_equal(result.points.positions[:n], scene.points.positions)
    assert result.fingerprint() != scene.fingerprint()


@pytest.mark.parametrize("two_sided", [False, True])
def test_pixels_that_see_backs_show_the_light_of_the_backs(two_sided):
    matrix = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix[2, 3] = -4
    scene = Scene.from_meshes([plane(3, two_sided=two_sided)])
    image = with_camera_image(scene, caster_of(scene), Camera(matrix, 0.2), 4, 4)
    points = image.image.point
    assert len(points) == 4 * 16
    for normals in (image.points.normals, image.points.geometric_normals, image.points.ray_offset):
        assert (normals[points][:, 2] < 0).all()
    np.testing.assert_allclose(image.points.normals[points], [[0, 0, -1]] * len(points))


def test_texels_cover_the_layout_and_what_is_beside_it():
    mesh = with_uv(plane(4), scale=0.5)
    scene = Scene.from_meshes([sphere(4, 0.3, (0, 0, 2), name="ball"), mesh])
    layout = geometry_layout(mesh)
    caster = BruteForceCaster(layout.vertices, layout.triangles)
    result = with_geometry_image(scene, caster, layout, 8)
    image = result.image
    assert (image.pixel == np.arange(64)).all()
    world = result.to_world(result.points.positions[image.point]).reshape(8, 8, 3)
    # A quarter of the image is the plane, upside up; the rest shows the nearest texel of it.
    assert len(result.points) - len(scene.points) == 16
    np.testing.assert_allclose(world[2, 2], [-0.75, 0.75, 0], atol=1e-5)
    np.testing.assert_allclose(world[5, 2], [-0.75, -0.75, 0], atol=1e-5)
    np.testing.assert_allclose(world[0, 0], world[2, 2])
    assert (result.points.object_index[len(scene.points) :] == 1).all()
    with pytest.raises(PRTError, match="UV map"):
        geometry_layout(plane(), "uv")


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    meshes = [sphere(10, 0.4, (0, 0, 0.5), name="ball", albedo=(0.8, 0.4, 0.2)), plane(13)]
    scene = Scene.from_meshes(meshes)
    steps = image_steps(scene, meshes, camera(4.0, 0.2), "auto", ImageSettings((16, 12)))
    path = tmp_path_factory.mktemp("bake") / "image.prt"
    scene = run(steps)
    run(bake_steps(scene, path, BakeSettings(resolution=8, caster="auto", tolerance=0.05)))
    return load(path)


def sky(bake):
    up = bake.cube_map.directions[:, 2:]
    return (1 + 0.5 * up * [1, 0.8, 0.6] + np.eye(384)[100, :, None] * 30).astype(np.float32)


def test_the_image_of_a_bake_is_what_its_camera_sees(bake):
    assert bake.scene.image is not None and "image of 16 x 12" in " ".join(bake.report["messages"])
    radiance = bake.transport.radiance(sky(bake))
    result = bake.image(radiance)
    caster = caster_of(bake.scene)
    truth = CameraRays(bake.scene, caster, camera(4.0, 0.2), 16, 12, 2).picture(radiance)
    assert result.shape == (12, 16, 3)
    assert np.linalg.norm(result - truth) < 0.05 * np.linalg.norm(truth)
    with pytest.raises(PRTError, match="holds none"):
        replace(bake, scene=replace(bake.scene, image=None)).image(radiance)


def test_rows_of_pixels_are_compressed_as_an_image(bake):
    rows = ImageRows(TransportRows(bake.transport, 200), bake.scene.image, bake.transport.albedo)
    light = sky(bake)
    truth = bake.image(bake.transport.radiance(light)).reshape(-1, 3)
    subset = np.array([0, 5, 100, 191])
    result = np.einsum("pdc,dc->pc", rows.block(subset), light)
    np.testing.assert_allclose(result, truth[subset], rtol=5e-3, atol=5e-3)
    model = Wavelet4D(ImageWavelet((12, 16), "5/3"), error=0.02).fit(rows)
    assert model.matrix_error_ <= 0.02 and model.depths_.max() > 0
    assert np.linalg.norm(model.product(light) - truth) < 0.02 * np.linalg.norm(truth)


def test_wrong_images_are_refused():
    meshes = [plane()]
    scene = Scene.from_meshes(meshes)
    for arguments, message in (
        ((camera(4, 0.2), (4, 4), 2, ("plane", 4)), "not both"),
        ((None, (4, 4), 2, None), "no camera whose lens is followed"),
        ((None, None, 2, ("sphere", 4)), "no object"),
        ((camera(4, 0.2), (4, 0), 2, None), "pixels"),
        ((camera(4, 0.2), (4, 4), 0, None), "pixel samples"),
    ):
        with pytest.raises(PRTError, match=message):
            seen_from, *asked = arguments
            run(image_steps(scene, meshes, seen_from, "auto", ImageSettings(*asked)))
    assert run(image_steps(scene, meshes, None, "auto", ImageSettings())) is scene


def test_what_lets_light_pass_shows_all_of_its_own_by_the_rays_that_end_at_it():
    pane = plane(3)
    ones = np.ones((len(pane.corner_vertex), 1))
    pane = replace(pane, materials=Materials(albedo=0.3 * ones[:, [0] * 3], opacity=ones / 2))
    scene, look = Scene.from_meshes([pane]), camera(4.0, 0.1)
    caster = scene.make_caster("brute", "camera", 8)
    rays = CameraRays(scene, caster, look, 16, 16, 3)
    ended = (rays.triangle >= 0).mean()
    assert 0.4 < ended < 0.6
    sent = scene.points.materials.albedo
    # Half of the rays end at the pane; it sends 0.3 of all light, and is black behind.
    assert rays.picture(sent).mean() == pytest.approx(0.3 * ended / 0.5, rel=1e-4)
    assert rays.picture(sent, whole=True).mean() == pytest.approx(0.3 * ended, rel=1e-4)
    image = with_camera_image(scene, caster, look, 16, 16, 3)
    shown = image.image.pixels(image.points.materials.front)
    np.testing.assert_allclose(shown, rays.picture(sent), atol=1e-3)
