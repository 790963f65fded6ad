"""Other programs read a .glb as it is meant: Khronos' validator, and three.js."""

import json
import shutil

import numpy as np

from prt_core import Lighting, export_glb
from prt_core.relight.blend import WeightedLight
from tests.engines.conftest import HERE, node
from tests.gltf import TO_BLENDER, Glb


def test_the_validator_has_nothing_to_say(written):
    issues = node("validate.mjs", written[0])
    assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
    # Numbers for programs are no part of glTF: it cannot know who reads them.
    assert {message["code"] for message in issues["messages"]} <= {"UNUSED_OBJECT"}


def test_three_js_reads_places_and_colours(written):
    path, report = written
    read, glb = node("read_three.mjs", path), Glb(path)
    assert read["extras"] == glb.json["extras"]
    by_object = {}
    for mesh in read["meshes"]:
        assert mesh["kind"] == "MeshBasicMaterial" and mesh["coloured"]
        by_object.setdefault(mesh["object"], []).append(mesh)
    assert set(by_object) == set(glb.nodes)
    for name, meshes in by_object.items():
        place, _, radiance, uv = glb.corners(name)
        parts = [(np.array(mesh["places"]).reshape(-1, 3, 3), mesh) for mesh in meshes]
        # Groups keep the order of their primitives; a mirror turns corners round.
        mirrored = slice(None, None, -1 if meshes[0]["mirrored"] else 1)
        theirs = np.concatenate([part[:, mirrored] for part, _ in parts])
        np.testing.assert_allclose(theirs @ TO_BLENDER.T, place, atol=1e-5)

        def corners(key, width, meshes=meshes, mirrored=mirrored):
            values = [np.array(mesh[key]).reshape(-1, 3, width)[:, mirrored] for mesh in meshes]
            return np.concatenate(values)

        np.testing.assert_allclose(corners("radiance", 3), radiance, rtol=1e-6)
        shown = np.minimum(radiance, report["scale"])
        error = np.abs(corners("colours", 3) * report["scale"] - shown).max()
        assert error <= 1e-3 * radiance.max()
        if uv is None:
            assert meshes[0]["uv"] is None
        else:
            np.testing.assert_allclose(corners("uv", 2), uv, atol=1e-6)


def test_three_js_blends_lights_by_their_names(baked, light, tmp_path):
    """The snippet of docs/engines, on a file that the validator has nothing to say of."""
    lights = [
        WeightedLight("Day", Lighting(light), 0.5),
        WeightedLight("Night", Lighting(2 / light)),
    ]
    export_glb(baked, tmp_path / "a.glb", lights=lights)
    issues = node("validate.mjs", tmp_path / "a.glb")
    assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
    shutil.copy(HERE.parents[1] / "docs" / "engines" / "prt_three.js", tmp_path / "prt_three.mjs")
    shutil.copy(HERE / "blend_lights.mjs", tmp_path)
    weights = json.dumps({"Day": 0.25, "Night": 3})
    shown = node(tmp_path / "blend_lights.mjs", tmp_path / "a.glb", weights)
    glb = Glb(tmp_path / "a.glb")
    parts = [attributes for name in glb.nodes for attributes, _, _ in glb.primitives(name)]
    for mesh, of in zip(shown, parts, strict=True):
        wanted = 0.25 * of["_PRT_LIGHT0"] + 3 * of["_PRT_LIGHT1"]
        np.testing.assert_allclose(np.reshape(mesh, (-1, 3)), wanted, rtol=1e-5)
