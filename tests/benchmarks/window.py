"""`make bench-window BLENDER=…`: how the add-on feels in a window; docs/benchmarks/window.md."""

import argparse
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "window")]

from tests.benchmarks.sections import PAGES, write_sections  # noqa: E402

SCENES = ("02_model_on_ground_small", "01_model_on_ground")
PAGE, TITLE = "window", "Buttons and sliders"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", default=os.environ.get("BLENDER", ""), help="its command")
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--pages", type=Path, default=PAGES, help="the folder of the page")
    options = parser.parse_args()
    rows = []
    for command in filter(None, options.blender.split(":")):
        for scene in options.scenes:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(measure(command, scene, Path(folder)))
    write_sections(PAGE, {TITLE: lambda: table(rows)}, options.pages)
    print("\n".join(table(rows)))
    return 0


def measure(command, scene, folder):
    """One scene in one Blender: the bake headless, then all of `inside/measure.py`."""
    from conftest import RealBlender

    blender = RealBlender(command, folder)
    shutil.copy(ROOT / "blend_scenes" / f"{scene}.blend", folder / "scene.blend")
    result = blender.play("measure")
    assert result["error"] is None, result["error"]
    headless = {}
    for caster in result["bake"]:
        done = blender.run(
            "-b", "scene.blend", "--addons", "bl_ext.user_default.prt_relight", "--command", "prt",
            "bake", "-o", f"h_{caster}.prt",
            "--caster", caster, "--quiet", user="user",
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        attributes = json.loads((folder / f"h_{caster}.prt" / "zarr.json").read_text())[
            "attributes"
        ]
        headless[caster] = sum(attributes["report"]["seconds"].values())
    return {"scene": scene, "version": blender.version, "headless": headless, **result}


def table(rows):
    """Markdown lines of the section."""
    lines = [
        "`make bench-window BLENDER=…`: clicks and keys by event simulation in a window of "
        "1280 x 900 with software OpenGL (viewport anti-aliasing off). Steps are turns of the "
        "main thread while a bake runs; colours are on screen when the view was drawn with them. "
        "The slider turns an image of 1024 x 512, relit exactly and from the compressed form.",
        "",
        "| Blender | points | caster | button to colours s | of that the bake s "
        "| bake headless s | ratio | longest step s (stage) "
        "| 99th percentile s | Esc obeyed s (worst) | slider to colours s: median, worst "
        "| on screen s: median, worst | compressed: to colours s | on screen s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        delays = [*np.array(row["delays"]).T, *np.array(row["quick"]).T]
        delays = [f"{np.median(part):.2f}, {part.max():.2f}" for part in delays]
        for caster, bake in row["bake"].items():
            turns = np.array([seconds for seconds, _ in bake["turns"]])
            longest = max(map(tuple, bake["turns"]))
            alone = row["headless"][caster]
            lines.append(
                f"| {row['version']} | {row['points']:,} | {caster} | {bake['seconds']:.1f} | "
                f"{bake['stages']:.1f} | "
                f"{alone:.1f} | {bake['stages'] / alone:.2f} | {longest[0]:.3f} ({longest[1]}) | "
                f"{np.quantile(turns, 0.99):.3f} | {max(row['stops']):.2f} | "
                f"{' | '.join(delays)} |"
            )
    installed = max(row["install"] for row in rows)
    lines += ["", f"To install the zip takes {installed:.1f} s at most."]
    return lines


if __name__ == "__main__":
    sys.exit(main())
