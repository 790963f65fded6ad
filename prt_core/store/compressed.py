"""The compressed form of a bake, in a folder of the bake's own group.

Its arrays are written into a new folder; then one atomic write of the bake's attributes names it,
and only then the folder before goes. A kill leaves the old form or the new one, and at most a
folder that nobody names and the next one removes. The attributes hold a digest of each array.
"""

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store.attributes import damage_as_error
from prt_core.store.store import COMPRESSED, GLOSS_FORM

# What to do about a compressed form that is damaged.
AGAIN = "compress again"


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
    """
    try:
        kept = (compressed_attributes(store, slot) or {}).get("folder")
    except PRTError:
        kept = None
    _remove_others(store, kept, slot)
    folder = f"{slot}{int(kept.removeprefix(slot)) + 1 if kept else 1}"
    values, arrays = {}, {}
    for name, value in state.items():
        if isinstance(value, np.ndarray):
            yield name
            arrays[name] = store.write(f"{folder}/{name}", value).digest()
        else:
            values[name] = value
    store.files.sync(folder)
    store.update(**{slot: {**attributes, "folder": folder, "values": values, "arrays": arrays}})
    _remove_others(store, folder, slot)


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
        _remove_others(store, None, slot)
    return bool(named)


def _remove_others(store, kept, slot):
    for name in store.files.names():
        if name.startswith(slot) and name != kept:
            store.remove(name)
