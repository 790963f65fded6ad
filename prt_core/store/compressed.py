"""The compressed form of a bake, in a folder of the bake's own group.

Its arrays are written into a new folder, whose name nobody else has; then one atomic write of the
bake's attributes names it, and only then the folders before go. A kill leaves the old form or the
new one, and at most a folder that nobody names and the next one removes. Of several that write at
once the first stays, and the others say so. The attributes hold a digest of each array.
"""

import secrets
from contextlib import suppress

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store.attributes import damage_as_error, read_attributes
from prt_core.store.store import COMPRESSED, GLOSS_FORM

# What to do about a compressed form that is damaged.
AGAIN = "compress again"
_MOST_FOLDERS = 10**12


def write_compressed(store, state, attributes, slot=COMPRESSED):
    """Store a compressor's state in place of the one that is there; a generator of array names.

    Parameters
    ----------
    store : BakeStore
        Opened to be written.
    state : dict
        Arrays of any shape, and values that JSON knows, by name.
        See `Compressor.state`.
    attributes : dict
        Method, settings, what it is of, size, error and time.
    slot : {COMPRESSED, GLOSS_FORM}
        Which of the two forms it is: of what points receive, or of what they reflect to views.

    Raises
    ------
    PRTError
        It cannot be written, or another one was stored meanwhile; what was there stays.
    """
    folder = f"{slot}{secrets.randbelow(_MOST_FOLDERS)}"
    named = False
    try:
        values, arrays = {}, {}
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                yield name
                arrays[name] = store.write(f"{folder}/{name}", value).digest()
            else:
                values[name] = value
        store.files.sync(folder)
        # Who begins a folder after this list knows the attributes that are written now.
        others = _folders(store, slot)
        store.update(**{slot: {**attributes, "folder": folder, "values": values, "arrays": arrays}})
        named = True
    except PRTError:
        _expect_first(store, slot)
        raise
    finally:
        if not named:
            with suppress(PRTError):
                store.remove(folder)
    for name in others:
        if name != folder:
            store.remove(name)


def _expect_first(store, slot):
    """Raise `PRTError` where another writer has stored its form since the store was opened."""
    try:
        there = (read_attributes(store.files) or {}).get(slot)
    except PRTError:
        return
    expect(
        there is None or there == store.attributes.get(slot),
        f"{store.path}: was compressed by another program meanwhile, whose form is kept, and "
        "nothing of this one; run the same command again to have this one instead",
    )


def compressed_attributes(store, slot=COMPRESSED):
    """Attributes of the compressed form, None where there is none.

    Parameters
    ----------
    store : BakeStore
    slot : {COMPRESSED, GLOSS_FORM}
        See `write_compressed`.

    Raises
    ------
    PRTError
        They are damaged.
    """
    attributes = store.attributes.get(slot)
    if attributes is None:
        return None
    with damage_as_error(store.path, "what is said of its compressed form", AGAIN):
        folder = attributes["folder"]
        good = folder == f"{slot}{int(folder.removeprefix(slot))}"
        good &= isinstance(attributes["values"], dict) and isinstance(attributes["arrays"], dict)
        # Names lead nowhere but into the folder.
        good &= all(name.isidentifier() for name in attributes["arrays"])
    expect(good, f"{store.path}: what is said of its compressed form is damaged; {AGAIN}")
    return attributes


def read_compressed(store, attributes):
    """The state that `write_compressed` was given.

    Parameters
    ----------
    store : BakeStore
    attributes : dict
        See `compressed_attributes`.

    Returns
    -------
    dict
    """
    state = dict(attributes["values"])
    for name in attributes["arrays"]:
        try:
            state[name] = store.read(f"{attributes['folder']}/{name}")
        except PRTError as error:
            raise PRTError(
                f"{store.path}: '{name}' of its compressed form cannot be read; {AGAIN}"
            ) from error
    return state


def remove_compressed(store):
    """Remove the compressed form, that of gloss as well.

    Parameters
    ----------
    store : BakeStore
        Opened to be written.

    Returns
    -------
    bool
        Whether there was one.
    """
    slots = COMPRESSED, GLOSS_FORM
    named = {slot: None for slot in slots if store.attributes.get(slot) is not None}
    if named:
        store.update(**named)
    for slot in slots:
        for name in _folders(store, slot):
            store.remove(name)
    return bool(named)


def _folders(store, slot):
    """Names of the folders of forms that are there, whether or not the attributes name them."""
    return [name for name in store.files.names() if name.startswith(slot)]
