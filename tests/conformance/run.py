"""The table of conformance: `python -m tests.conformance.run [--cycles] [NAME or KIND …]`.

Each scene is right (within its bound of Cycles), said (a message names the object and what was
left out) or WRONG; one that is wrong makes the exit code 1. With `--cycles` this Blender's own
Cycles is held against the golden files instead, which are Blender 5.0's.

Of a scene whose golden file shows what an older Blender does not, this Blender's Cycles makes the
truth; what cannot be built here is skipped with the reason.
"""

import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import prt_core
from tests.conformance.golden import cycles_colours, error, read_golden, save, truth_of
from tests.conformance.quiet import quiet
from tests.conformance.scene import all_scenes

RESOLUTION = 16


@dataclass(frozen=True)
class Outcome:
    """What came of a scene: a verdict, and the figures and messages behind it."""

    verdict: str
    text: str


def run_scene(scene, folder):
    """Bake and relight a scene, and hold it against its golden file."""
    try:
        truth = read_golden(scene.name)
    except FileNotFoundError as missing:
        return Outcome("WRONG", f"{missing.filename}: missing; make it with make_golden")
    return baked_and_compared(scene, folder, truth)


def run_anew(scene, folder):
    """The same of a scene whose golden file is of a later Blender: with a truth of this one."""
    try:
        scene.open()
    except (AttributeError, KeyError, TypeError, RuntimeError) as missing:
        return Outcome("skipped", f"this Blender cannot build it: {' '.join(str(missing).split())}")
    outcome = baked_and_compared(scene, folder, truth_of(scene, folder))
    return replace(outcome, text=f"{outcome.text}; truth by this Blender")


def baked_and_compared(scene, folder, truth):
    """Bake and relight a scene, and hold it against a truth (see `read_golden`)."""
    bake, messages = folder / "scene.prt", []
    try:
        save(scene, folder / "scene.blend")
        report = prt_core.bake(folder / "scene.blend", bake, resolution=RESOLUTION)
        messages += report["messages"]
        relighter = prt_core.Relighter(prt_core.load(bake))
        try:
            radiance = relighter.radiance(**_light(scene.light))
            colours = relighter.bake.colours(radiance)
            messages += relighter.notes
        finally:
            relighter.close()
    except prt_core.PRTError as refused:
        return Outcome(_said(scene, [*messages, str(refused)]), f"refused: {refused}")
    except Exception as crash:  # a table of all scenes shall come of it
        return Outcome("WRONG", f"crashed: {type(crash).__name__}: {crash}")
    return compared(scene, colours, *truth, messages)


def run_cycles(scene, folder):
    """Hold this Blender's Cycles against a golden file, at a quarter of its samples."""
    if not scene.exists_here:
        return Outcome("skipped", "its golden file shows a later Blender")
    truth, golden = read_golden(scene.name)
    colours = cycles_colours(scene, folder, scene.samples // 4, seed=2)
    return compared(scene, colours, truth, golden, [])


def compared(scene, colours, truth, golden, messages):
    """The outcome of colours beside the truth, where these messages were given."""
    errors, parts = [], []
    for name in scene.targets:
        if name not in colours:
            return Outcome(_said(scene, messages), f"{name}: has no colours")
        ours, theirs = colours[name], truth[name]
        if ours.shape != theirs.shape:
            text = f"{name}: {len(ours)} corners, Cycles has {len(theirs)}"
            return Outcome(_said(scene, messages), text)
        errors.append(error(ours, theirs))
        means = (" ".join(f"{v:.3f}" for v in c.mean(axis=0)) for c in (ours, theirs))
        parts.append(f"{name} {errors[-1]:.1%} off, mean {' for '.join(means)}")
    text = f"{'; '.join(parts)} (without its feature {golden['without']:.0%})"
    if max(errors) <= scene.bound:
        return Outcome("right", text)
    if scene.says:
        text += f"; to be said: {', '.join(scene.says)}"
    return Outcome(_said(scene, messages), text)


def _light(light):
    return {
        "light": "world" if light in ("world", "all") else None,
        "lamps": light in ("lamps", "all"),
    }


def _said(scene, messages):
    """The verdict on a scene that is not right."""
    words = [word.lower() for word in scene.says]
    said = any(all(word in line.lower() for word in words) for line in messages)
    return "said" if words and said else "WRONG"


def main(arguments):
    verdicts = Counter()
    for scene in all_scenes([name for name in arguments if name != "--cycles"]):
        if "--cycles" in arguments:
            run = run_cycles
        else:
            run = run_scene if scene.exists_here else run_anew
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder, quiet():
            outcome = run(scene, Path(folder))
        verdicts[outcome.verdict] += 1
        spent = time.perf_counter() - start
        label = f"{outcome.verdict:7} {scene.kind}/{scene.name}"
        print(f"{label:48} {spent:4.1f} s  {outcome.text}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items())))
    return verdicts["WRONG"]


if __name__ == "__main__":
    raise SystemExit(1 if main(sys.argv[1:]) else 0)
