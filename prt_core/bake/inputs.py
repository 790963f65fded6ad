"""What a bake is given, checked before anything is written; and what is left where it fails."""

import shutil
from contextlib import contextmanager
from pathlib import Path

from prt_core.errors import (
    expect,
    expect_all,
    expect_flag,
    expect_kind,
    expect_named,
    expect_number,
    expect_path,
)
from prt_core.light import Lamp
from prt_core.light.environment import expect_radiance
from prt_core.runtime.machine import expect_memory
from prt_core.scene import Camera, Scene

# Of a point while it is baked; its bits are in memory a tile at a time.
_POINT_BYTES = 700


def expect_bake_input(
    scene, path, cube_map, lamps, world, camera, source, restart, pace, lights, origin, cameras=None
):
    """Raise `PRTError` unless `bake_steps` can bake this, and `load` will read it.

    Parameters
    ----------
    scene, path
        See `bake_steps`.
    cube_map : CubeMap
    lamps, world, camera, source, restart, pace, lights, origin, cameras
        See `bake_steps`.

    Returns
    -------
    world : (n_directions, 3) float32, or None
    """
    expect_kind("scene", scene, Scene)
    expect_path("bake", path)
    if restart != "changed":
        expect_flag("restart", restart)
    if pace is not None:
        expect_number("pace", pace, above=0)
    expect_all("lamps", lamps, Lamp, "lamps")
    if camera is not None:
        expect_kind("camera", camera, Camera)
    if cameras is not None:
        expect_named("cameras", cameras, Camera, "cameras")
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
    return None if world is None else expect_radiance("world", world, cube_map)


@contextmanager
def unless_begun(path):
    """Take a new bake away again where it fails before a ray is cast: nothing would be lost."""
    path = Path(path)
    exists = path.exists()
    try:
        yield
    except Exception:
        rays = [path / name / "c" for name in ("visibility", "ray_journal")]
        if not exists and not any(chunks.exists() for chunks in rays):
            shutil.rmtree(path, ignore_errors=True)
        raise
