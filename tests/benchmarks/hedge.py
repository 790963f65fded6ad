"""A hedge of leaf cards with alpha: time against cards without it, and error against Cycles.

python -m tests.benchmarks.hedge [--cards 2000] [--samples 512]
"""

import argparse
import resource
import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np

import prt_core
from tests.benchmarks import cycles_truth
from tests.conformance.golden import error
from tests.conformance.parts import GREEN, add, ground, image, shaded, world

# The sky, some of it from below, and a hedge of 3 x 1 x 1.
_LOW, _HIGH = (-1.5, -0.5, 0.15), (1.5, 0.5, 1.15)


def leaf():
    """(32, 32) alpha: a round hole of 42 % of the card, whose corners have colours to compare."""
    side = (np.arange(32) + 0.5) / 16 - 1
    return (np.hypot(*np.meshgrid(side, side)) > 0.73).astype(float)


def build(path, cards, alpha):
    """Save the scene: the hedge is one object, as an artist's scatter is when it is realised."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ground(cells=24)
    world()
    pixels = np.zeros((32, 32, 4))
    pixels[..., :3], pixels[..., 3] = GREEN, leaf() if alpha else 1

    def surface(tree):
        texture = add(tree, "ShaderNodeTexImage", image=image("leaf", pixels)).outputs
        clear = add(tree, "ShaderNodeBsdfTransparent").outputs[0]
        green = add(tree, "ShaderNodeBsdfDiffuse", {"Color": texture[0]}).outputs[0]
        inputs = {0: texture[1], 1: clear, 2: green}
        return add(tree, "ShaderNodeMixShader", inputs).outputs[0]

    random = np.random.default_rng(11)
    turns = np.linalg.qr(random.normal(size=(cards, 3, 3)))[0]
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.06
    corners = np.einsum("ka,cai->cki", square, turns[:, :2])
    corners += random.uniform(_LOW, _HIGH, (cards, 1, 3))
    mesh = bpy.data.meshes.new("hedge")
    mesh.from_pydata(corners.reshape(-1, 3), [], np.arange(4 * cards).reshape(-1, 4).tolist())
    uv = mesh.uv_layers.new(name="UVMap")
    uv.data.foreach_set("uv", np.tile(np.float32([0, 0, 1, 0, 1, 1, 0, 1]), cards))
    mesh.materials.append(shaded("leaf", surface))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("hedge", mesh))
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def baked(blend, store):
    """(report, CPU seconds) of a bake."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    report = prt_core.bake(blend, store, resolution=16)
    after = resource.getrusage(resource.RUSAGE_SELF)
    return report, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cards", type=int, default=2000)
    parser.add_argument("--samples", type=int, default=512)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder, seconds, rays = Path(folder), {}, {}
        for name in ("without", "with", "without", "with"):
            build(folder / f"{name}.blend", options.cards, alpha=name == "with")
            shutil.rmtree(folder / f"{name}.prt", ignore_errors=True)
            report, spent = baked(folder / f"{name}.blend", folder / f"{name}.prt")
            seconds.setdefault(name, []).append(spent)
            rays[name] = report["rays"]
        ratios = np.divide(seconds["with"], seconds["without"])
        print({name: np.round(spent, 1).tolist() for name, spent in seconds.items()})
        print(f"CPU with alpha / without: {ratios.round(2)}; rays {rays}")
        relighter = prt_core.Relighter(prt_core.load(folder / "with.prt"))
        colours = relighter.bake.colours(relighter.radiance(light="world"))
        relighter.close()
        bpy.ops.wm.open_mainfile(filepath=str(folder / "with.blend"))
        halves = []
        for seed in (0, 1):
            cycles_truth.set_cycles(bpy.context.scene, options.samples, seed)
            bpy.context.scene.cycles.transparent_max_bounces = 64
            halves.append(
                cycles_truth.bake(bpy.context.scene, ("ground", "hedge"), "all", "CORNER")[0]
            )
        for name in ("ground", "hedge"):
            truth = (halves[0][name] + halves[1][name]) / 2
            print(
                f"{name}: {error(colours[name], truth):.2%} from Cycles at 2 x {options.samples} "
                f"(one of them {error(halves[0][name], truth):.2%} from their mean), mean "
                f"{colours[name].mean() / truth.mean() - 1:+.2%}"
            )


if __name__ == "__main__":
    main()
