"""What a bake is given, checked before anything is written."""

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_flag,
    expect_kind,
    expect_number,
    expect_path,
    shown,
)
from prt_core.light import Lamp
from prt_core.light.environment import BRIGHTEST
from prt_core.machine import expect_memory
from prt_core.scene import Scene

# Of a point while it is baked, its bits apart.
_POINT_BYTES = 400


def expect_bake_input(scene, path, cube_map, lamps, world, camera, source, restart, pace, lights):
    """Raise `PRTError` unless `bake_steps` can bake this, and `load` will read it.

    Parameters
    ----------
    scene, path, lamps, world, camera, source, restart, pace, lights
        See `bake_steps`.
    cube_map : CubeMap

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
    good = isinstance(lamps, list | tuple) and all(isinstance(lamp, Lamp) for lamp in lamps)
    expect(good, f"lamps: expected a list of lamps, got {shown(lamps)}")
    if camera is not None:
        expect_camera(camera)
    good = source is None or (
        isinstance(source, dict)
        and all(isinstance(text, str) for pair in source.items() for text in pair)
    )
    expect(good, f"source: expected a dict of digests by name, got {shown(source)}")
    if lights is not None:
        expect(isinstance(lights, dict) and lights, "lights: expected a dict of lights by name")
        for name, light in lights.items():
            expect_kind("lights", name, str, "names")
            expect_radiance(f"light '{name}'", light, cube_map)
    n_points = len(scene.points)
    expect_memory(
        f"bake: {n_points:,} points with {cube_map.n_directions:,} directions",
        n_points * (cube_map.n_directions / 8 + _POINT_BYTES),
        "take a lower resolution, or fewer points",
    )
    return None if world is None else expect_radiance("world", world, cube_map)


def expect_radiance(name, light, cube_map):
    """Light on the texels of a cube map as (n_directions, 3) float32."""
    return expect_array(name, light, (cube_map.n_directions, 3), np.float32, 0, BRIGHTEST)


def expect_camera(camera):
    """Raise `PRTError` unless this is a camera as pictures take it (see `camera_rays`)."""
    good = isinstance(camera, dict) and {"matrix", "tangent"} <= set(camera)
    expect(good, f"camera: expected a dict with a matrix and a tangent, got {shown(camera)}")
    matrix = expect_array("camera: matrix", camera["matrix"], (4, 4), np.float64)
    expect(
        matrix[:3, :3].any(axis=0).all(),
        "camera: expected a matrix whose axes have a length; this one's scale is 0",
    )
    expect_number("camera: tangent", camera["tangent"], above=0)
