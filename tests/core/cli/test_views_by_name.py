"""Cameras of a scene by name, whom `prt relight` and Python show gloss to."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, relight, run
from prt_core.bake.measure import standing_lights
from prt_core.cli import main
from prt_core.light import write_image
from prt_core.rays.caster import known_casters
from prt_core.relight.relighter import Relighter
from prt_core.scene import Camera
from prt_core.transport import View
from tests.meshes import plane

CASTER = "embree" if "embree" in known_casters() else "brute"
SKY = standing_lights()["low soft sun"]


def looking_down(x, y, z, **more):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return Camera(matrix, 0.5, frame=(40, 30), **more)


CAMERAS = {"Top": looking_down(0, 0, 2.5), "1,2,3": looking_down(0.5, 0, 2), "Plan": None}
CAMERAS["Plan"] = looking_down(0, 0, 5, lens="orthographic", shift=(0.1, 0.2), clip=(0.1, 50))
OWN = looking_down(0.2, 0.1, 1.5)


def floor(**gloss):
    mesh = plane(9, name="floor")
    gloss = {k: np.full((len(mesh.materials.albedo), 1), v) for k, v in gloss.items()}
    return Scene.from_meshes([replace(mesh, materials=mesh.materials.replaced(**gloss))])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names")
    write_image(folder / "sky.exr", SKY.pixels)
    settings = BakeSettings(resolution=8, bounces=0, caster=CASTER, gloss=True)
    scene = floor(dielectric=1.0, roughness=0.4)
    run(bake_steps(scene, folder / "a.prt", settings, camera=OWN, cameras=CAMERAS))
    settings = replace(settings, gloss=False)
    run(bake_steps(floor(), folder / "plain.prt", settings, camera=OWN, cameras=CAMERAS))
    return folder


def test_a_bake_keeps_all_cameras_and_takes_new_ones(folder):
    bake = load(folder / "a.prt")
    assert bake.cameras == CAMERAS and bake.camera_named("camera") == OWN
    settings = BakeSettings(**bake.settings)
    moved = {"Top": looking_down(0, 0, 3)}
    path = folder / "moved.prt"
    for cameras in (CAMERAS, moved):
        run(bake_steps(floor(), path, replace(settings, gloss=False), cameras=cameras))
    assert load(path).cameras == moved
    with pytest.raises(PRTError, match="camera: the baked scene has none called 'Side' whose lens"):
        load(path).camera_named("Side")
    with pytest.raises(PRTError, match="cameras: expected"):
        run(bake_steps(floor(), folder / "b.prt", settings, cameras={"Top": np.eye(4)}))


@pytest.mark.parametrize("name", ["Top", "1,2,3", "Plan", "camera"])
def test_colours_are_those_for_the_camera_of_that_name(folder, name):
    words = ["relight", str(folder / "a.prt"), "--light", str(folder / "sky.exr")]
    assert main([*words, "--view", name, "--output", str(folder / "a.npz")]) == 0
    result = np.load(folder / "a.npz")["floor"]
    camera = OWN if name == "camera" else CAMERAS[name]
    bake = load(folder / "a.prt")
    wanted = bake.colours(Relighter(bake).radiance(folder / "sky.exr", view=View.of_camera(camera)))
    np.testing.assert_array_equal(result, wanted["floor"])
    np.testing.assert_array_equal(relight(bake, folder / "sky.exr", view=name)["floor"], result)


def test_pictures_are_seen_from_it(folder, capsys):
    words = ["relight", "--light", str(folder / "sky.exr"), "--size", "40x30", "--png"]
    pictures = {}
    for name in ("a.prt", "plain.prt"):
        for view in ("camera", "Top"):
            png = folder / f"{view}.png"
            assert main([*words, str(png), "--view", view, str(folder / name)]) == 0
            pictures[name, view] = png.read_bytes()
    assert len(set(pictures.values())) == 4
    # Without gloss it is the plain picture.
    assert main([*words, str(folder / "p.png"), str(folder / "plain.prt")]) == 0
    assert (folder / "p.png").read_bytes() == pictures["plain.prt", "camera"]
    # One of a file of lights is seen from it as well.
    (folder / "lights.json").write_text('{"day": {"environment": "sky.exr"}}')
    words = ["relight", str(folder / "a.prt"), "--lights", str(folder / "lights.json")]
    words += ["--size", "40x30", "--png", str(folder / "q.png")]
    assert main([*words, "--view", "Top"]) == 0
    assert (folder / "q.png").read_bytes() == pictures["a.prt", "Top"]
    capsys.readouterr()


def test_gloss_that_is_shown_to_nobody_is_said(folder, capsys):
    words = ["relight", "--light", str(folder / "sky.exr"), "--output", str(folder / "n.npz")]
    asked = ("a.prt", [], 1), ("a.prt", ["--view", "Top"], 0), ("plain.prt", [], 0)
    for name, view, said in asked:
        assert main([*words, *view, str(folder / name)]) == 0
        assert capsys.readouterr().out.count("gloss is shown as an even colour") == said


def test_a_wrong_name_is_answered_with_those_that_there_are(folder, capsys):
    words = ["relight", str(folder / "a.prt"), "--light", str(folder / "sky.exr")]
    assert main([*words, "--view", "top", "--output", str(folder / "c.npz")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "--view: the baked scene has none called 'top'" in said
    assert "it has '1,2,3', 'Plan', 'Top' and 'camera', its own, or give a place as x,y,z" in said
    assert not (folder / "c.npz").exists()
    assert main([*words, "--view", "0,0,3", "--png", str(folder / "c.png")]) == 2
    assert "a picture is seen from the camera" in capsys.readouterr().err
