"""Materials that emit light: what Cycles bakes beside them, and the same colours by every door."""

import bpy
import numpy as np
import pytest

import build
import prt_core
from blender_addon import preview
from prt_core.blender.depsgraph import read_meshes, read_scene
from prt_core.transport import emitted_light, surface_lights
from tests.benchmarks import cycles_truth
from tests.blender.conftest import colours_on, quick


def emitting(name, colour, strength, kind="ShaderNodeEmission"):
    """A material of one shader that emits."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(kind)
    plain = kind == "ShaderNodeEmission"
    shader.inputs["Color" if plain else "Emission Color"].default_value = (*colour, 1)
    shader.inputs["Strength" if plain else "Emission Strength"].default_value = strength
    if not plain:
        shader.inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
        shader.inputs["Specular IOR Level"].default_value = 0
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def add(kind, name, material, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    item = bpy.context.object
    item.name = name
    item.data.materials.append(material)
    return item


def room():
    """A floor under a panel, and beside a tube, of 4 cm."""
    add("grid", "floor", build.diffuse("white", (1, 1, 1)), x_subdivisions=5, y_subdivisions=3)
    panel = emitting("panel", (1, 0.5, 0.2), 2, "ShaderNodeBsdfPrincipled")
    add("plane", "lid", panel, size=0.8, location=(-0.5, 0.2, 1.1), rotation=(0.3, 0.4, 0))
    neon = emitting("neon", (0.1, 0.3, 1.0), 50)
    add("cylinder", "tube", neon, vertices=7, radius=0.02, depth=1.4, location=(0.6, 0, 0.25),
        rotation=(np.pi / 2, 0, 0.2))  # fmt: skip
    return bpy.context.scene


def test_cycles_agrees_on_how_bright_a_panel_and_a_tube_are():
    scene = room()
    baked = read_scene()
    assert set(baked.emitters) == {"panel", "neon"}
    caster = prt_core.make_caster("blender", baked.vertices, baked.triangles)
    lights = surface_lights(baked)
    for light in lights:
        light.look_around(caster)
    emitted = emitted_light(baked, caster, lights, slice(0, len(baked.points)), 0, 0.003)
    caster.close()
    received = emitted.received[:, :, :3].sum(axis=0)
    item = next(item for item in baked.objects if item.name == "floor")
    ours = np.empty((item.n_vertices, 3))
    ours[item.corner_vertex] = received[item.corner_point]
    cycles_truth.set_cycles(scene, 2048, 0)
    truth = cycles_truth.bake(scene, ["floor"], "direct")[0]["floor"]
    assert np.linalg.norm(ours - truth) < 0.03 * np.linalg.norm(truth)


def test_materials_are_read_as_they_emit():
    scene = room()
    messages = []
    meshes = {mesh.name: mesh for mesh in read_meshes(scene, messages=messages)}
    assert meshes["tube"].material_names == ("neon",)
    tube, lid = meshes["tube"].materials, meshes["lid"].materials
    np.testing.assert_allclose(tube.emission[0], [5, 15, 50], rtol=1e-3)
    np.testing.assert_allclose(lid.emission[0], [2, 1, 0.4], rtol=1e-3)
    assert tube.albedo.max() == 0 and np.allclose(lid.albedo, 0.5)
    assert not meshes["floor"].materials.emission.any() and not messages


@pytest.mark.usefixtures("addon")
def test_every_door_gives_the_same_colours(tmp_path):
    scene = room()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    scene = quick(bpy.context.scene)
    assert bpy.ops.prt.bake() == {"FINISHED"}
    path = preview.path_of(scene)
    assert sorted(item.name for item in scene.prt.emitters) == ["neon", "panel"]
    assert preview.emitters(preview.held(scene)) == prt_core.load(path).emission.names

    def relit(**settings):
        for name, how in settings.items():
            for key, value in how.items():
                setattr(scene.prt.emitters[name], key, value)
        assert bpy.ops.prt.relight() == {"FINISHED"}
        return colours_on("floor")

    light = {"light": None, "lamps": []}
    as_it_is = prt_core.relight(path, **light, emission="all")
    np.testing.assert_array_equal(relit(), as_it_is["floor"])
    panel = relit(neon={"strength": 0.5, "recolour": True, "colour": (1, 0.5, 0)})
    changed = {"neon": ((1, 0.5, 0), 0.5)}
    np.testing.assert_array_equal(panel, prt_core.relight(path, **light, emission=changed)["floor"])
    from prt_core.cli import main

    out = tmp_path / "c.npz"
    words = ["neon=0.25", "panel=#ffffff:2"]
    assert main(["relight", path, "--emission", *words, "--output", str(out)]) == 0
    both = {"neon": {"strength": 0.25, "recolour": False},
            "panel": {"strength": 2, "recolour": True, "colour": (1, 1, 1)}}  # fmt: skip
    np.testing.assert_array_equal(relit(**both), np.load(out)["floor"])
    off = relit(neon={"strength": 0}, panel={"strength": 0})
    assert off.max() == 0
