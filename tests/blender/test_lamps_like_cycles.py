"""Lamps near a small floor: what Cycles bakes against the shadow rays of relighting."""

import bpy
import mathutils
import numpy as np
import pytest

import build
from prt_core import make_caster
from prt_core.blender import read_lamps
from prt_core.blender.depsgraph import read_scene
from prt_core.blender.glossy_rays import glossy_remarks
from prt_core.transport import lamp_light
from tests.benchmarks import cycles_truth
from tests.blender.conftest import cube, instance_of

LEANING = (0.4, -0.3, 0.7)
LAMPS = {
    "a point with a radius": ("POINT", {"shadow_soft_size": 0.5}, {}),
    "a ball": ("POINT", {"shadow_soft_size": 0.5, "use_soft_falloff": False}, {}),
    "a scaled point": ("POINT", {"shadow_soft_size": 0.5}, {"scale": (2, 2, 2)}),
    "inside a ball": (
        "POINT",
        {"shadow_soft_size": 1.9, "use_soft_falloff": False},
        {"location": (0.1, 0.1, 0.6)},
    ),
    "a spot": (
        "SPOT",
        {"shadow_soft_size": 0.4, "spot_size": 1.6, "spot_blend": 0.6},
        {"rotation": (0.2, -0.1, 0.7)},
    ),
    "a stretched spot": (
        "SPOT",
        {"shadow_soft_size": 0.1, "spot_size": 1.4, "spot_blend": 0.8},
        {"rotation": (0.2, -0.1, 0.7), "scale": (1, 2, 0.7)},
    ),
    "a spot that is a ball": (
        "SPOT",
        {"shadow_soft_size": 0.4, "spot_size": 2, "spot_blend": 0.6, "use_soft_falloff": False},
        {},
    ),
    "a rectangle": (
        "AREA",
        {"shape": "RECTANGLE", "size": 1, "size_y": 2},
        {"rotation": LEANING, "scale": (0.6, 0.5, 1)},
    ),
    "an ellipse": ("AREA", {"shape": "ELLIPSE", "size": 1, "size_y": 2}, {"rotation": LEANING}),
    "a spread": (
        "AREA",
        {"shape": "RECTANGLE", "size": 1, "size_y": 2, "spread": 1.3},
        {"rotation": (0.2, -0.1, 0.7), "scale": (0.6, 0.5, 1)},
    ),
    "a narrow disc": (
        "AREA",
        {"shape": "DISK", "size": 1.1, "spread": 0.4},
        {"rotation": (0.1, -0.1, 0.7)},
    ),
    "one that takes light away": ("POINT", {"energy": -70}, {}),
    "a small sun": ("SUN", {"angle": 0.01, "energy": 3}, {"rotation": LEANING}),
    "a wide sun": ("SUN", {"angle": 1.4, "energy": 3}, {"rotation": LEANING}),
    "half a sky": ("SUN", {"angle": 3.1, "energy": 3}, {"rotation": LEANING}),
}


@pytest.mark.parametrize("name", LAMPS)
def test_cycles_agrees_on_how_bright_it_is(name):
    kind, settings, place = LAMPS[name]
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=2, size=2)
    floor = bpy.context.object
    floor.data.materials.append(build.diffuse("white", (1, 1, 1)))
    scale = place.get("scale", (1, 1, 1))
    place = {"location": (0.2, -0.1, 1.1), "rotation": (0, 0, 0), **place, "scale": (1, 1, 1)}
    bpy.ops.object.light_add(type=kind, **place)
    lamp = bpy.context.object
    lamp.scale = scale
    for key, value in {"energy": 100, **settings}.items():
        setattr(lamp.data, key, value)
    baked, messages = read_scene(), []
    lamps = read_lamps(messages=messages)
    assert not messages
    caster = make_caster("blender", baked.vertices, baked.triangles)
    received = lamp_light(baked, caster, lamps, 512)
    caster.close()
    (item,) = baked.objects
    ours = np.empty((item.n_vertices, 3))
    ours[item.corner_vertex] = received[item.corner_point]
    cycles_truth.set_cycles(scene, 256, 0)
    truth = cycles_truth.bake(scene, [floor.name], "direct")[0][floor.name]
    most = np.abs(truth).max()
    assert most > 0.1
    # Vertices at the floor's rim share their samples with those beside them.
    np.testing.assert_allclose(
        ours, truth, rtol=0.02, atol=(0.02 if "disc" in name else 0.004) * most
    )


def test_a_lamp_whose_axes_lean_is_said():
    bpy.ops.object.light_add(type="AREA", rotation=(0, 0.5, 0.4))
    lamp = bpy.context.object
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    lamp.parent = parent
    for scale, said in (((2, 2, 2), []), ((3, 1, 1), ["lamp 'Area': its shear ignored"])):
        parent.matrix_world = mathutils.Matrix.Diagonal((*scale, 1))
        bpy.context.view_layer.update()
        messages = []
        read_lamps(messages=messages)
        assert messages == said


def lamp_of(kind, **settings):
    data = bpy.data.lights.new("lamp", kind)
    item = bpy.data.objects.new("lamp", data)
    bpy.context.scene.collection.objects.link(item)
    for name, value in settings.items():
        setattr(data, name, value)
    return item


def test_power_by_radiance_grows_with_the_lamp():
    item = lamp_of("AREA", shape="RECTANGLE", size=2, size_y=3, energy=5)
    if not hasattr(item.data, "normalize"):
        pytest.skip("this Blender has no such switch")
    item.data.normalize = False
    item.scale = 2, 2, 2
    assert read_lamps()[0].power == pytest.approx([5 * 24] * 3)
    ball = lamp_of("POINT", shadow_soft_size=0.5, energy=5)
    ball.data.normalize = False
    assert read_lamps()[1].power == pytest.approx([5 * 4 * np.pi * 0.25] * 3)


def test_lamps_that_give_diffuse_surfaces_nothing_are_left_out():
    item, messages = lamp_of("AREA"), []
    assert len(read_lamps()) == 1
    for owner, name, value in (
        (item, "visible_diffuse", False),
        (item, "hide_render", True),
        (item.data.cycles, "is_portal", True),
    ):
        before = getattr(owner, name)
        setattr(owner, name, value)
        bpy.context.view_layer.update()
        assert not read_lamps(messages=messages), name
        setattr(owner, name, before)
    # What the eye hides renders; what is in a collection that does not render does not.
    item.location = 1, 2, 3
    item.hide_set(True)
    bpy.context.view_layer.update()
    assert read_lamps()[0].position == pytest.approx([1, 2, 3])
    home = bpy.data.collections.new("old lamps")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    home.hide_render = True
    bpy.context.view_layer.update()
    assert not read_lamps() and not messages


def test_what_glossy_rays_meet_otherwise_is_followed_or_said():
    item, scene = lamp_of("AREA"), bpy.context.scene
    before = glossy_remarks(scene)
    item.visible_glossy = False
    bpy.context.view_layer.update()
    assert not read_lamps()[0].highlights and glossy_remarks(scene) == before == []
    item.visible_glossy, item.visible_diffuse = True, False
    (line,) = glossy_remarks(scene)
    assert line == "lamp: only glossy rays meet it; its highlights are left out"
    item.visible_diffuse = True
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.visible_glossy = False
    (line,) = glossy_remarks(scene)
    assert line.startswith("Plane: glossy rays do not meet it") and "all the same" in line


@pytest.mark.parametrize("output, told", [("Is Glossy Ray", True), ("Is Camera Ray", False)])
def test_worlds_and_lamps_whose_nodes_tell_glossy_rays_apart_are_said(output, told):
    item, scene = lamp_of("POINT"), bpy.context.scene
    scene.world = bpy.data.worlds.new("sky")
    for data, kind in ((item.data, "EMISSION"), (scene.world, "BACKGROUND")):
        if data.node_tree is None:
            data.use_nodes = True
        tree = data.node_tree
        (shader,) = (node for node in tree.nodes if node.type == kind)
        path = tree.nodes.new("ShaderNodeLightPath")
        tree.links.new(path.outputs[output], shader.inputs["Strength"])
    names = [line.split(": its Light Path")[0] for line in glossy_remarks(scene)]
    assert names == (["lamp", "world 'sky'"] if told else [])


def test_what_a_lamp_has_that_is_not_followed_is_said():
    item, messages = lamp_of("POINT"), []
    item.data.cycles.max_bounces = 2
    read_lamps(messages=messages)
    assert messages == ["lamp 'lamp': its limit of 2 bounces ignored"]


def test_linking_names_objects_as_cycles_means_it():
    home = bpy.context.scene.collection
    one, two = cube("one", home), cube("two", home)
    inside = bpy.data.collections.new("inside")
    three = cube("three", inside)
    instance_of("many", inside, home)
    lamp, linked = lamp_of("SUN"), bpy.data.collections.new("linked")

    def names(state, *items):
        for item in list(linked.objects):
            linked.objects.unlink(item)
        for item in items:
            linked.objects.link(item)
        for entry in linked.collection_objects:
            entry.light_linking.link_state = state
        lamp.light_linking.receiver_collection = linked
        bpy.context.view_layer.update()
        receivers = read_lamps()[0].receivers
        return receivers and sorted(set(receivers) - {"lamp", "many"})

    assert names("INCLUDE") is None
    assert names("INCLUDE", one) == ["one"]
    assert names("EXCLUDE", one, two) == ["many/three"]
    assert names("INCLUDE", three) == ["many/three"]
    assert names("INCLUDE", bpy.data.objects["many"]) == ["many/three"]
    baked = read_scene()
    assert baked.objects_named(["two", "many/three"]).tolist() == [False, True, True]


IES = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 5 3 1 2 0 0 0
1 1 100
0 22.5 45 67.5 90
0 45 90
1000 900 500 200 0
1000 700 300 100 0
1000 500 200 50 0
"""


def with_ies(tree, emission):
    node, text = tree.nodes.new("ShaderNodeTexIES"), bpy.data.texts.new("ies")
    text.write(IES)
    node.ies, node.mode = text, "INTERNAL"
    tree.links.new(node.outputs[0], emission.inputs["Strength"])


def with_falloff(tree, emission):
    node = tree.nodes.new("ShaderNodeLightFalloff")
    node.inputs["Smooth"].default_value, node.inputs["Strength"].default_value = 2, 3
    tree.links.new(node.outputs["Linear"], emission.inputs["Strength"])


def with_texture(tree, emission):
    place, picture = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexGradient"))
    tree.links.new(place.outputs["UV"], picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], emission.inputs["Color"])


NODES = {
    "an IES profile": ("POINT", {"shadow_soft_size": 0.2}, with_ies),
    "an IES profile on an area": ("AREA", {"size": 0.6}, with_ies),
    "linear falloff of a spot": ("SPOT", {"spot_size": 2.2, "shadow_soft_size": 0}, with_falloff),
    "a texture": ("AREA", {"shape": "RECTANGLE", "size": 1.5, "size_y": 0.7}, with_texture),
}


@pytest.mark.parametrize("name", NODES)
def test_the_nodes_of_a_lamp_shine_as_in_cycles(name):
    kind, settings, add = NODES[name]
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=3, size=2)
    floor = bpy.context.object
    floor.data.materials.append(build.diffuse("white", (1, 1, 1)))
    lamp = lamp_of(kind, energy=50, **settings)
    lamp.location, lamp.rotation_euler = (0.2, -0.1, 1.2), (0.3, -0.2, 0.7)
    if lamp.data.node_tree is None:
        lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    tree.nodes.clear()
    emission, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputLight"))
    tree.links.new(emission.outputs[0], output.inputs[0])
    add(tree, emission)
    bpy.context.view_layer.update()
    baked, messages = read_scene(), []
    before = len(bpy.data.lights), len(bpy.data.scenes), len(bpy.data.meshes)
    lamps = read_lamps(messages=messages)
    assert not messages and before == (
        len(bpy.data.lights), len(bpy.data.scenes), len(bpy.data.meshes)
    )  # fmt: skip
    caster = baked.make_caster("blender")
    received = lamp_light(baked, caster, lamps, 512)
    caster.close()
    (item,) = baked.objects
    ours = np.empty((item.n_vertices, 3))
    ours[item.corner_vertex] = received[item.corner_point]
    cycles_truth.set_cycles(bpy.context.scene, 128, 0)
    truth = cycles_truth.bake(bpy.context.scene, [floor.name], "direct")[0][floor.name]
    error = np.linalg.norm(ours - truth) / np.linalg.norm(truth)
    assert error < 0.02, error
