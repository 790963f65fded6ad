"""Gloss for a camera that stays: forms of its pixels under turning light, beside Cycles' render.

    python -m tests.benchmarks.gloss_camera [NAME …] [--light city] [--pixels 80x60] [--samples N]
                                            [--methods cpca …]

A scene of `gloss_pictures` is baked with the pixels of its camera; each form of them is measured
against exact relighting for that view (`prt compress`), and its picture under one light against two
renders of Cycles. Pictures go to docs/gloss_camera_NAME.png.
"""

import argparse
import time
from pathlib import Path

import bpy
import numpy as np

from prt_core import bake, compress, load
from prt_core.blender.studio import studio_paths
from prt_core.cli.arguments import size
from prt_core.evaluate import contact_sheet, to_srgb, write_png
from prt_core.relight.relighter import Relighter
from tests.benchmarks import gloss_pictures as pictures

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "bench" / "gloss_camera"
METHODS = "cpca:n_clusters=12,n_components=32", "haar:n_terms=2048", "wavelet4d:error=0.02", "auto"


def measured(name, light, pixels, samples, methods):
    """Prints a line of each form; writes the pictures of one scene."""
    pictures.build.clear()
    pictures.SCENES[name]()
    bpy.context.view_layer.update()
    studio = studio_paths([light])[light]
    pictures.world_image(studio)
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.prt"
    bake(None, path, gloss=True, method="exhaustive", restart="changed", camera_pixels=pixels)
    truths = [
        pictures.cycles_picture(FOLDER / "render.exr", *pixels, samples, seed) for seed in (1, 2)
    ]
    truth = (truths[0] + truths[1]) / 2
    shown = load(path).image(np.ones((len(load(path).scene.points), 3), np.float32)) > 0.999
    noise = off(truths[0], truths[1], shown)
    exact, spent = relit(path, studio, "exact")
    print(
        f"{name} under {light}, {pixels[0]} x {pixels[1]} pixels: exact "
        f"{off(exact, truth, shown):.2%} "
        f"from Cycles (one of two renders to the other {noise:.2%}), CPU {spent:.2f} s a light",
        flush=True,
    )
    images, labels = [to_srgb(truth), to_srgb(exact)], ["Cycles", "exact"]
    for method in methods:
        begun = time.process_time()
        report = compress(path, method=method, tolerance=0.02)
        seconds = time.process_time() - begun
        picture, _ = relit(path, studio, "compressed")
        print(
            f"  {method}: {report['method']}, {report['error']:.2%} from exact in the mean of "
            f"{report['lights']}, {report['worst']:.2%} at worst ({report['rows_error']:.2%} "
            f"uncompressed); {off(picture, truth, shown):.2%} from Cycles; "
            f"{report['bytes'] / 1e6:.1f} MB, {report['milliseconds']:.1f} ms a light; made in "
            f"{seconds:.0f} s of CPU",
            flush=True,
        )
        images.append(to_srgb(picture))
        labels.append(method.partition(":")[0])
    images = [np.repeat(np.repeat(image, 4, axis=0), 4, axis=1) for image in images]
    write_png(ROOT / "docs" / f"gloss_camera_{name}.png", contact_sheet(images, labels, 3))


def relit(path, studio, form):
    """The picture of a form, and CPU seconds of another light when all is there."""
    relighter = Relighter(load(path), form=form)
    relighter.radiance(studio, rotation=90, of="image")
    begun = time.process_time()
    picture = relighter.radiance(studio, of="image")
    spent = time.process_time() - begun
    relighter.close()
    return picture, spent


def off(picture, truth, shown):
    """Relative L2 of linear pixels that the scene fills, but for their brightest hundredth."""
    value = np.where(shown, truth, 0).max(axis=2)
    some = shown.all(axis=2) & (value < np.quantile(value[shown.all(axis=2)], 0.99))
    return float(np.linalg.norm((picture - truth)[some]) / np.linalg.norm(truth[some]))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=["plastic", "metal_and_lacquer"])
    parser.add_argument("--light", default="city")
    parser.add_argument("--pixels", type=size, default=(80, 60))
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()
    for name in options.names:
        measured(name, options.light, options.pixels, options.samples, options.methods)


if __name__ == "__main__":
    main()
