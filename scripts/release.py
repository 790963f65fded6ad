"""Build all that is given away: `make release`, into build/release.

A wheel and a source archive of the core, the extension's zips, a bill of materials (CycloneDX) of
each, and the SHA-256 of every file. Refused where the three places of the version differ, where the
changelog does not have it, or where something that travels in a zip has a licence that the
GPL-3.0-or-later does not take in. Nothing is published.
"""

import email
import hashlib
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scripts import build_extension  # noqa: E402

# Licences by SPDX's names that may be part of a work under the GPL-3.0-or-later, as a package
# spells them in its metadata: in an expression, in words, or by classifiers.
TAKEN = {
    "MIT", "BSD-2-Clause", "BSD-3-Clause", "Apache-2.0", "PSF-2.0", "MPL-2.0", "ISC", "0BSD",
    "LGPL-2.1-or-later", "LGPL-3.0-or-later", "GPL-3.0-or-later", "GPL-2.0-or-later",
}  # fmt: skip
WORDS = {
    "MIT License": "MIT", "BSD License": "BSD-3-Clause", "ISC License (ISCL)": "ISC",
    "Apache Software License": "Apache-2.0",
}  # fmt: skip
# What embreex calls its licence is the whole text of it: read, and found to be this one.
READ = {"embreex": "BSD-2-Clause"}


def main():
    version = version_of()
    output = ROOT / "build" / "release"
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    run("-m", "build", "--outdir", output, ROOT)
    run(ROOT / "scripts" / "build_extension.py", "--output", output)
    for python in build_extension.PYTHONS:
        check_licences(python)
        pins = build_extension.PINS / f"{python}.txt"
        materials = output / f"prt_relight-{version}-python-{python}.cdx.json"
        run("-m", "cyclonedx_py", "requirements", pins, "--output-reproducible", "-o", materials)
    needs = output / "needs.txt"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needs.write_text("\n".join(project["dependencies"]) + "\n")
    materials = output / f"prt_core-{version}.cdx.json"
    run("-m", "cyclonedx_py", "requirements", needs, "--output-reproducible", "-o", materials)
    needs.unlink()
    files = sorted(output.iterdir())
    sums = "".join(f"{_digest(file)}  {file.name}\n" for file in files)
    (output / "SHA256SUMS").write_text(sums)
    for file in files:
        print(f"{file.stat().st_size / 1e6:8.2f} MB  {file.name}")


def version_of(root=ROOT):
    """The version, where all places agree about it."""
    manifest = tomllib.loads((root / "blender_addon" / "blender_manifest.toml").read_text())
    module = (root / "prt_core" / "version.py").read_text()
    places = {
        "pyproject.toml": tomllib.loads((root / "pyproject.toml").read_text())["project"][
            "version"
        ],
        "blender_addon/blender_manifest.toml": manifest["version"],
        "prt_core/version.py": re.search(r'__version__ = "(.+)"', module)[1],
    }
    if len(set(places.values())) > 1:
        said = ", ".join(f"{place} {version}" for place, version in places.items())
        sys.exit(f"release: versions differ: {said}")
    version = places["pyproject.toml"]
    if f"\n## {version}" not in (root / "CHANGELOG.md").read_text():
        sys.exit(f"release: CHANGELOG.md has no section {version}")
    return version


def check_licences(python, folder=ROOT / "build" / "wheels"):
    """End where a wheel that travels in the zips for a Python may not be given away with them."""
    for platform in build_extension.PLATFORMS:
        for wheel in build_extension.dependencies(platform, python, folder):
            name, licences = licences_of(wheel)
            if not licences or not licences <= TAKEN:
                said = ", ".join(sorted(licences)) or "none that is known"
                sys.exit(f"release: {name}: its licence is {said}; see whether it may be in a zip")


def licences_of(wheel):
    """Name of a wheel's package, and the SPDX names of all licences that it is under."""
    with zipfile.ZipFile(wheel) as archive:
        (file,) = [n for n in archive.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", n)]
        data = email.message_from_bytes(archive.read(file))
    name, said = data["Name"], data["License-Expression"] or data["License"] or ""
    if name in READ:
        return name, {READ[name]}
    if "\n" in said or said.startswith("Copyright"):
        # A text: its classifier says which.
        said = ""
    parts = {WORDS.get(part, part) for part in re.split(r" (?:AND|OR) ", said.strip()) if part}
    classes = [c for c in data.get_all("Classifier", []) if c.startswith("License :: OSI")]
    return name, parts or {WORDS.get(c.split(" :: ")[-1], c.split(" :: ")[-1]) for c in classes}


def run(*command):
    """A command of this Python; the release ends where it fails."""
    done = subprocess.run([sys.executable, *map(str, command)], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(f"release: {' '.join(map(str, command[:3]))} failed")


def _digest(file):
    return hashlib.sha256(file.read_bytes()).hexdigest()


if __name__ == "__main__":
    main()
