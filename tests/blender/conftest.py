import sys
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "blend_scenes"))

import prt_core.blender  # noqa: E402, F401  (makes Blender's casters known)


@pytest.fixture(autouse=True)
def empty_file():
    """Every test begins with an empty file, and leaves no data-block of the casters behind."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    left = [b.name for kind in (bpy.data.scenes, bpy.data.objects, bpy.data.node_groups)
            for b in kind if b.name.startswith("prt ")]  # fmt: skip
    assert not left


@pytest.fixture
def hdri():
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    return lambda name: folder / f"{name}.exr"
