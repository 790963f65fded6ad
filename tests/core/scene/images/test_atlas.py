"""Atlases: texels of several objects by UV maps, their borders, seams and hard cases."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.rays import make_caster
from prt_core.rays.caster import known_casters
from prt_core.scene import Scene, with_atlas
from prt_core.scene.images.seams import bilinear
from tests.meshes import plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"


def caster(vertices, triangles):
    return make_caster(CASTER, vertices, triangles)


def flat_uv(mesh, low=(0.1, 0.1), high=(0.9, 0.9)):
    """UVs of a mesh seen from above, in a box."""
    places = mesh.vertices[mesh.corner_vertex, :2]
    least, most = places.min(axis=0), places.max(axis=0)
    return low + (places - least) / (most - least) * (np.array(high) - low)


def two_halves(mesh):
    """UVs of a ball: its upper half in one chart, the lower in another, seen from above."""
    places = mesh.vertices[mesh.corner_vertex]
    upper = places.reshape(-1, 3, 3)[..., 2].mean(axis=1) > 0
    upper = np.repeat(upper, 3)
    disc = 0.22 * places[:, :2] * (1 + np.abs(places[:, 2:]) * 0)
    return np.where(upper[:, None], [0.26, 0.5], [0.74, 0.5]) + disc


def atlas_of(meshes, uvs, size, **settings):
    scene = Scene.from_meshes(meshes)
    maps = {mesh.name: uv for mesh, uv in zip(meshes, uvs, strict=True)}
    return with_atlas(scene, meshes, maps, size, caster, **settings)


def smooth(scene):
    """(n_points, 3) something that varies over the surface, like light."""
    places = scene.points.positions
    return np.float32(1.5) + np.sin(3 * places + [0, 1, 2]).astype(np.float32)


def looked_up(image, pixels, uv):
    places = np.column_stack([uv[:, 0] * image.width, (1 - uv[:, 1]) * image.height])
    texel, weight = bilinear(places, image.width, image.height)
    return np.einsum("mk,mkc->mc", weight, pixels.reshape(-1, pixels.shape[-1])[texel])


@pytest.mark.parametrize("size", [(64, 64), (128, 56)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_lookups_at_corners_show_what_is_there(size, scale):
    one, two = plane(9, name="one"), sphere(12, name="two")
    two.vertices = two.vertices + [0, 0, 1.5]
    for mesh in (one, two):
        mesh.vertices = mesh.vertices * scale
    uvs = [flat_uv(one, (0.05, 0.05), (0.45, 0.95)), two_halves(sphere(12)) * [0.5, 0.9] + [0.5, 0]]
    scene = atlas_of([one, two], uvs, size)
    image, light = scene.image, smooth(scene)
    assert (image.height, image.width) == size[::-1]
    pixels = image.finished(image.pixels(light))
    for item, uv in zip(scene.objects, uvs, strict=True):
        wanted = light[item.corner_point]
        off = np.linalg.norm(looked_up(image, pixels, uv) - wanted) / np.linalg.norm(wanted)
        assert off < 0.02, (item.name, off)


def test_both_sides_of_seams_are_alike_and_no_texel_moves_far():
    ball = sphere(16)
    scene = atlas_of([ball], [two_halves(ball)], (64, 64))
    image, light = scene.image, smooth(scene)
    before, seams = image.pixels(light), image.atlas.seams
    assert len(np.unique(seams.edge)) == 32
    after = image.finished(before)
    assert seams.error(before)[1] > 5 * seams.error(after)[1]
    assert seams.error(after)[1] < 2e-3
    assert np.abs(after - before).max() < 0.15
    # What is far from every seam is as it was.
    untouched = np.ones(64 * 64, bool)
    untouched[np.isin(image.point, image.point[np.unique(seams.texel)])] = False
    assert untouched.mean() > 0.3
    same = after.reshape(-1, 3)[untouched] == before.reshape(-1, 3)[untouched]
    assert same.all()


def test_hard_edges_are_no_seams():
    lower, upper = plane(3, name="a"), plane(3, name="b")
    lower.corner_normal = np.tile([0.0, 0.6, 0.8], (len(lower.corner_normal), 1))
    upper.vertices = upper.vertices + [2, 0, 0]
    uvs = [flat_uv(lower, (0.1, 0.1), (0.4, 0.9)), flat_uv(upper, (0.6, 0.1), (0.9, 0.9))]
    assert not len(atlas_of([lower, upper], uvs, (32, 32)).image.atlas.seams.edge)
    lower.corner_normal = np.tile([0.0, 0, 1], (len(lower.corner_normal), 1))
    assert len(np.unique(atlas_of([lower, upper], uvs, (32, 32)).image.atlas.seams.edge)) == 2


def test_texels_around_a_chart_show_the_surface_behind_its_edge():
    left, right = plane(5, name="a"), plane(5, name="b")
    right.vertices = right.vertices + [2, 0, 0]
    uvs = [flat_uv(left, (0.1, 0.1), (0.4, 0.5)), flat_uv(right, (0.6, 0.3), (0.9, 0.9))]
    scene = atlas_of([left, right], uvs, (48, 48))
    # Light that changes along the surface and across the edge is looked up as it is.
    light = np.float32(3) + scene.points.positions @ np.float32([[1, 2, 0], [1, -1, 0], [0, 0, 0]])
    pixels = scene.image.pixels(light)
    assert scene.image.atlas.seams.error(pixels)[1] < 0.002
    edge = np.abs(left.vertices[left.corner_vertex, 0] - 1) < 1e-6
    edge &= np.abs(left.vertices[left.corner_vertex, 1]) < 0.9
    off = looked_up(scene.image, pixels, uvs[0]) - light[scene.objects[0].corner_point]
    assert edge.sum() > 4 and np.abs(off[edge]).max() < 0.01


def test_texels_between_charts_take_the_nearest_light():
    one, two = plane(3, name="one"), plane(3, name="two", z=-3.0)
    uvs = [flat_uv(one, (0.1, 0.1), (0.3, 0.9)), flat_uv(two, (0.7, 0.1), (0.9, 0.9))]
    scene = atlas_of([one, two], uvs, (40, 40))
    owner = scene.points.object_index[scene.image.point].reshape(40, 40)
    assert (owner[:, :20] == 0).all() and (owner[:, 20:] == 1).all()


def test_mirrored_charts_and_charts_below_a_texel_have_texels():
    one, two = plane(5, name="one"), plane(3, name="tiny", z=-1.0)
    mirrored = flat_uv(one) * [-1, 1] + [1, 0]
    tiny = flat_uv(two, (0.951, 0.951), (0.952, 0.952))
    scene = atlas_of([one, two], [mirrored, tiny], (32, 32))
    image, light = scene.image, smooth(scene)
    assert (scene.points.object_index[np.unique(image.point)] == 1).any()
    got = looked_up(image, image.pixels(light), mirrored)
    np.testing.assert_allclose(got, light[scene.objects[0].corner_point], atol=0.05)


@pytest.mark.parametrize("uvs, says", [
    (lambda a, b: [flat_uv(a), flat_uv(b)], "one and two: their UV maps overlap"),
    (lambda a, b: [flat_uv(a) * [2, 1], flat_uv(b, (0.91, 0), (1, 0.1))],
     "one: 4?5?0?.* of its surface lies outside"),
    (lambda a, b: [flat_uv(a), np.full((len(b.corner_vertex), 2), 0.95)],
     "two: 100% of its surface has no area in its UV map"),
    (lambda a, b: [flat_uv(a, (0, 0), (0.1, 0.1)), flat_uv(b, (0.2, 0.2), (1, 1))],
     "one: has 32 triangles and 24 texels in the atlas"),
    (lambda a, b: [np.abs(flat_uv(a, (-0.9, 0.1), (0.9, 0.9))), flat_uv(b, (0.91, 0), (1, 0.09))],
     "one: its UV map overlaps itself"),
])  # fmt: skip
def test_what_is_wrong_with_uv_maps_is_said_by_name(uvs, says):
    one, two = plane(5, name="one"), plane(5, name="two", z=-1.0)
    scene = atlas_of([one, two], uvs(one, two), (32, 32))
    assert any(__import__("re").search(says, line) for line in scene.messages), scene.messages


def test_what_cannot_be_an_atlas():
    mesh = plane(3)
    with pytest.raises(PRTError, match="cover nothing between 0 and 1"):
        atlas_of([mesh], [flat_uv(mesh) + 3], (16, 16))
    with pytest.raises(PRTError, match="no face has an area"):
        atlas_of([mesh], [np.zeros((len(mesh.corner_vertex), 2))], (16, 16))


def test_good_maps_say_nothing():
    one, two = plane(5, name="one"), plane(5, name="two", z=-1.0)
    uvs = [flat_uv(one, (0, 0), (0.5, 1)), flat_uv(two, (0.5, 0), (1, 1))]
    assert not atlas_of([one, two], uvs, (32, 32)).messages
