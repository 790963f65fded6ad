"""Lights by name in a .glb: their sum, and each beside it for engines that blend."""

import json

import numpy as np
import pytest

from prt_core import (
    BakeSettings,
    Lamp,
    PRTError,
    Scene,
    bake_steps,
    export_glb,
    load,
    relight_points,
    run,
)  # fmt: skip
from prt_core.cli import main
from prt_core.light import write_image
from prt_core.relight.blend import WeightedLight
from prt_core.relight.light_file import read_lights
from prt_core.relight.lighting import Lighting
from tests.core.export.glb.test_glb_relighting import points_of, vertices
from tests.gltf import Glb
from tests.meshes import plane, sphere

RNG = np.random.default_rng(5)
LIGHTS = {
    "Day": {"environment": "day.exr", "rotation": 30, "weight": 0.5},
    "Night": {"environment": "night.exr", "strength": 2, "weight": 0},
    "Desk": {"lamps": {"desk": 0.5}, "weight": 2},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lights")
    meshes = [plane(6, albedo=(0.7, 0.5, 0.3)), sphere(5, 0.3, (0, 0, 0.5))]
    desk = Lamp("point", (9, 8, 7), (0, 0.5, 1.5), name="desk")
    scene = Scene.from_meshes(meshes, max_hidden=150)
    run(bake_steps(scene, folder / "a.prt", BakeSettings(resolution=4), [desk]))
    for name in ("day", "night"):
        write_image(folder / f"{name}.exr", RNG.random((4, 8, 3)).astype(np.float32))
    (folder / "lights.json").write_text(json.dumps(LIGHTS))
    return folder


def test_vertices_have_each_light_beside_the_sum(folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    line = "export glb a.prt -o line.glb --lights lights.json --harmonics --exposure 1"
    assert main(line.split()) == 0, capfd.readouterr()
    glb = Glb(folder / "line.glb")
    said, of = glb.json["extras"]["PRT"], vertices(glb)
    assert [(light["name"], light["weight"]) for light in said["lights"]] == [
        ("Day", 0.5), ("Night", 0), ("Desk", 2)]  # fmt: skip
    bake, total = load(folder / "a.prt"), 0
    points = points_of(bake)
    for light, told in zip(read_lights(folder / "lights.json", bake), said["lights"], strict=True):
        own = 2 * relight_points(bake, light.lighting)[points]
        np.testing.assert_allclose(of[told["attribute"]], own, rtol=1e-5, atol=1e-7)
        assert own.max() > 0
        total = total + light.weight * own
    np.testing.assert_allclose(of["_PRT_RADIANCE"], total, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(of["COLOR_0"] * said["scale"], total, rtol=1e-5, atol=1e-6)
    # What relights is under the sum of what comes from far away.
    day, night = ([*told["rotation"]] for told in said["lights"][:2])
    assert day != night and said["light"] == {} and len(said["harmonics"]["light"]) == 9


def test_one_light_by_name_and_the_light_that_is_received(folder):
    bake = load(folder / "a.prt")
    day = Lighting(folder / "day.exr")
    export_glb(bake, folder / "one.glb", lights=[WeightedLight("Day", day)], colours="light")
    export_glb(bake, folder / "plain.glb", day, colours="light")
    one, plain = (Glb(folder / f"{name}.glb") for name in ("one", "plain"))
    for name in ("_PRT_RADIANCE", "COLOR_0"):
        np.testing.assert_array_equal(vertices(one)[name], vertices(plain)[name])
    np.testing.assert_array_equal(vertices(one)["_PRT_LIGHT0"], vertices(plain)["_PRT_RADIANCE"])
    assert "lights" not in plain.json["extras"]["PRT"]


@pytest.mark.parametrize("more, says", [
    ("--light day.exr", "--light: is for one light"),
    ("--lamps", "--lamps: is for one light"),
    ("--rotate 3", "--rotate: is for one light"),
])  # fmt: skip
def test_what_is_of_one_light_is_refused_beside_them(folder, monkeypatch, capfd, more, says):
    monkeypatch.chdir(folder)
    assert main(f"export glb a.prt -o no.glb --lights lights.json {more}".split()) == 2
    assert says in capfd.readouterr().err and not (folder / "no.glb").exists()


def test_wrong_calls(folder):
    bake = load(folder / "a.prt")
    with pytest.raises(PRTError, match="rotation: is of one light"):
        export_glb(bake, folder / "no.glb", lights=folder / "lights.json", rotation=3)
    with pytest.raises(PRTError, match="lights: expected at least one"):
        export_glb(bake, folder / "no.glb", lights=[])
    with pytest.raises(PRTError, match="two are called 'Day'"):
        two = [WeightedLight("Day", Lighting(folder / "day.exr"))] * 2
        export_glb(bake, folder / "no.glb", lights=two)
