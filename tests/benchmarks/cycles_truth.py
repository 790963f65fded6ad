"""Cycles' own vertex-colour bake of a scene under one light: the truth that bakes are held against.

python tests/benchmarks/cycles_truth.py SCENE.blend --light NAME|lamps --samples N \
    --bounces direct|all -o OUT.npz

OUT.npz: for each object `NAME` (n_vertices, 3) float32, point domain, and `seconds` of the bake.
"""

import argparse
import time
from pathlib import Path

import bpy
import numpy as np


def studio_light(name):
    """Path of one of the CC0 HDRIs inside Blender."""
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    path = folder / f"{name}.exr"
    if not path.exists():
        raise SystemExit(f"no HDRI '{name}' in {folder}")
    return path


def set_light(scene, light):
    """Light the scene by an HDRI alone, or by its lamps alone."""
    if light == "lamps":
        scene.world = None
        return
    for item in [o for o in scene.objects if o.type == "LIGHT"]:
        bpy.data.objects.remove(item)
    tree = scene.world.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(studio_light(light)))
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    scene.world.cycles.sampling_method = "MANUAL"
    scene.world.cycles.sample_map_resolution = 2048


def set_cycles(scene, samples, seed):
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0


def bake(scene, names, bounces, domain="POINT"):
    """Colours of each object as Cycles bakes them, of a domain, and the seconds it took."""
    passes = {"COLOR", "DIRECT"} | ({"INDIRECT"} if bounces == "all" else set())
    colours = {}
    start = time.perf_counter()
    for name in names:
        target = bpy.data.objects[name]
        for item in scene.objects:
            item.select_set(item is target)
        bpy.context.view_layer.objects.active = target
        attribute = target.data.color_attributes.new("truth", "FLOAT_COLOR", domain)
        target.data.color_attributes.active_color = attribute
        bpy.ops.object.bake(type="DIFFUSE", target="VERTEX_COLORS", pass_filter=passes)
        attribute = target.data.color_attributes["truth"]
        values = np.empty(len(attribute.data) * 4, np.float32)
        attribute.data.foreach_get("color", values)
        colours[name] = values.reshape(-1, 4)[:, :3].copy()
        target.data.color_attributes.remove(attribute)
    return colours, time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene")
    parser.add_argument("--light", required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--bounces", choices=("direct", "all"), required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", required=True)
    options = parser.parse_args()
    bpy.ops.wm.open_mainfile(filepath=str(Path(options.scene).resolve()))
    scene = bpy.context.scene
    set_light(scene, options.light)
    set_cycles(scene, options.samples, options.seed)
    names = [item.name for item in scene.objects if item.type == "MESH"]
    colours, seconds = bake(scene, names, options.bounces)
    np.savez(options.output, seconds=seconds, **colours)
    print(f"{options.output}: {options.samples} samples in {seconds:.0f} s")


if __name__ == "__main__":
    main()
