"""Real assets, as they are imported, against Cycles' diffuse pass under two HDRIs.

python -m tests.benchmarks.assets [FILE or FOLDER …] [--lights city courtyard] [--pictures FOLDER]

Without files: the models of the data folder (see `prt_core/blender/measuring.py`). Each asset is
baked and compared in a process of its own, which ends after three minutes. What Cycles baked is
kept under PRT_CACHE. The error is that of the conformance scenes: relative L2 over the corners of
all objects of the asset, without the worst 5 %. Beside it the error of the diffuse colours alone,
that of our colours where they are given Cycles' diffuse colours (of the light), and that of the
ground where the benchmark put one under the asset.
"""

import argparse
import hashlib
import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

import prt_core
from prt_core.blender.measuring import CACHE, data_folder
from prt_core.evaluate import contact_sheet, to_srgb, write_png
from prt_core.evaluate.view import CameraRays
from prt_core.scene.camera import auto_camera
from tests.benchmarks import asset_scene
from tests.benchmarks.cycles_truth import studio_light
from tests.conformance.golden import DARK, error
from tests.conformance.quiet import quiet

PAGE, TITLE = "assets", "Models as imported"
FILES_TITLE = "Files of Blender, from the tests of public repositories"
LIGHTS = ("city", "courtyard")
BOUND = 0.04
SECONDS, MOST_CORNERS, MOST_SAMPLES = 180, 200_000, 2048
# Objects of a file that are compared: those with the most corners.
MOST_OBJECTS = 40
# Radiance that is none.
ENDLESS = 1e6
FORMAT = 1


def default_files():
    """The models of the data folder; none where there is no such folder."""
    folder = data_folder()
    if folder is None:
        return []
    named = [*(folder / "meshes" / "bench").iterdir(), *(folder / "meshes").glob("spot*")]
    return sorted(path for path in named if path.suffix.lower() in asset_scene.SUFFIXES)


def files_of(arguments):
    """Files as they are named, and all assets in folders."""
    files = []
    for path in map(Path, arguments):
        inside = sorted(path.rglob("*")) if path.is_dir() else [path]
        files += [each for each in inside if each.suffix.lower() in asset_scene.SUFFIXES]
    return files


def measure(path, lights, pictures=None):
    """Bake, relight and compare an asset.

    Returns
    -------
    dict
        `points`, `seconds`, `messages`, `left` (what is not compared, by a reason), and `lights`:
        for each `error`, `albedo`, `light`, `noise`, `samples` and `objects` ({name: error}).
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            asset_scene.open_asset(path)
        except prt_core.PRTError as refused:
            return {"refused": str(refused)}
        asset_scene.set_world(lights[0] if lights else LIGHTS[0])
        corners = sum(len(item.data.loops) for item in bpy.data.objects if item.type == "MESH")
        if corners > MOST_CORNERS:
            return {"skipped": f"{corners:,} corners"}
        start = time.perf_counter()
        try:
            output = Path(folder) / "asset.prt"
            report = prt_core.bake(None, output, caster="embree")
        except prt_core.PRTError as refused:
            return {"refused": str(refused)}
        seconds = time.perf_counter() - start
        bake = prt_core.load(output)
        albedo = bake.colours(bake.scene.points.materials.albedo)
        names, left = asset_scene.targets(albedo)
        names = sorted(names, key=lambda n: (n != asset_scene.GROUND, -len(albedo[n])))
        left |= {name: "too many objects" for name in names[MOST_OBJECTS:]}
        result = {"points": report["points"], "seconds": seconds, "left": left, "lights": {}}
        result["messages"] = report["messages"]
        for light in lights if set(names) - {asset_scene.GROUND} else ():
            asset_scene.set_world(light)
            true = kept_truth(path, light, names[:MOST_OBJECTS])
            radiance = prt_core.relight_points(bake, studio_light(light), sharp_sun=True)
            # What a surface emits itself is no part of Cycles' diffuse pass.
            points = bake.scene.points
            sent = points.materials.emission * (points.emitter >= 0)[:, None]
            ours = bake.colours(radiance - sent)
            result["lights"][light] = compared(ours, albedo, true)
            if pictures is not None:
                picture(bake, ours, true["colours"], pictures / f"{path.stem}_{light}.png")
        return result


def kept_truth(path, light, names):
    """What Cycles bakes of the open scene; of the same file it is baked once."""
    about = [FORMAT, light, names, bpy.app.version_string, asset_scene.GROUND_EDGE, asset_scene.GAP]
    digest = hashlib.sha256(path.read_bytes() + repr(about).encode()).hexdigest()[:16]
    kept = CACHE / "assets" / f"{path.stem}_{light}_{digest}.pickle"
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}.part")
        part.write_bytes(pickle.dumps(asset_scene.truth(names, BOUND, MOST_SAMPLES)))
        part.replace(kept)
    return pickle.loads(kept.read_bytes())


def compared(ours, albedo, true):
    """Errors of all corners together and of each object."""
    names = [name for name in true["colours"] if name != asset_scene.GROUND]

    def all_of(values):
        return np.concatenate([values[name] for name in names]).astype(np.float64)

    colours, diffuse, truth = all_of(ours), all_of(albedo), all_of(true["colours"])
    # Where a diffuse colour is above 1 light grows without end as it bounces, in Cycles too.
    truth = np.where(np.abs(truth) < ENDLESS, truth, np.nan)
    light = colours / np.maximum(diffuse, 1e-6) * all_of(true["albedo"])
    return {
        "error": error(colours, truth),
        "albedo": error(diffuse, all_of(true["albedo"])),
        "light": error(np.where(diffuse > 1e-6, light, truth), truth),
        "noise": true["noise"],
        "samples": true["samples"],
        "dark": bool(np.nanmean(truth) < DARK),
        "objects": {name: error(ours[name], each) for name, each in true["colours"].items()},
    }


def picture(bake, ours, truth, path):
    """Cycles, ours, and four times the difference, from a camera that sees the asset."""
    shown = {"Cycles": truth, "ours": {name: ours[name] for name in truth}}
    shown["4 x difference"] = {name: 4 * np.abs(ours[name] - truth[name]) for name in truth}
    seen = [
        bake.scene.to_world(bake.scene.points.positions[item.corner_point[item.corner_point >= 0]])
        for item in bake.scene.objects
        if item.name in truth and item.name != asset_scene.GROUND
    ]
    low, high = np.concatenate(seen).min(axis=0), np.concatenate(seen).max(axis=0)
    size = float(np.linalg.norm(high - low))
    camera = auto_camera(SimpleNamespace(centre=(low + high) / 2, size=size))
    caster = bake.make_caster()
    rays = CameraRays(bake.scene, caster, camera, 480, 360)
    caster.close()
    images = []
    for colours in shown.values():
        points = np.zeros((len(bake.scene.points), 3), np.float32)
        for item in bake.scene.objects:
            if item.name in colours:
                used = item.corner_point >= 0
                points[item.corner_point[used]] = np.nan_to_num(colours[item.name][used], posinf=0)
        images.append(rays.picture(points))
    stops = -np.log2(max(np.percentile(images[0].max(axis=-1), 97), 1e-6))
    sheet = contact_sheet([to_srgb(image, stops) for image in images], list(shown), 3)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, sheet)


def in_own_process(path, lights, pictures=None):
    """`measure` where a crash or an endless run ends no table."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "result.json"
        command = [sys.executable, "-m", "tests.benchmarks.assets", "--one", str(path)]
        command += ["--json", str(output), "--lights", *lights]
        command += [] if pictures is None else ["--pictures", str(pictures)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return {"skipped": f"more than {SECONDS} s"}
        if done.returncode or not output.exists():
            last = (done.stderr.strip().splitlines() or ["no word"])[-1]
            return {"crashed": f"exit code {done.returncode}: {last}", "trace": done.stderr}
        return json.loads(output.read_text())


def rows(path, result):
    """Lines of the table for an asset."""
    for word in ("skipped", "refused", "crashed"):
        if word in result:
            return [f"| {path.name} | | | | | | | | | {word}: {result[word]} |"]
    messages, left, said = result["messages"], result["left"], []
    if messages:
        said.append(f"{len(messages)} said: {messages[0]}")
    if left:
        said.append(f"not compared: {len(left)} ({', '.join(sorted(set(left.values())))})")
    head = f"| {path.name} | {result['points']:,} | {result['seconds']:.0f} | "
    if not result["lights"]:
        return [f"{head}| | | | | | {'; '.join(['nothing to compare', *said])} |"]
    lines = []
    for light, figures in result["lights"].items():
        said += ["Cycles bakes it black"] if figures["dark"] else []
        # Both are independent: their squares add up to that of the error.
        own = max(figures["error"] ** 2 - figures["noise"] ** 2, 0.0) ** 0.5
        total, own = f"{figures['error']:.2%}", f"{own:.2%}"
        ground = figures["objects"].get(asset_scene.GROUND)
        ground = "" if ground is None else f"{ground:.2%}"
        total = f"**{total}**" if figures["error"] <= BOUND else total
        lines.append(
            f"{head}{light}: {total} | {own} | {figures['albedo']:.2%} | {figures['light']:.2%} | "
            f"{ground} | {figures['noise']:.2%} | {'; '.join(said)} |"
        )
        head, said = "| | | | ", []
    return lines


def table(files, lights=LIGHTS, pictures=None, each=None):
    """The lines of a section; `each` is called with a file and its result as they come."""
    lines = [
        "| asset | points | bake s | error | without the noise | diffuse colour | light | ground "
        "| Cycles' noise | remarks |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for path in files:
        result = in_own_process(path, lights, pictures)
        lines += rows(path, result)
        if each is not None:
            each(path, result)
    return lines if files else []


def files_table():
    """The .blend files below the folder in PRT_ASSETS; no lines without it."""
    folder = os.environ.get("PRT_ASSETS")
    return table(files_of([folder])) if folder else []


SECTIONS = {TITLE: lambda: table(default_files()), FILES_TITLE: files_table}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*")
    parser.add_argument("--lights", nargs="*", default=list(LIGHTS))
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--one", type=Path, help="measure this file in this process, into --json")
    parser.add_argument("--json", type=Path, help="write all results there as well")
    options = parser.parse_args()
    if options.one:
        with quiet():
            result = measure(options.one.resolve(), options.lights, options.pictures)
        options.json.write_text(json.dumps(result))
        return
    results = {}

    def show(path, result):
        results[str(path)] = result
        print("\n".join(rows(path, result)), flush=True)
        for light, figures in result.get("lights", {}).items():
            worst = sorted(figures["objects"].items(), key=lambda pair: -pair[1])[:3]
            listed = ", ".join(f"{name} {value:.1%}" for name, value in worst)
            print(f"    {light}, {figures['samples']} samples: {listed}", flush=True)
        for line in result.get("messages", []):
            print(f"    said: {line}", flush=True)
        if options.json:
            options.json.write_text(json.dumps(results, indent=1))

    table(files_of(options.files) or default_files(), options.lights, options.pictures, show)


if __name__ == "__main__":
    main()
