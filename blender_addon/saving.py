"""Bakes and light fields go with their file: out of the temporary folder when it gets a name, and
they stay within reach when it is saved elsewhere, as images of light do.

While Blender saves nobody knows yet whether the open file gets the name or only a copy does. So
they are copied before, and what is not needed any more goes when it is done.
"""

import shutil
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import bpy

from prt_core import BakeStore
from prt_core.blender.identity import by_uid, origin_of
from prt_core.store.places import beside

from . import field_list, light_fields, plan, preview, work

# Of scenes by `session_uid`, and kinds: what they showed. Of what is in the temporary folder:
# (from, to). Of scenes, and numbers of their lights: images by paths seen from the file.
_SHOWN, _COPIED, _IMAGES = {}, [], {}


@dataclass(frozen=True)
class _Kind:
    """What a scene shows, and where the next one goes: of bakes, or of light fields."""

    home: object  # the module that holds it in memory
    output_path: object

    def settings(self, scene):
        return scene.prt if self.home is preview else scene.prt.field


_KINDS = {
    ".prt": _Kind(preview, plan.output_path),
    ".slf": _Kind(light_fields, field_list.output_path),
}


def before(file):
    """The open file, or a copy of it, is about to be saved as `file`.

    Raises
    ------
    PRTError, OSError
        A bake could not be copied; then all of them stay where they are.
    """
    _forget()
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
        for number, light in enumerate(_lights(scene) if elsewhere else ()):
            if light.file.startswith("//"):
                _IMAGES[scene.session_uid, number] = light.file
                light.file = preview.relative(bpy.path.abspath(light.file), file)
        for suffix, kind in _KINDS.items():
            settings, shown = kind.settings(scene), kind.home.path_of(scene)
            _SHOWN[scene.session_uid, suffix] = settings.loaded
            for path in dict.fromkeys((shown, str(kind.output_path(scene)))):
                # One that is being made goes there when it is done (see `settle`).
                if plan.is_temporary(path) and Path(path).is_dir() and not work.status().running:
                    _COPIED.append((path, str(_copy(scene, Path(path), file))))
            copied = dict(_COPIED)
            if shown in copied or (shown and elsewhere and not plan.is_temporary(shown)):
                settings.loaded = preview.relative(copied.get(shown, shown), file)


def after(file=None):
    """It is done; `file` is None where it failed."""
    if file is not None and Path(bpy.data.filepath) == Path(file):
        for old, new in _COPIED:
            _remove(old)
            _KINDS[Path(old).suffix].home.relocated(old, new)
    else:
        for (uid, suffix), loaded in _SHOWN.items():
            scene = by_uid(bpy.data.scenes, uid)
            settings = None if scene is None else _KINDS[suffix].settings(scene)
            if settings is not None and settings.loaded != loaded:
                settings.loaded = loaded
        for (uid, number), image in _IMAGES.items():
            scene = by_uid(bpy.data.scenes, uid)
            if scene is not None:
                _lights(scene)[number].file = image
    _forget()


def _lights(scene):
    """The panel's own light and those that are kept as sets."""
    return [scene.prt, *scene.prt.sets]


def _forget():
    for each in (_SHOWN, _COPIED, _IMAGES):
        each.clear()


def settle(scene, path):
    """Where a bake or light field lies that is done or was stopped: beside the file, if that got
    a name meanwhile."""
    kind = _KINDS[Path(path).suffix]
    if not bpy.data.filepath or not plan.is_temporary(path):
        return Path(path)
    home = _copy(scene, Path(path), bpy.data.filepath)
    for each in bpy.data.scenes:
        if kind.home.path_of(each) == str(path):
            kind.settings(each).loaded = preview.relative(home)
    _remove(path)
    kind.home.relocated(str(path), str(home))
    return home


def _copy(scene, path, file):
    """Copy a bake to where those of `file` are, under a name that nothing there has; with it
    the stopped one that is to replace it."""
    target = _KINDS[path.suffix].output_path(scene, file)
    names = (target.with_name(f"{target.stem}.{n:03d}{path.suffix}") for n in count(1))
    while target.exists() or beside(target).exists():
        target = next(names)
    try:
        for old, new in ((path, target), (beside(path), beside(target))):
            if old.is_dir():
                shutil.copytree(old, new)
                store = BakeStore(new, "a")
                # The frame is still that of the bake.
                origin = origin_of(scene, target.parent, file)
                store.update(origin={**(store.attributes.get("origin") or {}), **origin})
    except BaseException:
        _remove(target)
        raise
    return target


def _remove(path):
    for each in (Path(path), beside(Path(path))):
        shutil.rmtree(each, ignore_errors=True)
