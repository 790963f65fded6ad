"""A camera's image of a bake with gloss: its view is baked in, and its rows are compressed."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.measure import standing_lights
from prt_core.cli import main
from prt_core.compress.rows import TransportRows
from prt_core.compress.rows.view_rows import ViewRows
from prt_core.light import read_image, write_image
from prt_core.rays.caster import known_casters
from prt_core.relight.fixed_view import FixedView
from prt_core.relight.relighter import Relighter
from prt_core.scene import Camera
from prt_core.transport import View
from tests.meshes import plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"
SKY = standing_lights()["low soft sun"]
GOLD = np.float32([1, 0.7, 0.3])
SIZE = WIDTH, HEIGHT = 20, 12


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


def camera(eye, target, tangent):
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(back, right), back, eye])
    return Camera(matrix, tangent)


def baked(path, meshes, seen_by, samples=1, **settings):
    scene = Scene.from_meshes(meshes, max_hidden=0)
    image = ImageSettings(camera_pixels=SIZE, pixel_samples=samples)
    scene = run(image_steps(scene, meshes, seen_by, CASTER, image))
    settings = {"resolution": 16, "caster": CASTER, "gloss": True, **settings}
    run(bake_steps(scene, path, BakeSettings(**settings)))
    return load(path)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("fixed") / "a.prt"
    floor = of(plane(12, name="floor"), dielectric=1.0, roughness=0.5)
    ball = of(sphere(14, 0.4, (0, 0, 0.5)), metal=GOLD, stand_in=0.5 * GOLD, roughness=0.4)
    baked(path, [floor, ball], camera((0.3, -3.0, 1.2), (0, 0, 0.3), 0.3))
    return path


def off(values, truth):
    return np.linalg.norm(values - truth) / np.linalg.norm(truth)


def test_rows_are_what_relighting_for_the_camera_gives(path):
    bake = load(path)
    light = SKY.to_cube_map(bake.cube_map, 20)
    relighter = Relighter(bake, CASTER)
    exact = relighter.radiance(light, of="image")
    assert exact.shape == (HEIGHT, WIDTH, 3)
    rows = ViewRows(TransportRows(bake.transport), bake.scene.image, FixedView(bake).weights())
    result = rows.product(light).reshape(exact.shape)
    assert off(result, exact) < 0.02
    # It is gloss that they show, of their own points from where the camera stands.
    assert off(bake.image(relighter.radiance(light)), exact) > 0.2
    points = relighter.radiance(light, view=View.of_camera(bake.scene.image.camera))
    np.testing.assert_allclose(bake.image(points), exact, rtol=1e-4, atol=1e-5)
    # Single texels are as good: none is lost or counted twice.
    texels = np.random.default_rng(3).choice(bake.cube_map.n_directions, 4, replace=False)
    few = np.zeros_like(light)
    few[texels] = 1
    alone = sum(rows.product(np.eye(len(light), dtype=np.float32)[[t] * 3].T) for t in texels)
    np.testing.assert_allclose(rows.product(few), alone, rtol=1e-4, atol=1e-6)


def test_metal_is_seen_in_metal(tmp_path):
    floor = of(plane(12, name="floor"), metal=GOLD, stand_in=0.5 * GOLD, roughness=0.5)
    ball = of(sphere(14, 0.4, (0, 0, 0.5)), metal=GOLD, stand_in=0.5 * GOLD, roughness=0.4)
    bake = baked(tmp_path / "a.prt", [floor, ball], camera((0.3, -3.0, 0.4), (0, 0, 0.3), 0.3))
    light = SKY.to_cube_map(bake.cube_map, 20)
    exact = Relighter(bake, CASTER).radiance(light, of="image")
    view = FixedView(bake).weights()
    rows = ViewRows(TransportRows(bake.transport), bake.scene.image, view)
    near = off(rows.product(light).reshape(exact.shape), exact)
    # As if what is seen there sent out its colour without gloss.
    view._seen.strong[:] = False
    rows = ViewRows(TransportRows(bake.transport), bake.scene.image, view)
    evenly = off(rows.product(light).reshape(exact.shape), exact)
    assert near < 0.1 and near < 0.5 * evenly, (near, evenly)


def test_a_white_furnace_is_white(tmp_path):
    ball = of(sphere(16, 0.5, (0, 0, 0), albedo=(0, 0, 0)), metal=np.ones(3), roughness=0.5)
    bake = baked(tmp_path / "a.prt", [ball], camera((0, -3.0, 0), (0, 0, 0), 0.2), bounces=0)
    rows = ViewRows(TransportRows(bake.transport), bake.scene.image, FixedView(bake).weights())
    result = rows.product(np.ones((bake.cube_map.n_directions, 3), np.float32))
    weights = FixedView(bake).weights()
    assert rows._is_grey() and weights is not None
    lit = result[result[:, 0] > 0.5]
    assert len(lit) > 60
    assert np.median(lit) == pytest.approx(1, abs=0.01) and lit.min() > 0.9


def test_a_compressed_form_holds_the_gloss_and_lamps_are_added(path):
    report = compress(path, method="cpca:n_clusters=3,n_components=48", tolerance=0.1,
                      lights={"sky": SKY})  # fmt: skip
    assert report["of"] == "image" and report["lights"] == 1
    assert 0 < report["rows_error"] < report["error"] < 0.1
    exact, quick = Relighter(load(path), CASTER, "exact"), Relighter(load(path), CASTER)
    wanted = exact.radiance(SKY, rotation=65, of="image")
    result = quick.radiance(SKY, rotation=65, of="image")
    assert quick.used == "compressed"
    assert off(result, wanted) == pytest.approx(report["worst"], rel=1e-3)
    lamps = [Lamp("point", (300.0, 200, 100), (1.0, 1, 2))]
    both = quick.radiance(SKY, rotation=65, lamps=lamps, lamp_samples=4, of="image", exposure=1.0)
    added = exact.radiance(lamps=lamps, lamp_samples=4, of="image")
    assert added.max() > 0.1 * result.max()
    np.testing.assert_allclose(both, 2 * (result + added), rtol=1e-4, atol=1e-5)
    # That was no light for other views.
    assert quick.lit is None and exact.lit is not None
    # Another camera is another form.
    bake = load(path)
    image = bake.scene.image
    moved = replace(image, camera=replace(image.camera, shift=(0.1, 0)))
    bake.scene = replace(bake.scene, image=moved)
    other = Relighter(bake, CASTER)
    other.radiance(SKY, of="image")
    assert other.used == "exact" and "another state of the bake" in other.why


def test_a_form_of_points_shows_the_cameras_gloss(path):
    compress(path, method="pca:n_components=30", tolerance=0.3, lights={"sky": SKY}, of="points")
    quick, exact = Relighter(load(path), CASTER, "compressed"), Relighter(load(path), form="exact")
    result = quick.radiance(SKY, rotation=65, of="image")
    assert quick.used == "compressed"
    assert off(result, exact.radiance(SKY, rotation=65, of="image")) < 0.1


def test_the_command_line_turns_the_light_of_what_the_camera_sees(path, tmp_path, capsys):
    image = tmp_path / "sky.exr"

    write_image(image, SKY.pixels)
    words = ["relight", str(path), "--light", str(image), "--form", "exact", "--rotate", "65"]
    assert main([*words, "--image", str(tmp_path / "a.exr")]) == 0
    assert main([*words, "--image", str(tmp_path / "b.exr"),
                 "--output", str(tmp_path / "b.npz")]) == 0  # fmt: skip
    seen, beside = (read_image(tmp_path / f"{name}.exr")[..., :3] for name in "ab")
    wanted = Relighter(load(path), form="exact").radiance(image, rotation=65, of="image")
    np.testing.assert_allclose(seen, wanted, rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(beside, seen, rtol=1e-6)
    assert main([*words, "--turn", "2", "--image", str(tmp_path / "t.exr")]) == 0
    # Other machines make other frames of the same turn.
    part = [*words, "--turn", "2", "--frames", "2", "--image", str(tmp_path / "part.exr")]
    assert main(part) == 0
    assert [path.name for path in tmp_path.glob("part*")] == ["part_0002.exr"]
    whole = (tmp_path / "t_0002.exr").read_bytes()
    assert (tmp_path / "part_0002.exr").read_bytes() == whole
    first = read_image(tmp_path / "t_0001.exr")[..., :3]
    np.testing.assert_allclose(first, seen, rtol=1e-6)
    capsys.readouterr()


def test_an_image_without_gloss_has_no_view(path):
    bake = load(path)
    bake.reflections = ()
    with pytest.raises(PRTError, match="image: this bake holds none with gloss; bake with --gloss"):
        FixedView(bake)
