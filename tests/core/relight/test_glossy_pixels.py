"""Pictures of gloss: each pixel by its own normal and view, and mirrors by rays."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import prt_core
from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.cli import main
from prt_core.evaluate.view import CameraRays
from prt_core.light import EnvironmentMap, sun_light, write_image
from prt_core.reflectance import Materials
from prt_core.reflectance.fresnel_powers import N_POWERS
from prt_core.relight.glossy_pixels import ordered_dither
from prt_core.relight.lighting import Lighting
from prt_core.relight.point_lobes import PointLobes
from prt_core.relight.relighter import Relighter
from prt_core.scene import Camera
from prt_core.transport import View
from prt_core.transport.mirror import mirrored_share
from tests.meshes import caster_of, plane, wall

SKY = EnvironmentMap(
    np.random.default_rng(4).random((8, 16, 3)).astype(np.float32) + np.float32(0.2), "sky"
)
MIRROR = {"metal": (1.0, 1.0, 1.0), "stand_in": (0.5, 0.5, 0.5), "roughness": 0.0}
ROUGH = {"dielectric": 1.0, "metal": (0.3, 0.2, 0.1), "roughness": 0.4}


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


def looking(away, target, tangent=0.3, **settings):
    """A camera at `target` + `away` that looks at `target`."""
    back = np.asarray(away, float) / np.linalg.norm(away)
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(back, right), back])
    matrix[:3, 3] = np.asarray(target, float) + away
    return Camera(matrix, tangent, **settings)


def baked(path, meshes, camera=None):
    scene = Scene.from_meshes(meshes, max_hidden=0)
    name = type(caster_of(scene)).__name__
    caster = "embree" if name == "EmbreeCaster" else "brute"
    settings = BakeSettings(resolution=16, caster=caster, gloss=True)
    run(bake_steps(scene, path, settings, camera=camera))
    return load(path), caster, path


@pytest.fixture(scope="module")
def mirror(tmp_path_factory):
    """A mirror with a matte wall on it, and its camera, which sees both."""
    path = tmp_path_factory.mktemp("mirror") / "a.prt"
    meshes = [of(plane(4, name="floor"), **MIRROR), wall(0.5, 0.6, 0.5, n=5, albedo=0.6)]
    return baked(path, meshes, looking([-2.0, 0.3, 1.2], [0.2, 0, 0]))


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    path = tmp_path_factory.mktemp("rough") / "a.prt"
    meshes = [of(plane(5, name="floor"), **ROUGH), wall(0.9, 1.5, 1.0, albedo=0.6)]
    return baked(path, meshes)


def rays_of(bake, camera, width, height, samples=1):
    return CameraRays(bake.scene, caster_of(bake.scene), camera, width, height, samples)


def mirrored(bake, rays):
    """Ways that the floor mirrors, where they meet the wall's plane, and which meet the wall."""
    origin, ways = bake.camera.position, rays.directions.astype(np.float64)
    on_floor = rays.points[:, 0] >= 0
    on_floor &= bake.scene.points.object_index[rays.points[:, 0]] == 0
    place = origin - ways * (origin[2] / ways[:, 2])[:, None]
    up = ways * [1, 1, -1]
    met = place + up * ((0.5 - place[:, 0]) / up[:, 0])[:, None]
    hits = on_floor & (np.abs(met[:, 1]) < 0.5) & (met[:, 2] < 0.6) & (place[:, 0] < 0.5)
    free = on_floor & ((np.abs(met[:, 1]) > 0.501) | (met[:, 2] > 0.601))
    return up, met, hits, free


def test_a_mirror_shows_the_sky_and_what_stands_on_it(mirror):
    bake, caster, _ = mirror
    rays = rays_of(bake, bake.camera, 24, 18)
    relighter = Relighter(bake, caster)
    picture = relighter.picture(rays, SKY)
    even = relighter.radiance(SKY)
    assert relighter.mirror_rays > 100
    relighter.close()
    up, met, hits, free = mirrored(bake, rays)
    assert hits.sum() > 20 and free.sum() > 20
    pixels = picture.reshape(-1, 3)
    np.testing.assert_allclose(pixels[free], SKY.interpolated(up[free]), rtol=2e-3)
    # The wall is a grid of 5 x 5 points: its colour lies between those around.
    points = np.flatnonzero(bake.scene.points.object_index == 1)
    where = bake.scene.to_world(bake.scene.points.positions[points])
    away = np.abs(where[None] - met[hits][:, None])
    near = ((away[..., 1] < 0.2501) & (away[..., 2] < 0.1501))[..., None]
    colours = even[points]
    least = np.where(near, colours, np.inf).min(axis=1)
    most = np.where(near, colours, -np.inf).max(axis=1)
    assert (pixels[hits] > 0.998 * least).all() and (pixels[hits] < 1.002 * most).all()


def test_a_mirror_shows_the_texels_of_a_world_smoothed_as_they_are_behind_the_scene(mirror):
    bake, caster, _ = mirror
    texels = np.random.default_rng(5).random((bake.cube_map.n_directions, 3)).astype(np.float32)
    bake = replace(bake, world=texels)
    rays, relighter = rays_of(bake, bake.camera, 24, 18), Relighter(bake, caster)
    pixels = relighter.picture(rays, "world").reshape(-1, 3)
    sky = relighter.sky(Lighting("world"))
    relighter.close()
    up, _, _, free = mirrored(bake, rays)
    assert free.sum() > 20
    np.testing.assert_allclose(pixels[free], sky(up[free]), rtol=2e-3)


def test_a_mirror_shows_the_image_of_a_world_and_its_suns(mirror):
    bake, caster, _ = mirror
    towards = np.array([0.8, 0.0, 0.6])
    axes = np.column_stack([[0, 1.0, 0], np.cross(towards, [0, 1.0, 0]), towards])
    sun = Lamp("sun", [3, 2, 1], axes=axes, angle=0.3)
    texels = SKY.to_cube_map(bake.cube_map) + sun_light(bake.cube_map, towards, sun.power, 0.3)
    bake = replace(bake, world=texels.astype(np.float32), world_image=SKY, lamps=[sun])
    rays, relighter = rays_of(bake, bake.camera, 24, 18), Relighter(bake, caster)
    pixels = relighter.picture(rays, "world", strength=2.0).reshape(-1, 3)
    behind = relighter.sky(Lighting("world", strength=2.0))
    relighter.close()
    up, _, _, free = mirrored(bake, rays)
    sunny = free & (up @ towards > np.cos(0.15))
    assert sunny.sum() > 3 and (free & ~sunny).sum() > 20
    wanted = 2 * SKY.interpolated(up)
    np.testing.assert_allclose(behind(up[free]), wanted[free], rtol=1e-4)
    disc = 2 * sun.power / (np.pi * np.sin(0.15) ** 2)
    np.testing.assert_allclose(pixels[free & ~sunny], wanted[free & ~sunny], rtol=2e-3)
    np.testing.assert_allclose(pixels[sunny], wanted[sunny] + disc, rtol=2e-3)


def test_at_points_pixels_are_what_points_are(rough):
    bake, caster, _ = rough
    # Pixels of 0.5 x 0.5, whose middles are the vertices of the floor, seen straight from above.
    matrix = np.eye(4)
    matrix[:3, 3] = 0, 0, 5.0
    camera = Camera(matrix, 1.25, "orthographic")
    rays = rays_of(bake, camera, 5, 5)
    relighter = Relighter(bake, caster)
    picture = relighter.picture(rays, SKY, background=np.zeros_like)
    points = relighter.radiance(SKY, view=View(direction=[0, 0, 1.0]))
    relighter.close()
    place = bake.scene.to_world(bake.scene.points.positions)
    floor = np.flatnonzero(bake.scene.points.object_index == 0)
    column, row = np.rint((place[floor, :2] + 1) * 2).astype(int).T
    seen = picture[4 - row, column]
    compared = seen.any(axis=1) & (place[floor, 0] < 0.9)
    assert compared.sum() > 8
    np.testing.assert_allclose(seen[compared], points[floor[compared]], rtol=2e-3)


def test_between_points_fields_are_taken_as_often_as_they_weigh(rough):
    bake, caster, _ = rough
    # Seen from far away a flat floor of one material is at pixels what it is between points.
    camera = looking([-2.0, -1.5, 2.0], [0.2, 0, 0], 0.6, lens="orthographic")
    rays = rays_of(bake, camera, 8, 8, 8)
    relighter = Relighter(bake, caster)
    picture = relighter.picture(rays, SKY)
    radiance = relighter.radiance(SKY, view=View(direction=[-2.0, -1.5, 2.0]))
    expected = rays.picture(radiance, relighter.sky(prt_core.Lighting(SKY)))
    relighter.close()
    # An 8 x 8 square of samples has each threshold once.
    np.testing.assert_allclose(picture, expected, rtol=0.015)
    assert np.abs(picture - expected).mean() < 1.2e-3
    assert np.ptp(radiance[:, 0]) > 0.1


def test_a_lamp_is_mirrored_where_it_is_between_points(rough):
    bake, caster, _ = rough
    camera = looking([0.0, -2.0, 2.0], [-0.23, -0.31, 0], 0.2)
    # Mirrored at the middle of the picture, which is no point.
    lamp = Lamp("point", (50.0,) * 3, (-0.23, -0.31 + 1.5, 1.5), radius=0.05)
    relighter = Relighter(bake, caster)
    picture = relighter.picture(rays_of(bake, camera, 33, 33), lamps=[lamp]).sum(axis=2)
    relighter.close()
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    # The lobe is a little off towards the horizon, and nearer to the lamp it is brighter.
    assert abs(column - 16) <= 1 and 8 <= row <= 18


def test_lobes_between_points():
    materials = Materials(
        albedo=np.zeros((2, 3)),
        metal=np.array([[0.2, 0.4, 0.6], [0.6, 0.4, 0.2]]),
        roughness=np.array([[0.2], [0.6]]),
    )
    lobes = PointLobes(materials, np.tile(np.float32([0, 0, 1]), (2, 1)))
    weights, straight = np.float32([[0.25, 0.75]]), np.ones(1)
    ((alpha, powers),), diffuse = lobes.between(np.array([[0, 1]]), weights, straight)
    np.testing.assert_allclose(alpha, [[0.5**2] * 2], rtol=1e-5)
    each = [lobes.at(np.array([row]), straight)[0][0][1] for row in (0, 1)]
    np.testing.assert_allclose(powers, 0.25 * each[0] + 0.75 * each[1], rtol=1e-6)
    # Beside what has no gloss there is less of it, as rough as it was.
    ((alpha, powers),), diffuse = lobes.between(np.array([[0, -1]]), weights, straight)
    np.testing.assert_allclose(alpha, [[0.2**2] * 2], rtol=1e-5)
    np.testing.assert_allclose(powers, 0.25 * each[0], rtol=1e-6)
    np.testing.assert_allclose(diffuse, 1)


def test_thresholds_are_even():
    row, column = np.divmod(np.arange(64), 8)
    np.testing.assert_allclose(np.sort(ordered_dither(row, column)), (np.arange(64) + 0.5) / 64)
    # Of each four samples of a pixel one is in each quarter.
    quarters = (4 * ordered_dither(row, column)).astype(int).reshape(4, 2, 4, 2)
    quarters = quarters.swapaxes(1, 2).reshape(16, 4)
    np.testing.assert_array_equal(np.sort(quarters, axis=1), [[0, 1, 2, 3]] * 16)


def test_a_mirror_of_one_power_each():
    powers = np.eye(N_POWERS, dtype=np.float32)[:, :, None] * np.ones(3, np.float32)
    share = mirrored_share(np.full(4, 0.5, np.float32), powers)
    np.testing.assert_allclose(share[:, 0], [1, 0.5**5, 0.5**2, 0.5 * 0.5**6], rtol=1e-6)


def test_the_command_says_that_mirrors_are_traced(mirror, tmp_path, capsys):
    _, caster, path = mirror
    light = tmp_path / "sky.exr"
    write_image(light, SKY.pixels)
    picture = tmp_path / "out.png"
    asked = ["relight", str(path), "--light", str(light), "--view", "camera"]
    asked += ["--size", "24x18", "--caster", caster]
    assert main([*asked, "--png", str(picture)]) == 0
    assert "mirrors are traced for the picture, by" in capsys.readouterr().out
    seen = np.asarray(Image.open(picture))
    assert seen.shape == (18, 24, 3)
    # A turntable's first frame is the light as it is; the next one differs.
    assert main([*asked, "--png", str(tmp_path / "turn.png"), "--turn", "2"]) == 0
    turned = [np.asarray(Image.open(tmp_path / f"turn_{frame:04d}.png")) for frame in (1, 2)]
    np.testing.assert_array_equal(turned[0], seen)
    assert np.abs(turned[1].astype(int) - seen).max() > 20
    capsys.readouterr()
    assert main([*asked, "--png", str(picture), "--view", "1,2,3"]) != 0
    assert "a picture is seen from the camera" in capsys.readouterr().err


def test_a_bake_without_gloss_has_no_such_picture(tmp_path):
    bake, caster, _ = baked(tmp_path / "a.prt", [plane(3)])
    relighter = Relighter(bake, caster)
    with pytest.raises(PRTError, match="view: this bake knows of no gloss"):
        relighter.picture(rays_of(bake, None, 4, 3), SKY)
    with pytest.raises(PRTError, match="rays: expected a CameraRays"):
        relighter.picture(View(np.ones(3)), SKY)


def test_rays_of_another_scene_are_refused(mirror):
    bake, caster, _ = mirror
    larger = Scene.from_meshes([plane(21)], max_hidden=0)
    rays = CameraRays(larger, caster_of(larger), None, 8, 6)
    relighter = Relighter(bake, caster)
    with pytest.raises(PRTError, match="rays: expected those of the baked scene"):
        relighter.picture(rays, SKY)
    relighter.close()
