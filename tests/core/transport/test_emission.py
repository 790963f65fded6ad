"""Light of emissive surfaces against closed forms: skies, discs, balls, edges, textures."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.reflectance import Materials
from prt_core.scene import Scene
from prt_core.scene.paint import Look
from prt_core.transport import emitted_light, surface_lights
from tests.meshes import caster_of, glowing, plane, sphere, wall


def aimed(scene, caster, seed=0):
    lights = surface_lights(scene)
    for light in lights:
        light.look_around(caster, seed)
    return lights


def received(scene, tolerance=0.003):
    """(n_emitters, n_points, 4) that points receive."""
    caster = caster_of(scene)
    lights = aimed(scene, caster, 3)
    emitted = emitted_light(scene, caster, lights, slice(0, len(scene.points)), 3, tolerance)
    assert (np.sqrt(emitted.spread) <= 2 * tolerance * np.sqrt(emitted.size)).all()
    return emitted.received


def of_polygon(corners, place):
    """What a floor receives of a polygon of radiance 1 above it (Lambert 1760)."""
    ways, total = np.asarray(corners, float) - place, 0.0
    for p, q in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        across = np.cross(p, q)
        length = np.linalg.norm(across)
        total += np.arctan2(length, p @ q) * across[2] / max(length, 1e-30)
    return abs(total) / (2 * np.pi)


def floor_points(scene, name="floor"):
    number = [item.name for item in scene.objects].index(name)
    which = np.flatnonzero(scene.points.object_index == number)
    return which, scene.to_world(scene.points.positions[which])


def above(x0, x1, y0, y1, z):
    return [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]


def test_a_plate_in_a_sky_made_of_a_mesh_receives_exactly_its_radiance():
    sky = glowing(sphere(9, 20.0, inside=True, name="sky"), (0.25, 0.5, 1.0))
    scene = Scene.from_meshes([plane(3, name="floor"), sky], max_hidden=0)
    which, _ = floor_points(scene)
    light = received(scene)[0]
    np.testing.assert_allclose(light[which], np.tile([0.25, 0.5, 1, 1], (9, 1)), rtol=1e-6)
    # Rays alone tell it, with the fewest of them.
    caster = caster_of(scene)
    lights = aimed(scene, caster)
    emitted = emitted_light(scene, caster, lights, slice(0, 9), 0, 1e-4)
    assert emitted.n_rays <= 9 * 4 * 32 and emitted.spread[0] == 0


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("n_sides", [48, 3000])
def test_a_disc_gives_what_its_formula_says_from_both_faces(n_sides, turned):
    angle = 2 * np.pi * np.arange(n_sides) / n_sides
    rim = np.column_stack([np.cos(angle), np.sin(angle)]) * 0.7
    disc = plane(2, name="disc")
    disc = type(disc)(
        "disc",
        np.vstack([np.column_stack([rim, np.full(n_sides, 1.1)]), [[0, 0, 1.1]]]),
        np.arange(n_sides + 1),
        np.tile([0, 0, 1.0], (n_sides + 1, 1)),
        np.column_stack(
            [np.arange(n_sides), (np.arange(n_sides) + 1) % n_sides, np.full(n_sides, n_sides)]
        )[:, :: -1 if turned else 1],
        Materials(
            albedo=np.zeros((n_sides + 1, 3)), emission=np.tile([3.0, 2, 1], (n_sides + 1, 1))
        ),
    )
    floor = plane(3, -1e-3, 1e-3, name="floor")
    scene = Scene.from_meshes([floor, disc], max_hidden=0)
    which, _ = floor_points(scene)
    share = 0.7**2 / (0.7**2 + 1.1**2)  # of the sky, by the cosine
    np.testing.assert_allclose(
        received(scene)[0, which], np.tile([3, 2, 1, 3], (9, 1)) * share, rtol=0.01
    )


def test_a_ball_gives_its_share_of_the_sky():
    # A closed surface: only the half that faces the point is sampled.
    ball = glowing(sphere(40, 0.05, (0, 0, 2.0), name="bulb"), (1.0, 1.0, 1.0))
    scene = Scene.from_meshes([plane(3, -1e-3, 1e-3, name="floor"), ball], max_hidden=0)
    which, _ = floor_points(scene)
    light = received(scene)[0, which, 0]
    np.testing.assert_allclose(light, (0.05 / 2) ** 2, rtol=0.012)
    caster = caster_of(scene)
    (one,) = aimed(scene, caster)
    chances = one.chances(scene.ray_origins[which].astype(float), np.tile([0, 0, 1.0], (9, 1)))
    places = one.sample(chances, np.random.default_rng(0).random((9, 500, 2)))[0]
    lower = scene.triangle_normals[places][..., 2] < 0.2
    assert lower.mean() > 0.95


def test_a_panel_that_shines_by_one_side_is_dark_behind():
    both = glowing(wall(0.0, 1.0, 1.0, n=2, name="panel"), (2.0, 2.0, 2.0))
    one = replace(both, back=Look(Materials(albedo=np.zeros((4, 3)))))
    floor = plane(12, name="floor")
    scenes = [Scene.from_meshes([floor, panel], max_hidden=0) for panel in (both, one)]
    which, places = floor_points(scenes[0])
    two_sided, light = (received(scene)[0, which, 0] for scene in scenes)
    front = places[:, 0] < 0
    assert front.sum() == (~front).sum() == 72
    np.testing.assert_allclose(light[front], two_sided[front], rtol=0.05)
    assert two_sided[~front].min() > 0 and (light[~front] == 0).all()


def test_an_emitter_that_stands_on_the_floor_is_neither_too_bright_nor_too_dark():
    panel = glowing(wall(0.5, 1.0, 1.0, n=2, name="panel"), (2.0, 2.0, 2.0))
    scene = Scene.from_meshes([plane(21, name="floor"), panel], max_hidden=0)
    which, places = floor_points(scene)
    light = received(scene)[0, which, 0]
    before = places[:, 0] < 0.49
    wanted = [2 * of_polygon([[0.5, -1, 0], [0.5, 1, 0], [0.5, 1, 1], [0.5, -1, 1]], place)
              for place in places[before]]  # fmt: skip
    error = np.linalg.norm(light[before] - wanted) / np.linalg.norm(wanted)
    assert error < 0.01
    assert light.max() <= 2 and np.isfinite(light).all()
    # Behind it the other face shines alike.
    behind = np.abs(places[:, 0] - 0.7) < 1e-6
    mirrored = np.abs(places[:, 0] - 0.3) < 1e-6
    assert np.isclose(light[behind].mean(), light[mirrored].mean(), rtol=0.02)


class Screen:
    """Emission 5 where x < 0, else 0; nothing of it at the corners."""

    def __init__(self, mesh):
        self._x = mesh.vertices[mesh.corner_vertex, 0]

    def at(self, corners, weights):
        x = (self._x[corners] * weights).sum(axis=1)
        return {"emission": np.where(x < 0, 5.0, 0.0)[:, None] * [1.0, 0.5, 0.1]}

    def alike(self, corners):
        return np.arange(len(corners))

    def texels(self, corners):
        return np.full(len(corners), 400.0)

    def digest(self):
        return b"screen"


def test_a_texture_shines_where_it_is_bright():
    screen = plane(2, -0.5, 0.5, name="screen", z=1.0)
    screen.paint = Screen(screen)
    scene = Scene.from_meshes([plane(7, name="floor"), screen], max_hidden=0)
    assert scene.emitters == ("screen",)
    which, places = floor_points(scene)
    light = received(scene)[0, which]
    wanted = np.array([5 * of_polygon(above(-0.5, 0, -0.5, 0.5, 1), place) for place in places])
    for channel, factor in enumerate((1, 0.5, 0.1, 1)):
        error = np.linalg.norm(light[:, channel] - factor * wanted)
        assert error < 0.01 * factor * np.linalg.norm(wanted)


def test_what_is_in_the_way_shades_and_what_looks_away_receives_nothing():
    lamp = glowing(plane(2, -0.5, 0.5, name="lamp", z=2.0), (1.0, 1.0, 1.0))
    meshes = [plane(3, -0.5, 0.5, name="floor"), plane(2, -3, 3, name="lid", z=1.0), lamp]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    light = received(scene)[0]
    for name, dark in (("floor", True), ("lid", False), ("lamp", True)):
        which, _ = floor_points(scene, name)
        assert (light[which].max() == 0) == dark, name


def test_objects_of_one_material_are_one_light_and_those_of_others_are_others():
    def lamp(name, x, material, radiance):
        mesh = glowing(plane(2, x, x + 0.1, name=name, z=1.0), (radiance,) * 3)
        mesh.material_names = ("other", material)
        mesh.corner_material = np.ones(len(mesh.corner_vertex), int)
        return mesh

    floor = plane(3, name="floor")
    meshes = [
        floor,
        lamp("a", 0, "neon", 1.0),
        lamp("b", 0.3, "bulb", 2.0),
        lamp("c", 0.6, "neon", 1.0),
    ]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    assert scene.emitters == ("neon", "bulb")
    of_triangle = scene.triangle_emitter[np.argsort(scene.triangle_object, kind="stable")]
    assert of_triangle.tolist() == [-1] * 8 + [0] * 2 + [1] * 2 + [0] * 2
    assert set(scene.points.emitter[scene.points.object_index == 2]) == {1}
    both = received(scene)
    alone = received(Scene.from_meshes([floor, meshes[2]], max_hidden=0))
    np.testing.assert_allclose(both[1, :9, 0], alone[0, :9, 0], rtol=0.03)
    assert Scene.from_meshes([floor, plane(2, name="d", z=1)]).emitters == ()


@pytest.mark.parametrize("half", [0.05, 4.0])
def test_what_lets_light_pass_shines_with_all_that_it_sends_out(half):
    """Emission is what leaves a place in the mean, however few of its rays end there."""
    sheet = glowing(plane(2, -half, half, name="sheet", z=0.5), (0.6, 0.6, 0.6))
    clear = np.full((len(sheet.corner_vertex), 1), 0.3)
    sheet.materials = sheet.materials.replaced(opacity=clear)
    scene = Scene.from_meshes([plane(3, -0.1, 0.1, name="floor"), sheet], max_hidden=0)
    caster = scene.make_caster("brute")
    lights = aimed(scene, caster, 3)
    emitted = emitted_light(scene, caster, lights, slice(0, len(scene.points)), 3, 0.003)
    which, places = floor_points(scene)
    corners = above(-half, half, -half, half, 0.5)
    wanted = [0.6 * of_polygon(corners, place) for place in places]
    np.testing.assert_allclose(emitted.received[0, which, 0], wanted, rtol=0.1)
    np.testing.assert_allclose(emitted.received[0, which, 0].mean(), np.mean(wanted), rtol=0.03)


def test_what_diffuse_rays_do_not_see_shines_for_the_viewer_only():
    lamp = glowing(plane(2, name="lamp", z=1.0), (1.0, 1.0, 1.0))
    lamp.diffuse_rays = False
    scene = Scene.from_meshes([plane(3, name="floor"), lamp], max_hidden=0)
    assert scene.emitters == ("lamp",) and set(scene.points.emitter) == {-1, 0}
    assert not received(scene).any()


@pytest.mark.parametrize("value", [np.nan, -1.0, np.inf, 1e16])
def test_emission_that_is_no_radiance_is_refused(value):
    with pytest.raises(PRTError, match="emission: ") as caught:
        glowing(plane(2, name="lamp"), (1.0, value, 0.0))
    assert "\n" not in str(caught.value)


def test_the_brightest_emitter_and_one_without_an_area():
    lamp = glowing(plane(2, name="lamp", z=1.0), (1e15, 0, 0))
    thin = glowing(plane(2, name="thin", z=0.5), (1.0, 1, 1))
    thin.vertices[:, 0] = 0
    scene = Scene.from_meshes([plane(3, name="floor"), lamp, thin], max_hidden=0)
    assert scene.emitters == ("lamp",)
    light = received(scene)[0]
    assert np.isfinite(light).all() and 1e13 < light[:9, 0].min() < light[:9, 0].max() < 1e15
