"""Views of gloss that move: evaluated and looked up, seconds and distance from sums over texels.

    python -m tests.benchmarks.gloss_views [--roughness 0.45 0.5 0.7] [--light city …]
                                           [--levels N] [--side N] [--sample N]

Suzanne on a ground, both of a Glossy BSDF. Sums are over all texels of the light that the field
has, with what is in the way as the bake knows it: they tell what lobes over blocks and maps of
views lose, nothing else. Seconds are of the wall and, in brackets, of the processor.
"""

import argparse
import time
from functools import partial

import numpy as np

from prt_core import bake, load
from prt_core.blender.studio import studio_paths
from prt_core.relight.gloss import Gloss
from prt_core.relight.lighting import lighting_of
from prt_core.relight.relighter import Relighter
from prt_core.runtime.progress import run
from prt_core.transport import View
from prt_core.transport.lobe_values import lobe_values
from prt_core.transport.visibility import unpack
from tests.benchmarks import gloss_scenes

# Levels of Suzanne and points along an edge of the ground; points that are summed.
SIZE, SAMPLE = (3, 171), 320


def baked(roughness, levels, side):
    """The bake of the scene, anew."""
    name = f"views_{roughness:g}"
    gloss_scenes.MATERIALS[name] = lambda: gloss_scenes.glossy("ggx", (1, 1, 1), roughness)
    gloss_scenes.scene_of(f"ground_{name}", levels, side)
    path = gloss_scenes.FOLDER / f"{name}_{levels}_{side}.prt"
    bake(None, path, gloss=True, method="exhaustive", restart="changed")
    return load(path)


class Known:
    """What a relighter told its `Gloss` of the light."""

    def __init__(self, relighter):
        self._light = Gloss.light
        Gloss.light = lambda gloss, *light, **more: self._take(gloss, *light, **more)
        self.relighter = relighter

    def _take(self, gloss, texels, sent, *more, **lamps):
        self.texels, self.sent = texels, sent
        return self._light(gloss, texels, sent, *more, **lamps)

    def close(self):
        Gloss.light = self._light


def summed(bake, part, rows, outgoing, texels, sent, alpha):
    """(k, 3): white lobes over all texels; metal seen in metal has the colour that stands for it"""
    field, cube_map = part.field.reflections, bake.cube_map
    ways = np.ascontiguousarray(cube_map.directions.T, np.float32)
    angles = cube_map.solid_angles.astype(np.float32)
    normals, blocks = bake.scene.points.normals[part.points], field.blocks
    sent, result = np.concatenate([sent, np.zeros((2, 3), np.float32)]), np.zeros((len(rows), 3))
    for place, row in enumerate(rows):
        entries = slice(field.start[row], field.start[row + 1])
        met = np.full(len(blocks), -1)
        met[field.block[entries]] = field.met[entries]
        seen = unpack(bake.transport.bits[part.points[row]][None], cube_map.n_directions)[0]
        light = np.where(seen[:, None] == 1, texels, sent[met[blocks.of_texel]])
        lobe = lobe_values(
            ways, normals[row : row + 1], outgoing[place : place + 1], alpha, None, 1
        )
        result[place] = (lobe[0][0] * angles) @ light
    return result


def spent(work, times=1):
    """Median seconds of the wall and of the processor that a generator takes, as text."""
    spans = []
    for _ in range(times):
        begun = np.array([time.perf_counter(), time.process_time()])
        run(work())
        spans.append(np.array([time.perf_counter(), time.process_time()]) - begun)
    return "{:.2g} ({:.2g})".format(*np.median(spans, axis=0))


def measured(baked_scene, roughness, light, n_sample):
    """A line of Markdown."""
    relighter = Relighter(baked_scene)
    known, view = Known(relighter), View.of_camera(baked_scene.camera)
    path = studio_paths([light])[light]

    def lit_steps(rotation):
        return relighter.steps(lighting_of(path, rotation=rotation), view=view)

    try:
        # What belongs to all lights is made with the first one.
        spent(partial(lit_steps, 90))
        lit = spent(partial(lit_steps, 0))
        evaluated = spent(partial(relighter.view_steps, view))
        made = spent(relighter.map_views_steps)
        moving = spent(partial(relighter.view_steps, view, mapped=True), 5)
    finally:
        known.close()
    (part,) = relighter._gloss._parts
    # As the sums have it: light of metal as the colour that stands for it.
    part.light(known.texels, known.sent)
    part.view_map().make()
    outgoing = view.outgoing(baked_scene.scene.to_world(baked_scene.scene.points.positions))
    outgoing = outgoing.astype(np.float32)[part.points]
    facing = part.facing(outgoing)
    cosine = np.einsum("kx,kx->k", outgoing[facing], part._normals[facing])
    rows = facing[cosine > 0.05]
    rows = rows[np.linspace(0, len(rows) - 1, min(n_sample, len(rows))).astype(int)]
    alpha = np.float32([roughness**2])
    wanted = summed(baked_scene, part, rows, outgoing[rows], known.texels, known.sent, alpha)
    # What further bounces bring depends on the view alone.
    gain = part._lobes.at(part._first + rows, np.einsum("kx,kx->k", outgoing[rows],
                                                        part._normals[rows]))[0]  # fmt: skip
    wanted *= sum(powers[:, 0] for _, powers in gain)

    def off(lobes):
        reflected, _ = lobes(rows, outgoing[rows])
        return np.sqrt(((reflected - wanted) ** 2).sum() / (wanted**2).sum())

    mapped = "none |  | "
    if part.mapped.all():
        mapped = f"{made} | {moving} | {off(part.looked_up):.2%}"
    megabytes = relighter._gloss.nbytes / 1e6
    relighter.close()
    return (
        f"| {roughness:g} | {light} | {len(facing):,} of {len(part.points):,} | {lit} | "
        f"{evaluated} | {off(part.toward):.2%} | {mapped} | {megabytes:.0f} |"
    )


TABLE = (
    "| roughness | light | points | light s | view s | off | maps s | looked up s | off | MB |",
    "|---" * 10 + "|",
)


def section():
    """Markdown: all of it for three roughnesses under two images."""
    return [
        "While a view moves, points whose lobes are round and of roughness 0.4 and above are "
        "looked up in maps that belong to the light "
        "([decision 112](../decisions/0112-maps-of-views.md)). Suzanne on a ground, both of a "
        "Glossy BSDF, so that everything is metal to all others. Seconds of the wall and, in "
        "brackets, of the processor, of a turned light with its view, and of another view, with "
        "all that belongs to them, bounces among it; errors against sums over all texels of the "
        f"same light, what is in the way included, at {SAMPLE} points. "
        "`python -m tests.benchmarks.gloss_views --roughness 0.3 0.5 0.7 --light city courtyard`.",
        "",
        *TABLE,
        *(
            measured(scene, roughness, light, SAMPLE)
            for roughness in (0.3, 0.5, 0.7)
            for scene in [baked(roughness, *SIZE)]
            for light in ("city", "courtyard")
        ),
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--roughness", nargs="+", type=float, default=[0.45, 0.5, 0.7])
    parser.add_argument("--light", nargs="+", default=["city", "courtyard", "interior"])
    parser.add_argument("--levels", type=int, default=SIZE[0])
    parser.add_argument("--side", type=int, default=SIZE[1])
    parser.add_argument("--sample", type=int, default=SAMPLE)
    options = parser.parse_args()
    print(*TABLE, sep="\n")
    for roughness in options.roughness:
        scene = baked(roughness, options.levels, options.side)
        for light in options.light:
            print(measured(scene, roughness, light, options.sample), flush=True)


if __name__ == "__main__":
    main()
