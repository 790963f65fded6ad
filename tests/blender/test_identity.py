"""A name is not an object: libraries, slashes, numbers, and names that are changed."""

import subprocess
import sys
from itertools import chain, count

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import freshness, live, plan, preview, work
from prt_core.blender import depsgraph
from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.identity import find_object
from tests.blender.conftest import colours_on, cube, instance_of, link_from_library, quick

OPTIONS = {"resolution": 8, "tolerance": 0.05, "caster": "blender"}


@pytest.fixture
def namesakes(tmp_path):
    """A linked box beside a box and a box.001 of the file, of different sizes, on a plate."""
    home = bpy.context.scene.collection
    linked = link_from_library(cube("box", None, 0.4), tmp_path / "library.blend", home)
    for name, size, x in (("box.001", 0.3, 1.2), ("box", 0.25, 0)):
        cube(name, home, size, (x, 0, 0.5))
    cube("plate", home, 2, (0, 0, -2))
    bpy.data.worlds.new("white").color = 1, 1, 1
    bpy.context.scene.world = bpy.data.worlds["white"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "namesakes.blend"))
    return linked


def sizes(meshes):
    return {mesh.name: round(np.ptp(mesh.vertices[:, 0]), 3) for mesh in meshes}


def test_a_linked_object_beside_local_ones_of_its_name(namesakes, tmp_path):
    wanted = {"box [library.blend]": 0.8, "box.001": 0.6, "box": 0.5, "plate": 4.0}
    assert sizes(read_meshes()) == wanted
    blend, path = tmp_path / "namesakes.blend", tmp_path / "n.prt"
    prt_core.bake(blend, path, **OPTIONS)
    colours = prt_core.relight(path, "world")
    lit = tmp_path / "lit.blend"
    done = subprocess.run(
        [sys.executable, "-m", "prt_core", "relight", path, "--light", "world", "--scene", blend,
         "--blend", lit],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and "note" not in done.stdout, done.stdout + done.stderr
    bpy.ops.wm.open_mainfile(filepath=str(lit))
    for name in ("box", "box.001"):
        np.testing.assert_array_equal(colours_on(find_object(name)), colours[name])
    (copy,) = (o for o in bpy.data.objects if o.get("prt_copy"))
    np.testing.assert_array_equal(colours_on(copy), colours["box [library.blend]"])
    linked = find_object("box", "library.blend")
    assert copy["prt_original"] == linked and linked.library is not None
    assert "PRT" not in linked.data.color_attributes and linked.hide_get()


def test_names_mean_the_files_own_object_first(namesakes):
    receiving = {m.name for m in read_meshes(receivers=["box"]) if m.receives}
    assert receiving == {"box"}
    receiving = {m.name for m in read_meshes(receivers=["box [library.blend]"]) if m.receives}
    assert receiving == {"box [library.blend]"}
    bpy.data.objects.remove(find_object("box"))
    # Alone it has its short name.
    receiving = {m.name for m in read_meshes(receivers=["box"]) if m.receives}
    assert receiving == {"box"} and sizes(read_meshes())["box"] == 0.8


def test_buttons_take_the_right_one_of_two(namesakes, addon):
    scene = quick(bpy.context.scene)
    namesakes.prt.receives = False
    bpy.ops.prt.bake()
    assert {item.name: item.receives for item in preview.held(scene).items} == {
        "box": True, "box.001": True, "plate": True, "box [library.blend]": False,
    }  # fmt: skip
    assert "PRT" in find_object("box").data.color_attributes
    spare = find_object("box").copy()
    spare.name = "spare"
    bpy.data.objects.remove(find_object("box"))
    with pytest.raises(RuntimeError, match="box: the open scene has no such mesh object"):
        bpy.ops.prt.relight()
    assert "PRT" not in namesakes.data.color_attributes
    spare.name = "box"
    scene.collection.objects.link(spare)
    bpy.ops.prt.clear()
    find_object("box").hide_render = True
    bpy.ops.prt.unhide(object_name="box")
    assert not find_object("box").hide_render


def test_slashes_and_numbers_collide_with_nothing():
    """Instances are called OWNER/SOURCE and numbered: what is called so already keeps its name."""
    home, parts = bpy.context.scene.collection, bpy.data.collections.new("parts")
    cube("b", parts, 0.1)
    instance_of("a", parts, home, (3, 0, 0))
    for name, size in (("a/b", 0.2), ("a/b.001", 0.3), ("../up", 0.4), ("日本 ü", 0.5)):
        cube(name, home, size)
    cube("c", home, 0.6).modifiers.new("Array", "ARRAY").count = 1
    result = sizes(read_meshes())
    assert result.pop("a/b.002") == 0.2
    assert result == {"a/b": 0.4, "a/b.001": 0.6, "../up": 0.8, "日本 ü": 1.0, "c": 1.2}


def test_repeated_instances_are_numbered_around_real_objects():
    home = bpy.context.scene.collection
    points = bpy.data.meshes.new("points")
    points.from_pydata([(0, 0, 1), (1, 0, 1), (0, 1, 1)], [], [(0, 1, 2)])
    owner = bpy.data.objects.new("tree", points)
    home.objects.link(owner)
    owner.instance_type = "VERTS"
    cube("leaf", home, 0.1).parent = owner
    cube("tree/leaf.001", home, 0.3)
    result = read_meshes()
    by_name = {mesh.name: mesh for mesh in result}
    assert len(by_name) == len(result)
    assert by_name["tree/leaf.001"].own_mesh and by_name["tree/leaf.001"].owner == "tree/leaf.001"
    leaves = [mesh for mesh in result if mesh.owner == "tree"]
    assert {m.name for m in leaves} >= {"tree/leaf", "tree/leaf.002", "tree/leaf.003"}


def test_objects_that_swap_their_names_keep_their_colours(baked_floor):
    scene = baked_floor
    cube("one", scene.collection, 0.2, (0.6, 0, 0.3))
    cube("two", scene.collection, 0.3, (-0.8, 0, 0.5))
    bpy.ops.prt.bake()
    wanted = {name: colours_on(name).copy() for name in ("one", "two")}
    one, two = scene.objects["one"], scene.objects["two"]
    one.name = "three"
    two.name = "one"
    one.name = "two"
    for relight in (lambda: scene.frame_set(2), bpy.ops.prt.relight):
        scene.prt.exposure += 1
        relight()
        factor = np.float32(2**scene.prt.exposure)
        np.testing.assert_allclose(colours_on(one), wanted["one"] * factor, rtol=1e-5)
        np.testing.assert_allclose(colours_on(two), wanted["two"] * factor, rtol=1e-5)
    assert preview.held(scene).warned == ""


def test_the_original_of_a_copy_may_be_renamed(floor_scene):
    scene = floor_scene
    twin = bpy.data.objects.new("twin", scene.objects["ball"].data)
    twin.location = -0.6, 0.4, 0.5
    scene.collection.objects.link(twin)
    bpy.ops.prt.bake()
    bpy.ops.prt.clear()
    twin.name = "sister"
    bpy.ops.prt.load(filepath=str(plan.output_path(scene)))
    assert twin.hide_render and preview.held(scene).warned == ""
    bpy.ops.prt.clear()
    assert not twin.hide_render


def test_a_scene_may_be_renamed_and_have_linked_namesakes(baked_floor, tmp_path, monkeypatch):
    scene = baked_floor
    # A clock by which a step has no time for more than one object, however slow the machine is.
    clock = chain([0.0, 0.0], count(1.0))
    monkeypatch.setattr(depsgraph.time, "perf_counter", lambda: next(clock))
    library = tmp_path / "scenes.blend"
    scene.name = "Day"
    bpy.ops.wm.save_as_mainfile(filepath=str(library), copy=True)
    scene.name = "Scene"
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.scenes = ["Day"]
    before, present = colours_on("ball").copy(), preview.held(scene)
    scene.prt.exposure = 2.0
    steps = freshness.check_steps(scene, present, 1e-9)
    next(steps)
    monkeypatch.undo()
    scene.name = "Day"
    assert [s.library is None for s in bpy.data.scenes if s.name == "Day"] == [True, False]
    assert prt_core.run(steps).fresh
    prt_core.run(live._relight_steps(scene, False))
    np.testing.assert_allclose(colours_on("ball"), before * 4, rtol=1e-5)
    assert bpy.ops.prt.relight() == {"FINISHED"} and not work.status().failed
    assert plan.reading(scene)[0].digests


def test_the_previews_blocks_are_the_files_own(baked_floor, tmp_path):
    """A preview's material out of a library, or a user's of that name, is not touched."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lit.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = quick(bpy.context.scene)
    with bpy.data.libraries.load(str(tmp_path / "lit.blend"), link=True) as (_, wanted):
        wanted.materials = ["PRT colours"]
    mine = bpy.data.materials.new("PRT colours")
    cube("cube", scene.collection).modifiers.new("Subdivision", "SUBSURF")
    for _ in range(2):
        bpy.ops.prt.bake()
        bpy.ops.prt.relight()
    (copy,) = (o for o in scene.objects if o.get("prt_copy"))
    used = copy.data.materials[0]
    assert used.library is None and used != mine and not mine.get("PRT preview")
    assert len([m for m in bpy.data.materials if not m.library]) == 2
