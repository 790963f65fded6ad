"""What is checked before anything is given away."""

import shutil
import zipfile
from pathlib import Path

import pytest

from scripts import release

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def tree(tmp_path):
    """The files that know the version, to be spoilt."""
    for name in ("pyproject.toml", "CHANGELOG.md", "prt_core/version.py",
                 "blender_addon/blender_manifest.toml"):  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def test_the_version_is_one():
    assert release.version_of() == release.version_of(ROOT)


def test_versions_that_differ_are_refused(tree):
    (tree / "prt_core" / "version.py").write_text('__version__ = "9.9.9"\n')
    with pytest.raises(SystemExit, match=r"versions differ: .*version\.py 9\.9\.9"):
        release.version_of(tree)


def test_a_version_without_its_changes_is_refused(tree):
    (tree / "CHANGELOG.md").write_text("# Changelog\n\n## 0.0.1\n")
    with pytest.raises(SystemExit, match="CHANGELOG.md has no section"):
        release.version_of(tree)


@pytest.mark.parametrize(
    "lines, wanted",
    [
        ("License-Expression: Apache-2.0 OR BSD-2-Clause", {"Apache-2.0", "BSD-2-Clause"}),
        ("License: MIT License", {"MIT"}),
        ("License: Copyright (c) 2001\nClassifier: License :: OSI Approved :: BSD License",
         {"BSD-3-Clause"}),
        ("Classifier: License :: Other/Proprietary License", set()),
    ],
)  # fmt: skip
def test_licences_are_read_from_a_wheel(tmp_path, lines, wanted):
    wheel = tmp_path / "thing-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("thing-1.0.dist-info/METADATA", f"Name: thing\n{lines}\n\nA thing.\n")
    assert release.licences_of(wheel) == ("thing", wanted)


def test_a_wheel_that_may_not_travel_is_named(tmp_path, monkeypatch):
    wheel = tmp_path / "thing-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("thing-1.0.dist-info/METADATA", "Name: thing\nLicense: SSPL\n\n")
    monkeypatch.setattr(release.build_extension, "dependencies", lambda *_: [wheel])
    with pytest.raises(SystemExit, match="thing: its licence is SSPL"):
        release.check_licences("3.11")
