"""Where a bake is made while another stands in its place, and how bakes change places and go.

A bake that replaces one is made in NAME.prt.restart. When it is finished, the old one is renamed
to NAME.prt.replaced, the new one to NAME.prt, and the old one is removed. Where a kill came between
the two renames, whoever opens NAME.prt next does the second. What a kill left in NAME.prt.replaced
is removed by the next bake there.
"""

import os
import re
import stat
from pathlib import Path

from prt_core.errors import PRTError, expect
from prt_core.store.attributes import FILE, is_foreign, read_attributes
from prt_core.store.files import Files, file_error, is_part, remove_tree, sync_folder

# What file managers put into any folder.
_CLUTTER = {".DS_Store", "Thumbs.db", "desktop.ini"}
_FOLDER = re.compile(r"[a-z]\w*")


def beside(path):
    """Where a new bake is made while an old one stands at `path`."""
    return _named(path, ".restart")


def was_swapping(path):
    """Whether a kill came while a finished bake was put in its place."""
    return os.path.lexists(_old(path)) or (not os.path.lexists(path) and _is_complete(beside(path)))


def finish_swap(path):
    """Put a finished new bake in its place, where a kill left nothing there."""
    new = beside(path)
    if os.path.lexists(path) or not _is_complete(new):
        return
    try:
        os.rename(new, path)
    except OSError as error:
        if not os.path.lexists(path):
            raise file_error(new, "put in its place", error) from error


def swap(path):
    """Put the finished bake beside `path` in its place, and remove the one that was there."""
    new, old = beside(path), _old(path)
    remove_bake_folder(old)
    try:
        if os.path.lexists(path):
            expect_removable(path)
            os.rename(path, old)
        os.rename(new, path)
    except OSError as error:
        if os.path.lexists(old) and not os.path.lexists(path):
            os.rename(old, path)
        raise file_error(new, "put in its place", error) from error
    sync_folder(path.parent)
    remove_bake_folder(old)


def remove_leftovers(path):
    """Remove what a kill left of a bake that another has replaced."""
    if os.path.lexists(path):
        remove_bake_folder(_old(path))


def remove_bake(path):
    """Delete a bake, finished or not, damaged or not, and what restarts left beside it.

    Parameters
    ----------
    path : str or Path
        `NAME.prt`.

    Raises
    ------
    PRTError
        There is none, or the folder holds what no bake does: then nothing is removed.
    """
    path = Path(path)
    finish_swap(path)
    places = beside(path), _old(path), path
    existing = [place for place in places if os.path.lexists(place)]
    expect(existing, f"{path}: there is no such bake")
    for place in existing:
        expect_removable(place)
    remove_bake_folder(beside(path))
    remove_bake_folder(_old(path))
    if path in existing:
        # Renamed first: a kill then leaves nothing in its place, rather than half of it.
        try:
            os.rename(path, _old(path))
        except OSError as error:
            raise file_error(path, "removed", error) from error
        remove_bake_folder(_old(path))


def remove_bake_folder(path):
    """Remove one folder of a bake, where it is there and is one."""
    if os.path.lexists(path):
        expect_removable(path)
        try:
            remove_tree(path)
        except OSError as error:
            raise file_error(path, "removed", error) from error


def expect_removable(path):
    """Raise `PRTError` unless a folder holds nothing but what bakes consist of."""
    files = Files(path)
    expect(files.exists(), f"{path}: there is no such bake")
    expect(
        not is_foreign(files),
        f"{path}: is not a bake of this library; it is not removed, choose another output",
    )
    expect_only_arrays(path)


def is_removable(path):
    """Whether a folder is at this `path` and holds nothing but what bakes consist of."""
    try:
        expect_removable(path)
    except PRTError:
        return False
    return True


def expect_only_arrays(path):
    """Raise `PRTError` where a folder holds files that no bake does."""
    try:
        strange = next(_strange(path, 0), None)
    except OSError as error:
        raise file_error(path, "read", error) from error
    expect(
        strange is None,
        f"{path}: is not a bake, or holds more than one does ({strange!r}); move that away or "
        "choose another output",
    )


def _old(path):
    return _named(path, ".replaced")


def _named(path, suffix):
    expect(path.name not in ("", ".."), f"{path}: expected the name of a folder, NAME.prt")
    return path.with_name(path.name + suffix)


def _is_complete(path):
    try:
        files = Files(path)
        attributes = read_attributes(files) if files.exists() else None
    except PRTError:
        return False
    return attributes is not None and attributes.get("complete") is True


def _strange(folder, depth, chunks=False):
    """Names below a folder that no bake gives; links are removed as such, and lose nothing."""
    with os.scandir(folder) as entries:
        for entry in entries:
            name = entry.name
            status = entry.stat(follow_symlinks=False)
            if not stat.S_ISDIR(status.st_mode):
                known = name in _CLUTTER or name == FILE or is_part(name)
                known |= (chunks and name.isdigit()) or stat.S_ISLNK(status.st_mode)
                if not known:
                    yield name
            elif chunks and name.isdigit():
                yield from _strange(entry.path, depth + 1, True)
            elif not chunks and name == "c" and depth:
                yield from _strange(entry.path, depth + 1, True)
            elif not chunks and depth < 2 and _FOLDER.fullmatch(name):
                yield from _strange(entry.path, depth + 1)
            else:
                yield name
