"""Glossy scenes under images, relit for a view, beside Cycles' bake for the same view.

    python -m tests.benchmarks.gloss_scenes [NAME …] [--light city …] [--samples N]

Cycles bakes vertices as the camera sees them, twice with other seeds: half the difference of the
two is its noise, and is taken out of the figure. Points whose view makes an angle of less than
some 12 degrees with the surface are left out: Cycles lifts their view.
"""

import argparse
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "blend_scenes")]

import build  # noqa: E402
import prt_core.blender  # noqa: E402, F401
from prt_core import bake, load  # noqa: E402
from prt_core.blender.studio import studio_paths  # noqa: E402
from prt_core.relight.lighting import lighting_of  # noqa: E402
from prt_core.relight.relighter import Relighter  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from prt_core.transport import View  # noqa: E402

FOLDER = ROOT / "build" / "bench" / "gloss"
# Least cosine between view and normal that Cycles does not lift.
_FACING = 0.2


def principled(name, colour=(0.6, 0.35, 0.2), **inputs):
    """A Principled BSDF with some of its sockets set."""
    material = build.principled(name, colour)
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Specular IOR Level"].default_value = 0.5
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return material


def glossy(name, colour=(0.9, 0.8, 0.6), roughness=0.5):
    """A Glossy BSDF alone."""
    material = build.diffuse(name, (0, 0, 0))
    tree = material.node_tree
    shader = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    shader.inputs["Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = roughness
    tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return material


MATERIALS = {
    "ggx_0.5": lambda: glossy("ggx", roughness=0.5),
    "ggx_0.2": lambda: glossy("ggx", roughness=0.2),
    "metal_0.3": lambda: principled("metal", (0.9, 0.6, 0.3), Metallic=1, Roughness=0.3),
    "dielectric": lambda: principled("plastic", Roughness=0.4),
    "brushed": lambda: principled(
        "brushed", (0.9, 0.6, 0.3), Metallic=1, Roughness=0.45, Anisotropic=0.7
    ),
    "tinted": lambda: principled("tinted", Roughness=0.4, Specular_Tint=(1, 0.4, 0.2, 1)),
    "clay": lambda: principled("clay", Roughness=0.6, Diffuse_Roughness=1),
    "coat": lambda: principled("lacquer", Roughness=0.6, Coat_Weight=1, Coat_Roughness=0.3),
}


def grazing():
    """Metal and lacquer on a glossy floor, most of which is seen at 12 to 20 degrees."""
    build.clear()
    gold = principled("gold", (0.9, 0.6, 0.25), Metallic=1, Roughness=0.3)
    build.suzanne("model", gold, 1, 1.4).location.x = -0.6
    lacquer = principled(
        "lacquer", (0.5, 0.03, 0.03), Roughness=0.5, Coat_Weight=1, Coat_Roughness=0.1
    )
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=32, ring_count=16, radius=0.55, location=(0.9, -0.3, 0.554)
    )
    build.added("ball", lacquer, smooth=True)
    build.grid("ground", 61, -2, 2, principled("floor", (0.25, 0.3, 0.35), Roughness=0.3))
    build.camera((0.3, -4.6, 1.15), (0, 0, 0.4), 45)
    bpy.context.view_layer.update()


def scene_of(name, levels=2, side=81):
    """Suzanne of a material on diffuse ground, or both of it where the name begins with ground.

    Or `grazing`.
    """
    if name == "grazing":
        grazing()
        return
    build.clear()
    made = MATERIALS[name.removeprefix("ground_")]()
    build.suzanne("model", made, levels, 1.6)
    floor = made if name.startswith("ground_") else build.diffuse("floor", (0.5, 0.5, 0.5))
    build.grid("ground", side, -2, 2, floor)
    build.camera((3.2, -3.6, 2.4), (0, 0, 0.7))
    bpy.context.view_layer.update()


def world_image(path):
    """The world shines with an image."""
    tree = bpy.context.scene.world.node_tree
    image = tree.nodes.new("ShaderNodeTexEnvironment")
    image.image = bpy.data.images.load(str(path))
    tree.links.new(image.outputs[0], tree.nodes["Background"].inputs["Color"])


def cycles_bake(seed, samples, kind="COMBINED"):
    """Name -> (n_corners, 3) float32: what Cycles bakes for the camera."""
    scene = bpy.context.scene
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy, cycles.caustics_reflective = 0, True
    scene.render.bake.view_from = "ACTIVE_CAMERA"
    colours = {}
    for item in [item for item in scene.objects if item.type == "MESH"]:
        mesh = item.data
        layer = mesh.color_attributes.new("truth", "FLOAT_COLOR", "CORNER")
        mesh.color_attributes.active_color = layer
        bpy.ops.object.select_all(action="DESELECT")
        item.select_set(True)
        bpy.context.view_layer.objects.active = item
        bpy.ops.object.bake(type=kind, target="VERTEX_COLORS")
        values = np.empty(4 * len(mesh.loops), np.float32)
        mesh.color_attributes["truth"].data.foreach_get("color", values)
        colours[item.name] = values.reshape(-1, 4)[:, :3].copy()
        mesh.color_attributes.remove(mesh.color_attributes["truth"])
    return colours


def compared(ours, truths, facing):
    """Relative L2 of each object, Cycles' noise taken out, and that noise."""
    result = {}
    for name in truths[0]:
        keep = facing[name]
        first, second = (truth[name][keep].astype(np.float64) for truth in truths)
        mean = (first + second) / 2
        noise = ((first - second) ** 2).sum() / 4
        away = ((ours[name][keep] - mean) ** 2).sum()
        size = (mean**2).sum()
        signed = (ours[name][keep] - mean).sum() / mean.sum()
        result[name] = np.sqrt(max(away - noise, 0) / size), np.sqrt(noise / size), signed
    return result


def truth(name, light, seed, samples):
    """`cycles_bake` of the open scene, kept for the next time."""
    path = FOLDER / f"{name}_{light}_{seed}_{samples}.npz"
    if not path.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        np.savez(path, **cycles_bake(seed, samples))
    return dict(np.load(path))


def measured(name, light, samples):
    """`compared` of a scene under an image, and seconds of a light and of a view."""
    scene_of(name)
    world_image(studio_paths([light])[light])
    path = FOLDER / f"{name}.prt"
    bake(None, path, gloss=True, method="exhaustive", restart="changed")
    baked = load(path)
    relighter, lighting = Relighter(baked), lighting_of(studio_paths([light])[light])
    view, spent = View.of_camera(baked.camera), []
    for _ in range(2):
        begun = time.perf_counter()
        radiance = run(relighter.steps(lighting, view=view))
        spent.append(time.perf_counter() - begun)
    relighter.close()
    points = baked.scene.points
    outgoing = view.outgoing(baked.scene.to_world(points.positions))
    facing = np.einsum("nx,nx->n", outgoing, points.normals) > _FACING
    facing = {item.name: facing[item.corner_point] for item in baked.scene.objects if item.receives}
    truths = [truth(name, light, seed, samples) for seed in (1, 2)]
    return compared(baked.colours(radiance), truths, facing), spent


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[*MATERIALS, "grazing"])
    parser.add_argument("--light", nargs="+", default=["city", "courtyard", "interior"])
    parser.add_argument("--samples", type=int, default=256)
    options = parser.parse_args()
    for name in options.names:
        for light in options.light:
            errors, spent = measured(name, light, options.samples)
            figures = ", ".join(
                f"{item} {error:.1%} (noise {noise:.1%}, mean {signed:+.1%})"
                for item, (error, noise, signed) in errors.items()
            )
            print(f"{name} under {light}: {figures}; {spent[0]:.2f}, {spent[1]:.2f} s", flush=True)


if __name__ == "__main__":
    main()
