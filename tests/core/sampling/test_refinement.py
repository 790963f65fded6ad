"""Edges are split where a shadow ends, until the tolerance is met or the vertices are used up."""

import numpy as np
import pytest

from prt_core import Lamp, PRTError, run
from prt_core.rays.caster import known_casters
from prt_core.sampling import RefineSettings, edge_errors, refine_steps
from prt_core.scene import Mesh, Scene, SplitMeshes
from prt_core.transport import lamp_light, place_light
from tests.meshes import caster_of, glowing, plane


def slab(name="slab", z=0.5, low=-0.25, high=0.25, **settings):
    """A square above the ground that faces down."""
    vertices = np.array([[low, low, z], [high, low, z], [high, high, z], [low, high, z]])
    down, triangles = np.tile([0, 0, -1.0], (4, 1)), np.array([[0, 2, 1], [0, 3, 2]])
    albedo = np.full((4, 3), 0.5)
    return Mesh(name, vertices, np.arange(4), down, triangles, albedo, **settings)


SUN = Lamp("sun", [3.0] * 3, name="sun")
FLOOR = plane(9)
# Hard light straight from above: the shadow is the slab's own outline, between the vertices.
SHADED = [FLOOR, slab(low=-0.29, high=0.31, receives=False)]


@pytest.fixture(autouse=True)
def few_rays(monkeypatch):
    monkeypatch.setattr(edge_errors, "_LEAST", 2000)
    monkeypatch.setattr(place_light, "SKY", 4)


def refined(meshes, lamps=(SUN,), world=None, **settings):
    name = "embree" if "embree" in known_casters() else "brute"
    return run(refine_steps(meshes, lamps, world, RefineSettings(**settings), name))


def shadow_error(floor):
    """How far the sun's light drawn between vertices is from where the shadow is."""
    meshes = [floor, SHADED[1]]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    light = lamp_light(scene, caster_of(scene), [SUN], 1)[:, 0]
    rng = np.random.default_rng(1)
    second, third = np.sort(rng.random((2, 400)), axis=0)
    second, third = second, third - second
    triangles = np.flatnonzero(scene.triangle_object == 0)
    areas = np.linalg.norm(
        np.cross(*(scene.vertices[scene.triangles[triangles]][:, 1:]
                   - scene.vertices[scene.triangles[triangles]][:, :1]).swapaxes(0, 1)), axis=1
    )  # fmt: skip
    corner = light[scene.lattice.reshape(-1, 3)[triangles]]
    place = scene.to_world(scene.vertices)[scene.triangles[triangles]]
    weights = np.stack([1 - second - third, second, third], axis=1)
    drawn, at = (np.einsum("sk,tk...->ts...", weights, values) for values in (corner, place))
    inside = ((at[..., :2] > -0.29) & (at[..., :2] < 0.31)).all(axis=2)
    wanted = np.where(inside, 0, light.max())
    return np.sqrt((areas @ ((drawn - wanted) ** 2).mean(axis=1)) / areas.sum())


def test_vertices_go_where_the_shadow_ends():
    (floor, roof), told = refined(SHADED, tolerance=1e-3, vertices="2x")
    assert roof is SHADED[1] and told.added == 81 and told.objects == {FLOOR.name: 81}
    new = floor.vertices[floor.refined.vertex_round > 0]
    from_edge = np.abs(np.abs(new[:, :2] - 0.01) - 0.3)
    near = (from_edge.min(axis=1) < 0.15) & (np.abs(new[:, :2] - 0.01).max(axis=1) < 0.45)
    assert near.mean() > 0.8
    assert shadow_error(floor) < 0.5 * shadow_error(FLOOR)
    assert told.errors["the lamps"] < 0.5 * told.errors_before["the lamps"]
    # What it says of the error is what it is.
    size = np.sqrt((told.errors_before["the lamps"] / shadow_error(FLOOR)) ** 2)
    assert np.isclose(told.errors["the lamps"], size * shadow_error(floor), rtol=0.25)
    assert "81 vertices added to 81" in str(told) and "more vertices would" in str(told)


def test_it_ends_where_the_tolerance_is_met():
    _, told = refined(SHADED, tolerance=0.1, vertices="100x")
    assert 0 < told.added < 2000 and told.tolerance_met
    assert max(told.errors.values()) <= 0.1 < max(told.errors_before.values())


def test_meshes_that_are_fine_enough_stay_as_they_are():
    meshes, told = refined([FLOOR], tolerance=0.05)
    assert meshes[0] is FLOOR and told.added == 0 and told.tolerance_met
    assert str(told).startswith("refined nothing: fine enough for a tolerance of 5.0%")


@pytest.mark.parametrize("vertices", [0, 40, "1x", "0.5x"])
def test_no_vertices_allowed_are_none(vertices):
    meshes, told = refined(SHADED, vertices=vertices)
    assert meshes[0] is FLOOR and told.added == 0
    assert "more vertices are not allowed" in str(told)


def test_a_shadow_within_one_large_face_is_found():
    wide = plane(2)
    (floor, _), told = refined(
        [wide, slab(low=0.1, high=0.3, receives=False)], tolerance=0.02, vertices=120
    )
    new = floor.vertices[floor.refined.vertex_round > 3]
    assert len(new) > 40 and told.errors["the lamps"] < 0.6 * told.errors_before["the lamps"]
    assert (np.abs(new[:, :2] - 0.2).max(axis=1) < 0.35).mean() > 0.7


def test_no_slivers_are_made():
    (floor, _), _ = refined(SHADED, tolerance=1e-3, vertices="4x")
    state = SplitMeshes([floor])
    lengths = state.lengths
    assert (lengths.min(axis=1) / lengths.max(axis=1)).min() > 0.12


def test_suns_stand_for_the_light_where_a_scene_has_none():
    _, told = refined(SHADED, (), vertices="1.2x")
    assert set(told.errors) == {"bounced light", "two suns"} and told.added > 0


def test_what_shines_casts_shadows():
    lit = glowing(slab("light", 1.5, -0.05, 0.05, receives=False), (50, 50, 50))
    (floor, *_), told = refined([*SHADED, lit], (), vertices="1.5x", tolerance=1e-3)
    assert set(told.errors) == {"bounced light", "what shines"}
    assert told.errors["what shines"] < 0.6 * told.errors_before["what shines"]
    # The shadow of a slab at a third of the height is half as large again.
    new = floor.vertices[floor.refined.vertex_round > 0]
    away = np.abs(new[:, :2] - 0.015).max(axis=1)
    assert ((away > 0.25) & (away < 0.65)).mean() > 0.8


def test_a_bright_texel_of_the_world_casts_its_shadow():
    world = np.full((6 * 64, 3), 0.01, np.float32)
    world[4 * 64 + 36] = 500
    _, told = refined(SHADED, (), world, vertices="1.5x", tolerance=1e-3)
    assert set(told.errors) == {"bounced light", "the world"}
    assert told.errors["the world"] < 0.75 * told.errors_before["the world"]


@pytest.mark.parametrize("size", [1e-3, 1e5])
def test_scale_does_not_matter(size):
    meshes = [plane(9), slab(low=-0.29, high=0.31, receives=False)]
    for item in meshes:
        item.vertices = item.vertices * size
    (floor, _), told = refined(meshes, tolerance=1e-3, vertices="1.5x")
    (same, _), _ = refined(SHADED, tolerance=1e-3, vertices="1.5x")
    assert told.added == 40
    np.testing.assert_allclose(floor.vertices / size, same.vertices, atol=1e-6)


def test_instances_and_overlaps_are_refined_each_by_its_own_light():
    far = plane(9, name="far")
    far.vertices = far.vertices + (10, 0, 0)
    under = plane(9, name="under")
    meshes, told = refined([*SHADED, far, under], tolerance=1e-3, vertices=350)
    assert meshes[2] is far and set(told.objects) == {FLOOR.name, "under"}
    np.testing.assert_array_equal(meshes[0].vertices, meshes[3].vertices)


def test_it_is_the_same_every_time():
    soft = Lamp("point", [30.0] * 3, (0.3, 0.1, 2), radius=0.2, name="bulb")
    one, two = (refined(SHADED, (soft,))[0][0] for _ in range(2))
    np.testing.assert_array_equal(one.vertices, two.vertices)
    np.testing.assert_array_equal(one.triangle_corners, two.triangle_corners)


def test_wrong_settings_are_refused():
    for wrong in ({"vertices": "many"}, {"vertices": -1}, {"vertices": 1.5}, {"tolerance": 0}):
        with pytest.raises(PRTError, match="refine"):
            RefineSettings(**wrong)
    assert RefineSettings(vertices="1.5x").most(100) == 150 and RefineSettings().most(3) == 4
