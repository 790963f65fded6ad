"""A camera is one value: checked once, kept with a bake as numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Camera, PRTError, Scene, bake_steps, load, run
from prt_core.evaluate.view import CameraRays
from prt_core.scene import auto_camera, camera_rays, view_rays
from tests.meshes import plane, sphere

# Looks along +x, with +z up, from (5, 2, 3); its axes are as long as 2, 3 and 7.
MATRIX = np.array([[0, 0, -7.0, 5], [-2, 0, 0, 2], [0, 3, 0, 3], [0, 0, 0, 1]])


def test_a_camera_knows_where_it_stands_and_looks():
    camera = Camera(MATRIX.tolist(), 0.5)
    np.testing.assert_array_equal(camera.position, [5, 2, 3])
    np.testing.assert_array_equal(camera.axes, [[0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    middle = camera_rays(camera, 3, 5, 1)[7]
    np.testing.assert_allclose(middle, [1, 0, 0], atol=1e-15)
    left, right = camera_rays(camera, 5, 1, 1)[[0, 4]]
    np.testing.assert_allclose(left[1] / left[0], 0.5 * 4 / 5)
    np.testing.assert_allclose(right, left * [1, -1, 1])


def test_cameras_are_equal_by_value_and_kept_as_numbers():
    camera = Camera(MATRIX, 0.5)
    assert Camera(**json.loads(json.dumps(camera.to_dict()))) == camera
    assert Camera(MATRIX, 0.25) != camera != Camera(MATRIX + np.eye(4), 0.5)
    assert camera != camera.to_dict()


LENSES = [
    Camera(MATRIX, 0.5, "orthographic", "vertical", (0.1, -0.2), (1, 2), (0.5, 7)),
    Camera(MATRIX, 1, "equirectangular", panorama=(-1, 2, -0.5, 1), frame=(300, 700)),
    Camera(MATRIX, 1, "equisolid", fisheye=(2.5, 9, 36, 20)),
]


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.lens)
def test_lenses_are_kept_as_numbers(camera):
    kept = Camera(**json.loads(json.dumps(camera.to_dict())))
    assert kept == camera and kept.clip == camera.clip and kept.frame == camera.frame


def straight(**settings):
    return Camera(np.eye(4), 0.5, **settings)


def test_the_sensor_fits_the_side_that_is_named():
    # Half the angle has the tangent 0.5 along that side.
    for fit, (width, height), aspect, (right, up) in (
        ("auto", (8, 4), (1, 1), (0.5, 0.25)),
        ("auto", (4, 8), (1, 1), (0.25, 0.5)),
        ("auto", (4, 6), (2, 1), (0.5, 0.375)),
        ("horizontal", (4, 8), (1, 1), (0.5, 1.0)),
        ("vertical", (8, 4), (1, 3), (1 / 3, 0.5)),
    ):
        camera = straight(sensor_fit=fit, pixel_aspect=aspect)
        ways = view_rays(camera, width, height, 1).directions
        corner = ways[width - 1] / -ways[width - 1, 2]
        edges = right * (1 - 1 / width), up * (1 - 1 / height)
        np.testing.assert_allclose(corner[:2], edges, rtol=1e-12, err_msg=fit)


def test_a_shift_is_in_lengths_of_that_side():
    middle = view_rays(straight(shift=(0.3, -0.1)), 5, 3, 1).directions[7]
    np.testing.assert_allclose(middle / -middle[2], [0.3, -0.1, -1])
    up = view_rays(straight(shift=(0.3, -0.1), sensor_fit="vertical"), 5, 3, 1).directions[7]
    np.testing.assert_allclose(up / -up[2], [0.3, -0.1, -1])


def test_clipping_is_by_depth():
    camera = straight(clip=(2, 5))
    rays = view_rays(camera, 7, 3, 1)
    np.testing.assert_allclose(rays.origins[:, 2], -2)
    ends = rays.origins + rays.directions * rays.lengths[:, None]
    np.testing.assert_allclose(ends[:, 2], -5)
    panorama = view_rays(straight(lens="equirectangular", clip=(2, 5)), 7, 3, 1)
    np.testing.assert_allclose(np.linalg.norm(panorama.origins, axis=1), 2)
    np.testing.assert_allclose(panorama.lengths, 3)


def test_an_orthographic_lens_looks_along_one_way():
    rays = view_rays(straight(lens="orthographic", clip=(1, 4)), 4, 2, 1)
    np.testing.assert_array_equal(rays.directions, np.tile([[0, 0, -1.0]], (8, 1)))
    np.testing.assert_allclose(rays.origins[0], [-0.375, 0.125, -1])
    np.testing.assert_allclose(rays.lengths, 3)


def test_panoramas_see_around():
    ways = view_rays(straight(lens="equirectangular"), 4, 2, 1).directions
    half = np.sqrt(0.5)
    # From behind on the left over straight ahead to behind on the right.
    np.testing.assert_allclose(ways[0], [-0.5, half, 0.5], atol=1e-12)
    np.testing.assert_allclose(ways[6], [0.5, -half, -0.5], atol=1e-12)
    for lens, away in (("equidistant", 0.6), ("equisolid", 2 * np.arcsin(0.3))):
        camera = straight(lens=lens, fisheye=(2.0, 10, 20, 30))
        rays = view_rays(camera, 5, 5, 1)
        np.testing.assert_allclose(rays.directions[12], [0, 0, -1], atol=1e-12)
        # Three fifths to the right of the middle: six of a sensor's half width of ten.
        right = view_rays(camera, 10, 10, 1).directions[58]
        assert right[0] > 0 and abs(right[1]) < 0.2
        x = view_rays(replace(camera, shift=(0.3, 0)), 5, 5, 1).directions[12]
        np.testing.assert_allclose(x, [np.sin(away), 0, -np.cos(away)], atol=1e-12)
        assert rays.lengths[0] < 0 < rays.lengths[12]


def test_pictures_end_at_the_clips_and_at_a_fisheyes_disc():
    scene = Scene.from_meshes(
        [plane(2, -9, 9, name="near", z=-1), plane(2, -9, 9, name="far", z=-4)]
    )
    caster = scene.make_caster("brute")

    def seen(**settings):
        rays = CameraRays(scene, caster, straight(**settings), 4, 4, 1)
        sky = rays.picture(np.ones((len(scene.points), 3), np.float32), lambda d: d * 0 + 5)
        index = scene.points.object_index[np.maximum(rays.points[:, 0], 0)]
        return [scene.objects[i].name for i in np.unique(index[rays.hit])], np.unique(sky[..., 0])

    assert seen()[0] == ["near"]
    assert seen(clip=(2, 9))[0] == ["far"]
    assert seen(clip=(0.1, 0.5)) == ([], [5])
    names, values = seen(lens="equidistant", fisheye=(1.0, 1, 1, 1))
    assert names == ["near"] and values.tolist() == [0, 1]


def test_a_bake_keeps_its_camera(tmp_path):
    scene, camera = Scene.from_meshes([plane(2)], max_hidden=0), Camera(MATRIX, 0.5)
    settings = BakeSettings(resolution=2, bounces=0, caster="brute")
    run(bake_steps(scene, tmp_path / "a.prt", settings, camera=camera))
    assert load(tmp_path / "a.prt").camera == camera


def test_a_dict_is_a_camera_for_one_release():
    with pytest.warns(DeprecationWarning, match="a dict is a Camera"):
        rays = camera_rays({"matrix": MATRIX.tolist(), "tangent": 0.5}, 3, 2, 1)
    np.testing.assert_array_equal(rays, camera_rays(Camera(MATRIX, 0.5), 3, 2, 1))
    with pytest.raises(PRTError, match="camera: expected a Camera, got"):
        camera_rays({"matrix": MATRIX.tolist()}, 3, 2, 1)


def test_the_camera_of_its_own_sees_the_whole_scene():
    scene = Scene.from_meshes([sphere(5, 30.0, (100, 7, -20))], max_hidden=0)
    camera = auto_camera(scene)
    local = (scene.to_world(scene.vertices) - camera.position) @ camera.axes
    assert (np.abs(local[:, :2]) < -camera.tangent * local[:, 2:]).all()


@pytest.mark.parametrize(
    ("matrix", "tangent", "message"),
    [
        (np.eye(3), 1, "camera: matrix: expected an array of shape"),
        (np.diag([1, 0, 1, 1]), 1, "axes have a length; a scale of 0 has none"),
        (np.eye(4), 0, "camera: tangent: expected a number above 0"),
    ],
)
def test_what_is_no_camera_is_said(matrix, tangent, message):
    with pytest.raises(PRTError, match=message):
        Camera(matrix, tangent)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"lens": "wide"}, "camera: lens: expected one of"),
        ({"sensor_fit": "both"}, "camera: sensor_fit: expected one of"),
        ({"clip": (3, 2)}, "camera: clip: expected a number above 3"),
        ({"clip": 3}, "camera: clip: expected two numbers"),
        ({"shift": (1, 2, 3)}, "camera: shift: expected an array of shape"),
        ({"pixel_aspect": (1, 0)}, "camera: pixel_aspect: expected numbers above 0"),
    ],
)
def test_what_is_no_lens_is_said(settings, message):
    with pytest.raises(PRTError, match=message):
        straight(**settings)
