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
PAGE, TITLE, PICTURES = "window", "Buttons and sliders", "Colours while a bake runs"
FIRST = "From the zip to a picture"
# What the first colours wait for, by the marks of `inside/first_look.py`.
MARKS = ("read", "built", "looked", "written")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", default=os.environ.get("BLENDER", ""), help="its command")
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--only", choices=(TITLE, PICTURES, FIRST), help="of the sections")
    parser.add_argument("--pages", type=Path, default=PAGES, help="the folder of the page")
    options = parser.parse_args()
    rows, shown, first = [], [], []
    for command in filter(None, options.blender.split(":")):
        for scene in options.scenes:
            with tempfile.TemporaryDirectory() as folder:
                if options.only in (None, TITLE):
                    rows.append(measure(command, scene, Path(folder)))
        if options.only in (None, PICTURES):
            with tempfile.TemporaryDirectory() as folder:
                shown.append(first_look(command, SCENES[-1], Path(folder)))
        if options.only in (None, FIRST):
            with tempfile.TemporaryDirectory() as folder:
                first.append(first_picture(command, Path(folder)))
    sections = {TITLE: lambda: table(rows)} if rows else {}
    sections |= {PICTURES: lambda: table_of_pictures(shown)} if shown else {}
    sections |= {FIRST: lambda: table_of_first(first)} if first else {}
    write_sections(PAGE, sections, options.pages)
    for lines in sections.values():
        print(*lines(), sep="\n")
    return 0


def first_look(command, scene, folder):
    """What `inside/first_look.py` finds in one Blender."""
    from conftest import RealBlender

    blender = RealBlender(command, folder)
    shutil.copy(ROOT / "blend_scenes" / f"{scene}.blend", folder / "scene.blend")
    result = blender.play("first_look")
    assert result["error"] is None, result["error"]
    return {"version": blender.version, **result}


def first_picture(command, folder):
    """What `inside/first_picture.py` finds in one Blender, with the load of the machine."""
    from conftest import RealBlender

    blender = RealBlender(command, folder)
    load = os.getloadavg()[0]
    result = blender.play("first_picture")
    assert result["error"] is None, result["error"]
    return {"version": blender.version, "load": load, **result}


def table_of_first(rows):
    """Markdown lines of the section about the way from the zip to a picture."""
    lines = [
        "`make bench-window BLENDER=…`: Blender's first scene, a cube under its world and its "
        "lamp, by the clicks that the guide names; seconds are those that are waited for, the hand "
        "is not timed. The picture is held beside Cycles' own of the scene, both rendered through "
        "the camera: relative L2 of means over 6 x 6 pixels.",
        "",
        "| Blender | clicks | keys | install s | cost known s | first colours s | all colours s "
        "| waited in all s | off Cycles | load of the machine |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        waited = row["waited"]
        first = f"{waited['first colours']:.1f}" if "first colours" in waited else "with all"
        whole = waited["installed"] + waited["cost"] + waited["baked"]
        lines.append(
            f"| {row['version']} | {len(row['clicks'])} | {len(row['keys'])} | "
            f"{waited['installed']:.1f} | {waited['cost']:.1f} | {first} | {waited['baked']:.1f} | "
            f"{whole:.1f} | {row['cycles']['l2']:.1%} | {row['load']:.1f} |"
        )
    clicks = ", ".join(f"*{name}*" for name in rows[0]["clicks"])
    return [*lines, "", f"The clicks: {clicks}; the key is `N`."]


def table_of_pictures(rows):
    """Markdown lines of the section about pictures of a bake under way."""
    lines = [
        "`make bench-window BLENDER=…`: seconds from pressing Bake (`01_model_on_ground`, city) to "
        "what the first colours wait for, on the clock, and of the processor, all threads of "
        "Blender together. The difference from the final colours is the mean over corners and "
        "channels, as a share of their mean. With Blender's own rays the bake ends there.",
        "",
        "| Blender | caster | scene read | scene built | looked at | colours on the meshes "
        "| from % of the points | error said | mean difference |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        for caster in ("embree", "blender"):
            baked = row[caster]["with"][0]
            times = {what: (wall, cpu) for what, wall, cpu in reversed(baked["marks"])}
            known, error, _, off = baked["pictures"][0][2:]
            # A bake that ends with its first colours has not read its scene.
            found = [times.get(mark) for mark in MARKS]
            cells = ["" if each is None else f"{each[0]:.2f} ({each[1]:.2f})" for each in found]
            cells += [f"{known:.2g}", f"{error:.3f}", "" if off is None else f"{off:.3f}"]
            lines.append(f"| {row['version']} | {caster} | {' | '.join(cells)} |")
    lines += ["", "Later pictures, with Embree:", ""]
    lines += [
        "| Blender | seconds | % known | error said | mean difference |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        for _, at, known, error, turned, off in row["embree"]["with"][0]["pictures"][1:]:
            if not turned:
                cells = f"{at:.1f} | {known:.3g} | {error:.3f} | {off:.3f}"
                lines.append(f"| {row['version']} | {cells} |")
    for row in rows:
        one, two = (row["embree"][kind][0] for kind in ("with", "without"))
        turned = row["embree"]["turned"]
        median = np.median([delay[0] for delay in turned["delays"]])
        lines += [
            "",
            f"Blender {row['version']}: the bake with pictures takes {one['cpu']:.1f} s of the "
            f"processor, without them {two['cpu']:.1f} s ({one['cpu'] / two['cpu']:.2f}; on the "
            f"clock {one['wall'] / two['wall']:.2f}; without the drawing of the view, which has "
            f"no GPU here, {undrawn(one) / undrawn(two):.2f}). A light that is turned all the "
            f"time changes {turned['changes'] / turned['wall']:.1f} times a second on the clock "
            f"({turned['changes'] / undrawn(turned):.1f} without the drawing), "
            f"{turned['changes'] / turned['cpu']:.1f} times a second of the processor, the bake's "
            f"own work included; the median from the change to its colours is {median:.2f} s.",
        ]
    return lines


def undrawn(row):
    """Seconds on the clock, without those in which 3D views were drawn."""
    return row["wall"] - sum(wall for wall, _ in row["draws"])


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
