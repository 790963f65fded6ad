"""A `Scene` in a store: everything but what follows from it, checked on the way in and out."""

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.runtime.array_parts import held_once
from prt_core.scene import (
    MATERIALS,
    BakePoints,
    Camera,
    Details,
    Opacity,
    PointImage,
    Refined,
    Scene,
    SceneObject,
    with_backs,
)
from prt_core.store.atlas import read_atlas, write_atlas
from prt_core.store.attributes import damage_as_error
from prt_core.store.mesh_parts import with_mesh_parts, write_mesh_parts
from prt_core.store.scene_checks import check_scene, lie_on

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
    "source": str,
    "shadow_rays": bool,
    "diffuse_rays": bool,
    "camera_rays": bool,
}
# What objects of bakes are that do not say it: they were made when rays met everything.
_MET = dict.fromkeys(("shadow_rays", "diffuse_rays", "camera_rays"), True)
_BEFORE = {"source": "", **_MET}
# Of objects whose edges were split: those of all such, one after the other.
_REFINED = {"around": "int32", "weights": "float32", "vertex_round": "int32"}
# Of triangles that let light pass, where there are some; and its names for either kind of rays.
_OPACITY = {"first": "int32", "along": "int32", "cells": "uint16", "back": "int32"}
_OPACITIES = ("opacity", "shadow_opacity")
# What the materials of bakes have that do not say it: they were made when there was no more.
_FIRST = ["albedo"]


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
    refined = [item.refined for item in scene.objects if item.refined is not None]
    for name in _REFINED if refined else ():
        store.keep(f"refined_{name}", np.concatenate([getattr(each, name) for each in refined]))
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
    seen_by = getattr(scene.image, "camera", None)
    return {
        **emitters,
        **({"image_camera": seen_by.to_dict()} if seen_by else {}),
        **write_mesh_parts(store, scene),
        **write_atlas(store, scene.image),
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
                **({"refined_from": item.refined.n_before} if item.refined else {}),
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
    lattice_back = held_once(store.read("scene_lattice_back", (len(lattice),), "int32"))
    by_triangle = {
        name: held_once(store.read(f"scene_{name}", (len(triangles),), dtype))
        for name, dtype in _TRIANGLES.items()
    }
    corners = {name: store.read(f"object_{name}", (None,), "int32") for name in _CORNERS}
    faces = store.read("object_face_sizes", (None,), "int32")
    details = _read_details(store)
    attributes = store.attributes
    with damage_as_error(store.path):
        objects, corner, face = [], 0, 0
        refined = _read_refined(store, attributes["objects"])
        for item in attributes["objects"]:
            item = {**_BEFORE, **item}
            strange = [
                key
                for key, kind in _OBJECT.items()
                if type(item[key]) is not kind or (kind is int and item[key] < 0)
            ]
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
                    refined=refined.get(item["name"]),
                )
            )
            corner, face = part.stop, face + item["n_faces"]
        of_object = by_triangle["triangle_object"]
        objects = with_mesh_parts(store, objects, np.bincount(of_object, minlength=len(objects)))
        scene = Scene(
            centre=np.array(attributes["centre"], np.float64).reshape(3),
            size=attributes["size"],
            vertices=vertices,
            triangles=triangles,
            points=points,
            objects=objects,
            lattice=lattice,
            lattice_back=lattice_back,
            image=_read_image(store, attributes["image"], attributes.get("image_camera")),
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


def _read_refined(store, items):
    """Name -> `Refined` of the objects whose edges were split."""
    items = [item for item in items if "refined_from" in item]
    if not items:
        return {}
    n_corners, n_vertices = (
        sum(item[key] for item in items) for key in ("n_corners", "n_vertices")
    )
    shapes = {"around": (n_corners, 3), "weights": (n_corners, 3), "vertex_round": (n_vertices,)}
    arrays = {
        name: store.read(f"refined_{name}", shapes[name], dtype) for name, dtype in _REFINED.items()
    }
    refined, corner, vertex = {}, 0, 0
    for item in items:
        corners = slice(corner, corner + item["n_corners"])
        vertices = slice(vertex, vertex + item["n_vertices"])
        corner, vertex, n_before = corners.stop, vertices.stop, item["refined_from"]
        around, weights = arrays["around"][corners], arrays["weights"][corners]
        rounds = arrays["vertex_round"][vertices]
        expect(
            type(n_before) is int
            and around.min(initial=0) >= 0
            and around.max(initial=-1) < n_before
            and bool((np.abs(weights - 0.5) <= 0.5 + 1e-5).all())
            and rounds.min(initial=0) >= 0,
            f"where '{item['name']}' was refined is out of range",
        )
        refined[item["name"]] = Refined(around, weights, rounds, n_before)
    return refined


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
        return (), np.broadcast_to(np.int32(-1), n_points), None
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

    own, mean = (
        Materials(**{name: read(prefix, name) for name in names}) for prefix in MATERIALS.values()
    )
    return {"materials": own, "mean_materials": own if mean.equals(own) else mean}


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
    same = same and lie_on(details, scene)
    return (details.triangle, details.barycentric, details.back) if same else None


def _read_details(store):
    n_details = store.array("detail_point").shape[0]
    return Details(
        **{
            name: store.read(f"detail_{name}", (n_details, *more), dtype)
            for name, (dtype, more) in _DETAILS.items()
        }
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


def _read_image(store, sizes, camera):
    if sizes is None:
        return None
    pixel = store.read("image_pixel", (None,), "int32")
    point = store.read("image_point", (len(pixel),), "int32")
    camera = None if camera is None else Camera(**camera)
    height, width, samples = (int(size) for size in sizes)
    atlas = read_atlas(store, height * width)
    return PointImage(height, width, samples, pixel, point, camera, atlas)
