"""The tutorials of the documentation run, and each ends in a picture."""

import runpy
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
matplotlib = pytest.importorskip("matplotlib")
TUTORIALS = sorted((Path(__file__).resolve().parents[2] / "docs" / "tutorials").glob("[0-9]*.py"))
pytestmark = pytest.mark.filterwarnings("error:.*prt_core:DeprecationWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One for all: a bake that another tutorial has made is not made again."""
    return tmp_path_factory.mktemp("tutorials")


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_ends_in_a_picture(path, folder, monkeypatch):
    if "light_field" in path.stem and bpy.app.version < (4, 5):
        pytest.skip("Cycles' own cameras came with Blender 4.5")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    monkeypatch.chdir(folder)
    runpy.run_path(str(path), run_name="__main__")
    assert pyplot.get_fignums(), "it shows nothing"
    for frame in pyplot.gcf().axes:
        for image in frame.get_images():
            picture = np.asarray(image.get_array())
            assert picture.std() > 12, f"{frame.get_title()} is all of one colour"
            assert (picture.min(axis=(0, 1)) < 255).all(), f"{frame.get_title()} is blown out"
    pyplot.close("all")


def test_there_are_eight_and_they_are_short():
    assert len(TUTORIALS) == 8
    for path in TUTORIALS:
        assert len(path.read_text().splitlines()) <= 85, path.name
