"""The benchmark of real assets: what it opens, puts under it, compares and survives."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from tests.benchmarks import asset_scene, assets  # noqa: E402

CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (2, 3) for y in (0, 5) for z in (7, 9)]
    + ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
)
FLOOR = "o floor\nv -9 0 -9\nv 9 0 -9\nv 9 0 19\nv -9 0 19\nf 9 10 11 12\n"


def test_an_asset_without_a_ground_stands_on_one(tmp_path):
    (tmp_path / "cube.obj").write_text(f"o cube\n{CUBE}\n")
    asset_scene.open_asset(tmp_path / "cube.obj")
    ground = bpy.data.objects[asset_scene.GROUND]
    # The file's y is up: the cube is 5 high from 0.
    assert ground.location.z == pytest.approx(0, abs=0.02) and ground.location.z < 0
    assert ground.dimensions.x == pytest.approx(25)


def test_an_asset_keeps_its_own_ground(tmp_path):
    (tmp_path / "room.obj").write_text(f"o cube\n{CUBE}\n{FLOOR}")
    asset_scene.open_asset(tmp_path / "room.obj")
    assert sorted(item.name for item in bpy.data.objects) == ["cube", "floor"]


def test_the_light_is_compared_apart_from_the_diffuse_colours():
    truth = np.linspace(0.2, 0.9, 33).reshape(11, 3)
    result = assets.compared(
        {"lamp": 3 * truth, asset_scene.GROUND: truth[:5] * 0},
        {"lamp": np.full((11, 3), 0.6)},
        {
            "colours": {"lamp": truth, asset_scene.GROUND: truth[:5]},
            "albedo": {"lamp": np.full((11, 3), 0.2)},
            "noise": 0.0,
            "samples": 1,
        },
    )
    assert result["error"] > 1.5 and result["albedo"] > 1.5
    assert result["light"] == pytest.approx(0, abs=1e-6)
    assert result["objects"]["lamp"] == result["error"]


def test_a_file_that_cannot_be_opened_is_a_row_of_the_table(tmp_path):
    (tmp_path / "broken.glb").write_bytes(b"no model")
    lines = assets.table([tmp_path / "broken.glb"])
    assert len(lines) == 3 and lines[2].startswith("| broken.glb |") and "crashed" in lines[2]
