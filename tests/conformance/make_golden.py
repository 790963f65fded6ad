"""Bake the golden files with Cycles: `python -m tests.conformance.make_golden [NAME or KIND …]`.

Those that have a file already are made anew only where they are named. Blender 5.0 makes them, or
the first that has the feature.
"""

import sys
import tempfile
import time
from pathlib import Path

import bpy

from tests.conformance.golden import FOLDER, make_golden
from tests.conformance.quiet import quiet
from tests.conformance.scene import all_scenes

MAKER = (5, 0)


def main(names):
    failed = 0
    for scene in all_scenes(names):
        if not names and (FOLDER / f"{scene.name}.npz").exists():
            continue
        maker = max(MAKER, scene.since)
        if bpy.app.version[:2] != maker:
            failed += 1
            print(f"{scene.name:32} FAILED: Blender {maker[0]}.{maker[1]} makes it, this is "
                  f"{bpy.app.version_string}", flush=True)  # fmt: skip
            continue
        start = time.perf_counter()
        try:
            with tempfile.TemporaryDirectory() as folder, quiet():
                made = make_golden(scene, Path(folder))
        except Exception as problem:  # all scenes shall be tried
            failed += 1
            print(f"{scene.name:32} FAILED: {type(problem).__name__}: {problem}", flush=True)
            continue
        print(
            f"{scene.name:32} noise {made['noise']:.2%}, without its feature {made['without']:.0%} "
            f"off, {time.perf_counter() - start:.1f} s",
            flush=True,
        )
    return failed


if __name__ == "__main__":
    raise SystemExit(1 if main(sys.argv[1:]) else 0)
