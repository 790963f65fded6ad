"""Whether the parts of a `Scene` fit each other: what was read may be damaged or forged."""

import numpy as np

from prt_core.errors import expect
from prt_core.reflectance import QUANTITIES
from prt_core.scene import MATERIALS, MOST_OFFSET

# How far weighted means of float32 may leave their range, and unit vectors a length of 1.
_ROUNDING = 1e-5
_LENGTH = 1e-3


def check_scene(scene):
    """Raise `PRTError` unless a scene's numbers are finite, in range, and lead to one another.

    What is baked is checked by it first, so that nothing is baked that cannot be read, and what is
    read, so that a damaged or forged store leads nowhere else and no colour becomes infinite.
    """
    points = scene.points
    finite = {name: array for name, array in points.arrays().items() if array.dtype.kind == "f"}
    finite |= {"vertices": scene.vertices, "centre": scene.centre}
    most = 0.5 + _ROUNDING
    for name, good in (
        *((name, _finite(array)) for name, array in finite.items()),
        ("positions", _finite(points.positions, -most, most)),
        ("areas", _finite(points.areas, -_ROUNDING)),
        ("visible", bool((points.visible.view(np.uint8) <= 1).all())),
        *_in_range(points),
        ("normals", _unit(points.normals)),
        ("geometric_normals", _unit(points.geometric_normals)),
        ("ray_offset", _off_surface(points)),
        ("size", isinstance(scene.size, int | float) and 0 < scene.size < np.inf),
        ("objects", len({item.name for item in scene.objects}) == len(scene.objects)),
    ):
        expect(good, f"scene: its '{name}' are not finite, not distinct or out of range")
    expect(
        _leads_inside(scene),
        "scene: its indices do not fit each other; it is damaged or tampered with",
    )


def _in_range(points):
    """(name, whether all values are in their range) of each quantity of the materials."""
    for field, prefix in MATERIALS.items():
        for name, values in getattr(points, field).arrays().items():
            quantity = QUANTITIES[name]
            highest = quantity.highest(bounced=field == "mean_materials")
            yield prefix + name, _finite(values, quantity.lowest, highest)


def _finite(array, low=-np.inf, high=np.inf):
    if not array.size:
        return True
    least, most = float(array.min()), float(array.max())
    return -np.inf < least and most < np.inf and low <= least and most <= high


def _unit(vectors):
    """Whether vectors are of length 1, or, where surfaces cancel out, of none."""
    with np.errstate(all="ignore"):
        squares = np.einsum("ij,ij->i", vectors, vectors)
    return bool(((abs(squares - 1) < 2 * _LENGTH) | (squares < _LENGTH**2)).all())


def _off_surface(points):
    """Whether rays start as near above the surface as rounding asks for."""
    offset, normals = points.ray_offset, points.geometric_normals
    with np.errstate(all="ignore"):
        length = np.linalg.norm(offset.astype(np.float64), axis=1)
        outward = np.einsum("ij,ij->i", offset, normals) > 0
    return bool((length <= 2 * MOST_OFFSET).all() and (outward | ~normals.any(axis=1)).all())


def _inside(array, low, high):
    return array.size == 0 or (array.min() >= low and array.max() < high)


def _leads_inside(scene):
    level = scene.triangle_level.astype(np.int64)
    cells = (level + 1) * (level + 2) // 2
    image, n_points = scene.image, len(scene.points)
    return (
        (
            image is None
            or (
                all(1 <= size <= 1 << 14 for size in (image.height, image.width, image.samples))
                and _inside(image.pixel, 0, image.height * image.width)
                and _inside(image.point, 0, n_points)
            )
        )
        and _inside(scene.triangles, 0, len(scene.vertices))
        and _inside(scene.triangle_object, 0, len(scene.objects))
        and _inside(scene.lattice, 0, n_points)
        and _inside(scene.lattice_back, -1, n_points)
        and _inside(level, 1, 1 << 12)
        and _inside(scene.lattice_start, 0, len(scene.lattice))
        and _inside(scene.lattice_start + cells, 0, len(scene.lattice) + 1)
        and _inside(scene.points.object_index, 0, len(scene.objects))
        and len(scene.triangle_emitter) == len(scene.triangles)
        and _inside(scene.triangle_emitter, -1, len(scene.emitters))
        and _inside(scene.points.emitter, -1, len(scene.emitters))
        and _inside(scene.details.point, 0, n_points)
        and _cells_lie_inside(scene.opacity)
        and _cells_lie_inside(scene.shadow_opacity)
        and lie_on(scene.details, scene)
        and sum(item.n_vertices for item in scene.objects) == len(scene.vertices)
        and all(
            _inside(item.corner_point, -1, n_points)
            and _inside(item.corner_vertex, 0, item.n_vertices)
            and int(item.face_sizes.sum()) == len(item.corner_point)
            and _inside(item.face_sizes, 0, np.inf)
            for item in scene.objects
        )
    )


def lie_on(details, scene):
    """Whether they are places on its triangles, on sides that receive light."""
    places = details.triangle, details.barycentric, details.back
    return (
        _inside(details.triangle, 0, len(scene.triangles))
        and _finite(details.barycentric, -_ROUNDING, 1 + _ROUNDING)
        and _finite(1 - details.barycentric.sum(axis=1), -_ROUNDING)
        and bool((details.back.view(np.uint8) <= 1).all())
        and _inside(scene.hit_points(*places)[0], 0, len(scene.points))
    )


def _cells_lie_inside(opacity):
    if opacity is None:
        return True
    along = opacity.along.astype(np.int64)
    sides = [opacity.first] if opacity.back is None else [opacity.first, opacity.back]
    return _inside(along, 1, 1 << 12) and all(
        _inside(first, -1, max(1, len(opacity.cells)))
        and np.array_equal(first >= 0, opacity.passing)
        and _inside((first + along**2)[first >= 0], 0, len(opacity.cells) + 1)
        for first in (side.astype(np.int64) for side in sides)
    )
