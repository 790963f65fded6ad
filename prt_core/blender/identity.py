"""Which data-block is meant: a name is one only together with the library it comes from."""

import os
from collections import Counter
from contextlib import suppress
from pathlib import Path

import bpy

from prt_core.errors import expect


def place_of(block):
    """(str, str): name of a data-block, and of the library it is linked from, empty where none."""
    return block.name, block.library.name if block.library else ""


def find_object(name, library=""):
    """The object of that name in the file, or in a library; None where there is none."""
    if not library:
        return bpy.data.objects.get((name, None))
    home = bpy.data.libraries.get(library)
    return None if home is None else bpy.data.objects.get((name, home.filepath))


def objects_by_place():
    """{(name, library): object} of all objects: Blender finds a single one by going through all."""
    return {place_of(item): item for item in bpy.data.objects}


def by_uid(blocks, uid):
    """The data-block of that `session_uid`, whatever it is called by now; None where it is gone."""
    return next((block for block in blocks if block.session_uid == uid), None)


def scene_of(uid):
    """The scene of that `session_uid`; `PRTError` where it was removed."""
    scene = by_uid(bpy.data.scenes, uid)
    expect(scene is not None, "scene: it was removed while it was read")
    return scene


class UniqueNames:
    """Gives each name once; who asks for one that is taken gets a number behind it."""

    def __init__(self):
        self._taken, self._count = set(), Counter()

    def give(self, name):
        """The name, with a number where it was given before."""
        unique = name
        while unique in self._taken:
            self._count[name] += 1
            unique = f"{name}.{self._count[name]:03d}"
        self._taken.add(unique)
        return unique


def display_names(objects):
    """How people tell objects apart: ({session_uid: name}, the `UniqueNames` that are left).

    Objects of the file keep their names; a linked one has its own where nobody else is called
    so, else it names its library as well.
    """
    objects = sorted(objects, key=lambda item: item.library is not None)
    count, names = Counter(item.name for item in objects), UniqueNames()
    given = {}
    for item in objects:
        own = item.library is None or count[item.name] == 1
        given[item.session_uid] = names.give(item.name if own else item.name_full)
    return given, names


def origin_of(scene, folder, file=None):
    """Which file and scene a bake in `folder` is of, as the bake's attributes keep it.

    The file (default: the open one) is named from the folder on, so that both may move together;
    empty without a name. Without a folder (None: an object store) it is its name alone.
    """
    file = bpy.data.filepath if file is None else str(file)
    if file and folder is None:
        file = Path(file).name
    elif file:
        with suppress(ValueError):  # another drive
            file = os.path.relpath(os.path.realpath(file), os.path.realpath(folder))
        file = Path(file).as_posix()
    return {"file": file, "scene": scene.name}


def origin_now(scene, folder):
    """`origin_of`, and the `frame` that the scene is at, as a bake that begins now keeps them."""
    return {**origin_of(scene, folder), "frame": frame_of(scene)}


def frame_of(scene):
    """The frame a scene is at, as text: whole, or with three digits between two frames."""
    between = scene.frame_subframe
    return f"{scene.frame_current_final:.3f}" if between else str(scene.frame_current)
