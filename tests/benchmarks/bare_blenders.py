"""The zips in Blenders that have nothing else, without a network: installed, baked, relit.

    make extension PLATFORMS=linux-x64
    python -m tests.benchmarks.bare_blenders --module bpy42/bin/python --module bpy52/bin/python
    python -m tests.benchmarks.bare_blenders --blender "/opt/blender/blender"

A module is a Python whose environment has bpy and nothing of ours. Each Blender begins with an
empty user folder in a network namespace of its own (`unshare -n`, as root), takes first the zips
that are for other Pythons, which must be refused in one line, and then its own: enabled, the
default cube baked by the operator and relit. Floor: all of that. A command that runs a Blender to
which the current folder has another name sets BLENDER_USER_RESOURCES itself, by `env`.
"""

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from scripts import build_extension

ROOT = Path(__file__).resolve().parents[2]
STORY = Path(__file__).with_name("bare_blender_story.py")
OFFLINE = ["unshare", "-n"]
# What a person's shell has, and nothing that leads to packages.
KEPT = "PATH", "HOME", "LANG", "TERM"


def tried(command, is_module, zips, folder):
    """What the story says of one Blender; it runs in `folder`, where names are relative."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for file in (*zips, STORY):
        shutil.copy(file, folder)
    script = [STORY.name] if is_module else ["-b", "--python-exit-code", "1", "-P", STORY.name]
    script += ["--", *(path.name for path in zips)]
    environment = {key: os.environ[key] for key in KEPT if key in os.environ}
    environment["BLENDER_USER_RESOURCES"] = str(folder / "user")
    done = subprocess.run(
        [*OFFLINE, *command, *script],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    said = done.stdout + done.stderr
    report = folder / "report.json"
    if not report.is_file():
        sys.exit(f"{shlex.join(command)}: the story did not end\n{said}")
    return json.loads(report.read_text())


def faults(report):
    """What is wrong with what a Blender said, as lines."""
    python = report["python"]
    for each in report["zips"]:
        is_own = f"-python-{python}" in each["zip"]
        if is_own != each["enabled"]:
            yield f"{each['zip']}: {'refused' if is_own else 'taken'}: {each['said']}"
        elif not is_own and len(each["said"]) != 1:
            yield f"{each['zip']}: refused in {len(each['said'])} lines: {each['said']}"
    if report["network"]:
        yield f"there is a network: {report['network']}"
    if not report["baked"] or not report["relit"] or not 0 < report["brightness"] < 1:
        yield f"the cube was not baked and relit: {report}"


def main():
    """Try all Blenders that are named, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--module", action="append", default=[], help="a Python that has bpy")
    parser.add_argument("--blender", action="append", default=[], help="a command")
    parser.add_argument("--zips", type=Path, default=ROOT / "build", help="their folder")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "bare", help="to work in")
    options = parser.parse_args()
    zips = sorted(options.zips.glob("prt_relight-*-linux-x64-python-*.zip"))
    if len(zips) != len(build_extension.PYTHONS):
        sys.exit("bare_blenders: make extension PLATFORMS=linux-x64 first")
    for path in zips:
        print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB")
    print(
        "| Blender | Python | install | bake and relight | the other zips |\n|---|---|---|---|---|"
    )
    wrong = []
    commands = [([str(Path(name).absolute())], True) for name in options.module]
    commands += [(shlex.split(text), False) for text in options.blender]
    for command, is_module in commands:
        report = tried(command, is_module, zips, options.folder)
        wrong += [f"{report['version']}: {line}" for line in faults(report)]
        refused = {line for each in report["zips"] if not each["enabled"] for line in each["said"]}
        print(
            f"| {report['version']}{', the module' * is_module} | {report['python']} "
            f"| {report['installed']:.1f} s | {report['baked']:.1f} s, {report['relit']:.2f} s "
            f"| {'; '.join(sorted(refused))} |",
            flush=True,
        )
    print(*(wrong or ["all were refused or taken as they should be"]), sep="\n")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
