"""Files that Blender opens, though not all of what they name is there."""

from types import SimpleNamespace

import bpy
import pytest

import prt_core
from prt_core import PRTError, blender_access


@pytest.fixture
def linked(tmp_path):
    """A file with a cube of its own and one of a library, and the library."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "far"
    library, blend = tmp_path / "library.blend", tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "near"
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["far"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend, library


def messages_of(blend):
    report = prt_core.bake(
        blend, blend.with_suffix(".prt"), resolution=4, tolerance=0.5, caster="blender"
    )
    return [line for line in report["messages"] if "library '" in line]


def test_a_library_that_is_there_is_no_message(linked):
    assert messages_of(linked[0]) == []


def test_a_library_that_is_gone_is_named(linked):
    blend, library = linked
    library.unlink()
    (line,) = messages_of(blend)
    assert line.startswith("library 'library.blend': its file '") and str(library) in line


def test_what_a_library_no_longer_holds_is_named(linked):
    blend, library = linked
    bpy.ops.wm.open_mainfile(filepath=str(library))
    bpy.data.objects["far"].name = "farther"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    (line,) = messages_of(blend)
    assert line == "far: is linked, but not in library 'library.blend' any more"


@pytest.mark.parametrize("opens", [True, False])
def test_what_blender_could_not_read_of_a_file_is_a_message(linked, opens, monkeypatch):
    def open_mainfile(filepath, load_ui):
        if opens:
            bpy.ops.wm.open_mainfile(filepath=filepath, load_ui=load_ui)
        raise RuntimeError("Error: 1 strip was not read\n")

    wm = SimpleNamespace(open_mainfile=open_mainfile)
    fake = SimpleNamespace(app=bpy.app, ops=SimpleNamespace(wm=wm))
    monkeypatch.setattr(blender_access, "import_bpy", lambda: fake)
    before = list(bpy.app.handlers.load_post)
    if opens:
        assert blender_access.open_blend(linked[0]) == [
            "scene.blend: Blender opened it, but reports: 1 strip was not read"
        ]
    else:
        with pytest.raises(PRTError, match="scene.blend: Blender cannot open it .1 strip was not"):
            blender_access.open_blend(linked[0])
    assert list(bpy.app.handlers.load_post) == before
