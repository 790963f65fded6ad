"""How bakes change places and go where nothing can be renamed: in an object store.

A bake is there by one object, the attributes of its group; without them its arrays are nobody's.
To put the finished bake NAME.prt.restart in the place of another, the attributes of the old one are
removed first: from then on the new one is the only whole one, and whoever opens NAME.prt copies it
into its place, attributes last, where a kill came between. Copies are made by the store itself.
"""

import re

from prt_core.errors import PRTError
from prt_core.store.attributes import FILE, read_attributes
from prt_core.store.object_files import ObjectFiles

_KNOWN = re.compile(rf"([a-z]\w*/){{0,2}}{FILE}|([a-z]\w*/){{1,2}}c(/\d+)+")


def is_there(path):
    """Whether a bake, finished or not, damaged or not, is at an address."""
    return ObjectFiles(path).holds(FILE)


def was_moving(path, new):
    """Whether a kill came while the finished bake at `new` was put at `path`."""
    seal = _seal(new)
    return seal is not None and (not is_there(path) or _seal(path) == seal)


def finish_move(path, new):
    """Put the finished bake at `new` in its place, where a kill left nothing there.

    Several may do so at once: what is in its place is never removed here.
    """
    if not is_there(path) and _seal(new) is not None:
        _take_in(path, new)


def move(path, new):
    """Put the finished bake at `new` in the place of what is at `path`."""
    ObjectFiles(path).remove_all([FILE])
    _take_in(path, new)


def _take_in(path, new):
    old, new = ObjectFiles(path), ObjectFiles(new)
    keys = new.keys()
    if FILE not in keys:
        # Another has moved it, and is removing what it copied.
        return
    kept = [key for key in keys if key != FILE]
    old.remove_all(sorted(set(old.keys()).difference(keys)))
    try:
        new.copy_to(old, kept)
        new.copy_to(old, [FILE])
    except PRTError:
        if is_there(path):
            return
        raise
    remove(new.root)


def remove(path):
    """Remove a bake, its attributes first: a kill leaves arrays that are nobody's."""
    files = ObjectFiles(path)
    files.remove_all([FILE])
    files.remove_all(files.keys())


def remove_leftovers(path, new):
    """Remove what a kill left of a bake at `new` that was put at `path`, or was being removed."""
    if not is_there(new) or was_moving(path, new):
        remove(new)


def strange_keys(path):
    """Keys below an address that no bake gives."""
    return (key for key in ObjectFiles(path).keys() if not _KNOWN.fullmatch(key))


def _seal(path):
    """The seal of a finished bake at an address; None where there is none."""
    try:
        attributes = read_attributes(ObjectFiles(path)) or {}
    except PRTError:
        return None
    return attributes.get("seal") if attributes.get("complete") is True else None
