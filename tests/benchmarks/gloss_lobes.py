"""What Cycles makes of surfaces of one lobe each: golden numbers, and how far we are from them.

python -m tests.benchmarks.gloss_lobes [--samples N] [--write] [CASE ...]

Bakes of vertex colours as the camera sees them (`view_from`), two seeds each. With `--write` the
golden file of the tests is made anew.
"""

import argparse
import json
import time

import bpy
import numpy as np

from tests.benchmarks.cycles_truth import set_cycles
from tests.conformance.quiet import quiet
from tests.gloss_cases import (
    CAMERA,
    CASES,
    GOLDEN,
    TANGENT,
    compared,
    difference,
    places,
    radiance_of,
    sky_radiance,
)

# Of the sky's picture: fine enough that Cycles' interpolation is not seen.
_WIDTH, _HEIGHT = 1024, 512
# Of the triangles that stand for places.
_SIZE = 1e-3


def open_scene(case, samples, seed=0):
    """An empty file with the triangles of a case, its sky and the camera: (scene, object)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_cycles(scene, samples, seed)
    scene.cycles.blur_glossy = 0
    _add_sky(scene, case.sky)
    item = _add_places(scene)
    item.data.materials.append(_material(case))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = CAMERA
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene, item


def cycles_radiance(case, samples, seed):
    """(N_PLACES, 3) radiance of a case to the camera, and its diffuse albedo (3,) from above."""
    scene, item = open_scene(case, samples, seed)
    bake = scene.render.bake
    bake.view_from = "ABOVE_SURFACE"
    scene.cycles.samples = 4
    albedo = _bake(item, "DIFFUSE", {"COLOR"}).mean(axis=0)
    scene.cycles.samples = samples
    bake.view_from = "ACTIVE_CAMERA"
    if case.passes == "COMBINED":
        filters = {"DIRECT", "INDIRECT", "DIFFUSE", "GLOSSY", "EMIT"}
    else:
        filters = {"DIRECT", "INDIRECT", "COLOR"}
    return _bake(item, case.passes, filters), albedo


def measured(case, samples):
    """(radiance, albedo, noise): the mean of two bakes, and its relative error by their difference.

    Parameters
    ----------
    case : Case
    samples : int
        Of each of both bakes, a corner.
    """
    with quiet():
        (first, albedo), (second, _) = (cycles_radiance(case, samples, seed) for seed in (0, 1))
    radiance = (first + second) / 2
    return radiance, albedo, difference(case, first, radiance)


def _bake(item, kind, filters):
    attribute = item.data.color_attributes.new("baked", "FLOAT_COLOR", "CORNER")
    item.data.color_attributes.active_color = attribute
    bpy.ops.object.bake(type=kind, target="VERTEX_COLORS", pass_filter=filters)
    attribute = item.data.color_attributes["baked"]
    values = np.empty(len(attribute.data) * 4, np.float32)
    attribute.data.foreach_get("color", values)
    item.data.color_attributes.remove(attribute)
    # The corners of a triangle are three bakes of one place.
    return values.reshape(-1, 3, 4)[..., :3].astype(np.float64).mean(axis=1)


def _add_places(scene):
    normals, _ = places()
    x = np.cross(normals, [0.31, 0.42, 0.85])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normals, x)
    corners = [normals + _SIZE * (np.cos(a) * x + np.sin(a) * y) for a in (0, 2.1, 4.2)]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    mesh = bpy.data.meshes.new("places")
    mesh.from_pydata(vertices, [], np.arange(len(vertices)).reshape(-1, 3))
    item = bpy.data.objects.new("places", mesh)
    scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    return item


def _material(case):
    material = bpy.data.materials.new("case")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(case.node)
    for name, value in case.settings.items():
        setattr(node, name, value)
    for name, value in case.inputs.items():
        socket = node.inputs[name]
        socket.default_value = (*value, 1) if socket.type == "RGBA" else value
    if "tangent" in case.quantities:
        vector = tree.nodes.new("ShaderNodeCombineXYZ")
        for socket, value in zip(vector.inputs, TANGENT, strict=True):
            socket.default_value = value
        tree.links.new(vector.outputs[0], node.inputs["Tangent"])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def _add_sky(scene, name):
    column, row = np.meshgrid(np.arange(_WIDTH), np.arange(_HEIGHT))
    angle = (0.5 - (column + 0.5) / _WIDTH) * 2 * np.pi
    height = ((row + 0.5) / _HEIGHT - 0.5) * np.pi
    flat = np.cos(height)
    directions = np.stack([flat * np.cos(angle), flat * np.sin(angle), np.sin(height)], axis=-1)
    pixels = np.ones((_HEIGHT, _WIDTH, 4), np.float32)
    pixels[..., :3] = sky_radiance(name, directions.reshape(-1, 3)).reshape(_HEIGHT, _WIDTH, 3)
    image = bpy.data.images.new("sky", _WIDTH, _HEIGHT, float_buffer=True, is_data=True)
    image.use_half_precision = False
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    world = scene.world = bpy.data.worlds.new("sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = _WIDTH


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=[])
    parser.add_argument("--samples", type=int, default=4096)
    parser.add_argument("--resolution", type=int, default=96)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    entries = {}
    for name in options.cases or CASES:
        case, start = CASES[name], time.perf_counter()
        radiance, albedo, noise = measured(case, options.samples)
        baked = time.perf_counter() - start
        ours = radiance_of(case, albedo, options.resolution)
        seen = compared(case)
        ratio = ours[seen].sum(axis=0) / radiance[seen].sum(axis=0)
        off = difference(case, ours, radiance)
        print(f"{name:28} off {off:.2%} (bound {case.bound:.1%}), noise {noise:.2%}, "
              f"ours/Cycles {ratio.round(4)}, {baked:.0f} s", flush=True)  # fmt: skip
        entries[name] = {
            "radiance": [[float(f"{v:.5g}") for v in row] for row in radiance],
            "albedo": [float(f"{v:.6g}") for v in albedo],
            "noise": float(f"{noise:.2g}"),
        }
    if options.write:
        GOLDEN.parent.mkdir(exist_ok=True)
        content = {"blender": bpy.app.version_string, "cases": entries}
        GOLDEN.write_text(json.dumps(content, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
