import numpy as np

from prt_core import Scene
from prt_core.sampling import tile_scene, tiles_of
from prt_core.scene import with_details
from tests.meshes import plane, sphere


def objects_scene():
    balls = [sphere(4, 0.2, (x, 0, 0.5), name=f"ball {x}") for x in range(5)]
    return Scene.from_meshes([*balls, plane(21, -2, 6, name="floor")], max_hidden=0)


def test_tiles_hold_every_point_once_and_never_more_than_they_may():
    scene = objects_scene()
    tiles = tiles_of(scene, 70)
    assert max(map(len, tiles)) <= 70
    assert np.array_equal(np.sort(np.concatenate(tiles)), np.arange(len(scene.points)))
    assert all((np.diff(tile) > 0).all() for tile in tiles)
    # About as few as there can be: the floor's 441 points take 7, two balls of 26 to 34 one each.
    assert len(tiles) <= 1.5 * len(scene.points) / 70 + 1


def test_small_objects_are_never_cut_and_large_ones_lie_close_together():
    scene = objects_scene()
    index, tiles = scene.points.object_index, tiles_of(scene, 70)
    for number in range(5):
        assert sum((index[tile] == number).any() for tile in tiles) == 1
    floor = [tile for tile in tiles if (index[tile] == 5).any()]
    sizes = [np.ptp(scene.points.positions[tile, :2], axis=0).prod() for tile in floor]
    whole = np.ptp(scene.points.positions[index == 5, :2], axis=0).prod()
    assert np.mean(sizes) < 0.35 * whole


def test_one_tile_is_the_scene_itself():
    scene = objects_scene()
    (tile,) = tiles_of(scene, len(scene.points))
    assert tile_scene(scene, tile) is scene


def test_a_tile_has_its_own_points_and_the_whole_scene_around_it():
    scene = objects_scene()
    corner = np.flatnonzero(scene.triangle_object == 5)[:3]
    inside = np.full((3, 2), 1 / 3)
    scene = with_details(scene, corner, inside, np.zeros(3, bool))
    tile = tiles_of(scene, 70)[-1]
    tile = np.union1d(tile, scene.details.point[1:])
    part = tile_scene(scene, tile)
    assert np.array_equal(part.points.positions, scene.points.positions[tile])
    assert np.array_equal(tile[part.details.point], scene.details.point[np.isin(
        scene.details.point, tile)])  # fmt: skip
    assert np.array_equal(part.ray_origins, scene.ray_origins[tile])
    assert np.array_equal(part.open_points, scene.open_points[tile])
    assert part.triangles is scene.triangles
