"""A camera is one value: checked once, kept with a bake as numbers."""

import json

import numpy as np
import pytest

from prt_core import BakeSettings, Camera, PRTError, Scene, bake_steps, load, run
from prt_core.scene import auto_camera, camera_rays
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
