"""The compressed form of a bake, in a folder of the bake's own group.

Its arrays are written into a new folder; then one atomic write of the bake's facts names it, and
only then the folder before goes. A kill leaves the old form or the new one, and at most a folder
that nobody names and the next one removes. The facts hold a digest of each of its arrays.
"""

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store.facts import damage_said
from prt_core.store.store import COMPRESSED

# What to do about a compressed form that is damaged.
AGAIN = "compress again"


def write_compressed(store, state, facts):
    """Store a compressor's state in place of the one that is there; a generator of array names.

    Parameters
    ----------
    store : BakeStore
        Opened to be written.
    state : dict
        Arrays of any shape, and values that JSON knows, by name.
        See `Compressor.state`.
    facts : dict
        Method, settings, what it is of, size, error and time.
    """
    try:
        kept = (compressed_facts(store) or {}).get("folder")
    except PRTError:
        kept = None
    _remove_others(store, kept)
    folder = f"{COMPRESSED}{int(kept.removeprefix(COMPRESSED)) + 1 if kept else 1}"
    values, arrays = {}, {}
    for name, value in state.items():
        if isinstance(value, np.ndarray):
            yield name
            arrays[name] = store.write(f"{folder}/{name}", value).digest()
        else:
            values[name] = value
    store.files.sync(folder)
    store.update(**{COMPRESSED: {**facts, "folder": folder, "values": values, "arrays": arrays}})
    _remove_others(store, folder)


def compressed_facts(store):
    """Facts of the compressed form, None where there is none.

    Parameters
    ----------
    store : BakeStore

    Raises
    ------
    PRTError
        They are damaged.
    """
    facts = store.facts.get(COMPRESSED)
    if facts is None:
        return None
    with damage_said(store.path, "what is said of its compressed form", AGAIN):
        folder = facts["folder"]
        good = folder == f"{COMPRESSED}{int(folder.removeprefix(COMPRESSED))}"
        good &= isinstance(facts["values"], dict) and isinstance(facts["arrays"], dict)
        # Names lead nowhere but into the folder.
        good &= all(name.isidentifier() for name in facts["arrays"])
    expect(good, f"{store.path}: what is said of its compressed form is damaged; {AGAIN}")
    return facts


def read_compressed(store, facts):
    """The state that `write_compressed` was given.

    Parameters
    ----------
    store : BakeStore
    facts : dict
        See `compressed_facts`.

    Returns
    -------
    dict
    """
    state = dict(facts["values"])
    for name in facts["arrays"]:
        try:
            state[name] = store.read(f"{facts['folder']}/{name}")
        except PRTError as error:
            raise PRTError(
                f"{store.path}: '{name}' of its compressed form cannot be read; {AGAIN}"
            ) from error
    return state


def remove_compressed(store):
    """Remove the compressed form.

    Parameters
    ----------
    store : BakeStore
        Opened to be written.

    Returns
    -------
    bool
        Whether there was one.
    """
    there = store.facts.get(COMPRESSED) is not None
    if there:
        store.update(**{COMPRESSED: None})
    _remove_others(store, None)
    return there


def _remove_others(store, kept):
    for name in store.files.names():
        if name.startswith(COMPRESSED) and name != kept:
            store.remove(name)
