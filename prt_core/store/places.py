"""Where a bake is made while another stands in its place, and how bakes change places and go.

A bake that replaces one is made in NAME.prt.restart. When it is finished, the old one is renamed
to NAME.prt.replaced, the new one to NAME.prt, and the old one is removed. Where a kill came between
the two renames, whoever opens NAME.prt next does the second. What a kill left in NAME.prt.replaced
is removed by the next bake there. In an object store, where nothing can be renamed, it is done as
`object_places` tells.
"""

import os
import re
import stat

from prt_core.errors import PRTError, expect
from prt_core.runtime.address import Address, expect_store_path
from prt_core.runtime.files import expect_output
from prt_core.store import object_places
from prt_core.store.attributes import FILE, is_foreign, read_attributes
from prt_core.store.files import Files, file_error, is_part, remove_tree, sync_folder
from prt_core.store.object_files import ObjectFiles, files_at

# What file managers put into any folder.
_CLUTTER = {".DS_Store", "Thumbs.db", "desktop.ini"}
_FOLDER = re.compile(r"[a-z]\w*")


def beside(path):
    """Where a new bake is made while an old one stands at `path`."""
    return _named(path, ".restart")


def is_taken(path):
    """Whether anything is at a path or address."""
    return ObjectFiles(path).exists() if isinstance(path, Address) else os.path.lexists(path)


def was_swapping(path):
    """Whether a kill came while a finished bake was put in its place."""
    if isinstance(path, Address):
        return object_places.was_moving(path, beside(path))
    return os.path.lexists(_old(path)) or (not os.path.lexists(path) and _is_complete(beside(path)))


def finish_swap(path):
    """Put a finished new bake in its place, where a kill left nothing there."""
    new = beside(path)
    if isinstance(path, Address):
        object_places.finish_move(path, new)
        return
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
    if isinstance(path, Address):
        if is_taken(path):
            expect_removable(path)
        object_places.move(path, new)
        return
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
    if isinstance(path, Address):
        object_places.remove_leftovers(path, beside(path))
    elif os.path.lexists(path):
        remove_bake_folder(_old(path))


def remove_bake(path):
    """Delete a bake, finished or not, damaged or not, and what restarts left beside it.

    Parameters
    ----------
    path : str, Path or Address
        `NAME.prt`.

    Raises
    ------
    PRTError
        There is none, or the folder holds what no bake does: then nothing is removed.
    """
    path = expect_store_path("bake", path)
    finish_swap(path)
    places = beside(path), _old(path), path
    existing = [place for place in places if is_taken(place)]
    expect(existing, f"{path}: there is no such bake")
    for place in existing:
        expect_removable(place)
    remove_bake_folder(beside(path))
    remove_bake_folder(_old(path))
    if path in existing and isinstance(path, Address):
        remove_bake_folder(path)
    elif path in existing:
        # Renamed first: a kill then leaves nothing in its place, rather than half of it.
        try:
            os.rename(path, _old(path))
        except OSError as error:
            raise file_error(path, "removed", error) from error
        remove_bake_folder(_old(path))


def remove_bake_folder(path):
    """Remove one folder of a bake, where it is there and is one."""
    if is_taken(path):
        expect_removable(path)
        remove_begun(path)


def remove_begun(path):
    """Remove what is at a path or address, unasked what it is: the caller has made it."""
    try:
        (object_places.remove if isinstance(path, Address) else remove_tree)(path)
    except OSError as error:
        raise file_error(path, "removed", error) from error


def expect_removable(path):
    """Raise `PRTError` unless a folder holds nothing but what bakes consist of."""
    files = files_at(path)
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
        away = isinstance(path, Address)
        strange = next(object_places.strange_keys(path) if away else _strange(path, 0), None)
    except OSError as error:
        raise file_error(path, "read", error) from error
    expect(
        strange is None,
        f"{path}: is not a bake, or holds more than one does ({strange!r}); move that away or "
        "choose another output",
    )


def expect_store_output(name, path, suffix, create=False):
    """Refuse, before the work, a place where no bake can be written afterwards.

    Parameters
    ----------
    name : str
        What the output is, for messages.
    path : str, Path or Address
    suffix : str
    create : bool
        Whether folders on the way are made where they are missing; addresses have none.

    Returns
    -------
    Path or Address

    Raises
    ------
    PRTError
        See `expect_output`; of an address: no bucket, credentials or connection, or no right to
        write.
    """
    path = expect_store_path(name, path)
    if not isinstance(path, Address):
        return expect_output(name, path, suffix, folder=True, create=create)
    expect(path.suffix.lower() == suffix, f"{path}: expected a name that ends in {suffix}")
    attempt = ObjectFiles(_named(path, ".part"))
    attempt.write(FILE, b"")
    attempt.remove_all([FILE])
    return path


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
