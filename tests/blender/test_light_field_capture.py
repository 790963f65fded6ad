"""Light fields by Cycles: closed forms, Cycles' own camera, lamps apart, and the file as it was."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scipy.spatial import cKDTree

from prt_core import bake
from prt_core.api import light_field
from prt_core.api.light_field import light_field_steps
from prt_core.bake.light_field import LightFieldSettings, points_of
from prt_core.bake.light_field_load import load_light_field
from prt_core.blender.light_field_scene import light_field_camera, light_field_meshes_steps
from prt_core.blender.light_field_shader import GRAZING
from prt_core.blender.passes.openexr import read_channels, write_channels
from prt_core.errors import PRTError
from prt_core.lightfield import HRDFLayout
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from tests.benchmarks.light_field_capture import compare, scene_with

NEW = bpy.app.version >= (4, 5, 0)
needs_camera = pytest.mark.skipif(not NEW, reason="cameras that are shaders came with Blender 4.5")
ANGLES = (5, 3)
ROOT = Path(__file__).resolve().parents[2]


def ball(name="ball", radius=0.7, location=(0.2, -0.1, 0.9), segments=9, smooth=True):
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=segments, ring_count=5, radius=radius, location=location
    )
    if smooth:
        bpy.ops.object.shade_smooth()
    item = bpy.context.object
    item.name = item.data.name = name
    return item


def material(item, kind, **inputs):
    new = bpy.data.materials.new(kind)
    if new.node_tree is None:
        new.use_nodes = True
    tree = new.node_tree
    tree.nodes.clear()
    shader, out = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new("ShaderNodeOutputMaterial")
    for name, value in inputs.items():
        shader.inputs[name].default_value = value
    tree.links.new(shader.outputs[0], out.inputs["Surface"])
    item.data.materials.append(new)
    return new


def sky(colour=(0.4, 0.5, 0.7)):
    world = bpy.data.worlds.new("sky")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (*colour, 1)
    bpy.context.scene.world = world
    return np.float32(colour)


def lamp(name, location, energy=60.0, colour=(1, 0.8, 0.6)):
    data = bpy.data.lights.new(name, "POINT")
    data.energy, data.color, data.shadow_soft_size = energy, colour, 0.2
    item = bpy.data.objects.new(name, data)
    item.location = location
    bpy.context.scene.collection.objects.link(item)
    return item


def state_of_file():
    """Everything of the file that a capture could have changed."""
    return {
        "blocks": sorted(
            (kind, block.name) for kind in ("scenes", "objects", "cameras", "materials", "worlds",
            "meshes", "images", "texts", "lights") for block in getattr(bpy.data, kind)
        ),
        "groups": [(o.name, o.lightgroup, o.visible_camera, o.hide_render)
                   for o in bpy.data.objects],
        "world": [(w.name, w.lightgroup) for w in bpy.data.worlds],
        "layers": [(s.name, s.camera and s.camera.name, s.render.engine, s.render.resolution_x,
                    s.cycles.samples, [g.name for v in s.view_layers for g in v.lightgroups])
                   for s in bpy.data.scenes],
    }  # fmt: skip


def shot(objects, angles=ANGLES, samples=16, lamps=False, seed=3):
    """Points and what the camera gives of them."""
    uid = bpy.context.scene.session_uid
    meshes = run(light_field_meshes_steps(uid, objects, lamps=lamps))
    built = Scene.from_meshes(meshes, 0)
    camera, _ = light_field_camera(uid, built, lamps)
    points = points_of(built)
    return points, camera, camera.shoot(points, angles, samples, seed)


@needs_camera
def test_an_emitter_has_its_radiance_in_all_directions():
    material(ball(), "Emission", Color=(0.7, 0.2, 0.1, 1), Strength=3.0)
    points, _, (radiance, missed, _) = shot(["ball"], samples=1)
    assert radiance.shape == (1, len(points), *ANGLES, 3) and len(points) == 9 * 4 + 2
    assert np.allclose(radiance, [2.1, 0.6, 0.3], rtol=1e-5)
    assert missed.max() == 0


@needs_camera
def test_a_diffuse_ball_alone_under_an_even_sky_reflects_its_albedo():
    # Convex, and shaded as it is: every point sees half of the sky.
    item = ball(smooth=False)
    material(item, "BsdfDiffuse", Color=(0.6, 0.3, 0.2, 1))
    colour = sky()
    bpy.context.scene.cycles.max_bounces = 1
    _, _, (radiance, missed, _) = shot(["ball"], samples=64)
    mean = radiance[0].mean(axis=(0, 1, 2))
    assert np.allclose(mean, colour * [0.6, 0.3, 0.2], rtol=0.01)
    assert missed.mean() < 0.01


@needs_camera
def test_it_agrees_with_cycles_own_camera_on_the_same_rays():
    apart, seeds, n_rays = compare(scene_with(), n_points=3, samples=16)
    assert n_rays > 30 and seeds > 1e-3
    # Medians of few rays: four sigma.
    assert apart < 2 * seeds


@needs_camera
def test_lamps_sum_to_the_whole_and_are_those_of_the_scene():
    item = ball()
    material(item, "BsdfDiffuse", Color=(0.6, 0.3, 0.2, 1))
    glow = ball("glow", 0.2, (0.2, 1.4, 1.5))
    material(glow, "Emission", Strength=5.0)
    sky()
    lamp("left", (-2, 0, 2))
    lamp("right", (2, 0, 2)).lightgroup = "own"
    before = state_of_file()
    points, camera, (radiance, _, apart) = shot(["ball"], lamps=True)
    assert camera.lights == ("left", "right", "glow", "world") and apart < 1e-5
    assert state_of_file() == before
    whole = shot(["ball"])[2][0]
    assert np.allclose(radiance.sum(axis=0), whole[0], atol=1e-5 * whole.max())
    # Each lamp lights its own side.
    left = points.frames[:, 2, 0] < -0.9
    right = points.frames[:, 2, 0] > 0.9
    assert radiance[0, left].mean() > 3 * radiance[0, right].mean()
    assert radiance[1, right].mean() > 3 * radiance[1, left].mean()
    assert radiance[3].min() > 0


@needs_camera
def test_dark_lamps_are_said_and_a_scene_without_light_is_refused(tmp_path):
    material(ball(), "BsdfDiffuse")
    lamp("off", (0, 0, 3), energy=0.0)
    with pytest.raises(PRTError, match="--lamps: nothing in it gives light"):
        shot(["ball"], lamps=True)
    lamp("world", (0, 0, 3))
    sky()
    report = light_field(None, tmp_path / "a.slf", lamps=True, angles=ANGLES, samples=2, hidden=0)
    assert report["lights"] == ["world", "world.001"]
    assert "lamp 'off': has no power" in report["messages"][0]


@needs_camera
def test_a_sheet_is_captured_from_both_sides(tmp_path):
    bpy.ops.mesh.primitive_plane_add(size=1)
    item = bpy.context.object
    item.name = "sheet"
    tree = material(item, "Emission", Color=(0, 1, 0, 1)).node_tree
    side, mix = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeMixShader")
    other = tree.nodes.new("ShaderNodeEmission")
    other.inputs["Color"].default_value = (1, 0, 0, 1)
    tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    tree.links.new(tree.nodes["Emission"].outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    points, _, (radiance, missed, _) = shot(["sheet"], samples=1)
    up = points.frames[:, 2, 2] > 0
    assert up.sum() == 4 and len(points) == 8 and missed.max() == 0
    assert np.allclose(radiance[0, up], [0, 1, 0]) and np.allclose(radiance[0, ~up], [1, 0, 0])


@needs_camera
def test_a_grid_has_a_point_at_each_texel(tmp_path):
    bpy.ops.mesh.primitive_plane_add(size=2)
    bpy.context.object.name = "sheet"
    tree = material(bpy.context.object, "Emission").node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["UV"], tree.nodes["Emission"].inputs["Color"])
    ball()
    keywords = {"angles": ANGLES, "samples": 1, "objects": ["sheet"], "grid": 7}
    light_field(None, tmp_path / "a.slf", **keywords)
    field = load_light_field(tmp_path / "a.slf")
    assert len(field) == 49
    (_, tables) = next(field.tables(field.weights()))
    image = field.scene.image
    u, v = np.meshgrid((np.arange(7) + 0.5) / 7, 1 - (np.arange(7) + 0.5) / 7)
    rows = np.searchsorted(field.point, image.point)
    assert np.allclose(tables[rows][:, :, :, 0], u.ravel()[:, None, None], atol=1e-3)
    assert np.allclose(tables[rows][:, :, :, 1], v.ravel()[:, None, None], atol=1e-3)
    with pytest.raises(PRTError, match="grid: is of one object; name one of"):
        light_field(None, tmp_path / "b.slf", **{**keywords, "objects": None})


@needs_camera
def test_the_file_is_as_it_was_even_after_an_error(tmp_path, monkeypatch):
    material(ball(), "BsdfDiffuse")
    bpy.data.objects["ball"].visible_camera = False
    sky(), lamp("lamp", (0, 0, 3))
    before = state_of_file()
    keywords = {"angles": ANGLES, "samples": 2, "lamps": True}
    report = light_field(None, tmp_path / "a.slf", **keywords)
    assert state_of_file() == before and report["apart"] < 1e-5
    field = load_light_field(tmp_path / "a.slf")
    # Rays of the camera meet it all the same.
    assert field.radiance[...].mean() > 0.01 and report["missed"] < 0.05
    with monkeypatch.context() as broken:
        broken.setattr("prt_core.blender.quiet_render.read_channels", lambda path: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            light_field(None, tmp_path / "b.slf", **keywords)
    assert state_of_file() == before and not (tmp_path / "b.slf").exists()


@needs_camera
def test_what_is_black_or_moved_or_missing_is_said(tmp_path):
    item = ball()
    sky()
    new = material(item, "BsdfDiffuse")
    new.node_tree.links.clear()
    keywords = {"angles": ANGLES, "samples": 1}
    report = light_field(None, tmp_path / "a.slf", **keywords)
    assert any("ball: its field is black" in line for line in report["messages"])
    with pytest.raises(PRTError, match="no geometry that renders is called 'nobody'"):
        light_field(None, tmp_path / "b.slf", objects=["nobody"], **keywords)
    bpy.context.scene.collection.objects.link(
        bpy.data.objects.new("bare", bpy.data.meshes.new("bare"))
    )
    with pytest.raises(PRTError, match="no geometry that renders is called 'bare'"):
        light_field(None, tmp_path / "b.slf", objects=["bare"], **keywords)


@needs_camera
def test_a_command_in_blender_bakes_and_tells(tmp_path, capsys):
    from prt_core.cli import main

    material(ball(), "Emission")
    path = str(tmp_path / "a.slf")
    flags = ["--angles", "5x3", "--samples", "1", "--hidden", "0", "--quiet"]
    assert main(["lightfield", "bake", "-o", path, *flags], in_blender=True) == 0
    assert main(["lightfield", "info", path]) == 0
    lines = capsys.readouterr().out
    assert "38 points, 5 x 3 directions, 1 light (all)" in lines and "samples 1" in lines
    assert main(["lightfield", "bake", "-o", path, "--angles", "1x1"], in_blender=True) == 2
    assert main(["info", path]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and "got 1 x 1" in lines[0] and "prt lightfield" in lines[1]


@needs_camera
def test_a_kill_while_cycles_renders_goes_on_bit_by_bit(tmp_path):
    material(ball(segments=17), "BsdfGlossy", Roughness=0.3)
    sky(), lamp("lamp", (0, 0, 3))
    blend = tmp_path / "a.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    code = (
        "import os, signal, sys\n"
        "import prt_core.blender.light_field_camera as camera\n"
        "from prt_core.api import light_field\n"
        "sys.modules['prt_core.bake.light_field']._PATHS = 15 * 4 * 20\n"
        "shoot, shots = camera.LightFieldCamera.shoot, [int(sys.argv[3])]\n"
        "def counted(self, *what):\n"
        "    shots[0] -= 1\n"
        "    if not shots[0]:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return shoot(self, *what)\n"
        "camera.LightFieldCamera.shoot = counted\n"
        "light_field(sys.argv[1], sys.argv[2], angles=(5, 3), samples=4, hidden=0)\n"
        # Blender 4.5's module may wait for itself for ever when Python ends.
        "os._exit(0)\n"
    )

    def bake(name, kill_at=0):
        command = [sys.executable, "-c", code, blend, tmp_path / name, str(kill_at)]
        return subprocess.run(command, cwd=ROOT, capture_output=True).returncode

    assert bake("whole.slf") == 0
    assert bake("a.slf", kill_at=4) != 0
    with pytest.raises(PRTError, match="not finished"):
        load_light_field(tmp_path / "a.slf")
    assert bake("a.slf") == 0
    one, two = (load_light_field(tmp_path / name) for name in ("whole.slf", "a.slf"))
    assert one.radiance.chunks[1] == 20 and len(one) > 60
    assert one.radiance[...].tobytes() == two.radiance[...].tobytes()


@needs_camera
@pytest.mark.parametrize("pattern", ["TABULATED_SOBOL", "AUTOMATIC"])
def test_short_renders_give_the_bits_of_long_ones_and_leave_nothing_between(
    tmp_path, monkeypatch, pattern
):
    material(ball(segments=17), "BsdfGlossy", Roughness=0.3)
    sky(), lamp("lamp", (0, 0, 3))
    bpy.context.scene.cycles.sampling_pattern = pattern
    capture = sys.modules["prt_core.bake.light_field"]
    monkeypatch.setattr(capture, "_PATHS", 15 * 4 * 40)
    settings = LightFieldSettings(ANGLES, 4)
    more = {"hidden": 0, "lamps": True, "objects": ["ball"]}
    run(light_field_steps(None, tmp_path / "a.slf", settings, **more))
    monkeypatch.setattr("prt_core.blender.light_field_camera._FIRST_PATHS", 15 * 4 * 10)
    monkeypatch.setattr("prt_core.runtime.progress.DearPace.worked", lambda self: None)
    before, done = state_of_file(), []
    stopped = light_field_steps(None, tmp_path / "b.slf", settings, **more, pace=0.01)
    for step in stopped:
        if step.stage == "light field" and step.done > 50:
            break  # in the midst of the second block
    stopped.close()
    assert state_of_file() == before
    for step in light_field_steps(None, tmp_path / "b.slf", settings, **more, pace=0.01):
        assert state_of_file() == before
        if step.stage == "light field":
            done.append(step.done / step.total)
    one, two = (load_light_field(tmp_path / f"{name}.slf") for name in "ab")
    assert one.lights == two.lights == ("lamp", "world") and one.radiance.chunks[1] == 40
    assert one.radiance[...].tobytes() == two.radiance[...].tobytes()
    assert one.radiance[...].max() > 0
    # Several renders of a block; the first of two was there.
    assert done == sorted(done) and len(set(done)) > 4 and done[-1] == 1


@pytest.mark.skipif(NEW, reason="of Blender before 4.5")
def test_an_older_blender_says_what_to_do(tmp_path):
    material(ball(), "Emission")
    with pytest.raises(PRTError, match=r"needs Blender 4.5 or later .* 'prt lightfield bake NAME"):
        light_field(None, tmp_path / "a.slf", angles=ANGLES)


@needs_camera
def test_denoised_light_is_nearer_the_truth_and_lamps_stay_apart():
    material(ball(segments=16), "BsdfDiffuse", Color=(0.6, 0.5, 0.4, 1))
    lamp("left", (-2, 0, 2)).data.shadow_soft_size = 1.5
    lamp("right", (2, 0, 2), colour=(0.2, 0.4, 1)).data.shadow_soft_size = 1.5
    bpy.context.scene.cycles.max_bounces = 0
    points, camera, (noisy, _, _) = shot(["ball"], (8, 7), samples=2, lamps=True)
    truth = camera.shoot(points, (8, 7), 512, 5)[0]
    before, cycles = state_of_file(), bpy.context.scene.cycles
    clean = camera.denoise(noisy, points, 2)
    assert state_of_file() == before
    # However the user's renders are denoised.
    cycles.denoising_prefilter, cycles.denoising_input_passes = "FAST", "RGB"
    np.testing.assert_array_equal(camera.denoise(noisy, points, 2), clean)
    # And whether the lights are denoised together or one after the other.
    alone = [camera.denoise(each[None], points, 2)[0] for each in noisy]
    np.testing.assert_array_equal(np.stack(alone), clean)
    assert clean.shape == noisy.shape and (clean >= 0).all()
    for before, after, right in zip(noisy, clean, truth, strict=True):
        assert np.linalg.norm(after - right) < 0.7 * np.linalg.norm(before - right)
        assert after.sum() == pytest.approx(before.sum(), rel=0.05)


def test_files_of_layers_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(4)
    names = ("a.Combined.R", "a.Combined.G", "a name that is longer than thirty-one letters.R")
    channels = {name: rng.normal(size=(5, 7)).astype(np.float32) for name in names}
    write_channels(tmp_path / "a.exr", channels, {"cycles.a.samples": "3"})
    back = read_channels(tmp_path / "a.exr")
    assert set(back) == set(names)
    assert all((back[name] == channels[name]).all() for name in names)


@needs_camera
def test_cycles_and_the_products_own_transport_agree_on_a_diffuse_scene(tmp_path):
    material(ball(segments=24), "BsdfDiffuse", Color=(0.7, 0.5, 0.3, 1))
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=9, y_subdivisions=9, size=4)
    material(bpy.context.object, "BsdfDiffuse", Color=(0.4, 0.6, 0.5, 1))
    sky((0.3, 0.4, 0.6))
    lamp("lamp", (1.5, -1, 3), energy=300)
    bake(None, tmp_path / "a.prt", resolution=16, tolerance=0.02, caster="blender")
    keywords = {"angles": (4, 3), "lamps": True}
    light_field(tmp_path / "a.prt", tmp_path / "own.slf", **keywords)
    light_field(None, tmp_path / "cycles.slf", samples=64, hidden=0, **keywords)
    own, cycles = (load_light_field(tmp_path / name) for name in ("own.slf", "cycles.slf"))
    assert set(own.lights) == set(cycles.lights) == {"lamp", "world"}

    def key(field):
        points = field.scene.points
        positions = field.scene.to_world(points.positions[field.point])
        return np.concatenate([positions, points.normals[field.point]], axis=1)

    distance, same = cKDTree(key(own)).query(key(cycles))
    # The backs of the sheet have points in a bake only where they are seen.
    good = (distance < 1e-3) & (cycles.frames[:, 2, 2] > 0)
    assert good.sum() > 100
    for light in own.lights:
        ours = own.radiance[own.lights.index(light)][same[good]]
        theirs = cycles.radiance[cycles.lights.index(light)][good]
        assert np.ptp(ours, axis=(1, 2)).max() == 0
        mean = theirs.mean(axis=(1, 2))
        error = np.linalg.norm(ours[:, 0, 0] - mean) / np.linalg.norm(mean)
        assert error < 0.05, (light, error)


@needs_camera
def test_each_cell_looks_from_its_direction_of_the_frame():
    tree = material(ball(), "Emission").node_tree
    place = tree.nodes.new("ShaderNodeNewGeometry")
    half = tree.nodes.new("ShaderNodeVectorMath")
    half.operation = "MULTIPLY_ADD"
    half.inputs[1].default_value = half.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(place.outputs["Incoming"], half.inputs[0])
    tree.links.new(half.outputs[0], tree.nodes["Emission"].inputs["Color"])
    angles = (13, 9)
    points, camera, _ = shot(["ball"], samples=1)
    # Facets that are not as they are shaded.
    tilted = points.above @ np.array([[1, 0, 0.3], [0, 1, 0], [0, 0, 1.0]])
    points = replace(points, above=tilted)
    radiance, _, _ = camera.shoot(points, angles, 1, 3, spread=0.0)
    local = HRDFLayout(*angles).directions.reshape(*angles, 3)
    ways = np.einsum("ijk,nkx->nijx", local, points.frames)
    height = np.linalg.norm(points.above, axis=1)
    above = points.above / height[:, None]
    slope = np.einsum("nijx,nx->nij", ways, above)
    straight = slope > GRAZING
    assert 0.8 < straight.mean() < 1
    seen = 2 * radiance[0] - 1
    met = np.linalg.norm(seen, axis=-1) > 0.99
    assert met.mean() > 0.95
    assert np.allclose(seen[straight & met], ways[straight & met], atol=1e-5)
    # Below the facets it looks from the horizon, as far around.
    bent = seen[~straight & met]
    owner = np.nonzero(~straight & met)[0]
    assert len(bent) > 20 and np.allclose((bent * above[owner]).sum(axis=1), GRAZING, atol=1e-4)


@needs_camera
def test_a_build_without_the_language_of_shaders_says_so(tmp_path, monkeypatch):
    material(ball(), "Emission")
    monkeypatch.setattr("_cycles.with_osl", False)
    with pytest.raises(PRTError, match=r"no OSL; take one from blender.org, or bake with") as error:
        light_field(None, tmp_path / "a.slf", angles=ANGLES)
    assert "\n" not in str(error.value) and not (tmp_path / "a.slf").exists()


@needs_camera
def test_glass_has_points_outside_alone_and_nothing_is_said_of_bakes(tmp_path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    glass = bpy.data.materials.new("glass")
    glass.use_nodes = True
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    bpy.context.object.data.materials.append(glass)
    bpy.ops.object.light_add(type="POINT", location=(2, 1, 3))
    reports = [
        light_field(
            None, tmp_path / f"{lamps}.slf", lamps=lamps, angles=(3, 2), samples=1, hidden=0
        )
        for lamps in (False, True)
    ]
    assert reports[0]["points"] == reports[1]["points"] == 24
    assert not [line for report in reports for line in report["messages"] if "sun" in line]
