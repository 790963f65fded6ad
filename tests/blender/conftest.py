import contextlib
import io
import os
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "blend_scenes"))

import blender_addon  # noqa: E402
import prt_core.blender  # noqa: E402, F401  (makes Blender's casters known)
from prt_core.cli import main  # noqa: E402

FLOOR = Path(__file__).resolve().parents[2] / "blend_scenes" / "08_two_triangle_floor.blend"


_STATUS = []


def pytest_sessionfinish(session, exitstatus):
    _STATUS.append(int(exitstatus))


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Blender 4.2 as a module crashes at the end of Python once a property had an update."""
    if _STATUS and bpy.app.version < (4, 3, 0):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_STATUS[-1])


@pytest.fixture(autouse=True)
def empty_file():
    """Every test begins with an empty file, and leaves no data-block of the casters behind."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    left = [b.name for kind in (bpy.data.scenes, bpy.data.objects, bpy.data.node_groups)
            for b in kind if b.name.startswith("prt ")]  # fmt: skip
    assert not left


@pytest.fixture
def hdri():
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    return lambda name: folder / f"{name}.exr"


@pytest.fixture
def addon():
    blender_addon.register()
    yield
    blender_addon.unregister()


@pytest.fixture
def floor_scene(addon, tmp_path):
    """The open scene of a saved file (a floor, a ball), with settings for a quick bake."""
    shutil.copy(FLOOR, tmp_path / "scene.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    return quick(bpy.context.scene)


@pytest.fixture
def baked_floor(floor_scene):
    assert bpy.ops.prt.bake() == {"FINISHED"}
    return floor_scene


def quick(scene):
    """Settings for a quick bake."""
    scene.prt.resolution, scene.prt.tolerance, scene.prt.caster = "8", 0.05, "blender"
    return scene


def colours_on(item, attribute="PRT"):
    """(n, 3) float32 of a colour attribute of an object, or of that of a name."""
    item = bpy.data.objects[item] if isinstance(item, str) else item
    data = item.data.color_attributes[attribute].data
    values = np.empty(len(data) * 4, np.float32)
    data.foreach_get("color", values)
    return values.reshape(-1, 4)[:, :3]


def cube(name, collection=None, size=0.2, location=(0, 0, 0)):
    """A cube of one mesh, in a collection or in none."""
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for z in (-size, size) for y in (-size, size) for x in (-size, size)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    item.location = location
    if collection is not None:
        collection.objects.link(item)
    return item


def instance_of(name, collection, home, location=(0, 0, 0)):
    """An empty that instances a collection."""
    item = bpy.data.objects.new(name, None)
    item.instance_type, item.instance_collection = "COLLECTION", collection
    item.location = location
    home.objects.link(item)
    return item


def scatter(name, collection, location=(0, 0, 0)):
    """A triangle at whose corners Geometry Nodes put cubes, and nothing else."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)], [], [(0, 1, 2)])
    item = bpy.data.objects.new(name, mesh)
    item.location = location
    collection.objects.link(item)
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end, put, built = (
        group.nodes.new(kind)
        for kind in ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeInstanceOnPoints",
                     "GeometryNodeMeshCube")
    )  # fmt: skip
    built.inputs["Size"].default_value = 0.2, 0.2, 0.2
    group.links.new(start.outputs[0], put.inputs["Points"])
    group.links.new(built.outputs["Mesh"], put.inputs["Instance"])
    group.links.new(put.outputs[0], end.inputs[0])
    item.modifiers.new("Scatter", "NODES").node_group = group
    return item


def link_from_library(item, path, collection):
    """The object out of a library of its own, in place of itself."""
    name = item.name
    bpy.data.libraries.write(str(path), {item}, fake_user=True)
    mesh = item.data
    bpy.data.objects.remove(item)
    bpy.data.meshes.remove(mesh)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = [name]
    collection.objects.link(wanted.objects[0])
    return wanted.objects[0]


def prt(*arguments, code=0):
    """The command line in this process, which has Blender already."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        returned = main(list(map(str, arguments)))
    assert returned == code, err.getvalue()
    return SimpleNamespace(stdout=out.getvalue(), stderr=err.getvalue())
