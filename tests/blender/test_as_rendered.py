"""The scene is read as a render has it, whatever the window shows; one feature a test."""

import bpy
import numpy as np
import pytest
from conftest import cube, instance_of

from prt_core import PRTError
from prt_core.blender.casters import is_temporary
from prt_core.blender.compat import fcurve_of
from prt_core.blender.depsgraph import read_meshes, read_meshes_steps
from prt_core.blender.render_scene import as_rendered


@pytest.fixture
def scene():
    return bpy.context.scene


@pytest.fixture
def home(scene):
    """A collection of its own in the scene."""
    collection = bpy.data.collections.new("home")
    scene.collection.children.link(collection)
    return collection


def read(**options):
    """(name -> (vertices, triangles), messages) of what is baked."""
    messages = []
    meshes = read_meshes(messages=messages, **options)
    return {m.name: (len(m.vertices), len(m.triangle_corners)) for m in meshes}, messages


def by_name():
    return {mesh.name: mesh for mesh in read_meshes()}


def state(scene):
    """All plain settings of a scene, of its renders and of its view layers, to compare."""
    values = []
    for holder in (scene, scene.render, scene.render.image_settings, *scene.view_layers):
        for prop in holder.bl_rna.properties:
            if prop.type in {"INT", "FLOAT", "BOOLEAN", "STRING", "ENUM"}:
                if prop.identifier != "use_nodes":  # on its way out
                    value = getattr(holder, prop.identifier)
                    is_array = getattr(prop, "is_array", False)
                    values.append((prop.identifier, tuple(value) if is_array else value))
    return values, scene.camera, scene.world


def counts():
    kinds = "scenes objects cameras meshes collections images node_groups worlds".split()
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


def nodes(name, item, *kinds):
    """A geometry-nodes modifier on an object whose nodes of `kinds` follow one another."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    chain = [group.nodes.new(k) for k in ("NodeGroupInput", *kinds, "NodeGroupOutput")]
    for one, two in zip(chain, chain[1:], strict=False):
        group.links.new(one.outputs[0], two.inputs[0])
    item.modifiers.new(name, "NODES").node_group = group
    return chain[1:-1]


def material(name, *links, colour=(0.2, 0.5, 0.7, 1)):
    """A material of a Diffuse shader, or of other nodes: (kind, input of the output)."""
    built = bpy.data.materials.new(name)
    if built.node_tree is None:
        built.use_nodes = True
    tree = built.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    for kind, socket in links or [("ShaderNodeBsdfDiffuse", "Surface")]:
        node = tree.nodes.new(kind)
        if "Color" in node.inputs:
            node.inputs["Color"].default_value = colour
        tree.links.new(node.outputs[0], output.inputs[socket])
    return built


# Switches of visibility


@pytest.mark.parametrize("hide", ["eye", "monitor", "collection eye", "collection monitor"])
def test_what_is_hidden_in_the_viewport_alone_is_baked_into_its_own_mesh(scene, home, hide):
    cube("seen", scene.collection)
    item = cube("hidden", home)
    layer = bpy.context.view_layer.layer_collection.children["home"]
    if hide == "eye":
        item.hide_set(True)
    elif hide == "monitor":
        item.hide_viewport = True
    elif hide == "collection eye":
        layer.hide_viewport = True
    else:
        home.hide_viewport = True
    meshes = by_name()
    assert set(meshes) == {"seen", "hidden"} and meshes["hidden"].own_mesh


@pytest.mark.parametrize("hide", ["collection", "excluded", "parent collection"])
def test_what_no_render_shows_is_not_baked(scene, home, hide):
    cube("seen", scene.collection)
    inner = bpy.data.collections.new("inner")
    home.children.link(inner)
    cube("hidden", inner)
    layer = bpy.context.view_layer.layer_collection.children["home"].children["inner"]
    if hide == "collection":
        inner.hide_render = True
    elif hide == "excluded":
        layer.exclude = True
    else:
        home.hide_render = True
    assert set(by_name()) == {"seen"}


def test_holdout_and_indirect_only_collections_still_bounce_light(scene, home):
    cube("wall", home)
    layer = bpy.context.view_layer.layer_collection.children["home"]
    layer.holdout = True
    names, messages = read()
    assert set(names) == {"wall"}
    assert messages == ["wall: is a holdout; renders have a hole there, pictures of a bake show it"]
    assert by_name()["wall"].camera_rays
    layer.holdout, layer.indirect_only = False, True
    names, messages = read()
    assert set(names) == {"wall"} and not messages
    assert not by_name()["wall"].camera_rays


def test_a_shadow_catcher_is_said(scene, home):
    cube("ground", home).is_shadow_catcher = True
    names, messages = read()
    assert set(names) == {"ground"}
    assert messages == [
        "ground: is a shadow catcher; renders have its shadows alone, pictures of a bake show it"
    ]


def test_an_instance_of_a_holdout_is_one(scene, home):
    inner = bpy.data.collections.new("inner")
    cube("mask", inner).is_holdout = True
    for place in (0.0, 3.0):
        item = bpy.data.objects.new(f"of a mask at {place}", None)
        item.instance_type, item.instance_collection = "COLLECTION", inner
        item.location.x = place
        home.objects.link(item)
    said = [line.partition(":")[0] for line in read()[1] if "is a holdout" in line]
    assert sorted(said) == ["of a mask at 0.0", "of a mask at 3.0"]


def test_the_view_layer_that_renders_is_read_and_the_others_are_named(scene, home):
    cube("seen", scene.collection)
    cube("extra", home)
    bpy.context.view_layer.layer_collection.children["home"].exclude = True
    other = scene.view_layers.new("other")
    names, messages = read()
    assert set(names) == {"seen"}
    assert messages == ["view layer 'ViewLayer' is baked; 'other' render as well and are not"]
    bpy.context.view_layer.use = False
    assert read() == ({"extra": (8, 12), "seen": (8, 12)}, [])
    other.use = False
    names, messages = read()
    assert set(names) == {"seen"}
    assert "view layer 'ViewLayer': is off in renders, as all are" in messages[0]
    assert [layer.use for layer in scene.view_layers] == [False, False]


def test_instances_of_what_does_not_render_do_not(scene, home):
    inner, outer = (bpy.data.collections.new(name) for name in ("inner", "outer"))
    cube("seen", inner)
    cube("unseen", inner).hide_render = True
    instance_of("middle", inner, outer)
    instance_of("top", outer, scene.collection, location=(0, 0, 3))
    cube("ground", scene.collection)
    meshes = by_name()
    assert set(meshes) == {"ground", "top/seen"}
    np.testing.assert_allclose(meshes["top/seen"].vertices.mean(axis=0), [0, 0, 3], atol=1e-6)
    inner.hide_render = True
    assert set(by_name()) == {"ground"}


# Modifiers and settings of renders


def test_modifiers_are_those_of_renders(scene):
    item = cube("box", scene.collection)
    rows = item.modifiers.new("rows", "ARRAY")
    rows.count, rows.show_viewport = 5, False
    gone = item.modifiers.new("gone", "SUBSURF")
    gone.show_render = False
    assert read()[0] == {"box": (40, 60)}


def test_subdivision_is_that_of_renders(scene):
    modifier = cube("box", scene.collection).modifiers.new("smooth", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 2
    assert read()[0] == {"box": (98, 192)}
    scene.render.use_simplify = True
    scene.render.simplify_subdivision, scene.render.simplify_subdivision_render = 6, 1
    assert read()[0] == {"box": (26, 48)}


def test_multires_levels_are_those_of_renders(scene):
    item = cube("box", scene.collection)
    bpy.context.view_layer.objects.active = item
    modifier = item.modifiers.new("detail", "MULTIRES")
    for _ in range(2):
        bpy.ops.object.multires_subdivide(modifier="detail")
    modifier.levels, modifier.render_levels = 0, 2
    assert read()[0] == {"box": (98, 192)}


def test_shape_keys_count_and_the_colours_go_to_the_own_mesh(scene):
    item = cube("box", scene.collection)
    item.shape_key_add(name="Basis")
    raised = item.shape_key_add(name="up")
    for point in raised.data:
        point.co.z += 2
    raised.value = 0.5
    (mesh,) = read_meshes()
    assert mesh.own_mesh
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [0, 0, 1], atol=1e-6)


def test_metaballs_curves_and_text_have_the_resolution_of_renders(scene):
    bpy.ops.object.metaball_add()
    bpy.context.object.data.resolution = 0.5
    bpy.context.object.data.render_resolution = 0.25
    bpy.ops.curve.primitive_bezier_circle_add()
    curve = bpy.context.object.data
    curve.bevel_depth, curve.resolution_u, curve.render_resolution_u = 0.1, 2, 5
    bpy.ops.object.text_add()
    text = bpy.context.object.data
    text.extrude, text.resolution_u, text.render_resolution_u = 0.1, 3, 7
    rendered, _ = read()
    for data, name in ((curve, "BézierCircle"), (text, "Text")):
        data.render_resolution_u = data.resolution_u
        assert read()[0][name] < rendered[name]
    bpy.data.metaballs[0].render_resolution = 0.5
    assert read()[0]["Mball"] < rendered["Mball"]


def test_objects_on_particles_are_those_of_renders(scene):
    ground, leaf = cube("ground", scene.collection), cube("leaf", scene.collection)
    system = ground.modifiers.new("leaves", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.render_type, system.instance_object = "HAIR", "OBJECT", leaf
    system.count, system.display_percentage = 7, 0
    names, _ = read()
    assert sum(name.startswith("ground/leaf") for name in names) == 7 and "ground" in names
    ground.show_instancer_for_render = False
    assert "ground" not in read()[0]


def test_geometry_nodes_put_instances_of_what_is_hidden_in_renders(scene):
    source = cube("source", scene.collection)
    source.hide_render = True
    field = cube("field", scene.collection)
    (put,) = nodes("scatter", field, "GeometryNodeInstanceOnPoints")
    info = put.id_data.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = source, True
    put.id_data.links.new(info.outputs["Geometry"], put.inputs["Instance"])
    names, _ = read()
    assert "source" not in names and len(names) == 8


def test_a_view_layer_may_override_all_materials(scene):
    cube("box", scene.collection).data.materials.append(material("blue"))
    bpy.context.view_layer.material_override = material("red", colour=(0.9, 0.1, 0.3, 1))
    (mesh,) = read_meshes()
    assert mesh.material_names == ("red",)
    np.testing.assert_allclose(mesh.materials.albedo[0], [0.9, 0.1, 0.3], atol=2e-4)


def test_what_is_scaled_to_nothing_is_flat_and_black(scene):
    cube("slab", scene.collection).scale = 2, 3, 0
    messages = []
    (mesh,) = read_meshes(messages=messages)
    assert (mesh.vertices[:, 2] == 0).all() and not mesh.materials.albedo.any()
    assert len(mesh.solid_triangles()) == 4
    assert "slab: scaled to nothing in one direction" in messages[0]


def test_the_uv_map_is_that_of_renders(scene):
    mesh = cube("box", scene.collection).data
    for number, name in enumerate(("edited", "rendered")):
        layer = mesh.uv_layers.new(name=name)
        layer.data.foreach_set("uv", np.full(2 * len(mesh.loops), 0.25 + number / 2, np.float32))
    mesh.uv_layers["rendered"].active_render = True
    mesh.uv_layers.active = mesh.uv_layers["edited"]
    (read_mesh,) = read_meshes()
    assert (read_mesh.corner_uv == 0.75).all()


def test_a_rigid_body_is_where_its_simulation_has_it(scene):
    item = cube("stone", scene.collection, location=(0, 0, 5))
    bpy.context.view_layer.objects.active = item
    bpy.ops.rigidbody.world_add()
    bpy.ops.rigidbody.object_add(type="ACTIVE")
    for frame in range(1, 9):
        scene.frame_set(frame)
    height = item.matrix_world.translation.z
    before = state(scene), counts()
    (mesh,) = read_meshes()
    assert height < 4.9
    np.testing.assert_allclose(mesh.vertices[:, 2].mean(), height, atol=1e-4)
    assert before == (state(scene), counts())


# What is no mesh


def lawn(collection, count=50):
    """A cube with hair of 0.5 that stands on its faces."""
    item = cube("lawn", collection, size=1)
    item.data.materials.append(material("soil"))
    item.data.materials.append(material("grass", colour=(0.1, 0.6, 0.2, 1)))
    system = item.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count, system.hair_length, system.material = "HAIR", count, 0.5, 2
    system.root_radius, system.tip_radius, system.radius_scale = 4, 2, 0.01
    return item, system


def test_particle_hair_casts_shadows_in_its_materials_colour(scene):
    lawn(scene.collection)[1].use_close_tip = False
    messages = []
    meshes = {mesh.name: mesh for mesh in read_meshes(messages=messages)}
    hair = meshes["lawn/particle hair"]
    assert meshes["lawn"].receives and not hair.receives
    np.testing.assert_allclose(hair.materials.albedo[0], [0.1, 0.6, 0.2], rtol=1e-6)
    assert messages[0].startswith("lawn: its particle hair casts shadows and bounces light")
    assert 1.4 < np.abs(hair.vertices).max() < 1.6
    # As much shadow as cylinders: of mean radius 0.015, 50 of them 0.5 long; a quarter of their
    # surface is what they cover in the mean over all directions.
    a, b, c = np.moveaxis(hair.vertices[hair.corner_vertex[hair.triangle_corners]], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    np.testing.assert_allclose(area, 50 * 2 * np.pi * 0.015 * 0.5, rtol=0.05)


def test_hair_follows_the_switches_of_renders(scene):
    item, system = lawn(scene.collection)
    hairs = read()[0]["lawn/particle hair"]
    system.display_percentage, system.child_type = 10, "SIMPLE"
    system.child_percent, system.rendered_child_count = 1, 3
    children = read()[0]["lawn/particle hair"]
    assert children[1] > 2.5 * hairs[1]
    bpy.context.view_layer.use_strand = False
    assert set(read()[0]) == {"lawn"}
    bpy.context.view_layer.use_strand = True
    item.modifiers["hair"].show_render = False
    assert set(read()[0]) == {"lawn"}
    item.modifiers["hair"].show_render, item.show_instancer_for_render = True, False
    assert set(read()[0]) == {"lawn/particle hair"}


def test_of_too_many_strands_some_stand_for_all(scene, monkeypatch):
    from prt_core.blender import strands

    def projected(mesh):
        a, b, c = np.moveaxis(mesh.vertices[mesh.corner_vertex[mesh.triangle_corners]], 1, 0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

    lawn(scene.collection, count=60)[1].use_close_tip = False
    whole = by_name()["lawn/particle hair"]
    # Three vertices at each end of a third of them.
    monkeypatch.setattr(strands, "MOST_VERTICES", 60 * 2 * 3 // 3)
    messages = []
    cut = {m.name: m for m in read_meshes(messages=messages)}["lawn/particle hair"]
    assert len(cut.vertices) == 20 * 2 * 3 < len(whole.vertices)
    np.testing.assert_allclose(projected(cut), projected(whole), rtol=0.05)
    assert "one of each 3 and so much wider" in messages[0]


def test_curves_and_points_of_geometry_nodes_cast_shadows(scene):
    item = bpy.data.objects.new("wire", bpy.data.hair_curves.new("wire"))
    scene.collection.objects.link(item)
    line, radius = nodes(
        "wire", item, "GeometryNodeCurvePrimitiveLine", "GeometryNodeSetCurveRadius"
    )
    radius.inputs["Radius"].default_value = 0.05
    line.id_data.links.new(line.outputs[0], radius.inputs[0])
    names, messages = read()
    assert names == {"wire/hair": (15, 24)} and "its hair casts shadows" in messages[0]
    (mesh,) = read_meshes()
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [0, 0, 0.5], atol=1e-5)
    bpy.data.objects.remove(item)
    item = cube("item", scene.collection, size=1)
    (points,) = nodes("dots", item, "GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = 0.25
    messages = []
    (mesh,) = read_meshes(messages=messages)
    assert (len(mesh.vertices), len(mesh.triangle_corners)) == (8 * 6, 8 * 8)
    assert "its point cloud casts shadows" in messages[0]
    # A convex body covers a quarter of its surface in the mean: that of the ball that it is.
    a, b, c = np.moveaxis(mesh.vertices[mesh.corner_vertex[mesh.triangle_corners]], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    np.testing.assert_allclose(area / 4, 8 * np.pi * 0.25**2, rtol=1e-4)
    outward = np.cross(b - a, c - a) * ((a + b + c) / 3 - np.sign(a) * 1.0)
    assert (outward.sum(axis=1) > 0).all()


def test_a_volume_is_named_and_does_not_block_light(scene):
    cube("ground", scene.collection)
    fog = cube("fog", scene.collection)
    fog.data.materials.append(material("smoke", ("ShaderNodeVolumePrincipled", "Volume")))
    bpy.ops.object.volume_add()
    names, messages = read(receivers=["ground", "fog"])
    assert set(names) == {"ground"}
    assert sorted(messages) == ["Volume: volume is not baked", "fog: its volume is not baked"]


def test_faces_with_a_volume_alone_are_left_out(scene):
    item = cube("half", scene.collection)
    item.data.materials.append(material("solid"))
    item.data.materials.append(material("smoke", ("ShaderNodeVolumePrincipled", "Volume")))
    item.data.polygons[0].material_index = 1
    names, messages = read()
    assert names == {"half": (8, 10)} and messages == ["half: its volume is not baked"]


def test_true_displacement_is_named(scene):
    links = ("ShaderNodeBsdfDiffuse", "Surface"), ("ShaderNodeDisplacement", "Displacement")
    raised = material("raised", *links)
    cube("rock", scene.collection).data.materials.append(raised)
    assert not any("true displacement" in line for line in read()[1])
    raised.displacement_method = "BOTH"
    (message,) = read()[1]
    assert message.startswith("rock: true displacement by its material is not baked")


def test_film_exposure_and_few_bounces_are_said(scene):
    cube("box", scene.collection)
    assert not read()[1]
    scene.cycles.film_exposure, scene.cycles.diffuse_bounces = 4, 2
    assert read()[1] == [
        "renders have a film exposure of 4, a bake has none; --exposure 2 is as much",
        "renders end light after 2 diffuse bounces, a bake has all of them; --bounces 2 has as "
        "many",
    ]


def test_what_renders_cut_off_light_is_said(scene):
    cube("box", scene.collection)
    cycles = scene.cycles
    cycles.use_fast_gi, cycles.fast_gi_method = True, "ADD"
    assert not read()[1]
    cycles.transparent_max_bounces, cycles.fast_gi_method = 2, "REPLACE"
    cycles.sample_clamp_direct, cycles.sample_clamp_indirect = 0.5, 3
    assert read()[1] == [
        "renders end light behind 2 transparent surfaces, in a bake it passes all of them",
        "renders have Fast GI in the place of bounces, a bake has the bounces",
        "renders clamp direct light to 0.5, a bake has all of it",
        "renders clamp indirect light to 3, a bake has all of it",
    ]


def test_motion_blur_and_the_compositor_are_said(scene):
    cube("box", scene.collection)
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("grade", "CompositorNodeTree")
        scene.compositing_node_group = tree
    else:
        scene.use_nodes = True
        tree = scene.node_tree
    tree.nodes.new("CompositorNodeViewer")
    assert not read()[1]
    scene.render.use_motion_blur = True
    blur = tree.nodes.new("CompositorNodeBlur")
    assert read()[1] == [
        "renders have motion blur, a bake has none: it is of one moment",
        "renders go through the compositor's nodes, pictures of a bake do not",
    ]
    blur.mute, scene.render.use_motion_blur = True, False
    assert not read()[1]
    blur.mute, scene.render.use_compositing = False, False
    assert not read()[1]


def test_culling_by_the_camera_is_said(scene):
    item = cube("box", scene.collection)
    scene.render.use_simplify = scene.cycles.use_distance_cull = True
    assert not any("true displacement" in line for line in read()[1])
    item.cycles.use_distance_cull = item.cycles.use_camera_cull = True
    assert read()[1] == ["box: is baked, though renders may cull it by distance"]


# What stays as it is


def test_reading_leaves_the_scene_as_it_was(scene, home, capfd):
    cube("box", home).hide_set(True)
    scene.render.resolution_x, scene.render.resolution_percentage = 777, 55
    scene.render.use_border, scene.render.use_stamp = True, True
    scene.render.use_single_layer = scene.render.use_persistent_data = True
    scene.render.filepath = "//never/written"
    before = state(scene), counts()
    engines = set(bpy.types.RenderEngine.__subclasses__())
    capfd.readouterr()
    read_meshes()
    assert not capfd.readouterr().out
    assert before == (state(scene), counts())
    assert bpy.context.scene == scene and scene.collection.children[:] == [home]
    assert not any(is_temporary(block) for block in bpy.data.scenes)
    for engine in set(bpy.types.RenderEngine.__subclasses__()) - engines:
        assert not engine.is_registered


def test_an_animated_object_keeps_what_is_not_keyed_yet(scene):
    item = cube("box", scene.collection)
    for frame, x in ((1, 0), (21, 4)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    for point in fcurve_of(item, "location").keyframe_points:
        point.interpolation = "LINEAR"
    scene.frame_set(11, subframe=0.5)
    item.location.x = 7
    (mesh,) = read_meshes()
    # A render does not know of it.
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [2.1, 0, 0], atol=1e-5)
    assert item.location.x == 7


def test_an_error_while_reading_is_raised_and_leaves_nothing_behind(scene):
    cube("box", scene.collection)
    before = state(scene), counts()

    def fail(_depsgraph):
        raise PRTError("box: fell over")

    for _ in range(2):
        with pytest.raises(PRTError, match="box: fell over"):
            as_rendered(scene, fail)
    assert before == (state(scene), counts())
    assert as_rendered(scene, lambda depsgraph: depsgraph.mode) == "RENDER"


def test_a_scene_that_is_not_open_is_read(scene):
    cube("here", scene.collection)
    other = bpy.data.scenes.new("other")
    cube("away", other.collection)
    assert {mesh.name for mesh in read_meshes(other)} == {"away"}
    assert bpy.context.scene == scene


def test_grease_pencil_does_not_render_here(scene):
    cube("box", scene.collection)
    kind = "grease_pencils_v3" if hasattr(bpy.data, "grease_pencils_v3") else "grease_pencils"
    drawing = bpy.data.objects.new("drawing", getattr(bpy.data, kind).new("drawing"))
    scene.collection.objects.link(drawing)
    assert set(by_name()) == {"box"}


def test_instances_share_what_was_copied(scene):
    group = bpy.data.collections.new("group")
    cube("source", group)
    for number in range(5):
        instance_of(f"copy {number}", group, scene.collection, location=(number, 0, 0))
    meshes = read_meshes()
    assert len({id(mesh.corner_vertex) for mesh in meshes}) == 1 and len(meshes) == 5
    places = sorted(mesh.vertices[:, 0].mean() for mesh in meshes)
    np.testing.assert_allclose(places, range(5), atol=1e-6)


def test_the_first_step_says_what_the_window_waits_for(scene):
    cube("box", scene.collection)
    steps = read_meshes_steps(scene.session_uid, pace=1e-4)
    assert next(steps).stage == "evaluate"
    stages = {progress.stage for progress in steps}
    assert stages <= {"evaluate", "scene", "materials"}


def test_a_render_without_a_window_reads_the_scene_before_its_frames(baked_floor, tmp_path, capsys):
    bpy.data.objects["ball"].modifiers.new("smooth", "SUBSURF").show_viewport = False
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    scene = bpy.context.scene
    assert scene.prt.loaded
    scene.render.engine = "CYCLES"
    scene.cycles.samples = scene.frame_start = 1
    scene.frame_end = 2
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.filepath = str(tmp_path / "frame")
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    refused = []

    def read_in_frame(*_):
        with pytest.raises(PRTError, match="a render is under way"):
            read_meshes(scene)
        refused.append(scene.frame_current)

    bpy.app.handlers.frame_change_post.append(read_in_frame)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.frame_change_post.remove(read_in_frame)
    assert set(refused) == {1, 2} and len(list(tmp_path.glob("frame*"))) == 2
    assert "the scene is not the one that was baked (ball" in capsys.readouterr().out
    read_meshes(scene)


def test_a_scene_whose_output_is_a_movie_is_read(scene):
    cube("box", scene.collection)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    assert "box" in read()[0]
    assert settings.file_format == "FFMPEG"


def test_a_view_layer_without_environment_is_said(scene):
    cube("box", scene.collection)
    assert not any("Environment" in line for line in read()[1])
    bpy.context.view_layer.use_sky = False
    (line,) = (line for line in read()[1] if "Environment" in line)
    assert line.startswith("view layer 'View") and "the world gives no light" in line
