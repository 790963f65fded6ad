"""What is kept with a bake for relighting and pictures: lamps, world, camera, digests of meshes.

They may change without any ray being cast again, so a finished bake takes new ones.
"""

from dataclasses import asdict

from prt_core.errors import PRTError, expect, expect_named
from prt_core.light import Lamp
from prt_core.light.environment import expect_radiance
from prt_core.scene import Camera
from prt_core.store import damage_as_error

# How the arrays that hold the world's light begin; the attribute "world" names the one that does.
_WORLD = "world"


def light_attributes(lamps=(), world=None, camera=None, source=None, origin=None, cameras=None):
    """What `keep_lights` takes: attributes of lamps, cameras and source, and the world's light.

    Parameters
    ----------
    lamps, world, camera, source, origin, cameras
        See `bake_steps`.

    Returns
    -------
    attributes : dict
    world : (n_directions, 3) float32, or None
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
    name, old = None, store.attributes.get("world")
    with damage_as_error(store.path):
        spare = _new_name(old)
    if world is not None:
        # A finished bake keeps the old light until the new one is named.
        stays = _is_same(store, old, world) or not store.is_complete
        name = old if old and stays else spare
        store.keep(name, world)
        store.files.sync(name)
    if store.is_complete:
        arrays = {key: value for key, value in store.attributes["arrays"].items() if key != old}
        attributes["arrays"] = {**arrays, name: store.array(name).digest()} if name else arrays
    # Whoever began a bake has it; lamps and world are of the frame they were read at.
    origin = attributes["origin"]
    frame = {"frame": origin["frame"]} if "frame" in origin else {}
    attributes["origin"] = {**(store.attributes.get("origin") or origin), **frame}
    store.update(world=name, **attributes)
    # Only now: a kill before leaves the old light, one after leaves an array that nothing names.
    for other in store.names():
        if other.startswith(_WORLD) and other != name:
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
            world = expect_radiance("world", store.read(name, shape, "float32"), cube_map)
    return lamps, world, camera, source, origin, cameras


def cameras_attribute(cameras):
    """What is kept of cameras by name, dict of str -> `Camera` or None."""
    return {name: each.to_dict() for name, each in (cameras or {}).items()}


def read_cameras(attributes):
    """dict of str -> `Camera` of a store's attributes; those before views by name have none."""
    cameras = expect_named("cameras", attributes.get("cameras") or {}, dict, "cameras")
    return {name: Camera(**each) for name, each in cameras.items()}


def _is_same(store, name, world):
    try:
        return name is not None and store.read(name).tobytes() == world.tobytes()
    except PRTError:
        return False


def _new_name(old):
    return f"{_WORLD}{_number(old) + 1 if old else 1}"


def _number(name):
    return int(name.removeprefix(_WORLD))
