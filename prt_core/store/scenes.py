"""A `Scene` in a store: everything but what follows from it."""

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.scene import BakePoints, PointImage, Scene, SceneObject

_POINTS = {
    "positions": ("float32", 3),
    "normals": ("float32", 3),
    "geometric_normals": ("float32", 3),
    "inward": ("float32", 3),
    "areas": ("float32", 0),
    "albedo": ("float32", 3),
    "object_index": ("int32", 0),
    "visible": ("bool", 0),
}
_TRIANGLES = {"triangle_object": "int32", "triangle_level": "int32", "lattice_start": "int64"}
_IMAGE = ("height", "width", "samples")
_CORNERS = ("corner_point", "corner_vertex")


def write_scene(store, scene):
    """Store a scene; `read_scene` gives it back bit by bit."""
    for name, array in scene.points.arrays().items():
        store.write(f"point_{name}", array)
    for name in ("vertices", "triangles", "lattice", "lattice_back", *_TRIANGLES):
        store.write(f"scene_{name}", getattr(scene, name))
    for name in (*_CORNERS, "face_sizes"):
        parts = [getattr(item, name) for item in scene.objects]
        store.write(f"object_{name}", np.concatenate(parts).astype(np.int32))
    if scene.image is not None:
        store.write("image_pixel", scene.image.pixel)
        store.write("image_point", scene.image.point)
    store.update(
        image=None if scene.image is None else [getattr(scene.image, name) for name in _IMAGE],
        centre=scene.centre,
        size=scene.size,
        objects=[
            {
                "name": item.name,
                "n_corners": len(item.corner_point),
                "n_faces": len(item.face_sizes),
                "n_vertices": item.n_vertices,
                "receives": item.receives,
                "two_sided": item.two_sided,
                "own_mesh": item.own_mesh,
                "owner": item.owner,
                "library": item.library,
            }
            for item in scene.objects
        ],
    )


def read_scene(store):
    """The scene of a store.

    Raises
    ------
    PRTError
        Arrays that do not fit each other: the store was damaged or tampered with.
    """
    n_points = store.array("point_positions").shape[0]
    points = BakePoints(
        **{
            name: store.read(f"point_{name}", (n_points, 3) if width else (n_points,), dtype)
            for name, (dtype, width) in _POINTS.items()
        }
    )
    vertices = store.read("scene_vertices", (None, 3), "float32")
    triangles = store.read("scene_triangles", (None, 3), "int32")
    lattice = store.read("scene_lattice", (None,), "int32")
    lattice_back = store.read("scene_lattice_back", (len(lattice),), "int32")
    by_triangle = {
        name: store.read(f"scene_{name}", (len(triangles),), dtype)
        for name, dtype in _TRIANGLES.items()
    }
    corners = {name: store.read(f"object_{name}", (None,), "int32") for name in _CORNERS}
    faces = store.read("object_face_sizes", (None,), "int32")
    facts = store.facts
    try:
        objects, corner, face = [], 0, 0
        for item in facts["objects"]:
            part = slice(corner, corner + item["n_corners"])
            sizes = faces[face : face + item["n_faces"]]
            objects.append(
                SceneObject(
                    str(item["name"]),
                    corners["corner_point"][part],
                    corners["corner_vertex"][part],
                    sizes,
                    int(item["n_vertices"]),
                    bool(item["receives"]),
                    bool(item["two_sided"]),
                    bool(item["own_mesh"]),
                    str(item.get("owner", item["name"])),
                    str(item.get("library", "")),
                )
            )
            corner, face = part.stop, face + item["n_faces"]
        scene = Scene(
            centre=np.asarray(facts["centre"], np.float64).reshape(3),
            size=float(facts["size"]),
            vertices=vertices,
            triangles=triangles,
            points=points,
            objects=objects,
            lattice=lattice,
            lattice_back=lattice_back,
            image=_read_image(store, facts.get("image")),
            **by_triangle,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise PRTError(f"{store.path}: its description is damaged ({error!r})") from error
    _check(store, scene, corner, face)
    return scene


def _read_image(store, sizes):
    if sizes is None:
        return None
    pixel = store.read("image_pixel", (None,), "int32")
    point = store.read("image_point", (len(pixel),), "int32")
    return PointImage(*(int(size) for size in sizes), pixel, point)


def _check(store, scene, n_corners, n_faces):
    """Indices inside their arrays, so that a damaged store cannot lead anywhere else."""

    def inside(array, low, high):
        return array.size == 0 or (array.min() >= low and array.max() < high)

    level = scene.triangle_level.astype(np.int64)
    cells = (level + 1) * (level + 2) // 2
    image = scene.image
    fits = (
        (
            image is None
            or (
                min(image.height, image.width, image.samples) > 0
                and inside(image.pixel, 0, image.height * image.width)
                and inside(image.point, 0, len(scene.points))
            )
        )
        and inside(scene.triangles, 0, len(scene.vertices))
        and inside(scene.triangle_object, 0, len(scene.objects))
        and inside(scene.lattice, 0, len(scene.points))
        and inside(scene.lattice_back, -1, len(scene.points))
        and inside(level, 1, 1 << 12)
        and inside(scene.lattice_start, 0, len(scene.lattice))
        and inside(scene.lattice_start + cells, 0, len(scene.lattice) + 1)
        and inside(scene.points.object_index, 0, len(scene.objects))
        and sum(item.n_vertices for item in scene.objects) == len(scene.vertices)
        and all(
            inside(item.corner_point, -1, len(scene.points))
            and inside(item.corner_vertex, 0, item.n_vertices)
            and int(item.face_sizes.sum()) == len(item.corner_point)
            for item in scene.objects
        )
        and n_corners == store.array("object_corner_point").shape[0]
        and n_faces == store.array("object_face_sizes").shape[0]
    )
    expect(fits, f"{store.path}: its indices do not fit each other; it is damaged or tampered with")
