"""What is kept with a bake for relighting and pictures: lamps, world, camera, digests of meshes.

They may change without any ray being cast again, so a finished bake takes new ones.
"""

from dataclasses import asdict, fields

import numpy as np

from prt_core.errors import PRTError, expect, expect_array
from prt_core.light import Lamp
from prt_core.store import damage_said

# How the arrays that hold the world's light begin; the fact "world" names the one that does.
_WORLD = "world"
# Radiance above which sums of float32 over all directions might not stay finite.
_MOST_LIGHT = 1e20


def light_facts(cube_map, lamps=(), world=None, camera=None, source=None):
    """Facts of lamps, camera and source, and the light of the world, checked.

    Parameters
    ----------
    cube_map : CubeMap
    lamps, world, camera, source
        See `bake_steps`.

    Returns
    -------
    facts : dict
    world : (n_directions, 3) float32, or None

    Raises
    ------
    PRTError
        One of them could not be read again.
    """
    for lamp in lamps:
        _check_lamp(lamp)
    _check_camera(camera)
    facts = {"lamps": [asdict(lamp) for lamp in lamps], "camera": camera, "source": source or {}}
    return facts, None if world is None else _checked_world(cube_map, world)


def keep_lights(store, facts, world):
    """Put them in place of those that a store has; where they are the same it is not touched."""
    name, old = None, store.facts.get("world")
    with damage_said(store.path):
        spare = _new_name(old)
    if world is not None:
        # A finished bake keeps the old light until the new one is named.
        stays = _is_same(store, old, world) or not store.is_complete
        name = old if old and stays else spare
        store.keep(name, world)
        store.files.sync(name)
    if store.is_complete:
        arrays = {key: value for key, value in store.facts["arrays"].items() if key != old}
        facts["arrays"] = {**arrays, name: store.array(name).digest()} if name else arrays
    store.update(world=name, **facts)
    # Only now: a kill before leaves the old light, one after leaves an array that nothing names.
    for other in store.names():
        if other.startswith(_WORLD) and other != name:
            store.remove(other)


def read_lights(store, cube_map):
    """Lamps, world, camera and source of a store, as `Bake` has them.

    Raises
    ------
    PRTError
        They are damaged or out of range.
    """
    facts = store.facts
    with damage_said(store.path):
        lamps = [Lamp(**lamp) for lamp in facts["lamps"]]
        for lamp in lamps:
            _check_lamp(lamp)
        camera, source, name = facts["camera"], facts["source"], facts["world"]
        _check_camera(camera)
        expect(
            isinstance(source, dict) and all(isinstance(value, str) for value in source.values()),
            "the digests of its meshes are damaged",
        )
        expect(name is None or name == f"{_WORLD}{_number(name)}", "the name of its world is")
        world = None
        if name is not None:
            shape = cube_map.n_directions, 3
            world = _checked_world(cube_map, store.read(name, shape, "float32"))
    return lamps, world, camera, source


def _is_same(store, name, world):
    try:
        return name is not None and store.read(name).tobytes() == world.tobytes()
    except PRTError:
        return False


def _new_name(old):
    return f"{_WORLD}{_number(old) + 1 if old else 1}"


def _number(name):
    return int(name.removeprefix(_WORLD))


def _checked_world(cube_map, world):
    world = expect_array("world", world, (cube_map.n_directions, 3), np.float32)
    expect(
        float(np.abs(world).max()) <= _MOST_LIGHT,
        f"world: expected radiance of {_MOST_LIGHT:g} at most, got {np.abs(world).max():g}",
    )
    return world


def _check_lamp(lamp):
    """A `Lamp` checks its vectors itself; here it is that all the rest are finite numbers."""
    expect(isinstance(lamp, Lamp), f"lamps: expected Lamp, got {type(lamp).__name__}")
    for field in fields(lamp):
        value = getattr(lamp, field.name)
        if isinstance(field.default, float) or field.name == "size":
            expect_array(f"{lamp.name!r}: {field.name}", value, np.shape(value), np.float64)
    expect(
        isinstance(lamp.name, str) and isinstance(lamp.ellipse, bool | np.bool_),
        "lamps: expected a name of letters and whether it is an ellipse",
    )


def _check_camera(camera):
    if camera is None:
        return
    with damage_said("camera", "what it is"):
        expect_array("camera: matrix", camera["matrix"], (4, 4), np.float64)
        tangent = expect_array("camera: tangent", camera["tangent"], (), np.float64)
        expect(tangent > 0, f"camera: expected a tangent above 0, got {tangent}")
