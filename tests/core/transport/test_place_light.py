"""Light at single places, in closed form."""

import numpy as np
import pytest

from prt_core import run
from prt_core.scene import Scene, surface_points
from prt_core.transport.place_light import PlaceLight
from tests.meshes import caster_of, glowing, plane


def slab(z, low, high, name="slab"):
    """A square whose front is below."""
    item = plane(2, low, high, name=name, z=z)
    item.triangle_corners = item.triangle_corners[:, ::-1]
    item.corner_normal = -item.corner_normal
    return item


def light_at(meshes, x, world=None):
    """Groups, and what places on the first mesh receive of them."""
    scene = Scene.from_meshes(meshes, max_hidden=0)
    caster = caster_of(scene)
    light = PlaceLight(scene, caster, lambda _: caster, (), world)
    # Of the two triangles of a square from -1 to 1 the lower one, at y = -0.5.
    places = np.stack([(np.array(x) + 1) / 2 - 0.25, np.full(len(x), 0.25)], axis=1)
    front = np.zeros(len(x), bool)
    points, _ = surface_points(scene, np.zeros(len(x), int), places, front)
    np.testing.assert_allclose(
        scene.to_world(points.positions), [(each, -0.5, 0) for each in x], atol=1e-6
    )
    return [channel.group for channel in light.channels], run(light.steps(points))


def test_nothing_in_the_way_of_an_even_sky_is_one():
    groups, values = light_at([plane(2)], [0.0, 0.3])
    assert groups == ["bounced light", "two suns", "two suns"]
    np.testing.assert_allclose(values[:, 0], 1, atol=0.03)
    heights = np.array([0.52, 0.87]) / np.linalg.norm(
        [[0.8, 0.3, 0.52], [-0.3, -0.4, 0.87]], axis=1
    )
    np.testing.assert_allclose(values[:, 1:], [heights] * 2, rtol=1e-6)


def test_a_bright_texel_shines_from_where_it_is():
    world = np.full((6 * 1024, 3), 1e-3, np.float32)
    row, column = 16, 24
    world[4 * 1024 + row * 32 + column] = 1e4
    across = (column + 0.5) / 16 - 1
    # The shadow of a slab at z = 0.5 that ends at x = 0.5 ends here.
    end = 0.5 - 0.5 * across
    groups, values = light_at([plane(2), slab(0.5, -0.9, 0.5)], [end - 0.02, end + 0.02], world)
    assert groups == ["bounced light", "the world"]
    assert values[0, 1] < 0.01 * values[1, 1]


@pytest.mark.parametrize("height", [0.15, 1.0])
def test_a_square_that_shines_gives_what_it_is_seen_of(height):
    lit = glowing(slab(height, -0.25, 0.25, "light"), (2, 2, 2))
    lit.vertices = lit.vertices - (0, 0.5, 0)
    groups, values = light_at([plane(2), lit], [0.0, 0.9])
    assert groups == ["bounced light", "what shines"]
    # The form factor of a square from below its middle is four times that of a quarter.
    side = 0.25 / height
    quarter = 2 * side / np.sqrt(1 + side**2) * np.arctan(side / np.sqrt(1 + side**2)) / (2 * np.pi)
    np.testing.assert_allclose(values[0, 1], 2 * 4 * quarter, rtol=0.1)
    assert 0 < values[1, 1] < 0.5 * values[0, 1]
