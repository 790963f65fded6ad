"""The papers' set-up for measuring samplers: a model of height 1.6 on a ground from -2 to 2.

Models come from a folder of meshes (PRT_DATA, or shared/data beside the source tree); what Blender
has read is kept under PRT_CACHE (/tmp).
"""

import os
from pathlib import Path

import bpy
import numpy as np

from prt_core.errors import expect
from prt_core.scene import Mesh, Scene

MODELS = {
    "bunny": "bunny_stanford_35947.ply",
    "dancer": "dancer_DancingGirl.fbx",
    "dragon": "dragon_22982.ply",
    "suzanne": None,
}
GROUND, HEIGHT = 171, 1.6
CACHE = Path(os.environ.get("PRT_CACHE", "/tmp"))


def data_folder():
    """Where the meshes are, or None."""
    beside = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    for folder in (os.environ.get("PRT_DATA"), beside):
        if folder and (Path(folder) / "meshes").is_dir():
            return Path(folder)
    return None


def measuring_scene(name, ground=GROUND, levels=3, halvings=0):
    """One of MODELS on the ground, as a `Scene` of the objects `model` and `ground`.

    Parameters
    ----------
    name : str
    ground : int
        Vertices along an edge of the ground.
    levels : int
        Subdivisions of Suzanne (3: 31,658 vertices; each level has four times as many).
    halvings : int
        Times that every edge of the model is halved: the same surface in about four times as many
        points each.
    """
    vertices, triangles = model_arrays(name, levels)
    for _ in range(halvings):
        vertices, triangles = _halved(vertices, triangles)
    return Scene.from_meshes(
        [
            smooth_mesh("model", vertices, triangles, (0.7, 0.65, 0.6)),
            smooth_mesh("ground", *ground_arrays(ground), (0.5, 0.5, 0.5)),
        ]
    )


def model_arrays(name, levels=3):
    """Vertices (n, 3) float64 and triangles (m, 3) int32 of one of MODELS, standing on z = 0."""
    kept = CACHE / "scenes" / (f"{name}_{levels}.npz" if name == "suzanne" else f"{name}.npz")
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        vertices, triangles = _read_with_blender(name, levels)
        part = kept.with_suffix(f".{os.getpid()}.part")
        with part.open("wb") as file:
            np.savez(file, vertices=vertices, triangles=triangles)
        part.replace(kept)
    arrays = np.load(kept)
    return arrays["vertices"], arrays["triangles"]


def _read_with_blender(name, levels):
    """Vertices (z up, standing on z = 0, HEIGHT high) and triangles."""
    folder = data_folder()
    expect(
        MODELS[name] is None or folder is not None,
        f"{name}: expected a folder with meshes/{MODELS[name]}, found none; name it in PRT_DATA",
    )
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if MODELS[name] is None:
        bpy.ops.mesh.primitive_monkey_add()
        modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = levels
    else:
        path = str(folder / "meshes" / MODELS[name])
        if path.endswith(".fbx"):
            bpy.ops.wm.fbx_import(filepath=path)
        else:
            bpy.ops.wm.ply_import(filepath=path, forward_axis="NEGATIVE_Z", up_axis="Y")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    model = next(o for o in bpy.data.objects if o.type == "MESH").evaluated_get(depsgraph)
    mesh = model.data
    vertices = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", vertices)
    triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    world = np.array(model.matrix_world, np.float64)
    vertices = vertices.reshape(-1, 3).astype(np.float64) @ world[:3, :3].T + world[:3, 3]
    triangles = triangles.reshape(-1, 3)
    low, high = vertices[triangles].min(axis=(0, 1)), vertices[triangles].max(axis=(0, 1))
    vertices = (vertices - [*((low + high)[:2] / 2), low[2]]) * HEIGHT / (high - low)[2]
    return vertices, triangles


def _halved(vertices, triangles):
    """Each triangle as four, by the middles of its edges."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    edges, edge = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    ab, bc, ca = len(vertices) + edge.reshape(-1, 3).T
    a, b, c = triangles.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    middles = vertices[edges].mean(axis=1)
    return np.concatenate([vertices, middles]), np.concatenate([np.transpose(p) for p in parts])


def ground_arrays(n):
    """Vertices and triangles of the square from -2 to 2, of n vertices along an edge."""
    side = np.linspace(-2, 2, n)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    a, b, c, d = first, first + 1, first + n + 1, first + n
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def smooth_mesh(name, vertices, triangles, albedo):
    """One normal a vertex: the mean of its faces', weighted by their area."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    face = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], face)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    corners = triangles.ravel()
    return Mesh(
        name,
        vertices,
        corners,
        normals[corners],
        np.arange(len(corners)).reshape(-1, 3),
        np.broadcast_to(np.asarray(albedo, float), (len(corners), 3)),
    )
