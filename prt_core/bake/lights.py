"""What is kept with a bake for relighting and pictures: lamps, world, camera, digests of meshes.

They may change without any ray being cast again, so a finished bake takes new ones.
"""

from dataclasses import asdict

from prt_core.errors import PRTError, expect, expect_named
from prt_core.light import Lamp
from prt_core.light.baked_world import BakedWorld
from prt_core.light.environment import EnvironmentMap, expect_radiance
from prt_core.scene import Camera
from prt_core.store import damage_as_error

# How the arrays that hold the world's light begin; attributes of these names say which do.
_WORLD, _IMAGE = "world", "world_image"


def light_attributes(lamps=(), world=None, camera=None, source=None, origin=None, cameras=None):
    """What `keep_lights` takes: attributes of lamps, cameras and source, and the world's light.

    Parameters
    ----------
    lamps, world, camera, source, origin, cameras
        See `bake_steps`.

    Returns
    -------
    attributes : dict
    world : BakedWorld, or None
    """
    attributes = {
        "lamps": [asdict(lamp) for lamp in lamps],
        "camera": camera and camera.to_dict(),
        "source": source or {},
        "origin": origin or {},
        "cameras": cameras_attribute(cameras),
    }
    return attributes, world


def keep_lights(store, attributes, world):
    """Put them in place of those that a store has; where they are the same it is not touched."""
    old = [store.attributes.get(kind) for kind in (_WORLD, _IMAGE)]
    with damage_as_error(store.path):
        number = _number(old[0]) if old[0] else 0
    new = _arrays(world, number)
    # A finished bake keeps the old light until the new one is named.
    same = [key for key in old if key] == list(new) and all(
        _is_same(store, *one) for one in new.items()
    )
    if not number or (store.is_complete and not same):
        new = _arrays(world, number + 1)
    for key, array in new.items():
        store.keep(key, array)
        store.files.sync(key)
    if store.is_complete:
        arrays = {key: value for key, value in store.attributes["arrays"].items() if key not in old}
        digests = {key: store.array(key).digest() for key in new}
        attributes["arrays"] = {**arrays, **digests}
    # Whoever began a bake has it; lamps and world are of the frame they were read at.
    origin = attributes["origin"]
    frame = {"frame": origin["frame"]} if "frame" in origin else {}
    attributes["origin"] = {**(store.attributes.get("origin") or origin), **frame}
    names = dict.fromkeys((_WORLD, _IMAGE)) | dict(zip((_WORLD, _IMAGE), new, strict=False))
    store.update(**names, **attributes)
    # Only now: a kill before leaves the old light, one after leaves an array that nothing names.
    for other in store.names():
        if other.startswith(_WORLD) and other not in new:
            store.remove(other)


def read_lights(store, cube_map):
    """Lamps, world, camera, source, origin and cameras of a store, as `Bake` has them.

    Raises
    ------
    PRTError
        They are damaged or out of range.
    """
    attributes = store.attributes
    with damage_as_error(store.path):
        lamps = [Lamp(**lamp) for lamp in attributes["lamps"]]
        camera, source, name = attributes["camera"], attributes["source"], attributes["world"]
        if camera is not None:
            camera = Camera(**camera)
        cameras = read_cameras(attributes)
        expect_named("source", source, str, "digests")
        origin = expect_named("origin", attributes["origin"], str, "names")
        expect(name is None or name == f"{_WORLD}{_number(name)}", "the name of its world is")
        world = None
        if name is not None:
            shape = cube_map.n_directions, 3
            texels = expect_radiance("world", store.read(name, shape, "float32"), cube_map)
            world = BakedWorld(texels, _read_image(store, _number(name)))
    return lamps, world, camera, source, origin, cameras


def _read_image(store, number):
    """The `EnvironmentMap` beside the texels of a world; None where none was kept."""
    name = store.attributes.get(_IMAGE)
    if name is None:
        return None
    expect(name == f"{_IMAGE}{number}", "the name of its world's image is")
    return EnvironmentMap(store.read(name), "world")


def _arrays(world, number):
    """Arrays of a `BakedWorld`, or of none, by name."""
    if world is None:
        return {}
    image = {} if world.image is None else {f"{_IMAGE}{number}": world.image.pixels}
    return {f"{_WORLD}{number}": world.texels, **image}


def cameras_attribute(cameras):
    """What is kept of cameras by name, dict of str -> `Camera` or None."""
    return {name: each.to_dict() for name, each in (cameras or {}).items()}


def read_cameras(attributes):
    """dict of str -> `Camera` of a store's attributes; those before views by name have none."""
    cameras = expect_named("cameras", attributes.get("cameras") or {}, dict, "cameras")
    return {name: Camera(**each) for name, each in cameras.items()}


def _is_same(store, name, array):
    try:
        return store.read(name).tobytes() == array.tobytes()
    except PRTError:
        return False


def _number(name):
    return int(name.removeprefix(_WORLD))
