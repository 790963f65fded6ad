"""A real asset as a scene: imported as it is, on a ground, under one HDRI, and baked by Cycles.

What is measured is the asset's own geometry and materials: its lamps and its world give way to the
HDRI. A file that brings a ground of its own keeps it.
"""

import time

import bpy
import numpy as np

import prt_core
from tests.benchmarks import cycles_truth
from tests.conformance.golden import error

IMPORTERS = {
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".gltf": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".fbx": lambda path: _import_fbx(path),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
}
SUFFIXES = (".blend", *IMPORTERS)


def _import_fbx(path):
    """By the importer of the menu: since Blender 4.5 that of C++."""
    if "fbx_import" in dir(bpy.ops.wm):
        bpy.ops.wm.fbx_import(filepath=path)
    else:
        bpy.ops.import_scene.fbx(filepath=path)


GROUND, GROUND_EDGE = "ground of the benchmark", 31
# Of the width of the ground: nothing lies in its plane.
GAP = 2e-4
# Samples of a round of Cycles, and seconds after which it begins no other.
ROUND, PATIENCE = 64, 12


def open_asset(path):
    """Open or import a file into an empty one, without its lamps and on a ground."""
    if path.suffix.lower() == ".blend":
        prt_core.open_blend(path)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        IMPORTERS[path.suffix.lower()](str(path))
    for item in [item for item in bpy.data.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(item)
    low, high = _boxes()
    if len(low) and not _has_ground(low, high):
        _add_ground(low.min(axis=0), high.max(axis=0))


def _boxes():
    """(n, 3) lowest and highest corners of what has a surface, by instance."""
    corners = [
        np.array(each.object.bound_box) @ np.array(each.matrix_world)[:3, :3].T
        + np.array(each.matrix_world)[:3, 3]
        for each in bpy.context.evaluated_depsgraph_get().object_instances
        if each.object.type in ("MESH", "CURVE", "SURFACE", "FONT", "META")
        and not each.object.hide_render
    ]
    corners = np.array(corners, np.float64).reshape(-1, 8, 3)
    return corners.min(axis=1), corners.max(axis=1)


def _has_ground(low, high):
    """Whether something flat lies under everything else."""
    size, middle = high - low, (high + low) / 2
    flat = size[:, 2] <= 0.02 * size[:, :2].max(axis=1)
    wide = (size[:, :2] >= 0.9 * (high.max(axis=0) - low.min(axis=0))[:2]).all(axis=1)
    below = middle[:, 2] <= low[:, 2].min() + 0.1 * (high[:, 2].max() - low[:, 2].min())
    return bool((flat & wide & below).any()) and len(low) > 1


def _add_ground(low, high):
    """A grey grid of five times the asset's size right under it."""
    width = 5 * max(float((high - low).max()), 1e-3)
    middle = ((low + high) / 2)[:2]
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=GROUND_EDGE,
        y_subdivisions=GROUND_EDGE,
        size=width,
        location=(*middle, low[2] - GAP * width),
    )
    ground = bpy.context.object
    ground.name = GROUND
    material = bpy.data.materials.new(GROUND)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = (nodes.new(f"ShaderNode{name}") for name in ("BsdfDiffuse", "OutputMaterial"))
    shader.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    material.node_tree.links.new(shader.outputs[0], output.inputs[0])
    ground.data.materials.append(material)


def set_world(light):
    """Light the open scene by one of Blender's own HDRIs."""
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new(light)
    scene.world.use_nodes = True
    cycles_truth.set_light(scene, light)
    for layer in scene.view_layers:
        layer.use_sky = True


def targets(colours):
    """Names of the objects that both bake, and what Cycles cannot bake, by a reason.

    Parameters
    ----------
    colours : dict of str -> (n_corners, 3)
        Those of our bake.
    """
    bakes, left = [], {}
    for name, ours in colours.items():
        item = bpy.data.objects.get(name)
        if item is None or item.type != "MESH":
            left[name] = "no mesh object"
        elif item.library or item.data.library or item.override_library:
            left[name] = "linked"
        elif item.name not in bpy.context.view_layer.objects or item.hide_render:
            left[name] = "not by itself in the render"
        elif len(item.data.loops) != len(ours):
            left[name] = "modifiers change its corners"
        else:
            bakes.append(name)
    return bakes, left


def truth(names, bound, most_samples):
    """Cycles' diffuse pass (direct, indirect, colour) and the diffuse colour alone.

    Rounds of two seeds are added until the noise is below a third of the bound.

    Returns
    -------
    dict
        `colours` and `albedo` ({name: (n_corners, 3)}), `noise` (that of the mean of both seeds,
        as an error of the asset), `samples`, `seconds`.
    """
    scene, start = bpy.context.scene, time.perf_counter()
    _let_bake(scene, names)
    cycles_truth.set_cycles(scene, 16, 0)
    albedo = _bake(scene, names, {"COLOR"})
    ends = np.cumsum([len(albedo[name]) for name in names])[:-1]
    asset = np.concatenate([np.full(len(albedo[name]), name != GROUND) for name in names])
    halves, rounds = [0.0, 0.0], 0
    while True:
        for half in (0, 1):
            cycles_truth.set_cycles(scene, ROUND, 2 * rounds + half)
            scene.cycles.transparent_max_bounces = scene.cycles.max_bounces
            baked = _bake(scene, names, {"COLOR", "DIRECT", "INDIRECT"})
            flat = np.concatenate([baked[name] for name in names]).astype(np.float64)
            halves[half] = (halves[half] * rounds + flat) / (rounds + 1)
        rounds += 1
        mean = (halves[0] + halves[1]) / 2
        noise, spent = error(halves[0][asset], mean[asset]), time.perf_counter() - start
        if noise <= bound / 3 or 2 * rounds * ROUND >= most_samples or spent > PATIENCE:
            break
    colours = dict(zip(names, np.split(mean.astype(np.float32), ends), strict=True))
    return {
        "colours": colours,
        "albedo": albedo,
        "noise": noise,
        "samples": 2 * rounds * ROUND,
        "seconds": spent,
    }


def _let_bake(scene, names):
    """Settings of a file that would keep Cycles from baking these objects as they are."""
    scene.render.bake.use_selected_to_active = False
    scene.render.bake.target = "VERTEX_COLORS"
    scene.render.bake.view_from = "ABOVE_SURFACE"
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for name in names:
        item = bpy.data.objects[name]
        item.hide_select = item.hide_viewport = False
        item.hide_set(False)


def _bake(scene, names, passes):
    colours = {}
    for name in names:
        target = bpy.data.objects[name]
        for item in bpy.context.view_layer.objects:
            item.select_set(item is target)
        bpy.context.view_layer.objects.active = target
        attribute = target.data.color_attributes.new("truth", "FLOAT_COLOR", "CORNER")
        label = attribute.name
        target.data.color_attributes.active_color = attribute
        try:
            bpy.ops.object.bake(type="DIFFUSE", target="VERTEX_COLORS", pass_filter=passes)
            attribute = target.data.color_attributes[label]
            values = np.empty(len(attribute.data) * 4, np.float32)
            attribute.data.foreach_get("color", values)
        finally:
            target.data.color_attributes.remove(target.data.color_attributes[label])
        colours[name] = values.reshape(-1, 4)[:, :3].copy()
    return colours
