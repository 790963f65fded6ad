"""What other programs want of meshes comes back from a store, and bakes without it are read."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeStore, PRTError
from prt_core.scene import Scene
from prt_core.store import read_scene, write_scene
from tests.meshes import plane, sphere


def stored(scene, path):
    store = BakeStore(path, "a")
    store.update(**write_scene(store, scene))
    return BakeStore(path, "a")


@pytest.fixture
def scene():
    matrix = np.eye(4)
    matrix[:3, 3] = 1, 2, 3
    floor = plane(3, corner_material=np.arange(16) // 4 % 2, material_names=("a", "b"))
    floor = replace(floor, corner_uv=np.arange(32.0).reshape(16, 2), matrix=matrix)
    return Scene.from_meshes([floor, sphere(3)])


def test_parts_come_back_as_they_were(scene, tmp_path):
    back = read_scene(stored(scene, tmp_path / "a.prt"))
    for mine, theirs in zip(scene.objects, back.objects, strict=True):
        for name in ("triangle_corners", "corner_material", "matrix"):
            mine_of, theirs_of = getattr(mine.parts, name), getattr(theirs.parts, name)
            np.testing.assert_array_equal(mine_of, theirs_of)
            assert mine_of.dtype == theirs_of.dtype
        assert mine.parts.material_names == theirs.parts.material_names
    np.testing.assert_array_equal(back.objects[0].parts.corner_uv[3], [6, 7])
    assert back.objects[1].parts.corner_uv is None
    # Corners of triangles have the vertices that rays hit.
    item = back.objects[0]
    corners = item.corner_vertex[item.parts.triangle_corners]
    np.testing.assert_array_equal(corners, back.triangles[: len(corners)])
    assert back.fingerprint() == scene.fingerprint()


def test_bakes_of_before_have_none(scene, tmp_path):
    store = stored(scene, tmp_path / "a.prt")
    attributes = store.attributes
    bare = replace(scene, objects=[replace(item, parts=None) for item in scene.objects])
    store = stored(bare, tmp_path / "a.prt")
    assert attributes["meshes"] and store.attributes["meshes"] is None
    assert "mesh_corner_uv" not in store
    assert [item.parts for item in read_scene(store).objects] == [None, None]


@pytest.mark.parametrize(
    "change",
    [
        lambda meshes: meshes[:1],
        lambda meshes: [{**meshes[0], "uv": 1}, meshes[1]],
        lambda meshes: [{**meshes[0], "uv": False}, meshes[1]],
        lambda meshes: [{**meshes[0], "matrix": meshes[0]["matrix"][:15]}, meshes[1]],
        lambda meshes: [{**meshes[0], "materials": [3]}, meshes[1]],
        lambda meshes: {"a": 1},
        lambda meshes: [3, 4],
    ],
)
def test_what_does_not_fit_is_damage(scene, tmp_path, change):
    store = stored(scene, tmp_path / "a.prt")
    store.update(meshes=change(store.attributes["meshes"]))
    with pytest.raises(PRTError) as error:
        read_scene(BakeStore(tmp_path / "a.prt"))
    assert len(str(error.value).splitlines()) == 1


def test_corners_out_of_range_are_damage(scene, tmp_path):
    store = stored(scene, tmp_path / "a.prt")
    corners = store.read("mesh_triangle_corners")
    corners[0, 0] = 16
    store.write("mesh_triangle_corners", corners)
    with pytest.raises(PRTError, match="damaged"):
        read_scene(BakeStore(tmp_path / "a.prt"))
