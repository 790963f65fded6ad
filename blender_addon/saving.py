"""Bakes go with their file: out of the temporary folder when it gets a name, and they stay within
reach when it is saved elsewhere.

While Blender saves nobody knows yet whether the open file gets the name or only a copy does. So
the bakes are copied before, and what is not needed any more goes when it is done.
"""

import shutil
from itertools import count
from pathlib import Path

import bpy

from prt_core import BakeStore
from prt_core.blender.identity import by_uid, origin_of
from prt_core.store.places import beside

from . import plan, preview, work

# Of scenes by `session_uid`: what they showed. Of bakes in the temporary folder: (from, to).
_SHOWN, _COPIED = {}, []


def before(file):
    """The open file, or a copy of it, is about to be saved as `file`.

    Raises
    ------
    PRTError, OSError
        A bake could not be copied; then all of them stay where they are.
    """
    _SHOWN.clear()
    _COPIED.clear()
    try:
        _take_along(file)
    except BaseException:
        for _, new in _COPIED:
            _remove(new)
        after()
        raise


def _take_along(file):
    elsewhere = bpy.data.filepath and Path(bpy.data.filepath).parent != Path(file).parent
    for scene in bpy.data.scenes:
        if scene.library is not None:
            continue
        _SHOWN[scene.session_uid] = scene.prt.loaded
        shown = preview.path_of(scene)
        for path in dict.fromkeys((shown, str(plan.output_path(scene)))):
            # One that is being made goes there when it is done (see `settle`).
            if plan.is_temporary(path) and Path(path).is_dir() and not work.status().running:
                _COPIED.append((path, str(_copy(scene, Path(path), file))))
        copied = dict(_COPIED)
        if shown in copied or (shown and elsewhere and not plan.is_temporary(shown)):
            scene.prt.loaded = preview.relative(copied.get(shown, shown), file)


def after(file=None):
    """It is done; `file` is None where it failed."""
    if file is not None and Path(bpy.data.filepath) == Path(file):
        for old, new in _COPIED:
            _remove(old)
            preview.relocated(old, new)
    else:
        for uid, loaded in _SHOWN.items():
            scene = by_uid(bpy.data.scenes, uid)
            if scene is not None and scene.prt.loaded != loaded:
                scene.prt.loaded = loaded
    _SHOWN.clear()
    _COPIED.clear()


def settle(scene, path):
    """Where a bake lies that is done or was stopped: beside the file, if that got a name
    meanwhile."""
    if not bpy.data.filepath or not plan.is_temporary(path):
        return Path(path)
    home = _copy(scene, Path(path), bpy.data.filepath)
    for each in bpy.data.scenes:
        if preview.path_of(each) == str(path):
            each.prt.loaded = preview.relative(home)
    _remove(path)
    preview.relocated(str(path), str(home))
    return home


def _copy(scene, path, file):
    """Copy a bake to where those of `file` are, under a name that nothing there has; with it
    the stopped one that is to replace it."""
    target = plan.output_path(scene, file)
    names = (target.with_name(f"{target.stem}.{n:03d}.prt") for n in count(1))
    while target.exists() or beside(target).exists():
        target = next(names)
    try:
        for old, new in ((path, target), (beside(path), beside(target))):
            if old.is_dir():
                shutil.copytree(old, new)
                BakeStore(new, "a").update(origin=origin_of(scene, target.parent, file))
    except BaseException:
        _remove(target)
        raise
    return target


def _remove(path):
    for each in (Path(path), beside(Path(path))):
        shutil.rmtree(each, ignore_errors=True)
