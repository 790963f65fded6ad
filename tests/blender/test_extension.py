"""The extension's zip, installed into an empty user folder, with no package but what it brings."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

import prt_core
from scripts import build_extension

ROOT = Path(__file__).resolve().parents[2]
BLEND = ROOT / "blend_scenes" / "08_two_triangle_floor.blend"
PLATFORM = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}[sys.platform]
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"

# What a Blender has of its own.
BLENDERS = ("bpy", "numpy", "numpy.libs", "requests", "urllib3", "certifi", "charset_normalizer",
            "idna", "zstandard", "attr", "attrs", "cattr", "cattrs",
            "typing_extensions.py")  # fmt: skip
BRINGS = {"prt_core", "scipy", "zarr", "numcodecs", "embreex", "yaml", "donfig",
          "threadpoolctl"}  # fmt: skip


@pytest.fixture(scope="module")
def zip_path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("zip")
    command = [ROOT / "scripts" / "build_extension.py", "--platforms", PLATFORM]
    command += ["--pythons", PYTHON, "--output", folder]
    done = subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = folder.glob("*.zip")
    return path


def test_every_python_that_a_blender_runs_is_in_the_zips():
    """3.14 is that of Debian's Blender 5.2; a zip without it is refused there."""
    assert build_extension.PYTHONS == ("3.11", "3.13", "3.14")
    for python in build_extension.PYTHONS:
        pins = build_extension.read_pins(build_extension.PINS / f"{python}.txt")
        hashes = {name: result for name, _, result in pins}
        assert BRINGS - {"prt_core", "yaml"} <= set(hashes) and "pyyaml" in hashes
        for name in ("scipy", "numcodecs", "embreex", "crc32c", "pyyaml"):
            assert len(hashes[name]) == len(build_extension.PLATFORMS), (python, name)
    source = build_extension.__doc__
    assert all(f"{python}:" in source for python in build_extension.PYTHONS)


def test_a_zip_says_which_python_it_is_for(zip_path):
    assert zip_path.stem.endswith(f"{PLATFORM}-{build_extension.CALLED[PYTHON]}")
    assert all(f"python-{python}" in name for python, name in build_extension.CALLED.items())
    # Distributions run other Pythons than blender.org: no Blender is kept out by its version.
    with zipfile.ZipFile(zip_path) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["blender_version_min"] == "4.2.0" and "blender_version_max" not in manifest


@pytest.fixture(scope="module")
def report(zip_path, tmp_path_factory):
    """What a fresh Blender says after it has installed and used the zip."""
    folder = tmp_path_factory.mktemp("user")
    packages = folder / "packages"
    packages.mkdir()
    site = Path(np.__file__).resolve().parents[1]
    for name in BLENDERS:
        if (site / name).exists():
            (packages / name).symlink_to(site / name)
    shutil.copy(BLEND, folder / "scene.blend")
    environment = os.environ | {
        "BLENDER_USER_RESOURCES": str(folder / "resources"),
        "PYTHONPATH": str(packages),
    }
    checks = Path(__file__).with_name("extension_checks.py")
    done = subprocess.run(
        [sys.executable, "-S", checks, zip_path, folder / "scene.blend", folder],
        env=environment, cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    said = done.stdout + done.stderr
    assert (folder / "report.json").is_file(), said
    assert "Traceback" not in said, said
    return json.loads((folder / "report.json").read_text()) | {"folder": folder, "said": said}


def test_numpy_is_blenders_own_and_wheels_are_for_this_platform_only(zip_path):
    with zipfile.ZipFile(zip_path) as archive:
        names = archive.namelist()
    wheels = [name.removeprefix("wheels/") for name in names if name.endswith(".whl")]
    assert not [name for name in wheels if name.startswith("numpy")]
    assert len({name.split("-")[0] for name in wheels}) == len(wheels)
    pins = ROOT / "scripts" / "extension_wheels" / f"{PYTHON}.txt"
    assert len(wheels) == 1 + pins.read_text().count("=="), "prt_core and every pinned wheel"
    assert "blender_manifest.toml" in names and "LICENSE" in names
    assert not [name for name in names if "__pycache__" in name]


def test_it_is_enabled_and_blender_has_nothing_against_it(report):
    assert report["enabled"], report["said"]
    assert report["warnings"] == report["warnings_after"] == "{}", report["said"]
    assert report["turns"] == [True, True, True]


def test_its_packages_are_those_it_brought(report):
    installed = str(report["folder"] / "resources")
    assert not BRINGS & set(report["before"])
    brought = {name for name, file in report["files"].items() if file.startswith(installed)}
    assert BRINGS <= brought
    # Nothing from the environment of this test, either.
    site = str(Path(np.__file__).resolve().parents[1])
    assert not [file for file in report["files"].values() if file.startswith(site)]
    assert not {"sklearn", "pywt", "PIL", "matplotlib"} & set(report["files"])


def test_bake_and_commands_work_with_what_it_brought(report, tmp_path, hdri):
    assert report["bake"] == ["FINISHED"], report["said"]
    codes = {"relight": 0, "compress": 0, "wavelets": 0, "quick": 0, "info": 0}
    codes |= {"missing": 2, "usage": 2}
    assert report["commands"] == codes, report["said"]
    assert "there is no such bake" in report["said"]
    bake = prt_core.load(report["path"])
    assert bake.report["back_end"] == "embree"
    prt_core.bake(BLEND, tmp_path / "api.prt", resolution=8, tolerance=0.05)
    wanted = prt_core.relight(tmp_path / "api.prt", hdri("city"), rotation=30)
    with np.load(report["folder"] / "colours.npz") as result:
        assert set(result) == set(wanted)
        for name, colours in wanted.items():
            np.testing.assert_array_equal(result[name], colours)
    assert (report["folder"] / "view.png").read_bytes().startswith(b"\x89PNG")
