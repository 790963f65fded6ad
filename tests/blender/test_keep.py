"""What is kept stays: on the meshes themselves, or on realised objects that are the user's."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import plan, preview, work
from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.realised import KEPT_COLLECTION
from prt_core.scene import mesh_digests
from tests.blender.conftest import colours_on, cube, instance_of, link_from_library, quick, scatter

pytestmark = pytest.mark.usefixtures("addon")

PLACES = {
    "ball": (0, 0, 0.5), "twin": (-0.6, 0.4, 0.5), "mirrored": (0.7, 0.4, 0.5),
    "fine": (0.1, -0.8, 0.4), "linked": (-0.7, -0.6, 0.4), "group": (0.9, -0.7, 0.3),
    "many": (0, 0.9, 0.2),
}  # fmt: skip


@pytest.fixture
def scene(floor_scene, tmp_path):
    """Beside floor and ball: shared, mirrored, subdivided, linked and instanced ones."""
    scene = floor_scene
    for name, x in (("twin", 0.5), ("mirrored", -0.7)):
        other = bpy.data.objects.new(name, scene.objects["ball"].data)
        other.scale.x = x
        scene.collection.objects.link(other)
    fine = cube("fine", scene.collection)
    fine.modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    link_from_library(cube("linked"), tmp_path / "library.blend", scene.collection)
    parts = bpy.data.collections.new("parts")
    for name, x in (("part", 0), ("other", 0.5)):
        cube(name, parts, 0.1, (x, 0, 0))
    instance_of("group", parts, scene.collection)
    scatter("many", scene.collection)
    for name, place in PLACES.items():
        scene.objects[name].location = place
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    assert bpy.ops.prt.bake() == {"FINISHED"}
    return scene


REALISED = {
    "ball",
    "twin",
    "mirrored",
    "fine",
    "linked",
    "group/part",
    "group/other",
    "many",
    "many.001",
    "many.002",
}


def kept_objects():
    return {item["prt_kept"]: item for item in bpy.data.objects if item.get("prt_kept")}


def world_corners(item):
    corners = np.empty(len(item.data.loops), np.int32)
    item.data.loops.foreach_get("vertex_index", corners)
    return np.array([item.matrix_world @ item.data.vertices[i].co for i in corners])


def check_kept(attribute, wanted):
    result = kept_objects()
    assert set(result) == REALISED
    for name, item in result.items():
        np.testing.assert_array_equal(colours_on(item, attribute), wanted[name], err_msg=name)
    np.testing.assert_array_equal(colours_on("floor", attribute), wanted["floor"])
    return result


def relit(scene):
    """Colours of the loaded bake, as the preview has them on its meshes."""
    result = {o["prt_copy"]: colours_on(o).copy() for o in scene.objects if o.get("prt_copy")}
    return result | {"floor": colours_on("floor").copy()}


def test_kept_colours_outlive_the_preview(scene):
    wanted = relit(scene)
    hidden = {o.name: o.hide_render for o in scene.objects}
    assert set(wanted) == REALISED | {"floor"}
    assert bpy.ops.prt.keep(attribute="Mine") == {"FINISHED"}
    # While the preview is there, what was kept stands behind it.
    result = kept_objects()
    assert all(item.hide_render and item.hide_get() for item in result.values())
    assert f"'{KEPT_COLLECTION}'" in work.status().message
    assert bpy.ops.prt.clear() == {"FINISHED"}
    result = check_kept("Mine", wanted)
    assert not [o for o in scene.objects if o.get("prt_copy")]
    for name, item in result.items():
        assert not item.hide_render and item.visible_get(), name
        assert [c.name for c in item.users_collection] == [KEPT_COLLECTION]
        assert item.data.color_attributes.active_color.name == "Mine"
        (material,) = item.data.materials
        nodes = {node.type: node for node in material.node_tree.nodes}
        assert nodes["VERTEX_COLOR"].layer_name == "Mine" and "EMISSION" in nodes
    # Nothing renders twice: the originals hide behind what was kept of them, and only those.
    behind = {"ball", "twin", "mirrored", "fine", "linked", "group", "many"}
    for name in behind:
        assert scene.objects[name].hide_render and not scene.objects[name].visible_get(), name
    assert not scene.objects["floor"].hide_render and set(hidden) >= behind
    assert "7 stay hidden behind what was kept of them" in work.status().message
    assert "Mine" in scene.objects["floor"].data.color_attributes
    assert not [b for b in (*bpy.data.materials, *bpy.data.node_groups) if b.get("PRT preview")]


def test_kept_objects_lie_where_their_originals_do_and_face_the_same_way(scene):
    meshes = {mesh.name: mesh for mesh in read_meshes(scene)}
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.prt.clear()
    bpy.context.view_layer.update()
    for name, item in kept_objects().items():
        mesh = meshes[name]
        places = mesh.vertices[mesh.corner_vertex]
        np.testing.assert_allclose(world_corners(item), places, atol=1e-5, err_msg=name)
        turn = item.matrix_world.inverted().transposed().to_3x3()
        normals = [turn @ corner.vector for corner in item.data.corner_normals]
        np.testing.assert_allclose(normals, mesh.corner_normal, atol=2e-3, err_msg=name)
        face = item.data.polygons[0]
        assert np.dot(turn @ face.normal, mesh.corner_normal[face.loop_start]) > 0.5, name


def test_keep_again_under_the_same_and_another_name(scene):
    first = relit(scene)
    bpy.ops.prt.keep(attribute="One")
    scene.prt.exposure = 1.0
    bpy.ops.prt.relight()
    second = relit(scene)
    bpy.ops.prt.keep(attribute="Two", domain="POINT", kind="BYTE_COLOR")
    assert len(kept_objects()) == len(REALISED)
    check_kept("One", first)
    item = kept_objects()["twin"]
    assert item.data.color_attributes["Two"].domain == "POINT"
    assert item.data.materials[0].node_tree.nodes["Color Attribute"].layer_name == "Two"
    own = bpy.data.materials.new("own")
    item.data.materials[0] = own
    bpy.ops.prt.keep(attribute="One")
    check_kept("One", second)
    assert (
        item.data.materials[0] == own and len(bpy.data.collections[KEPT_COLLECTION].objects) == 10
    )
    bpy.ops.prt.clear()
    check_kept("One", second)


def of_meshes(path):
    """How many points a bake has on its meshes: those in gaps move with the floor."""
    report = prt_core.load(path).report
    return report["points"] - report["details"]


def test_kept_objects_are_not_baked_as_doubles(scene):
    meshes = mesh_digests(read_meshes(scene))
    bpy.ops.prt.keep(attribute="Mine")
    path, kept = preview.path_of(scene), relit(scene)
    assert mesh_digests(read_meshes(scene)) == meshes
    bpy.ops.prt.clear()
    messages = []
    assert mesh_digests(read_meshes(scene, messages=messages)) == meshes
    assert any("10 objects hold kept colours" in text for text in messages)
    assert not any("hidden in the viewport" in text for text in messages)
    points = of_meshes(path)
    scene.objects["floor"].location.z -= 0.1
    assert bpy.ops.prt.bake() == {"FINISHED"}
    assert of_meshes(preview.path_of(scene)) == points
    shown = {o.name for o in scene.objects if o.visible_get() and o.type == "MESH"}
    copies = {o.name for o in scene.objects if o.get("prt_copy")}
    assert shown == copies | {"floor"}
    bpy.ops.prt.clear()
    for name, item in kept_objects().items():
        np.testing.assert_array_equal(colours_on(item, "Mine"), kept[name])
    shown = {o for o in scene.objects if o.visible_get() and o.type == "MESH"}
    assert shown == {*kept_objects().values(), scene.objects["floor"]}
    for item in scene.objects:
        item.prt.receives = item in kept_objects().values()
    with pytest.raises(RuntimeError, match="none receives colours"):
        bpy.ops.prt.bake()


def test_keep_then_load(scene):
    wanted = relit(scene)
    path = preview.path_of(scene)
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.prt.clear()
    with pytest.raises(RuntimeError, match="Bake the scene, or load a bake, first"):
        bpy.ops.prt.keep(attribute="Again")
    assert bpy.ops.prt.load(filepath=path) == {"FINISHED"} and not preview.held(scene).warned
    assert all(item.hide_render for item in kept_objects().values())
    bpy.ops.prt.keep(attribute="Again")
    bpy.ops.prt.clear()
    check_kept("Mine", wanted)
    check_kept("Again", wanted)


def test_an_object_of_another_shape_is_kept_beside_the_earlier_one(scene):
    bpy.ops.prt.keep(attribute="Mine")
    earlier = kept_objects()["fine"]
    before = colours_on(earlier, "Mine").copy()
    scene.objects["fine"].modifiers[0].render_levels = 3
    bpy.ops.prt.bake()
    bpy.ops.prt.keep(attribute="Mine")
    later = kept_objects()["fine"]
    assert later != earlier and len(later.data.loops) == 4 * len(earlier.data.loops)
    np.testing.assert_array_equal(colours_on(earlier, "Mine"), before)
    assert "was kept with another shape" in work.status().notes
    bpy.ops.prt.clear()
    assert not earlier.visible_get() and earlier.hide_render and later.visible_get()


def test_originals_come_back_when_what_was_kept_is_deleted(scene):
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.prt.clear()
    bpy.data.objects.remove(kept_objects()["twin"])
    bpy.ops.prt.clear()
    twin = scene.objects["twin"]
    assert not twin.hide_render and twin.visible_get()
    assert not [key for key in twin.keys() if key.startswith("prt_")]
    assert scene.objects["ball"].hide_render
    # And the other way round: without its original the kept object is one like others.
    fine = scene.objects["fine"]
    scene.collection.objects.unlink(fine)  # as Blender's own Delete does
    bpy.ops.prt.clear()
    # Not `users`: Blender 4.2 counts some that nothing is.
    assert not bpy.data.user_map(subset={fine})[fine]
    assert {"fine kept", "twin"} <= {mesh.name for mesh in read_meshes(scene)}


def test_undo_of_each(scene):
    bpy.ops.ed.undo_push(message="baked")
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.ed.undo_push(message="kept")
    wanted = relit(bpy.context.scene)
    bpy.ops.prt.clear()
    bpy.ops.ed.undo_push(message="restored")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert (
        scene.prt.loaded and {o["prt_copy"] for o in scene.objects if o.get("prt_copy")} == REALISED
    )
    assert all(item.hide_render and item.hide_get() for item in kept_objects().values())
    bpy.ops.ed.undo()
    assert not kept_objects() and bpy.context.scene.objects["twin"].hide_render
    assert "Mine" not in bpy.data.objects["floor"].data.color_attributes
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    scene = bpy.context.scene
    check_kept("Mine", wanted)
    assert not scene.prt.loaded and kept_objects()["twin"].visible_get()
    assert scene.objects["twin"].hide_render and not scene.objects["twin"].visible_get()


def test_a_file_with_kept_colours_opens_as_it_was(scene, tmp_path):
    """Linked and overridden objects keep no marks of ours: they hide again all the same."""
    wanted = relit(scene)
    bpy.ops.prt.keep(attribute="Mine")
    for restored in (False, True):
        if restored:
            bpy.ops.prt.clear()
        path = str(tmp_path / f"kept{restored}.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        scene = bpy.context.scene
        check_kept("Mine", wanted)
        linked = next(o for o in scene.objects if o.library)
        assert linked.hide_render and linked.hide_get()
        assert kept_objects()["linked"].visible_get() == restored
    for item in kept_objects().values():
        bpy.data.objects.remove(item)
    bpy.ops.prt.clear()
    assert not linked.hide_render and linked.visible_get()


def test_an_overridden_object_hides_and_comes_back(floor_scene, tmp_path):
    scene = floor_scene
    linked = link_from_library(cube("linked"), tmp_path / "library.blend", scene.collection)
    item = linked.override_create(remap_local_usages=True)
    item.location = 0, 0.5, 0.5
    bpy.ops.prt.bake()
    assert item.hide_render and not item.visible_get()
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.revert_mainfile()
    scene = bpy.context.scene
    (item,) = (o for o in scene.objects if o.override_library)
    assert item.hide_render and prt_core.run(plan.read_steps(scene))
    bpy.data.objects.remove(kept_objects()["linked"])
    bpy.ops.prt.clear()
    assert not item.hide_render and item.visible_get()


def test_an_object_with_a_mesh_of_its_own_and_instances(floor_scene):
    """Both parts go to realised objects, or the instances would be seen twice."""
    scene = floor_scene
    ball, leaf = scene.objects["ball"], cube("leaf", scene.collection, 0.05)
    ball.instance_type, ball.show_instancer_for_render = "VERTS", True
    mesh = bpy.data.meshes.new("few")
    mesh.from_pydata([(0, 0, 0.2), (0.4, 0, 0.2), (0, 0.4, 0.3)], [], [(0, 1, 2)])
    ball.data = mesh
    leaf.parent = ball
    bpy.ops.prt.bake()
    names = {o.name: o.own_mesh for o in preview.held(scene).items if o.owner == "ball"}
    assert len(names) == 4 and not any(names.values())
    assert ball.hide_render and not ball.visible_get()
    bpy.ops.prt.keep(attribute="Mine")
    bpy.ops.prt.clear()
    assert set(kept_objects()) == set(names) and ball.hide_render


def test_two_scenes_have_copies_of_their_own(scene):
    other = quick(bpy.data.scenes.new("Other"))
    bpy.context.window.scene = other
    for x in (0, 1):
        item = bpy.data.objects.new(f"pair {x}", bpy.data.objects["part"].data)
        item.location.x = x
        other.collection.objects.link(item)
    bpy.ops.prt.bake()
    bpy.ops.prt.keep(attribute="Theirs")
    bpy.ops.prt.clear()
    assert len([o for o in scene.objects if o.get("prt_copy")]) == len(REALISED)
    kept = {o["prt_kept"] for o in other.objects if o.get("prt_kept")}
    assert kept == {"pair 0", "pair 1"}
    bpy.context.window.scene = scene
    bpy.ops.prt.clear()
    assert not scene.objects["twin"].hide_render
    assert plan.of(scene) is not None and other.objects["pair 0"].hide_render


def test_a_name_that_one_mesh_cannot_take_is_on_none(baked_floor):
    floor, ball = (baked_floor.objects[name] for name in ("floor", "ball"))
    ball.vertex_groups.new(name="Mask")
    names = [floor.data.attributes.keys(), ball.data.attributes.keys()]
    said = {
        ball.data.uv_layers[0].name: "ball: '.*' is an attribute that is no colour",
        "Mask": "ball: 'Mask' is one of its vertex groups",
        "ä" * 40: "longer than the 67 bytes",
    }
    for name, words in said.items():
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.prt.keep(attribute=name)
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.prt.occlusion(attribute=name)
    with pytest.raises(RuntimeError, match="Mask"):
        bpy.ops.prt.occlusion(kind="bent-normal", attribute="Mask")
    assert [floor.data.attributes.keys(), ball.data.attributes.keys()] == names
    baked_floor.prt.attribute = "Mask"
    with pytest.raises(RuntimeError, match="ball: 'Mask' is one of its vertex groups"):
        bpy.ops.prt.relight()
    assert "Mask" not in floor.data.attributes


def test_an_object_that_its_library_hides_behind_a_copy_is_named(floor_scene, tmp_path):
    ball, props = floor_scene.objects["ball"], bpy.data.collections.new("props")
    floor_scene.collection.children.link(props)
    props.objects.link(ball)
    ball.modifiers.new("Cut", "TRIANGULATE")
    bpy.ops.prt.bake()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))

    def said(names):
        bpy.ops.wm.read_homefile(use_empty=True)
        with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
            wanted.collections = names
        scene, messages = bpy.context.scene, []
        for number, collection in enumerate(wanted.collections):
            instance_of(f"each {number}", collection, scene.collection)
        cube("box", scene.collection)
        read_meshes(messages=messages)
        return [line for line in messages if "stands in" in line]

    assert said(["props"]) == [
        "ball: is hidden in renders, and not baked: in 'library.blend' a copy with colours stands "
        "in for it; link that as well, or press Restore there and save it"
    ]
    assert said(["props", "PRT"]) == []
