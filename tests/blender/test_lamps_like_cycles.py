"""Lamps near a small floor: what Cycles bakes against the shadow rays of relighting."""

import bpy
import mathutils
import numpy as np
import pytest

import build
from prt_core import make_caster
from prt_core.blender import read_lamps
from prt_core.blender.depsgraph import read_scene
from prt_core.transport import lamp_light
from tests.benchmarks import cycles_truth

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
    assert truth.max() > 0.1
    # Vertices at the floor's rim share their samples with those beside them.
    np.testing.assert_allclose(ours, truth, rtol=0.02, atol=0.004 * truth.max())


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


def test_what_a_lamp_has_that_is_not_followed_is_said():
    bpy.ops.object.light_add(type="POINT")
    lamp, collection = bpy.context.object, bpy.data.collections.new("some")
    settings = (
        ("its ray visibility", lamp, "visible_diffuse", False, True),
        ("its light linking", lamp.light_linking, "receiver_collection", collection, None),
        ("its light linking", lamp.light_linking, "blocker_collection", collection, None),
        ("its negative power", lamp.data, "energy", -3, 3),
        ("its shadowless setting", lamp.data, "use_shadow", False, True),
    )
    for said, owner, name, value, before in settings:
        setattr(owner, name, value)
        bpy.context.view_layer.update()
        messages = []
        (found,) = read_lamps(messages=messages)
        assert messages == [f"lamp 'Point': {said} ignored"]
        assert found.power.min() >= 0
        setattr(owner, name, before)
    bpy.context.view_layer.update()
    messages = []
    read_lamps(messages=messages)
    assert not messages
