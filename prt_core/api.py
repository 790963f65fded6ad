"""The calls most people need: bake a .blend, relight a bake."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from prt_core.bake import Bake, BakeSettings, bake_steps, load
from prt_core.errors import PRTError, expect, expect_array
from prt_core.light import EnvironmentMap, split_sun
from prt_core.progress import run
from prt_core.transport import lamp_light


def bake(
    blend,
    output,
    *,
    objects=None,
    two_sided=(),
    restart=False,
    report=None,
    **settings,
):
    """Bake a .blend file, or Blender's current scene, into a store.

    Parameters
    ----------
    blend : str, Path or None
        None: the scene that is open.
    output : str or Path
        `NAME.prt`.
    objects : sequence of str, optional
        Those that receive colours; all others cast and bounce. Default: all.
    two_sided : sequence of str
        Objects whose back sides receive and bounce as well.
    restart : bool
        Begin anew whatever `output` holds.
    report : callable(Progress), optional
    **settings
        See `BakeSettings`: resolution, bounces, tolerance, caster, seed.

    Returns
    -------
    dict
        The report (see `bake_steps`).

    Raises
    ------
    PRTError
        bpy is missing, the file or a name is wrong, or the store holds something else.
    """
    settings = BakeSettings(**settings)
    steps = bake_blend_steps(blend, output, settings, objects, two_sided, restart)
    return run(steps, report)


def bake_blend_steps(blend, output, settings, objects=None, two_sided=(), restart=False):
    """`bake` as a generator of `Progress`."""
    if blend is not None:
        open_blend(blend)
    from prt_core.blender.depsgraph import read_camera, read_scene
    from prt_core.blender.lamps import read_lamps
    from prt_core.blender.world import read_world
    from prt_core.light import CubeMap

    messages = []
    scene = read_scene(receivers=objects, two_sided=two_sided, messages=messages)
    scene.messages[:0] = messages
    lamps = read_lamps(messages=scene.messages)
    try:
        world = read_world(CubeMap(settings.resolution))
    except PRTError as error:
        scene.messages.append(f"{error}; '--light world' is not there for this bake")
        world = None
    result = yield from bake_steps(
        scene, output, settings, lamps, world, read_camera(), restart=restart
    )
    return result


def open_blend(path):
    """Open a .blend file in this process's Blender.

    Raises
    ------
    PRTError
        bpy is not installed, or the file cannot be opened.
    """
    path = Path(path)
    expect(path.is_file(), f"{path}: there is no such .blend file")
    expect(path.suffix == ".blend", f"{path}: expected a .blend file")
    bpy = import_bpy()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise PRTError(f"{path}: Blender cannot open it ({reason})") from error


def import_bpy():
    """The bpy module, with the core's Blender side loaded.

    Raises
    ------
    PRTError
        It is not installed for this Python.
    """
    try:
        import bpy

        import prt_core.blender  # noqa: F401  (makes its ray casters known)
    except ImportError as error:
        raise PRTError(
            f"bpy: Blender's module cannot be loaded ({error}); pip install 'prt-core[blender]' "
            "or run inside Blender"
        ) from error
    return bpy


def relight(
    bake,
    light=None,
    *,
    rotation=None,
    strength=1.0,
    sharp_sun=False,
    lamps=False,
    lamp_samples=256,
    caster="auto",
    bounces="baked",
):
    """Colours of a baked scene under a light.

    Parameters
    ----------
    bake : Bake, str or Path
        From `load`, or its folder.
    light : str, Path, EnvironmentMap or (n_directions, 3) array, optional
        An environment image; "world" is the light of the baked scene's own world.
    rotation : float, (3,) or (3, 3), optional
        Of the environment: degrees about z, Euler angles in degrees, or a matrix.
    strength : float
    sharp_sun : bool
        Take what is far brighter than the rest out of the environment and cast its shadow rays
        now: shadows as sharp as the image, not as the cube map's texels.
    lamps : bool or sequence of Lamp
        True: the lamps of the baked scene; their shadow rays are cast now.
    lamp_samples : int
        Shadow rays a point and lamp.
    caster : str
        For the shadow rays.
    bounces : int, optional
        Default: as baked; 0 is direct light.

    Returns
    -------
    dict of str -> (n_corners, 3) float32
        Linear Rec.709 radiance in Blender's loop order, for each object that receives.
    """
    if not isinstance(bake, Bake):
        bake = load(bake)
    radiance = relight_points(
        bake,
        light,
        rotation=rotation,
        strength=strength,
        sharp_sun=sharp_sun,
        lamps=lamps,
        lamp_samples=lamp_samples,
        caster=caster,
        bounces=bounces,
    )
    return bake.colours(radiance)


def relight_points(
    bake,
    light=None,
    *,
    rotation=None,
    strength=1.0,
    sharp_sun=False,
    lamps=False,
    lamp_samples=256,
    caster="auto",
    bounces="baked",
):
    """As `relight`, the radiance of all points, (n_points, 3) float32."""
    expect(
        light is not None or lamps is not False,
        "light: give an environment image, 'world', or ask for the lamps",
    )
    chosen = list(bake.lamps if lamps is True else (lamps or []))
    if lamps is True:
        expect(chosen, "lamps: the baked scene had no lamps that render")
    if chosen and strength != 1.0:
        chosen = [replace(lamp, power=lamp.power * strength) for lamp in chosen]
    if sharp_sun:
        light = read_environment(light)
        expect(
            isinstance(light, EnvironmentMap),
            "sharp_sun: needs an environment image, not a light that is on texels already",
        )
        light, sun = split_sun(light, rotation, strength)
        chosen += [sun] if sun is not None else []
    radiance = environment_light(bake, light, rotation, strength)
    received = None
    if chosen:
        rays = bake.make_caster(caster)
        try:
            received = lamp_light(bake.scene, rays, chosen, lamp_samples)
        finally:
            rays.close()
    return bake.transport.relight(radiance, received, bounces)


def read_environment(light):
    """An `EnvironmentMap` where `light` is the path of an image, else `light` as it is."""
    if isinstance(light, Path) or (isinstance(light, str) and light != "world"):
        if Path(light).suffix.lower() == ".hdr":
            import_bpy()
        return EnvironmentMap.read(light)
    return light


def environment_light(bake, light, rotation=None, strength=1.0):
    """(n_directions, 3) float32 of any light `relight` takes, or None."""
    if light is None:
        return None
    cube_map = bake.cube_map
    if isinstance(light, str) and light == "world":
        expect(
            bake.world is not None,
            "light 'world': the bake has none, its world was not understood; give an image",
        )
        expect(rotation is None, "rotation: the world's light is fixed; give its image to turn it")
        return bake.world * np.float32(strength)
    light = read_environment(light)
    if isinstance(light, EnvironmentMap):
        return light.to_cube_map(cube_map, rotation, strength)
    expect(rotation is None, "rotation: turns an environment image, not a light on texels")
    array = expect_array("light", light, (cube_map.n_directions, 3), np.float32)
    return array * np.float32(strength)
