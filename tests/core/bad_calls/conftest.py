"""A small bake and what it is made of, for all calls."""

from types import SimpleNamespace

import numpy as np
import pytest

from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.load import load
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from tests.meshes import plane, wall

from .calls import N_DIRECTIONS, RESOLUTION, RNG


@pytest.fixture(scope="package")
def there(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calls")
    (folder / "file").write_text("in the way")
    meshes = [plane(3, albedo=0.5), wall(0.9, 1.0, 1.0, albedo=0.7)]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    run(bake_steps(scene, folder / "a.prt", BakeSettings(resolution=RESOLUTION, caster="brute")))
    bake = load(folder / "a.prt")
    light = (1 + RNG.random((N_DIRECTIONS, 3))).astype(np.float32)
    return SimpleNamespace(folder=folder, meshes=meshes, scene=scene, bake=bake, light=light)


@pytest.fixture(autouse=True)
def in_folder(there, monkeypatch):
    """Some texts are good names of files to be made."""
    monkeypatch.chdir(there.folder)
