"""What is kept with a bake for relighting and pictures: lamps, world, cameras, view transform,
digests of meshes.

They may change without any ray being cast again, so a finished bake takes new ones.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

from prt_core.errors import PRTError, expect, expect_named
from prt_core.light import Lamp
from prt_core.light.baked_world import BakedWorld
from prt_core.light.environment import EnvironmentMap, expect_radiance
from prt_core.scene import Camera, ViewTransform
from prt_core.store import damage_as_error

# How the arrays that hold the world's light and the view transform begin; attributes of these names
# say which do, and one more what the table of the last is of.
_WORLD, _IMAGE, _SHOWN = _KINDS = "world", "world_image", "view_transform"
_SHOWN_BY = "shown_by"


class Beside(NamedTuple):
    """What is kept beside a bake, as `bake_steps` takes it; the world is a `BakedWorld`."""

    lamps: Sequence = ()
    world: BakedWorld | None = None
    camera: Camera | None = None
    source: dict | None = None
    origin: dict | None = None
    cameras: dict | None = None
    view_transform: ViewTransform | None = None


def light_attributes(beside):
    """What `keep_lights` takes: attributes of lamps, cameras and source, and what is large.

    Parameters
    ----------
    beside : Beside

    Returns
    -------
    attributes : dict
    arrays : dict of str -> array
        The world's light and the table of the view transform, by what they are.
    """
    world, shown = beside.world, beside.view_transform
    attributes = {
        "lamps": [asdict(lamp) for lamp in beside.lamps],
        "camera": beside.camera and beside.camera.to_dict(),
        "source": beside.source or {},
        "origin": beside.origin or {},
        "cameras": cameras_attribute(beside.cameras),
        **view_transform_attribute(shown),
    }
    arrays = {} if world is None else {_WORLD: world.texels}
    if world is not None and world.image is not None:
        arrays[_IMAGE] = world.image.pixels
    if shown is not None:
        arrays[_SHOWN] = shown.table
    return attributes, arrays


def keep_lights(store, attributes, arrays):
    """Put them in place of those that a store has; where they are the same it is not touched."""
    # Whoever began a bake has it; lamps and world are of the frame they were read at.
    origin = attributes["origin"]
    frame = {"frame": origin["frame"]} if "frame" in origin else {}
    attributes["origin"] = {**(store.attributes.get("origin") or origin), **frame}
    _keep(store, attributes, arrays, _KINDS)


def keep_view_transform(store, view_transform, attributes):
    """Put a `ViewTransform`, or None, in place of that of a store, with other attributes."""
    arrays = {} if view_transform is None else {_SHOWN: view_transform.table}
    attributes = {**attributes, **view_transform_attribute(view_transform)}
    _keep(store, attributes, arrays, (_SHOWN,))


def _keep(store, attributes, arrays, kinds):
    """Attributes, and arrays by which of the `kinds` they are."""
    old = {kind: store.attributes.get(kind) for kind in kinds}
    with damage_as_error(store.path):
        number = max([0, *(_number(kind, name) for kind, name in old.items() if name)])
    names = {kind: f"{kind}{number}" for kind in arrays}
    # What is finished keeps the old ones until the new ones are named.
    same = names == {kind: name for kind, name in old.items() if name} and all(
        _is_same(store, name, arrays[kind]) for kind, name in names.items()
    )
    if not number or (store.is_complete and not same):
        names = {kind: f"{kind}{number + 1}" for kind in arrays}
    new = {names[kind]: array for kind, array in arrays.items()}
    for key, array in new.items():
        store.keep(key, array)
        store.files.sync(key)
    if store.is_complete:
        digests = {key: store.array(key).digest() for key in new}
        others = store.attributes["arrays"].items()
        others = {key: value for key, value in others if key not in old.values()}
        attributes["arrays"] = {**others, **digests}
    store.update(**(dict.fromkeys(kinds) | names), **attributes)
    # Only now: a kill before leaves the old ones, one after leaves an array that nothing names.
    for other in store.names():
        if other.startswith(tuple(kinds)) and other not in new:
            store.remove(other)


def read_lights(store, cube_map):
    """The `Beside` of a store.

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
        shown = read_view_transform(store)
        world = None
        if name is not None:
            shape = cube_map.n_directions, 3
            number = _number(_WORLD, name)
            texels = expect_radiance("world", store.read(name, shape, "float32"), cube_map)
            world = BakedWorld(texels, _read_image(store, number))
    return Beside(lamps, world, camera, source, origin, cameras, shown)


def _read_image(store, number):
    """The `EnvironmentMap` beside the texels of a world; None where none was kept."""
    name = store.attributes.get(_IMAGE)
    if name is None:
        return None
    expect(name == f"{_IMAGE}{number}", "the name of its world's image is")
    return EnvironmentMap(store.read(name), "world")


def view_transform_attribute(view_transform):
    """What is kept of a `ViewTransform` or None beside its table: as keywords of `store.update`."""
    known = view_transform is not None
    shown_by = {"name": view_transform.name, "exposure": view_transform.exposure} if known else None
    return {_SHOWN_BY: shown_by}


def read_view_transform(store):
    """The `ViewTransform` of a store; None where it has none, as those of older versions."""
    name = store.attributes.get(_SHOWN)
    if name is None:
        return None
    _number(_SHOWN, name)
    return ViewTransform(store.read(name), **store.attributes[_SHOWN_BY])


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


def _number(kind, name):
    """The number at the end of the name of an array of a kind."""
    number = name.removeprefix(kind)
    expect(name.startswith(kind) and number.isdecimal(), f"the name of its {kind} is")
    return int(number)
