"""Points in spatial tiles, each of which is sampled alone.

Sampling by agreement asks the points around; those of another tile are not asked, which costs a few
per cent more rays along the borders, and nothing else: each tile is a scene whose rays meet
everything and whose points are few. Objects of few points come along a curve through their middles
and are never cut; a large object is cut along a curve through its own points.
"""

from dataclasses import fields, replace

import numpy as np

from prt_core.errors import expect, expect_indices, expect_kind, expect_whole
from prt_core.sampling.neighbours import morton
from prt_core.scene import BakePoints, Details, Scene


def tiles_of(scene, size):
    """The points of each tile.

    Parameters
    ----------
    scene : Scene
    size : int
        Points of a tile, at most.

    Returns
    -------
    list of (n,) int64
        Ascending; each point is in one of them.
    """
    points = expect_kind("scene", scene, Scene).points
    size = expect_whole("size", size, 1)
    if len(points) <= size:
        return [np.arange(len(points))]
    index = points.object_index
    counts = np.bincount(index, minlength=len(scene.objects))
    order = np.lexsort((_along_curve(points), index))
    first = np.cumsum(counts) - counts
    tiles, group, held = [], [], 0
    for number in _objects_along_curve(points, counts):
        own = order[first[number] : first[number] + counts[number]]
        if counts[number] > size:
            tiles += np.array_split(own, -(-counts[number] // size))
            continue
        if held + counts[number] > size:
            tiles.append(np.concatenate(group))
            group, held = [], 0
        group.append(own)
        held += counts[number]
    if group:
        tiles.append(np.concatenate(group))
    return [np.sort(tile) for tile in tiles]


def tile_scene(scene, points):
    """The scene with some of its points alone: what rays meet is the same.

    Parameters
    ----------
    scene : Scene
    points : (n,) int64
        Ascending.

    Returns
    -------
    Scene
        The very scene where they are all its points. It has no lattice that fits its points: it is
        for samplers, which ask for none.
    """
    expect_kind("scene", scene, Scene)
    points = expect_indices("points", points, len(scene.points))
    good = not isinstance(points, slice) and len(points) and (np.diff(points) > 0).all()
    expect(good, "points: expected numbers of some points, each once, in ascending order")
    if len(points) == len(scene.points):
        return scene
    whole = scene.points
    some = BakePoints(**{f.name: getattr(whole, f.name)[points] for f in fields(BakePoints)})
    details = scene.details
    place = np.searchsorted(points, details.point)
    inside = np.flatnonzero(points[np.minimum(place, len(points) - 1)] == details.point)
    kept = {f.name: getattr(details, f.name)[inside] for f in fields(Details)}
    kept["point"] = place[inside].astype(np.int32)
    part = replace(scene, points=some, details=Details(**kept))
    # What is known of the whole scene is known of its parts.
    part.frames, part.open_points = scene.frames, scene.open_points[points]
    part.ray_origins = scene.ray_origins[points]
    return part


def _along_curve(points):
    """(n_points,) uint64: where each point lies along a curve through the scene."""
    low = points.positions.min(axis=0)
    extent = np.ptp(points.positions, axis=0).max()
    return morton(points.positions - low, np.full(len(points), extent))


def _objects_along_curve(points, counts):
    """Numbers of the objects that have points, along a curve through their middles."""
    present, index = np.flatnonzero(counts), points.object_index
    sums = [np.bincount(index, x, len(counts))[present] for x in points.positions.T]
    middles = np.stack(sums, axis=1) / counts[present, None]
    low = middles.min(axis=0)
    extent = np.full(len(present), np.ptp(middles, axis=0).max())
    return present[np.argsort(morton(middles - low, extent), kind="stable")]
