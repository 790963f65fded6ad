"""A scene with all that the store keeps: `python -m tests.benchmarks.store_scene OUT.blend`.

Cards with cut-outs of an image and of two sides, a pane, a translucent sheet, a wall whose back is
lit, a tube that glows, and materials that diffuse rays and shadow rays meet otherwise.
"""

import argparse
import math

import bpy

from tests.conformance import parts


def build():
    """Build it in an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    parts.world(0.7, (0.6, 0.8, 1))
    parts.lamp_above("SPOT")
    parts.ground(cells=24)
    parts.wall(rotation=(0, -math.pi / 2, 0))
    parts.ball("bulb", parts.emission("tube", (1, 0.3, 0.1), 6), 0.1, location=(1.2, 1, 0.4))
    parts.sheet("card", _cut_out(), 1, location=(0.9, -0.9, 0.5))
    parts.sheet("two sides", _two_sides(), 0.8, location=(-0.6, 0.9, 0.4))
    leaf = parts.shader("leaf", "ShaderNodeBsdfTranslucent", {"Color": (0.2, 0.7, 0.1, 1)})
    parts.sheet("leaf", leaf, 0.7, location=(-0.8, -0.8, 0.3))
    parts.sheet("screen", _told_apart(), 0.8, location=(0.2, 0.2, 0.9))


def _cut_out():
    alpha = parts.image("holes", parts.patches(16, 16, seed=3)[..., :1].repeat(3, axis=2), True)

    def surface(tree):
        holes = parts.add(tree, "ShaderNodeTexImage", image=alpha).outputs[0]
        kind, inputs = "ShaderNodeBsdfPrincipled", {"Specular IOR Level": 0, "Alpha": holes}
        return parts.add(tree, kind, {**inputs, "Base Color": (0.8, 0.5, 0.1, 1)}).outputs[0]

    return parts.shaded("card", surface)


def _two_sides():
    """Grey from the front; from behind it glows, and half of the light goes through."""

    def surface(tree):
        back = parts.add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
        clear = parts.add(tree, "ShaderNodeBsdfTransparent").outputs[0]
        glow = parts.add(tree, "ShaderNodeEmission", {"Color": (0.2, 0.4, 1, 1)}).outputs[0]
        behind = parts.add(tree, "ShaderNodeMixShader", {0: 0.5, 1: clear, 2: glow}).outputs[0]
        front = parts.add(tree, "ShaderNodeBsdfDiffuse").outputs[0]
        return parts.add(tree, "ShaderNodeMixShader", {0: back, 1: front, 2: behind}).outputs[0]

    return parts.shaded("two sides", surface)


def _told_apart():
    """Shown grey, met red by diffuse rays, clear to shadow rays."""

    def surface(tree):
        path = parts.add(tree, "ShaderNodeLightPath").outputs
        grey = parts.add(tree, "ShaderNodeBsdfDiffuse").outputs[0]
        red = parts.add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.9, 0.1, 0.1, 1)}).outputs[0]
        clear = parts.add(tree, "ShaderNodeBsdfTransparent").outputs[0]
        kinds = {0: path["Is Diffuse Ray"], 1: grey, 2: red}
        met = parts.add(tree, "ShaderNodeMixShader", kinds).outputs[0]
        kinds = {0: path["Is Shadow Ray"], 1: met, 2: clear}
        return parts.add(tree, "ShaderNodeMixShader", kinds).outputs[0]

    return parts.shaded("screen", surface)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("blend")
    build()
    bpy.ops.wm.save_as_mainfile(filepath=parser.parse_args().blend)
