"""Where files of tests are run side by side: which come first, and threads for each."""

import os
from pathlib import Path

from threadpoolctl import threadpool_limits

# Processes side by side share the cores. Threads of OpenBLAS wait for one another by spinning: if
# they are more than the cores, small products take many times as long.
_BESIDE = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
if _BESIDE > 1:
    _SHARE = max(1, (os.cpu_count() or 1) // _BESIDE)
    # That of numpy may be loaded already, by a plug-in of pytest.
    threadpool_limits(_SHARE, user_api="blas")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", str(_SHARE))

# A file goes to one process; those that take long are begun first, so that none is waited for.
LONG = (
    "core/export/test_web_gloss.py", "blender/test_addon.py", "core/store/test_fuzz.py",
    "conformance/test_scenes.py", "core/store/test_resume.py", "blender/test_tutorials.py",
    "blender/test_keep.py", "core/store/test_kills.py", "blender/test_entry_points.py",
    "blender/test_bake_files.py", "core/store/test_restart.py", "core/bake/test_reuse.py",
    "blender/test_light_field_addon.py", "core/bake/test_bake_pictures.py",
    "blender/test_extension.py", "core/bake/test_compressed.py", "core/store/test_object_store.py",
    "blender/test_moved_in_panel.py", "blender/test_worn_materials.py",
)  # fmt: skip


def pytest_collection_modifyitems(items):
    place = {Path(__file__).parent / name: number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: place.get(item.path, len(place)))
