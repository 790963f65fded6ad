"""Build Blender's extension: a zip for each platform and Python, with all that the add-on imports.

    make extension                                   # every zip into build/
    make extension PLATFORMS=linux-x64 PYTHONS=3.11  # one platform, one Python
    make extension PLATFORMS=linux-x64 TOGETHER=1    # one zip for all Pythons, and as large

A zip holds blender_addon/, prt_core as a wheel, and the wheels of scripts/extension_wheels/,
unmodified, from PyPI, for the Python of its Blender (3.11: Blender 4.2 to 5.0; 3.13: 5.1 and 5.2,
and Debian's 4.3; 3.14: Debian's 5.2). Its name says which; Blender refuses one for another Python.
numpy is Blender's own. Downloads are kept in build/wheels
and checked against the hashes; Blender's own tool builds and validates the zips.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PINS = Path(__file__).resolve().parent / "extension_wheels"
# How the zip for a Python is called: that Python, and which of blender.org's Blenders run it.
# Distributions build others: Debian's 4.3 runs 3.13, its 5.2 runs 3.14.
CALLED = {
    "3.11": "python-3.11-blender-4.2-to-5.0",
    "3.13": "python-3.13-blender-5.1-to-5.2",
    "3.14": "python-3.14",
}
PYTHONS = tuple(CALLED)

# What pip calls the systems that Blender's builds run on, the most demanding first.
PLATFORMS = {
    "linux-x64": [f"manylinux_2_{n}_x86_64" for n in (28, 27, 17)] + ["manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": [f"macosx_{n}_0_arm64" for n in (13, 12, 11)],
    "macos-x64": [f"macosx_{n}_0_x86_64" for n in (13, 12, 11)]
    + [f"macosx_10_{n}_x86_64" for n in (15, 14, 13, 12, 9)],
}
# Of every file in a zip, so that the same sources give the same bytes.
_TIME = 1_700_000_000


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--platforms", nargs="+", choices=PLATFORMS, default=list(PLATFORMS))
    parser.add_argument(
        "--pythons", nargs="+", default=list(PYTHONS), metavar="X.Y",
        help=f"default: {' '.join(PYTHONS)}",
    )  # fmt: skip
    parser.add_argument("--together", action="store_true", help="one zip for all of the Pythons")
    parser.add_argument("--addon", type=Path, default=ROOT / "blender_addon", help="its folder")
    parser.add_argument("--output", type=Path, default=ROOT / "build", help="folder of the zips")
    parser.add_argument("--wheels", type=Path, default=ROOT / "build" / "wheels", help="downloads")
    parser.add_argument(
        "--pin", action="store_true", help="write the hashes of the versions in extension_wheels/"
    )
    options = parser.parse_args()
    if options.pin:
        return pin(options.wheels)
    unknown = [python for python in options.pythons if python not in CALLED]
    if unknown:
        sys.exit(f"extension: no wheels for Python {unknown[0]}; their list would be in {PINS}")
    zips = [options.pythons] if options.together else [[python] for python in options.pythons]
    for platform in options.platforms:
        for pythons in zips:
            output = options.output.resolve()
            path = build(options.addon, platform, pythons, output, options.wheels)
            print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    return 0


def build(addon, platform, pythons, output, wheels):
    """Build and validate one zip; returns its path."""
    manifest = (addon / "blender_manifest.toml").read_text()
    called = "" if len(pythons) > 1 else f"-{CALLED[pythons[0]]}"
    attributes = tomllib.loads(manifest)
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder) / attributes["id"]
        ignored = shutil.ignore_patterns("__pycache__", "*.pyc")
        shutil.copytree(addon, stage, ignore=ignored)
        shutil.copy(ROOT / "LICENSE", stage)
        (stage / "wheels").mkdir()
        chosen_wheels = [core_wheel(Path(folder))]
        for python in pythons:
            chosen_wheels += dependencies(platform, python, wheels)
        for wheel in chosen_wheels:
            shutil.copy(wheel, stage / "wheels")
        names = sorted({f"./wheels/{wheel.name}" for wheel in chosen_wheels})
        lists = f"platforms = {_toml([platform])}\nwheels = {_toml(names)}\n\n"
        # Before the first table: what comes after a table's name belongs to it.
        (stage / "blender_manifest.toml").write_text(
            re.sub(r"^\[", lambda _: lists + "[", manifest, count=1, flags=re.MULTILINE)
        )
        for path in stage.rglob("*"):
            os.utime(path, (_TIME, _TIME))
        output.mkdir(parents=True, exist_ok=True)
        path = output / f"{attributes['id']}-{attributes['version']}-{platform}{called}.zip"
        blender_ext("build", "--source-dir", stage, "--output-filepath", path)
        blender_ext("validate", path)
    return path


def core_wheel(folder):
    """Path of prt_core as a wheel, from a copy: setuptools would pick up an older build's files."""
    source = folder / "source"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "prt_core", source / "prt_core", ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip("wheel", "--no-deps", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("prt_core-*.whl")
    return wheel


def dependencies(platform, python, folder):
    """Paths of the wheels for one platform and Python; downloaded where they are missing."""
    pins = PINS / f"{python}.txt"
    folder = folder / f"{platform}-{python}"
    wanted = {name: hashes for name, _, hashes in read_pins(pins)}
    wheels = _with_hashes(folder, wanted)
    if len(wheels) < len(wanted):
        download(platform, python, folder, "--require-hashes", "--requirement", pins)
        wheels = _with_hashes(folder, wanted)
    return wheels


def _with_hashes(folder, wanted):
    every = set().union(*wanted.values())
    return [path for path in sorted(folder.glob("*.whl")) if _digest(path) in every]


def download(platform, python, folder, *what):
    """Unmodified wheels for another system than this one."""
    tags = [f"--platform={tag}" for tag in PLATFORMS[platform]]
    pip(
        "download", "--only-binary=:all:", "--no-deps", f"--python-version={python}",
        "--implementation=cp", *tags, "--dest", folder, *what,
    )  # fmt: skip


def read_pins(path):
    """(name, version, hashes) of each line `name==version --hash=sha256:… …`."""
    for line in path.read_text().replace("\\\n", " ").splitlines():
        if line.strip():
            requirement, *hashes = line.split()
            name, version = requirement.split("==")
            yield name, version, {text.removeprefix("--hash=sha256:") for text in hashes}


def pin(folder):
    """Download the chosen versions for every platform and write what their hashes are."""
    for path in sorted(PINS.glob("*.txt")):
        lines = []
        for name, version, _ in read_pins(path):
            digests = set()
            for platform in PLATFORMS:
                with tempfile.TemporaryDirectory() as fresh:
                    download(platform, path.stem, Path(fresh), f"{name}=={version}")
                    (wheel,) = Path(fresh).glob("*.whl")
                    digests.add(_digest(wheel))
                    kept = folder / f"{platform}-{path.stem}"
                    kept.mkdir(parents=True, exist_ok=True)
                    shutil.copy(wheel, kept)
            hashes = "".join(f" \\\n    --hash=sha256:{digest}" for digest in sorted(digests))
            lines.append(f"{name}=={version}{hashes}\n")
        path.write_text("".join(lines))
    return 0


def pip(*arguments):
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments]
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(_TIME)}
    done = subprocess.run([str(part) for part in command], env=environment, check=False)
    if done.returncode:
        sys.exit(f"extension: pip {arguments[0]} failed; is the package index within reach?")


def blender_ext(*arguments):
    """Blender's own tool for extensions, out of the bpy wheel."""
    spec = find_spec("bpy")
    if spec is None:
        sys.exit("extension: Blender's module is missing; run make setup")
    (scripts,) = Path(spec.origin).parent.glob("*/scripts")
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    command = [sys.executable, tool, arguments[0], "--valid-tags", tags, *arguments[1:]]
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"extension: {arguments[0]}: {done.stdout}{done.stderr}")


def _digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _toml(names):
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"


if __name__ == "__main__":
    sys.exit(main())
