"""What the colours look like: by the view transform, and as light on the user's own materials."""

import bpy
import numpy as np
import pytest

from blender_addon import advice, live, plan, preview
from prt_core import run
from prt_core.blender.own_materials import relit_material
from prt_core.blender.passes.records import surface_of
from prt_core.blender.raw_mesh import RawMesh
from prt_core.blender.view_transform import transform_key, view_transform_of
from tests.blender.conftest import colours_on

pytestmark = pytest.mark.usefixtures("addon")
RNG = np.random.default_rng(8)


def shown_by_blender(scene, colours, folder):
    """(n, 3) of what Blender sends to the display of linear colours, by its own picture."""
    image = bpy.data.images.new("colours", len(colours), 1, float_buffer=True)
    pixels = np.ones((len(colours), 4), np.float32)
    pixels[:, :3] = colours
    image.pixels.foreach_set(pixels.ravel())
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_depth = "16"
    image.save_render(str(folder / "shown.png"), scene=scene)
    read = bpy.data.images.load(str(folder / "shown.png"))
    read.colorspace_settings.is_data = True
    read.pixels.foreach_get(pixels.ravel())
    return pixels[:, :3]


@pytest.mark.parametrize("name", ["AgX", "Standard", "Filmic"])
def test_the_view_transform_is_blenders(name, tmp_path):
    scene = bpy.context.scene
    scene.view_settings.view_transform, scene.view_settings.exposure = name, 0.7
    before = len(bpy.data.scenes), len(bpy.data.images)
    transform, key = view_transform_of(scene), transform_key(scene)
    assert (len(bpy.data.scenes), len(bpy.data.images)) == before
    colours = (2 ** RNG.uniform(-7, 4, (500, 1)) * RNG.uniform(0.3, 1, (500, 3))).astype(np.float32)
    wanted = shown_by_blender(scene, colours, tmp_path)
    got = transform.display(colours)
    assert np.abs(got - wanted).max() < 0.02 and np.abs(got - wanted).mean() < 0.001
    # Solid mode encodes linear colours as sRGB, and nothing else.
    solid = transform.for_solid(colours)
    encoded = np.where(solid <= 0.0031308, 12.92 * solid, 1.055 * solid ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(encoded, got, atol=1e-5)
    assert view_transform_of(scene) is transform
    scene.view_settings.exposure = 0
    assert key != transform_key(scene) and view_transform_of(scene) is not transform


def test_solid_mode_shows_what_renders_show(baked_floor):
    mesh = bpy.data.objects["ball"].data
    # None of it is of the mesh that is baked.
    bpy.ops.prt.relight()
    assert not preview.held(baked_floor).warned
    assert mesh.color_attributes[mesh.color_attributes.render_color_index].name == "PRT"
    bpy.ops.prt.keep(attribute="Mine")  # what is kept leaves what is seen as it is
    assert mesh.color_attributes.active_color.name == "PRT Solid"
    assert mesh.color_attributes[mesh.color_attributes.render_color_index].name == "Mine"
    bpy.ops.prt.relight()
    radiance, solid = colours_on("ball"), colours_on("ball", "PRT Solid")
    np.testing.assert_allclose(solid, view_transform_of(baked_floor).for_solid(radiance), atol=1e-6)
    baked_floor.view_settings.exposure = 2
    preview.see_again(baked_floor)
    assert colours_on("ball", "PRT Solid").mean() > solid.mean() + 0.01
    assert (colours_on("ball") == radiance).all()


def test_nothing_that_is_shown_is_of_the_mesh_that_is_read(floor_scene):
    mesh = bpy.data.objects["ball"].data
    before = surface_of(mesh, mesh, (), RawMesh.of(mesh, mesh)).digest
    floor_scene.prt.look = "MATERIALS"
    bpy.ops.prt.bake()
    assert {"PRT", "PRT Solid", "PRT Light"} <= set(mesh.color_attributes.keys())
    assert surface_of(mesh, mesh, (), RawMesh.of(mesh, mesh)).digest == before


def test_a_burnt_out_scene_is_said_and_fitted(baked_floor):
    held = preview.held(baked_floor)
    assert held.burnt == 0
    baked_floor.prt.exposure = 14
    bpy.ops.prt.relight()
    assert held.burnt > preview.MOST_BURNT
    assert bpy.ops.prt.fit_exposure() == {"FINISHED"}
    bpy.ops.prt.relight()
    assert held.burnt < 0.05
    shown = view_transform_of(baked_floor).display(held.radiance)
    assert 0.6 < np.quantile(shown.max(axis=1), 0.95) < 0.95


def evaluated_materials(item):
    """Names of the materials of the faces of an object as it renders."""
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = seen.to_mesh()
    slots = [slot.material for slot in seen.material_slots]
    names = {slots[face.material_index].name for face in mesh.polygons}
    seen.to_mesh_clear()
    return names


def test_light_on_own_materials_and_back(floor_scene):
    ball, scene = floor_scene.objects["ball"], floor_scene
    second = bpy.data.materials.new("Second")
    second.use_nodes = True
    ball.data.materials.append(second)
    ball.data.polygons[0].material_index = 1
    own = [slot.material for slot in ball.material_slots]
    scene.prt.look = "MATERIALS"
    bpy.ops.prt.bake()
    albedo = preview.held(scene).bake.transport.albedo
    received = preview.held(scene).received
    np.testing.assert_allclose(albedo * received, preview.held(scene).radiance, rtol=1e-4)
    light = preview.held(scene).bake.colours(received)["ball"]
    bpy.ops.prt.relight()
    assert not preview.held(scene).warned
    assert (colours_on("ball", "PRT Light") == light).all()
    assert [slot.material for slot in ball.material_slots] == own
    assert evaluated_materials(ball) == {f"{material.name} relit" for material in own}
    # A material that is changed is copied anew with the next colours.
    second.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.123
    assert preview.outdate_materials(scene)
    bpy.ops.prt.relight()
    copy = bpy.data.materials["Second relit"]
    assert copy.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value == (
        pytest.approx(0.123)
    )
    bpy.ops.prt.clear()
    assert [slot.material for slot in ball.material_slots] == own and not ball.modifiers
    left = [b.name for kind in (bpy.data.materials, bpy.data.node_groups) for b in kind]
    assert not [name for name in left if "relit" in name or "PRT" in name]
    assert "PRT Light" not in ball.data.color_attributes


def test_what_is_diffuse_becomes_emission_and_the_rest_stays():
    material = bpy.data.materials.new("Own")
    material.use_nodes = True
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    group.nodes.new("ShaderNodeBsdfDiffuse")
    tree.nodes.new("ShaderNodeGroup").node_tree = group
    checks = tree.nodes.new("ShaderNodeTexChecker")
    tree.links.new(checks.outputs[0], shader.inputs["Base Color"])
    shader.inputs["Metallic"].default_value = 0.25
    copy = relit_material(material, "Light")
    assert relit_material(material, "Light") == copy
    changed = copy.node_tree.nodes["Principled BSDF"]
    assert changed.inputs["Emission Color"].is_linked
    assert changed.inputs["Emission Strength"].default_value == 1
    # What metal reflects keeps a quarter of the colour; the rest shines by the light.
    scaled = changed.inputs["Base Color"].links[0].from_node
    assert scaled.inputs["Scale"].default_value == pytest.approx(0.25)
    shown = changed.inputs["Emission Color"].links[0].from_node
    assert shown.inputs["Scale"].default_value == pytest.approx(0.75)
    # The user's own are as they were.
    assert shader.inputs["Base Color"].links[0].from_node == checks
    assert [node.bl_idname for node in group.nodes] == ["ShaderNodeBsdfDiffuse"]
    inner = next(n.node_tree for n in copy.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    kinds = {node.bl_idname for node in inner.nodes}
    assert "ShaderNodeEmission" in kinds and "ShaderNodeBsdfDiffuse" not in kinds


def test_presets_set_quality_and_custom_stays(floor_scene):
    chosen = floor_scene.prt
    chosen.quality = "FINAL"
    assert (chosen.resolution, round(chosen.tolerance, 6), chosen.all_bounces) == ("32", 0.01, True)
    chosen.quality = "DRAFT"
    assert (chosen.resolution, chosen.bounces, chosen.quality) == ("16", 2, "DRAFT")
    chosen.resolution = "64"
    assert chosen.quality == "CUSTOM"
    chosen.quality = "FINAL"
    chosen.quality = "CUSTOM"
    assert chosen.quality == "CUSTOM" and chosen.resolution == "32"


def test_another_quality_costs_no_new_reading(floor_scene, monkeypatch):
    bpy.ops.prt.refresh()
    before, _ = plan.of(floor_scene)
    floor_scene.prt.resolution = "32"
    assert not plan.of(floor_scene)[1]
    with monkeypatch.context() as alone:
        alone.setattr(plan, "read_steps", None)
        run(plan.steps(floor_scene, again=False))
    after, holds = plan.of(floor_scene)
    assert holds and after.cost.rays > before.cost.rays
    assert (after.messages, after.digests) == (before.messages, before.digests)
    # What is of the scene is read anew, and so is gloss.
    live.geometry_changed(floor_scene)
    assert reads_again(floor_scene, monkeypatch)
    floor_scene.prt.gloss = True
    assert reads_again(floor_scene, monkeypatch)
    assert not reads_again(floor_scene, monkeypatch)


def reads_again(scene, monkeypatch):
    """Whether the next plan reads the scene."""
    read, reads = plan.read_steps, []
    with monkeypatch.context() as counted:
        counted.setattr(plan, "read_steps", lambda *a, **k: reads.append(1) or read(*a, **k))
        run(plan.steps(scene, again=False))
    return bool(reads)


def test_missing_gloss_is_said_before_the_bake_with_what_helps(floor_scene):
    metal = bpy.data.materials.new("Metal")
    metal.use_nodes = True
    bpy.data.objects["ball"].material_slots[0].material = metal
    metal.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 1
    live.geometry_changed(floor_scene)
    bpy.ops.prt.refresh()
    helps = {text: helps for text, helps, _ in advice.warnings(floor_scene)}
    assert [h for text, h in helps.items() if "metal" in text] == ["prt.use_gloss"]
    bpy.ops.prt.use_gloss()
    bpy.ops.prt.refresh()
    assert not [h for _, h, _ in advice.warnings(floor_scene) if h == "prt.use_gloss"]
