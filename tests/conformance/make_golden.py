"""Bake the golden files with Cycles: `python -m tests.conformance.make_golden [NAME or KIND …]`.

Those that have a file already are made anew only where they are named. Made with Blender 5.0.
"""

import sys
import tempfile
import time
from pathlib import Path

from tests.conformance.golden import FOLDER, make_golden
from tests.conformance.quiet import quiet
from tests.conformance.scene import all_scenes


def main(names):
    failed = 0
    for scene in all_scenes(names):
        if not scene.exists_here or (not names and (FOLDER / f"{scene.name}.npz").exists()):
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
