"""A `Scene` in a store: everything but what follows from it, checked on the way in and out."""

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.scene import (
    MATERIALS,
    MOST_OFFSET,
    BakePoints,
    Details,
    Opacity,
    PointImage,
    Scene,
    SceneObject,
    with_backs,
)
from prt_core.store.attributes import damage_as_error

_POINTS = {
    "positions": ("float64", 3),
    "normals": ("float32", 3),
    "geometric_normals": ("float32", 3),
    "ray_offset": ("float32", 3),
    "areas": ("float32", 0),
    "object_index": ("int32", 0),
    "visible": ("bool", 0),
}
_TRIANGLES = {"triangle_object": "int32", "triangle_level": "int32", "lattice_start": "int64"}
_DETAILS = {
    "point": ("int32", ()),
    "triangle": ("int32", ()),
    "barycentric": ("float32", (2,)),
    "back": ("bool", ()),
}
_IMAGE = ("height", "width", "samples")
_CORNERS = ("corner_point", "corner_vertex")
_OBJECT = {
    "name": str,
    "n_corners": int,
    "n_faces": int,
    "n_vertices": int,
    "receives": bool,
    "two_sided": bool,
    "own_mesh": bool,
    "owner": str,
    "library": str,
    "shadow_rays": bool,
    "diffuse_rays": bool,
    "camera_rays": bool,
}
# What objects of bakes are that do not say it: they were made when rays met everything.
_MET = dict.fromkeys(("shadow_rays", "diffuse_rays", "camera_rays"), True)
# Of triangles that let light pass, where there are some; and its names for either kind of rays.
_OPACITY = {"first": "int32", "along": "int32", "cells": "uint16", "back": "int32"}
_OPACITIES = ("opacity", "shadow_opacity")
# What the materials of bakes have that do not say it: they were made when there was no more.
_FIRST = ["albedo"]
# How far weighted means of float32 may leave their range, and unit vectors a length of 1.
_ROUNDING = 1e-5
_LENGTH = 1e-3


def write_scene(store, scene):
    """Store a scene; `read_scene` gives it back bit by bit.

    Arrays that are there already and the same are left, others are written again.

    Parameters
    ----------
    store : BakeStore
    scene : Scene

    Returns
    -------
    dict
        Attributes that belong to it, for `BakeStore.update`.
    """
    for name, array in scene.points.arrays().items():
        store.keep(f"point_{name}", array)
    for name in ("vertices", "triangles", "lattice", "lattice_back", *_TRIANGLES):
        store.keep(f"scene_{name}", getattr(scene, name))
    for name in (*_CORNERS, "face_sizes"):
        parts = [getattr(item, name) for item in scene.objects]
        store.keep(f"object_{name}", np.concatenate(parts).astype(np.int32))
    if scene.emitters:
        store.keep("scene_triangle_emitter", scene.triangle_emitter)
    for name in _DETAILS:
        store.keep(f"detail_{name}", getattr(scene.details, name))
    opacities = {"opacity": scene.opacity}
    if scene.shadow_opacity is not scene.opacity:
        opacities["shadow_opacity"] = scene.shadow_opacity
    for kind in _OPACITIES:
        for name in _OPACITY:
            array = getattr(opacities.get(kind), name, None)
            if array is not None:
                store.keep(f"{kind}_{name}", array)
            else:
                store.remove(f"{kind}_{name}")
    if scene.image is not None:
        store.keep("image_pixel", scene.image.pixel)
        store.keep("image_point", scene.image.point)
    emitters = {"emitters": list(scene.emitters)} if scene.emitters else {}
    return {
        **emitters,
        "materials": scene.points.nondefault(),
        "opacity": scene.opacity is not None,
        **_more_of(opacities),
        "image": None if scene.image is None else [getattr(scene.image, name) for name in _IMAGE],
        "centre": scene.centre,
        "size": scene.size,
        "objects": [
            {
                "name": item.name,
                "n_corners": len(item.corner_point),
                "n_faces": len(item.face_sizes),
                "n_vertices": item.n_vertices,
                "receives": bool(item.receives),
                "two_sided": bool(item.two_sided),
                "own_mesh": bool(item.own_mesh),
                "owner": item.owner,
                "library": item.library,
                "source": item.source,
                **{name: bool(getattr(item, name)) for name in _MET},
            }
            for item in scene.objects
        ],
    }


def read_scene(store):
    """The scene of a store.

    Parameters
    ----------
    store : BakeStore

    Returns
    -------
    Scene

    Raises
    ------
    PRTError
        Arrays that do not fit each other: the store was damaged or tampered with.
    """
    n_points = store.array("point_positions").shape[0]
    points = {
        name: store.read(f"point_{name}", (n_points, 3) if width else (n_points,), dtype)
        for name, (dtype, width) in _POINTS.items()
    }
    emitters, point_emitter, triangle_emitter = _read_emitters(store, n_points)
    points = BakePoints(**points, **_read_materials(store, n_points), emitter=point_emitter)
    vertices = store.read("scene_vertices", (None, 3), "float64")
    triangles = store.read("scene_triangles", (None, 3), "int32")
    lattice = store.read("scene_lattice", (None,), "int32")
    lattice_back = store.read("scene_lattice_back", (len(lattice),), "int32")
    by_triangle = {
        name: store.read(f"scene_{name}", (len(triangles),), dtype)
        for name, dtype in _TRIANGLES.items()
    }
    corners = {name: store.read(f"object_{name}", (None,), "int32") for name in _CORNERS}
    faces = store.read("object_face_sizes", (None,), "int32")
    details = _read_details(store)
    attributes = store.attributes
    with damage_as_error(store.path):
        objects, corner, face = [], 0, 0
        for item in attributes["objects"]:
            item = {**_MET, **item}
            strange = [
                key
                for key, kind in _OBJECT.items()
                if type(item[key]) is not kind or (kind is int and item[key] < 0)
            ]
            source = item.get("source", "")  # bakes of old do not have it
            strange += [] if type(source) is str else ["source"]
            expect(not strange, f"an object of it has a wrong {', '.join(strange)}")
            part = slice(corner, corner + item["n_corners"])
            sizes = faces[face : face + item["n_faces"]]
            objects.append(
                SceneObject(
                    item["name"],
                    corners["corner_point"][part],
                    corners["corner_vertex"][part],
                    sizes,
                    **{key: item[key] for key in list(_OBJECT)[3:]},
                    source=source,
                )
            )
            corner, face = part.stop, face + item["n_faces"]
        scene = Scene(
            centre=np.array(attributes["centre"], np.float64).reshape(3),
            size=attributes["size"],
            vertices=vertices,
            triangles=triangles,
            points=points,
            objects=objects,
            lattice=lattice,
            lattice_back=lattice_back,
            image=_read_image(store, attributes["image"]),
            details=details,
            **_read_opacities(store, len(triangles)),
            emitters=emitters,
            triangle_emitter=triangle_emitter,
            **by_triangle,
        )
        check_scene(scene)
        expect(
            (corner, face) == (len(corners["corner_point"]), len(faces)),
            "its objects have more or fewer corners than there are",
        )
    return scene


def _read_emitters(store, n_points):
    """Names of the emitters, and which of them each point and triangle belongs to."""
    names = store.attributes.get("emitters", [])
    with damage_as_error(store.path):
        texts = isinstance(names, list) and all(isinstance(name, str) for name in names)
        good = texts and len(set(names)) == len(names)
        # Where something emits light there is somebody whose light it is.
        good = good and (names or "emission" not in store.attributes.get("materials", _FIRST))
        expect(good, "the names of its emitters are")
    if not names:
        return (), np.full(n_points, -1, np.int32), None
    point, triangle = (
        store.read(name, (length,), "int32")
        for name, length in (("point_emitter", n_points), ("scene_triangle_emitter", None))
    )
    return tuple(names), point, triangle


def _read_materials(store, n_points):
    """Name -> `Materials`: those that each point has."""
    names = store.attributes.get("materials", _FIRST)
    with damage_as_error(store.path):
        whole = all(name in names for name, q in QUANTITIES.items() if q.default is None)
        expect(
            isinstance(names, list) and set(names) <= set(QUANTITIES) and whole,
            f"its materials have {', '.join(map(str, names))}, this library knows "
            f"{', '.join(QUANTITIES)}",
        )

    def read(prefix, name):
        quantity = QUANTITIES[name]
        shape = n_points, quantity.n_channels
        return store.read(f"point_{prefix}{name}", shape, quantity.dtype)

    return {
        field: Materials(**{name: read(prefix, name) for name in names})
        for field, prefix in MATERIALS.items()
    }


def read_backs(store, scene):
    """The scene with the backs that a bake which is not finished began with.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
        Without them, and without details.

    Returns
    -------
    Scene, or None
        None where there are none to read that fit the scene.
    """
    try:
        lattice_back = store.read("scene_lattice_back", scene.lattice_back.shape, "int32")
    except PRTError:
        return None
    sided = with_backs(scene, lattice_back[scene.lattice_start] >= 0)
    return sided if np.array_equal(sided.lattice_back, lattice_back) else None


def read_details(store, scene):
    """Where the details of a scene lie, of a bake that is not finished.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
        Without them.

    Returns
    -------
    triangle, barycentric, back
        As `with_details` takes them; None where they are not those that the bake began with.
    """
    try:
        details = _read_details(store)
    except PRTError:
        return None
    same = details.digest(scene.lattice_back) == store.attributes.get("details")
    same = same and _lie_on(details, scene)
    return (details.triangle, details.barycentric, details.back) if same else None


def _read_details(store):
    n_details = store.array("detail_point").shape[0]
    return Details(
        **{
            name: store.read(f"detail_{name}", (n_details, *more), dtype)
            for name, (dtype, more) in _DETAILS.items()
        }
    )


def _lie_on(details, scene):
    """Whether they are places on its triangles, on sides that receive light."""
    places = details.triangle, details.barycentric, details.back
    return (
        _inside(details.triangle, 0, len(scene.triangles))
        and _finite(details.barycentric, -_ROUNDING, 1 + _ROUNDING)
        and _finite(1 - details.barycentric.sum(axis=1), -_ROUNDING)
        and bool((details.back.view(np.uint8) <= 1).all())
        and _inside(scene.hit_points(*places)[0], 0, len(scene.points))
    )


def _more_of(opacities):
    """Attributes of what bakes with one opacity, for all rays and both sides, do not say."""
    sided = [
        kind for kind, opacity in opacities.items() if getattr(opacity, "back", None) is not None
    ]
    more = {"sided_opacity": sided} if sided else {}
    if "shadow_opacity" in opacities:
        more["shadow_opacity"] = opacities["shadow_opacity"] is not None
    return more


def _read_opacities(store, n_triangles):
    """Name -> `Opacity` or None, of either kind of rays."""
    sided = store.attributes.get("sided_opacity", [])

    def read(kind):
        if not store.attributes.get(kind, False):
            return None
        shapes = dict.fromkeys(_OPACITY, (n_triangles,)) | {"cells": (None,)}
        names = [name for name in _OPACITY if name != "back" or kind in sided]
        return Opacity(
            **{name: store.read(f"{kind}_{name}", shapes[name], _OPACITY[name]) for name in names}
        )

    opacity = read("opacity")
    own = "shadow_opacity" in store.attributes
    return {"opacity": opacity, "shadow_opacity": read("shadow_opacity") if own else opacity}


def _read_image(store, sizes):
    if sizes is None:
        return None
    pixel = store.read("image_pixel", (None,), "int32")
    point = store.read("image_point", (len(pixel),), "int32")
    return PointImage(*(int(size) for size in sizes), pixel, point)


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
        and _lie_on(scene.details, scene)
        and sum(item.n_vertices for item in scene.objects) == len(scene.vertices)
        and all(
            _inside(item.corner_point, -1, n_points)
            and _inside(item.corner_vertex, 0, item.n_vertices)
            and int(item.face_sizes.sum()) == len(item.corner_point)
            and _inside(item.face_sizes, 0, np.inf)
            for item in scene.objects
        )
    )
