"""Pictures of glossy scenes, shaded pixel by pixel, beside Cycles' renders from the same camera.

    python -m tests.benchmarks.gloss_pictures [NAME …] [--light city …] [--samples N]

Each picture has ours, Cycles' and the difference side by side, in docs/gloss_NAME.png. Printed is
the relative L2 difference of linear pixels to the mean of two renders of Cycles with other seeds,
for the whole picture and without its brightest hundredth, and the same of one render to the other.
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
from prt_core.evaluate import contact_sheet, to_srgb, write_png  # noqa: E402
from prt_core.evaluate.view import CameraRays  # noqa: E402
from prt_core.light import read_image  # noqa: E402
from prt_core.relight.relighter import Relighter  # noqa: E402
from tests.benchmarks.gloss_scenes import principled, world_image  # noqa: E402

FOLDER = ROOT / "build" / "bench" / "gloss_pictures"
WIDTH, HEIGHT = 400, 300


def _floor(roughness=0.3, side=81):
    material = principled("floor", (0.25, 0.3, 0.35), Roughness=roughness)
    return build.grid("ground", side, -2, 2, material)


def _ball(name, material, place, radius):
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=64, ring_count=32, radius=radius, location=(*place, radius + 0.004)
    )
    return build.added(name, material, smooth=True)


def metal_and_lacquer():
    """A brushed golden Suzanne and a lacquered ball on a glossy floor."""
    gold = principled("gold", (0.9, 0.6, 0.25), Metallic=1, Roughness=0.25)
    item = build.suzanne("model", gold, 2, 1.4)
    item.location.x = -0.6
    lacquer = principled(
        "lacquer", (0.5, 0.03, 0.03), Roughness=0.5, Coat_Weight=1, Coat_Roughness=0.03
    )
    _ball("ball", lacquer, (0.9, -0.3), 0.55)
    _floor()
    build.camera((2.2, -4.4, 2.0), (0.05, 0, 0.6), 45)


def mirror_ball():
    """A mirror ball and a rough golden Suzanne on a glossy floor."""
    gold = principled("gold", (0.9, 0.6, 0.25), Metallic=1, Roughness=0.45)
    item = build.suzanne("model", gold, 2, 1.4)
    item.location.x = -0.7
    mirror = principled("mirror", (0.9, 0.9, 0.9), Metallic=1, Roughness=0)
    _ball("ball", mirror, (0.85, 0.1), 0.65)
    _floor()
    build.camera((1.6, -4.6, 1.8), (0.05, 0, 0.6), 45)


def plastic():
    """A Suzanne of shiny plastic on matte ground: what a statue of clay with a gloss looks like."""
    build.suzanne("model", principled("plastic", (0.35, 0.12, 0.4), Roughness=0.35), 3, 1.6)
    build.grid("ground", 43, -2, 2, build.diffuse("floor", (0.5, 0.5, 0.5)))
    build.camera((1.9, -4.0, 2.0), (0, 0, 0.65))


SCENES = {"metal_and_lacquer": metal_and_lacquer, "mirror_ball": mirror_ball, "plastic": plastic}


def cycles_picture(path, width, height, samples, seed):
    """(height, width, 3) float32: what Cycles renders of the open scene, by an .exr at `path`."""
    scene = bpy.context.scene
    cycles, render = scene.cycles, scene.render
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy, cycles.caustics_reflective = 0, True
    cycles.pixel_filter_type, render.threads_mode, render.threads = "BOX", "FIXED", 1
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.image_settings.file_format = "OPEN_EXR"
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read_image(path)[..., :3]


def cycles_render(name, light, seed, samples):
    """The `cycles_picture` of a scene that is open, kept for the next time."""
    path = FOLDER / f"{name}_{light}_{seed}_{samples}.npy"
    if not path.exists():
        np.save(path, cycles_picture(FOLDER / "render.exr", WIDTH, HEIGHT, samples, seed))
    return np.load(path)


def differences(picture, other, truth):
    """Relative L2 of all pixels, and of all but the hundredth whose truth is brightest."""
    value = truth.max(axis=2)
    some = value < np.quantile(value, 0.99)
    return [
        float(np.linalg.norm(a - b) / np.linalg.norm(of))
        for a, b, of in ((picture, other, truth), (picture[some], other[some], truth[some]))
    ]


def measured(name, light, samples):
    """Our picture, two of Cycles, and CPU seconds: of another light, and of the picture again."""
    build.clear()
    SCENES[name]()
    bpy.context.view_layer.update()
    studio = studio_paths([light])[light]
    world_image(studio)
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.prt"
    bake(None, path, gloss=True, method="exhaustive", restart="changed")
    truths = [cycles_render(name, light, seed, samples) for seed in (1, 2)]
    baked = load(path)
    caster = baked.make_caster(rays="camera")
    rays = CameraRays(baked.scene, caster, baked.camera, WIDTH, HEIGHT)
    caster.close()
    relighter, spent = Relighter(baked), []
    for turn in (90, 0, 0):
        begun = time.process_time()
        picture = relighter.picture(rays, studio, rotation=turn)
        spent.append(time.process_time() - begun)
    relighter.close()
    return picture, truths, spent[1:], len(baked.scene.points)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(SCENES))
    parser.add_argument("--light", default="city")
    parser.add_argument("--samples", type=int, default=256)
    options = parser.parse_args()
    for name in options.names:
        picture, truths, spent, n_points = measured(name, options.light, options.samples)
        truth = (truths[0] + truths[1]) / 2
        (whole, dim), noise = differences(picture, truth, truth), differences(*truths, truth)
        print(
            f"{name} under {options.light}, {n_points:,} points: {whole:.1%}, {dim:.1%} without "
            f"the brightest hundredth (one of Cycles to the other "
            f"{noise[0]:.1%}, {noise[1]:.1%}); mean {picture.mean() / truth.mean() - 1:+.1%}; "
            f"CPU {spent[0]:.1f} s under another light, "
            f"{spent[1]:.1f} s from another side",
            flush=True,
        )
        away = 0.5 + 0.5 * np.clip(picture - truth, -1, 1)
        images = [to_srgb(picture), to_srgb(truth), (255 * away).astype(np.uint8)]
        labels = ["shaded by pixels", f"Cycles, {2 * options.samples} samples", "difference"]
        sheet = contact_sheet(images, labels, 3)
        write_png(ROOT / "docs" / f"gloss_{name}.png", sheet)


if __name__ == "__main__":
    main()
