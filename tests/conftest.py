"""Which files of tests come first where several are run side by side."""

from pathlib import Path

# A file goes to one process; those that take long are begun first, so that none is waited for.
LONG = (
    "core/store/test_fuzz.py", "core/store/test_resume.py", "blender/test_entry_points.py",
    "blender/test_tutorials.py", "core/store/test_kills.py", "core/store/test_restart.py",
    "blender/test_keep.py", "core/bake/test_compressed.py", "blender/test_moved_in_panel.py",
    "blender/test_bake_files.py", "blender/test_extension.py", "conformance/test_scenes.py",
    "core/store/test_object_store.py", "blender/test_addon.py", "core/bake/test_bake_pictures.py",
    "blender/test_light_field_addon.py", "blender/test_worn_materials.py",
)  # fmt: skip


def pytest_collection_modifyitems(items):
    place = {Path(__file__).parent / name: number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: place.get(item.path, len(place)))
