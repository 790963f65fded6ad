"""Bakes as .glb files of many kinds, and the programs that read them."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from prt_core import compress, export_glb
from tests.core.export.glb.test_glb_files import MATRICES, bake_of, prism
from tests.meshes import glowing, plane, sphere

HERE = Path(__file__).parent
# How a bake is written, by name.
KINDS = {
    "plain": {},
    "sixteen bits": {"encoding": "u16", "white": 2.0},
    "multiplied": {"material": "multiplied"},
    "light alone": {"colours": "light"},
    "relit": {"weights": True, "harmonics": True, "texels": 2},
    "relit light": {"weights": True, "harmonics": True, "material": "multiplied"},
}


def node(script, *arguments):
    """What a script prints, as JSON: of this folder, or copied into another."""
    home = Path(os.environ.get("PRT_NODE_MODULES", HERE / "node_modules"))
    if shutil.which("node") is None or not home.is_dir():
        pytest.skip("needs node, and 'make engines' once")
    script = HERE / script
    if not (script.parent / "node_modules").exists():
        (script.parent / "node_modules").symlink_to(home)
    command = ["node", script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="session")
def baked(tmp_path_factory):
    """Several materials, seams, instances, mirrors, shear, odd names, and a lamp of its own."""
    meshes = [prism(name, matrix) for name, matrix in MATRICES.items()]
    meshes += [
        plane(6, albedo=(0.5, 0.4, 0.3), name="Boden/ß [lib]"),
        glowing(sphere(5, 0.2, (0, 0, 0.5), name="ball"), (3.0, 2.0, 1.0)),
    ]
    path = tmp_path_factory.mktemp("engines") / "a.prt"
    bake = bake_of(meshes, path)
    compress(path, method="cpca:n_clusters=3,n_components=6")
    return bake


@pytest.fixture(scope="session")
def light():
    return (1 + np.random.default_rng(7).random((96, 3)) * 5).astype(np.float32)


@pytest.fixture(scope="session", params=KINDS)
def written(request, baked, light, tmp_path_factory):
    """(path, report) of one file of each kind."""
    path = tmp_path_factory.mktemp("files") / "a.glb"
    return path, export_glb(baked, path, light, **KINDS[request.param])
