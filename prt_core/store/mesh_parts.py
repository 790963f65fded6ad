"""The `MeshParts` of a scene's objects in a store; bakes of before have none."""

from dataclasses import replace

import numpy as np

from prt_core.errors import expect
from prt_core.scene import MeshParts
from prt_core.store.attributes import damage_as_error

_ARRAYS = {"triangle_corners": 3, "corner_material": 0, "corner_uv": 2}


def write_mesh_parts(store, scene):
    """Store them; returns the attributes that belong to them.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    """
    parts = [item.parts for item in scene.objects]
    if any(part is None for part in parts):
        # A scene that was read from a bake of before.
        for name in _ARRAYS:
            store.remove(f"mesh_{name}")
        return {"meshes": None}
    uvs = [part.corner_uv for part in parts if part.corner_uv is not None]
    whole = {
        "triangle_corners": np.concatenate([part.triangle_corners for part in parts]),
        "corner_material": np.concatenate([part.corner_material for part in parts]),
        "corner_uv": np.concatenate(uvs) if uvs else np.zeros((0, 2), np.float32),
    }
    for name, array in whole.items():
        store.keep(f"mesh_{name}", array)
    return {
        "meshes": [
            {
                "materials": list(part.material_names),
                "matrix": part.matrix.ravel().tolist(),
                "uv": part.corner_uv is not None,
            }
            for part in parts
        ]
    }


def with_mesh_parts(store, objects, n_triangles):
    """Objects with their parts, where the store has them.

    Parameters
    ----------
    store : BakeStore
    objects : list of SceneObject
    n_triangles : sequence of int
        Of each object.

    Returns
    -------
    list of SceneObject
    """
    meshes = store.attributes.get("meshes")
    if meshes is None:
        return objects
    n_corners = [len(item.corner_point) for item in objects]
    with damage_as_error(store.path):
        good = isinstance(meshes, list) and len(meshes) == len(n_corners)
        expect(good and all(map(_is_mesh, meshes)), "what it says of its meshes is")
        expect(len(n_triangles) == len(objects), "its triangles belong to no object")
        corners, triangles = sum(n_corners), int(sum(n_triangles))
        with_uv = sum(n for n, mesh in zip(n_corners, meshes, strict=True) if mesh["uv"])
    of_triangles = store.read("mesh_triangle_corners", (triangles, 3), "int32")
    materials = store.read("mesh_corner_material", (corners,), "int32")
    uvs = store.read("mesh_corner_uv", (with_uv, 2), "float32")
    result, corner, triangle, uv = [], 0, 0, 0
    with damage_as_error(store.path):
        expect(bool(np.isfinite(uvs).all()), "its UV maps are not finite")
        for item, mesh, n, m in zip(objects, meshes, n_corners, n_triangles, strict=True):
            mine = of_triangles[triangle : triangle + m]
            inside = not mine.size or (mine.min() >= 0 and mine.max() < n)
            expect(inside, "corners of its triangles are out of range")
            parts = MeshParts(
                mine,
                materials[corner : corner + n],
                tuple(mesh["materials"]),
                np.array(mesh["matrix"], np.float64).reshape(4, 4),
                uvs[uv : uv + n] if mesh["uv"] else None,
            )
            result.append(replace(item, parts=parts))
            corner, triangle, uv = corner + n, triangle + m, uv + n * mesh["uv"]
    return result


def _is_mesh(mesh):
    numbers = mesh["matrix"]
    return (
        all(isinstance(name, str) for name in mesh["materials"])
        and type(mesh["uv"]) is bool
        and len(numbers) == 16
        and all(type(number) is float and np.isfinite(number) for number in numbers)
    )
