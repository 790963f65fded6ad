"""What gloss adds to a bake: `python -m tests.benchmarks.gloss_bakes`."""

import tempfile
import time
from pathlib import Path

import numpy as np

from prt_core import bake
from tests.benchmarks import gloss_scenes
from tests.benchmarks.gloss_views import SIZE

# Of the model; whether the ground is of it as well.
CASES = (("ggx_0.5", True), ("ggx_0.5", False), ("metal_0.3", True), ("metal_0.3", False))
# Bakes of each, of which the quickest counts.
TIMES = 2
# With gloss, in parts of the time without: floor of the whole bake.
MOST = 1.5


def measured(name, both):
    """A line of Markdown."""
    gloss_scenes.scene_of(f"ground_{name}" if both else name, *SIZE)
    reports, spent = {}, {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(2 * TIMES):
            gloss = turn % 2 == 1
            begun = np.array([time.perf_counter(), time.process_time()])
            reports[gloss] = bake(None, Path(folder) / f"{turn}.prt", gloss=gloss, caster="embree")
            spent[gloss].append(np.array([time.perf_counter(), time.process_time()]) - begun)
    without, with_gloss = reports[False], reports[True]
    spent = [np.min(spent[gloss], axis=0) for gloss in (False, True)]
    wall, cpu = spent[1] / spent[0]
    stages = [with_gloss["seconds"][stage] for stage in ("reflections", "gloss certificate")]
    return (
        f"| {name.replace('_', ' ')} | {'the same' if both else 'matte'} | "
        f"{with_gloss['points']:,} | {with_gloss['glossy_points']:,} | "
        f"{without['rays'] / 1e6:.1f} | {with_gloss['rays_reflections'] / 1e6:.1f} | "
        f"{spent[0][0]:.1f} ({spent[0][1]:.1f}) | {spent[1][0]:.1f} ({spent[1][1]:.1f}) | "
        f"{stages[0]:.1f} + {stages[1]:.1f} | {wall:.2f} ({cpu:.2f})"
        f"{', **missed**' * (wall > MOST)} |"
    )


def section():
    """Markdown: bakes of one scene without gloss and with it."""
    return [
        "Suzanne on a ground, sampled with the defaults, Embree, the quickest of "
        f"{TIMES} bakes each. Millions of rays; seconds of the "
        "wall and, in brackets, of the processor, reading the scene included; of the stages that "
        f"gloss adds those of the wall. Floor: {MOST} of a bake without gloss. "
        "`python -m tests.benchmarks.gloss_bakes`.",
        "",
        "| Suzanne | ground | points | glossy | rays without | of reflections | s without | s with "
        "gloss | reflections + certificate | parts |",
        "|---" * 10 + "|",
        *(measured(*case) for case in CASES),
    ]


if __name__ == "__main__":
    print(*section(), sep="\n")
