"""An image's pixels are chosen for, compressed and measured as an image."""

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.measure import standing_lights
from prt_core.compress import Task, method_from_text
from prt_core.relight import Relighter
from prt_core.scene import Camera
from tests.meshes import plane, sphere

SKY = standing_lights()["low soft sun"]
HEIGHT, WIDTH = 12, 20


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    meshes = [sphere(8, 0.4, (0, 0, 0.5), name="ball", albedo=(0.8, 0.4, 0.2)), plane(11)]
    matrix = np.diag([1.0, 1, 1, 1])
    matrix[2, 3] = 4.0
    image = ImageSettings(camera_pixels=(WIDTH, HEIGHT))
    scene = Scene.from_meshes(meshes)
    scene = run(image_steps(scene, meshes, Camera(matrix, 0.2), "auto", image))
    path = tmp_path_factory.mktemp("image") / "a.prt"
    run(bake_steps(scene, path, BakeSettings(resolution=4, tolerance=0.05)))
    return path


def test_the_task_of_an_image_is_its_pixels(path):
    bake = load(path)
    task = Task.of_image(bake.transport, bake.scene.image, 5)
    assert task.n_points == HEIGHT * WIDTH and task.seed == 5 and task.subject.read_bits is None
    np.testing.assert_array_equal(task.positions[WIDTH + 2], [2, 1, 0])
    light = SKY.to_cube_map(bake.cube_map, 20)
    wanted = bake.image(bake.transport.radiance(light)).reshape(-1, 3)
    result = task.colours({"a": light, "grey": np.ones_like(light)})
    np.testing.assert_allclose(result["a"], wanted, rtol=1e-5, atol=1e-6)
    wanted = bake.image(bake.transport.radiance(np.ones_like(light))).reshape(-1, 3)
    np.testing.assert_allclose(result["grey"], wanted, rtol=1e-5, atol=1e-6)
    subset = np.array([3, 70, 111])
    part = task.some(subset)
    np.testing.assert_array_equal(part.rows.features(np.arange(3)), task.rows.features(subset))


def test_an_image_is_first_tried_in_4d_wavelets(path):
    attributes = compress(path, tolerance=0.1, lights={"sky": SKY})
    assert attributes["of"] == "image" and attributes["method"] == "wavelet4d"
    assert {trial["method"] for trial in attributes["trials"]} == {"wavelet4d"}
    assert attributes["settings"]["columns"] == "9/7" and attributes["tolerance_met"]
    relighter = Relighter(load(path))
    exact = Relighter(load(path), form="exact")
    for rotation in (65, 305):
        result = relighter.radiance(SKY, rotation=rotation, of="image")
        assert relighter.used == "compressed" and result.shape == (HEIGHT, WIDTH, 3)
        wanted = exact.radiance(SKY, rotation=rotation, of="image")
        assert 0 < np.linalg.norm(result - wanted) <= 0.2 * np.linalg.norm(wanted)
    twice = relighter.radiance(SKY, rotation=305, of="image", strength=2)
    np.testing.assert_allclose(twice, 2 * result, rtol=1e-6)
    # What is asked of the points is exact, and so is the image of other bounces.
    points = relighter.radiance(SKY)
    assert relighter.used == "exact" and "it is of the image" in relighter.why
    np.testing.assert_array_equal(points, exact.radiance(SKY))
    relighter.radiance(SKY, bounces=0, of="image")
    assert relighter.used == "exact"
    # A form that changed its image is not used.
    bake = load(path)
    bake.scene.image.pixel[:1] += 1
    other = Relighter(bake)
    other.radiance(SKY, of="image")
    assert other.used == "exact" and "another state of the bake" in other.why


METHODS = (
    "block_pca",
    "block_pca:size=7,n_components=9",
    "wavelet4d:columns=5/3,error=0.05",
    "wavelet4d:columns=d4,rows=d4,error=0.05",
    "pca:n_components=20",
)


@pytest.mark.parametrize("method", METHODS)
def test_methods_of_images(path, method):
    attributes = compress(path, method=method, tolerance=0.3, lights={"sky": SKY})
    assert attributes["of"] == "image" and attributes["tolerance_met"], attributes["error"]
    exact = Relighter(load(path), form="exact").radiance(SKY, rotation=65, of="image")
    result = Relighter(load(path), form="compressed").radiance(SKY, rotation=65, of="image")
    error = np.linalg.norm(result - exact) / np.linalg.norm(exact)
    assert 0 < error <= attributes["worst"] * 1.001


def test_columns_of_points_are_not_those_of_an_image(path):
    bake = load(path)
    task = Task.of_image(bake.transport, bake.scene.image)
    with pytest.raises(PRTError, match="expected one of haar, d4, .* for an image, got 'multiw"):
        method_from_text("wavelet4d:columns=multiwavelet").budgets(task)


def test_a_form_of_points_shows_the_image_as_well(path):
    attributes = compress(path, method="pca:n_components=20", tolerance=0.3, lights={"sky": SKY},
                     of="points")  # fmt: skip
    assert attributes["of"] == "points"
    bake, lamps = load(path), [Lamp("point", (300.0, 200, 100), (1.0, 1, 2))]
    for more in ({}, {"lamps": lamps, "exposure": 1.5}):
        relighter = Relighter(bake, form="compressed")
        points = relighter.radiance(SKY, rotation=65, **more)
        result = relighter.radiance(SKY, rotation=65, of="image", **more)
        np.testing.assert_allclose(result, bake.image(points), rtol=1e-5, atol=1e-6)


def test_lamps_are_added_to_a_compressed_image(path):
    compress(path, method="wavelet4d:error=0.02", tolerance=0.3, lights={"sky": SKY})
    bake, lamps = load(path), [Lamp("point", (300.0, 200, 100), (1.0, 1, 2))]
    relighter, exact = Relighter(bake, form="compressed"), Relighter(bake, form="exact")
    sky = relighter.radiance(SKY, of="image")
    both = relighter.radiance(SKY, lamps=lamps, of="image", exposure=1.0)
    assert relighter.used == "compressed"
    added = exact.radiance(lamps=lamps, of="image")
    assert added.max() > 0.1 * sky.max()
    np.testing.assert_allclose(both, 2 * (sky + added), rtol=1e-4, atol=1e-5)
