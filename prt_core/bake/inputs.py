"""What a bake is given, checked before anything is written; and what is left where it fails."""

from contextlib import contextmanager, suppress

from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_flag,
    expect_kind,
    expect_named,
    expect_number,
)
from prt_core.light import Lamp
from prt_core.light.baked_world import BakedWorld
from prt_core.light.environment import EnvironmentMap, expect_radiance
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.machine import expect_memory
from prt_core.scene import Camera, Scene, ViewTransform
from prt_core.store import files_at, is_taken, remove_begun

# Of a point while it is baked; its bits are in memory a tile at a time.
_POINT_BYTES = 700
# Arrays of answers of rays.
_RAYS = "visibility", "ray_journal", "tile_bits0"


def expect_bake_input(
    scene, path, cube_map, lamps, world, camera, source, restart, pace, lights, origin,
    cameras=None, view_transform=None,
):  # fmt: skip
    """Raise `PRTError` unless `bake_steps` can bake this, and `load` will read it.

    Parameters
    ----------
    scene, path
        See `bake_steps`.
    cube_map : CubeMap
    lamps, world, camera, source, restart, pace, lights, origin, cameras, view_transform
        See `bake_steps`.

    Returns
    -------
    world : BakedWorld, or None
    """
    expect_kind("scene", scene, Scene)
    expect_store_path("bake", path)
    if restart != "changed":
        expect_flag("restart", restart)
    if pace is not None:
        expect_number("pace", pace, above=0)
    expect_all("lamps", lamps, Lamp, "lamps")
    if camera is not None:
        expect_kind("camera", camera, Camera)
    if cameras is not None:
        expect_named("cameras", cameras, Camera, "cameras")
    if view_transform is not None:
        expect_kind("view_transform", view_transform, ViewTransform)
    for name, given, what in (("source", source, "digests"), ("origin", origin, "names")):
        if given is not None:
            expect_named(name, given, str, what)
    if lights is not None and not callable(lights):
        expect(expect_named("lights", lights, object, "lights"), "lights: expected at least one")
        for name, light in lights.items():
            expect_radiance(f"light '{name}'", light, cube_map)
    n_points = len(scene.points)
    expect_memory(
        f"bake: {n_points:,} points",
        n_points * _POINT_BYTES,
        "take fewer points",
    )
    if world is None:
        return None
    given = world if isinstance(world, BakedWorld) else BakedWorld(world)
    if given.image is not None:
        expect_kind("world: image", given.image, EnvironmentMap)
    return BakedWorld(expect_radiance("world", given.texels, cube_map), given.image)


@contextmanager
def unless_begun(path):
    """Take a new bake away again where it fails before a ray is cast: nothing would be lost."""
    path = expect_store_path("bake", path)
    existed = is_taken(path)
    try:
        yield
    except Exception:
        with suppress(PRTError):
            files = files_at(path)
            if not existed and not any(files.names(f"{name}/c") for name in _RAYS):
                remove_begun(path)
        raise
