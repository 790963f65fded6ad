"""What is kept is shown over an object's own materials, which stay, and no bake sees it."""

import bpy
import numpy as np
import pytest

from blender_addon import preview
from prt_core.blender.covers import KEPT_COVER, covers_of
from prt_core.blender.depsgraph import read_meshes
from prt_core.scene import mesh_digests
from tests.blender.conftest import colours_on
from tests.blender.test_panel_looks import evaluated_materials

pytestmark = pytest.mark.usefixtures("addon")


def test_kept_colours_are_shown_in_renders_and_baked_from_what_lies_beneath(baked_floor):
    ball = baked_floor.objects["ball"]
    own = [slot.material for slot in ball.material_slots]
    before = mesh_digests(read_meshes(baked_floor))
    assert bpy.ops.prt.keep(attribute="Mine", show=True) == {"FINISHED"}
    # The preview lies above while it is there.
    assert [modifier.name for modifier in ball.modifiers][-2:] == [KEPT_COVER, "PRT preview"]
    assert evaluated_materials(ball) == {"PRT colours"}
    assert mesh_digests(read_meshes(baked_floor)) == before
    kept = colours_on("ball", "Mine")
    bpy.ops.prt.clear()
    assert evaluated_materials(ball) == {"Mine kept colours"}
    assert [slot.material for slot in ball.material_slots] == own
    assert mesh_digests(read_meshes(baked_floor)) == before
    # The same light, through the cover.
    bpy.ops.prt.bake(restart=True)
    np.testing.assert_allclose(colours_on("ball"), kept, atol=1e-6)
    bpy.ops.prt.keep(attribute="Other", show=True)
    bpy.ops.prt.clear()
    assert evaluated_materials(ball) == {"Other kept colours"} and len(covers_of(ball)) == 1
    assert not preview.present(baked_floor)
    ball.modifiers.remove(ball.modifiers[KEPT_COVER])
    assert evaluated_materials(ball) == {m.name for m in own}


def test_nothing_is_covered_unless_it_is_asked_for(baked_floor):
    bpy.ops.prt.keep(attribute="Mine")
    assert not any(KEPT_COVER in item.modifiers for item in baked_floor.objects)


def test_a_lightmap_is_shown_in_renders(floor_scene, tmp_path):
    settings = {"size": (32, 32), "filepath": str(tmp_path / "map"), "format": "PNG"}
    assert bpy.ops.prt.lightmap(**settings, show=True) == {"FINISHED"}
    assert evaluated_materials(floor_scene.objects["ball"]) == {"map lightmap"}
