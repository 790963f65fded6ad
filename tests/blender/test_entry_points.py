"""API and command line give the same arrays."""

import json
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

import build
import prt_core
from prt_core import PRTError
from prt_core.blender.colours import write_all, write_colours
from tests.blender.conftest import prt

ROOT = Path(__file__).resolve().parents[2]
NAME = "08_two_triangle_floor"


@pytest.fixture(scope="module")
def blend(tmp_path_factory):
    return build.build(NAME, tmp_path_factory.mktemp("scenes"))


@pytest.fixture(scope="module")
def baked(blend):
    path = blend.with_suffix(".prt")
    prt_core.bake(blend, path, resolution=8, tolerance=0.02, caster="blender")
    return path


def prt_alone(*arguments, code=0):
    """The same in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "prt_core", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert done.returncode == code, done.stderr
    return done


def test_command_line_and_api_give_the_same(blend, baked, hdri, tmp_path):
    done = prt_alone(
        "bake", blend, "-o", tmp_path / "c.prt", "--resolution", 8, "--tolerance", 0.02,
        "--caster", "blender", "--json",
    )  # fmt: skip
    report = json.loads(done.stdout)
    wanted = {"points", "directions", "back_end", "rays", "seconds", "bytes", "peak_bytes"}
    assert wanted <= set(report) and report["back_end"] == "blender"
    prt(
        "relight", tmp_path / "c.prt", "--light", hdri("city"), "--rotate", 30, "--exposure", 1,
        "--output", tmp_path / "c.npz", "--png", tmp_path / "c.png", "--size", "64x36",
    )  # fmt: skip
    result = np.load(tmp_path / "c.npz")
    colours = prt_core.relight(baked, hdri("city"), rotation=30)
    assert set(result.files) == set(colours) == {"floor", "ball"}
    for name in colours:
        assert result[name].dtype == np.float32
        np.testing.assert_array_equal(result[name], colours[name] * np.float32(2))
    assert (tmp_path / "c.png").stat().st_size > 500
    assert json.loads(prt("info", tmp_path / "c.prt", "--json").stdout)["complete"] is True


def test_a_bake_shows_itself_by_the_call_and_the_command_line(blend, baked, tmp_path):
    seen = []
    again = tmp_path / "p.prt"
    prt_core.bake(
        blend, again, resolution=8, tolerance=0.02, caster="blender", on_picture=seen.append
    )
    assert [seen[-1].known_percent, seen[-1].error] == [100, prt_core.load(again).report["error"]]
    light = np.ones((384, 3), np.float32)
    np.testing.assert_array_equal(
        seen[-1].transport.radiance(light), prt_core.load(baked).transport.radiance(light)
    )
    png = tmp_path / "p.png"
    said = prt(
        "bake", blend, "-o", tmp_path / "c.prt", "--resolution", 8, "--tolerance", 0.02,
        "--caster", "blender", "--show-png", png,
    )  # fmt: skip
    assert png.stat().st_size > 1000 and "within about" in said.stderr
    wrong = prt("bake", blend, "-o", tmp_path / "w.prt", "--show-light", "world", code=2)
    assert "--show-png" in wrong.stderr and not (tmp_path / "w.prt").exists()


def test_compress_from_the_command_line_is_the_api(baked, hdri, tmp_path):
    import shutil

    one, two = (shutil.copytree(baked, tmp_path / f"{name}.prt") for name in "ab")
    options = ("--method", "cpca", "--tolerance", 0.05, "--light", hdri("city"), hdri("sunset"))
    done = prt("compress", one, *options)
    assert "chosen: cpca" in done.stdout and "within the tolerance" in done.stdout
    attributes = prt_core.compress(
        two, method="cpca", tolerance=0.05, lights=[hdri("city"), hdri("sunset")]
    )
    info = json.loads(prt("info", one, "--json").stdout)["compressed"]
    assert info["error"] == attributes["error"] and info["bytes"] == attributes["bytes"]
    assert "compressed:" in prt("info", one).stdout
    for form, says in (("auto", "compressed (cpca"), ("exact", "exactly")):
        done = prt("relight", one, "--light", hdri("night"), "--rotate", 30, "--output",
                   tmp_path / "c.npz", "--form", form)  # fmt: skip
        assert f"points relit {says}" in done.stdout
        result = np.load(tmp_path / "c.npz")
        colours = prt_core.relight(two, hdri("night"), rotation=30, form=form)
        for name in colours:
            np.testing.assert_array_equal(result[name], colours[name])
    exact = prt_core.relight(baked, hdri("night"), rotation=30)
    np.testing.assert_array_equal(exact["floor"], colours["floor"])
    turned = prt("relight", one, "--light", hdri("night"), "--turn", 2, "--output",
                 tmp_path / "t_#.npz")  # fmt: skip
    n_points = len(prt_core.load(one).scene.points)
    assert f"2 frames of {n_points:,} points relit compressed" in turned.stdout
    assert "no compressed form" in prt("compress", one, "--method", "none").stdout
    assert json.loads(prt("info", one, "--json").stdout)["compressed"] is None


def test_images_are_baked_and_written(blend, hdri, tmp_path):
    output = tmp_path / "i.prt"
    common = "--resolution", 8, "--tolerance", 0.05, "--caster", "blender"
    prt("bake", blend, "-o", output, *common, "--camera-pixels", "24x16", "--pixel-samples", 1)
    prt("relight", output, "--light", hdri("city"), "--image", tmp_path / "c.png")
    assert (tmp_path / "c.png").stat().st_size > 200
    bake = prt_core.load(output)
    result = bake.image(prt_core.api.relight_points(bake, hdri("city")))
    assert result.shape == (16, 24, 3) and result.max() > 0
    prt_core.open_blend(blend)
    mesh = bpy.data.objects["floor"].data
    layer = mesh.uv_layers.active or mesh.uv_layers.new(name="flat")
    for loop, place in zip(mesh.loops, layer.data, strict=True):
        place.uv = np.sign(mesh.vertices[loop.vertex_index].co[:2]) / 4 + 0.5
    prt_core.bake(
        None, tmp_path / "g.prt", resolution=8, tolerance=0.05, caster="blender",
        geometry_image=("floor", 8),
    )  # fmt: skip
    bake = prt_core.load(tmp_path / "g.prt")
    place = bake.scene.to_world(bake.scene.points.positions[bake.scene.image.point])
    corner = np.abs(np.array([v.co[0] for v in mesh.vertices])).max()
    assert np.abs(place[0] / corner - [-0.75, 0.75, 0]).max() < 0.02
    wrong = prt("bake", blend, "-o", tmp_path / "w.prt", "--geometry-image", "ball", "x", code=2)
    assert "OBJECT N" in wrong.stderr


def test_images_over_the_sphere_by_both_doors(blend, tmp_path):
    common = "--resolution", 4, "--tolerance", 0.1, "--caster", "blender"
    image = "--geometry-image", "ball", 12
    done = prt(
        "bake", blend, "-o", tmp_path / "c.prt", *common, *image, "--parametrisation", "sphere"
    )
    assert "ball: over the sphere with a stretch efficiency of" in done.stdout
    prt_core.bake(
        blend, tmp_path / "a.prt", resolution=4, tolerance=0.1, caster="blender",
        geometry_image=("ball", 12), parametrisation="sphere",
    )  # fmt: skip
    one, two = (prt_core.load(tmp_path / f"{name}.prt").scene for name in "ca")
    assert one.fingerprint() == two.fingerprint()
    assert one.image.point.max() == len(one.points) - len(one.details) - 1
    image = "--geometry-image", "floor", 12
    done = prt(
        "bake", blend, "-o", tmp_path / "w.prt", *common, *image, "--parametrisation", "sphere",
        code=2,
    )  # fmt: skip
    assert "floor" in done.stderr and "open sheet" in done.stderr and "UV" in done.stderr


def test_suzanne_goes_over_the_sphere_without_her_eyes(tmp_path):
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.name = "head"
    report = prt_core.bake(
        None, tmp_path / "s.prt", resolution=4, tolerance=0.1, caster="blender",
        geometry_image=("head", 16), parametrisation="sphere",
    )  # fmt: skip
    printed = next(message for message in report["messages"] if "over the sphere" in message)
    assert "2 holes filled" in printed and "left out" in printed
    scene = prt_core.load(tmp_path / "s.prt").scene
    place = scene.to_world(scene.points.positions[scene.image.point])
    assert (np.ptp(place, axis=0) > 0.8 * np.array(bpy.context.object.dimensions)).all()


def test_colours_reach_the_meshes_exactly(blend, baked, hdri, tmp_path):
    prt(
        "relight", baked, "--light", hdri("city"), "--blend", tmp_path / "o.blend",
        "--scene", blend, "--attribute", "Lit",
    )  # fmt: skip
    colours = prt_core.relight(baked, hdri("city"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "o.blend"))
    for name, wanted in colours.items():
        mesh = bpy.data.objects[name].data
        attribute = mesh.color_attributes["Lit"]
        assert (attribute.data_type, attribute.domain) == ("FLOAT_COLOR", "CORNER")
        assert mesh.color_attributes.active_color.name == "Lit"
        values = np.empty(len(attribute.data) * 4, np.float32)
        attribute.data.foreach_get("color", values)
        np.testing.assert_array_equal(values.reshape(-1, 4)[:, :3], wanted)
        assert (values[3::4] == 1).all()


def test_a_blend_is_built_where_none_is_named(baked, hdri, tmp_path):
    prt("relight", baked, "--light", hdri("city"), "--blend", tmp_path / "o.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "o.blend"))
    floor = bpy.data.collections["PRT"].objects["floor"].data
    assert len(floor.loops) == 6 and len(floor.color_attributes["PRT"].data) == 6


def test_instances_get_realised_copies_once(tmp_path):
    blend = build.build("06_instances", tmp_path)
    prt_core.bake(blend, tmp_path / "i.prt", resolution=2, bounces=0)
    bake = prt_core.load(tmp_path / "i.prt")
    colours = bake.colours(np.ones((len(bake.scene.points), 3), np.float32))
    for _ in range(2):
        copies = write_all(bake.scene, colours)
    assert len(copies) == 8 and len(bpy.data.collections["PRT"].objects) == 8
    floor = bpy.data.objects["floor"].data
    assert "PRT" in floor.color_attributes


@pytest.mark.parametrize("domain", ["CORNER", "POINT"])
def test_a_mesh_that_changed_is_refused(domain):
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(PRTError, match="has 24 corners, the bake 8; the mesh was changed"):
        write_colours(bpy.context.object, np.zeros((8, 3), np.float32), domain=domain)
    write_colours(bpy.context.object, np.full((24, 3), 0.5, np.float32), domain=domain)
    assert bpy.context.object.data.color_attributes["PRT"].domain == domain


def test_errors_are_one_line_and_an_exit_code(baked, hdri, tmp_path):
    cases = [
        (("bake", tmp_path / "none.blend"), "there is no such .blend"),
        (("relight", tmp_path / "none.prt", "--light", hdri("city"), "--png", "x.png"), "no such"),
        (
            ("relight", baked, "--light", "no.exr", "--output", tmp_path / "x.npz"),
            "no such image",
        ),
        (("relight", baked, "--light", hdri("city")), "nothing to write"),
        (("relight", baked, "--lamps", "--output", tmp_path / "x.npz"), "had no lamps"),
        (("relight", baked, "--light", hdri("city"), "--output", tmp_path / "x.csv"), "in .npz"),
        (("compress", tmp_path / "none.prt"), "there is no such bake"),
        (("compress", baked, "--method", "best"), "method: expected auto, cpca"),
        (("compress", baked, "--tolerance", "2"), "tolerance: expected a number above 0 and"),
        (
            (
                "relight",
                baked,
                "--light",
                hdri("city"),
                "--output",
                tmp_path / "x.npz",
                "--form",
                "compressed",
            ),
            "there is no compressed form; make one with 'prt compress'",
        ),
    ]
    for number, (arguments, message) in enumerate(cases):
        done = (prt if number else prt_alone)(*arguments, code=2)
        lines = [line for line in done.stderr.splitlines() if line.startswith("prt: ")]
        assert len(lines) == 1 and message in lines[0], done.stderr
        assert "Traceback" not in done.stderr
    assert not (tmp_path / "x.npz").exists()


@pytest.mark.parametrize(
    "method, stages", [("exhaustive", ["visibility/c"]), ("agreement", ["ray_journal", "gather/c"])]
)
def test_a_killed_bake_goes_on_to_the_same_bytes(blend, tmp_path, method, stages):
    """kill -9 soon after the first files of a stage, resumed each time; against an unbroken one."""
    import signal
    import time

    arguments = ["bake", blend, "--resolution", 16, "--tolerance", 0.01, "--caster", "blender",
                 "--method", method, "--quiet", "-o"]  # fmt: skip
    prt(*arguments, tmp_path / "whole.prt")
    rng = np.random.default_rng(5)
    broken = tmp_path / "broken.prt"
    command = [sys.executable, "-m", "prt_core", *map(str, arguments), str(broken)]
    for stage in stages:
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        while process.poll() is None and not (broken / stage).exists():
            time.sleep(0.01)
        time.sleep(0.03 * rng.random())
        process.kill()
        assert process.wait() == -signal.SIGKILL
    prt(*arguments, broken)
    from prt_core.store import BakeStore

    one, two = BakeStore(tmp_path / "whole.prt"), BakeStore(broken)
    own = "visibility_rays" if method == "exhaustive" else "traced"
    for name in ("visibility", "gather", own, "gather_rays", "point_positions"):
        np.testing.assert_array_equal(one.read(name), two.read(name), err_msg=name)
    for key in ("rays", "error", "certificate", "entries_percent"):
        assert one.attributes["report"][key] == two.attributes["report"][key], key


def test_nothing_of_ours_listens_when_python_ends():
    """Blender 4.2 as a module crashes of it, and 4.5 never ends."""
    script = (
        "import atexit, bpy; pre = bpy.app.handlers.render_pre;"
        "atexit.register(lambda: print('left:', len(pre)));"
        "import prt_core.blender; print('now:', len(pre))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, timeout=120
    )
    assert done.returncode == 0, done.stderr
    # Blender may have lines of its own to say.
    lines = [line for line in done.stdout.splitlines() if line.startswith(("now:", "left:"))]
    assert lines == ["now: 1", "left: 0"]
