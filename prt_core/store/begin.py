"""The store that a bake is written into: begun, gone on with, or beside the one it will replace."""

from prt_core.errors import PRTError, expect
from prt_core.runtime.address import expect_store_path
from prt_core.store.attributes import damage_as_error
from prt_core.store.places import (
    beside,
    expect_removable,
    finish_swap,
    is_taken,
    remove_bake_folder,
    remove_leftovers,
    swap,
    was_swapping,
)
from prt_core.store.store import BakeStore


def begin_bake(path, identity, restart=False):
    """The store that a bake of a scene with settings is written into.

    What is in its place stays as it is; the first `update` makes a folder that is not there.

    Parameters
    ----------
    path : str, Path or Address
        `NAME.prt`.
    identity : dict
        Digest of the scene, and settings.
    restart : bool or "changed"
        Begin anew whatever is there; or only where that is of another identity. What is there
        stays until `finish_bake`; a restart that was stopped goes on.

    Returns
    -------
    BakeStore

    Raises
    ------
    PRTError
        The folder holds a bake of another identity, or none of this library.
    """
    path = expect_store_path("bake", path)
    swapping = was_swapping(path)
    finish_swap(path)
    if restart is True and swapping:
        # All that the restart had not done yet is to remove the old bake.
        existing = _read(path)
        if existing is not None and existing.attributes.get("identity") == identity:
            remove_leftovers(path)
            return existing
    if restart is True or _waits_beside(path, identity):
        return _begin_beside(path, identity)
    store = BakeStore(path, "a")
    remove_leftovers(path)
    with damage_as_error(path):
        existing = store.attributes.get("identity") or identity
        keys = {*identity, *existing}
        different = sorted(key for key in keys if existing.get(key) != identity.get(key))
    if different and restart == "changed":
        return _begin_beside(path, identity)
    expect(
        not different,
        f"{path}: holds a bake with another {', '.join(different)}; choose another output "
        "or add --restart to replace it",
    )
    return store


def finish_bake(store, path):
    """Put a finished bake in its place.

    Parameters
    ----------
    store : BakeStore
        Of `begin_bake`.
    path : str, Path or Address
        Its place.

    Returns
    -------
    BakeStore
        The one there.
    """
    path = expect_store_path("bake", path)
    if store.path != path:
        swap(path)
        return BakeStore(path, "r+")
    return store


def _begin_beside(path, identity):
    if is_taken(path):
        expect_removable(path)
    store = _read(beside(path))
    if store is not None and store.attributes.get("identity") not in (None, identity):
        store = None
    if store is None:
        remove_bake_folder(beside(path))
        store = BakeStore(beside(path), "a")
    return store


def _waits_beside(path, identity):
    """Whether a restart that was stopped had nothing to replace, and is of this identity."""
    if is_taken(path) or not is_taken(beside(path)):
        return False
    store = _read(beside(path))
    return store is not None and store.attributes.get("identity") == identity


def _read(path):
    try:
        return BakeStore(path, "a")
    except PRTError:
        return None
