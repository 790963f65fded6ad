"""The calls most people need: bake a .blend, relight a bake."""

from pathlib import Path

import numpy as np

from prt_core.bake import Bake, BakeSettings, bake_steps
from prt_core.bake.compress import CompressSettings, compress_steps
from prt_core.bake.images import expect_image, image_steps
from prt_core.bake.load import load
from prt_core.bake.visibility import chosen_method
from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_flag,
    expect_kind,
    expect_path,
    system_errors,
)
from prt_core.light import EnvironmentMap
from prt_core.light.environment import expect_strength, named_images, read_environment
from prt_core.relight.relighter import Relighter, on_texels
from prt_core.runtime.files import expect_output
from prt_core.runtime.progress import Errands, beside, run, steps_beside
from prt_core.scene import Scene, mesh_digests
from prt_core.store import BakeStore, remove_compressed


def bake(
    blend,
    output,
    *,
    objects=None,
    two_sided=(),
    restart=False,
    report=None,
    camera_pixels=None,
    pixel_samples=2,
    geometry_image=None,
    parametrisation="auto",
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
    restart : bool or "changed"
        Begin anew whatever `output` holds; or only where that is of another scene or settings.
    report : callable(Progress), optional
    camera_pixels : (int, int), optional
        Bake what the scene's camera sees as well, width x height pixels.
    pixel_samples : int
        Points along each side of such a pixel.
    geometry_image : (str, int), optional
        Bake a square image of an object's surface as well: its name, and texels a side.
    parametrisation : {"auto", "uv", "sphere"}
        How that surface becomes a square: by its UV map, or, where it is closed and has no
        handles, over the sphere. `auto`: the UV map where there is one.
    **settings
        See `BakeSettings`: resolution, bounces, tolerance, caster, seed, method.

    Returns
    -------
    dict
        The report (see `bake_steps`).

    Raises
    ------
    PRTError
        bpy is missing, the file or a name is wrong, or the store holds something else.
    """
    known = BakeSettings.__dataclass_fields__
    unknown = sorted(set(settings) - set(known))
    expect(not unknown, f"{', '.join(unknown)}: no such setting; there are {', '.join(known)}")
    settings = BakeSettings(**settings)
    output = expect_output("output", output, ".prt", folder=True, made=True)
    image = camera_pixels, pixel_samples, geometry_image, parametrisation
    steps = bake_blend_steps(blend, output, settings, objects, two_sided, restart, image=image)
    return run(steps, report)


def bake_blend_steps(
    blend,
    output,
    settings,
    objects=None,
    two_sided=(),
    restart=False,
    pace=None,
    scene=None,
    strict=True,
    image=(None, 2, None, "auto"),
):
    """`bake` as a generator of `Progress`.

    Parameters
    ----------
    pace : float, optional
        Seconds a step may take (see `bake_steps`).
    scene : bpy.types.Scene, optional
        Where `blend` is None; default: the current one.
    strict : bool
        Whether a name that renders nothing is an error.
    image : tuple
        `camera_pixels`, `pixel_samples`, `geometry_image` and `parametrisation` of `bake`.
    """
    expect_kind("settings", settings, BakeSettings)
    objects = None if objects is None else _names("objects", objects)
    two_sided = _names("two_sided", two_sided)
    if restart != "changed":
        expect_flag("restart", restart)
    expect_image(*image)
    if blend is None:
        import_bpy()
    else:
        open_blend(blend)
    from prt_core.blender.depsgraph import read_camera, read_meshes_steps, say_copies
    from prt_core.blender.identity import origin_of
    from prt_core.blender.lamps import read_lamps
    from prt_core.blender.world import read_world_steps
    from prt_core.sphere import CubeMap

    messages = []
    scene = scene or import_bpy().context.scene
    uid, origin = scene.session_uid, origin_of(scene, Path(output).parent)
    lamps, camera = read_lamps(scene, messages), read_camera(scene)
    try:
        world = yield from read_world_steps(CubeMap(settings.resolution), scene)
    except PRTError as error:
        messages.append(f"{error}; '--light world' is not there for this bake")
        world = None
    meshes = yield from read_meshes_steps(uid, objects, two_sided, messages, strict, pace)
    say_copies(meshes, messages)
    built = yield from beside("scene", Scene.from_meshes, meshes)
    built.messages[:0] = messages
    source = yield from beside("scene", mesh_digests, meshes)
    built = yield from image_steps(built, meshes, camera, settings.caster, *image)
    cube_map, probes = CubeMap(settings.resolution), None
    if chosen_method(settings.method, len(built.points), cube_map.n_directions) != "exhaustive":
        from prt_core.blender.studio import studio_light_steps

        probes = yield from studio_light_steps(cube_map)
    result = yield from bake_steps(
        built, output, settings, lamps, world, camera, source, restart, pace, probes, origin
    )
    return result


def open_blend(path):
    """Open a .blend file in this process's Blender.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    PRTError
        bpy is not installed, or the file cannot be opened.
    """
    path = expect_blend(path)
    bpy = import_bpy()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise PRTError(f"{path}: Blender cannot open it ({reason})") from error


def expect_blend(path):
    """The path of a .blend file that is there.

    Raises
    ------
    PRTError
        It is not, or is something else.
    """
    path = expect_path("scene", path)
    with system_errors(path):
        expect(path.is_file(), f"{path}: there is no such .blend file")
    expect(path.suffix == ".blend", f"{path}: expected a .blend file")
    return path


def _names(what, names):
    """Names of objects, as a list."""
    names = sorted(names) if isinstance(names, set | frozenset) else names
    return expect_all(what, names, str, "objects' names")


def import_bpy():
    """The bpy module, with the core's Blender side loaded.

    Raises
    ------
    PRTError
        It is not installed for this Python.
    """
    try:
        # Makes its ray casters known as well.
        from prt_core.blender import bpy
    except ImportError as error:
        raise PRTError(
            f"bpy: Blender's module cannot be loaded ({error}); pip install 'prt-core[blender]' "
            "or run inside Blender"
        ) from error
    return bpy


def compress_bake(
    bake,
    *,
    method="auto",
    tolerance=None,
    megabytes=None,
    milliseconds=None,
    seed=0,
    lights=None,
    of="auto",
    report=None,
):
    """Compress a bake, so that relighting takes milliseconds; kept beside it in its folder.

    Parameters
    ----------
    bake : str or Path
        `NAME.prt`.
    method : str
        `auto` tries several on a sample; `none` removes the compressed form; or one of
        `prt_core.compress.method_names()`, with settings of its own as NAME:key=value,key=value.
    tolerance, megabytes, milliseconds : float, optional
        Error of relit colours, size, time of a new light that must be kept (see
        `CompressSettings`); default: a tolerance of 0.01.
    seed : int
    lights : dict of str -> EnvironmentMap, or sequence of paths, optional
        Under which it is chosen and measured; default: Blender's own where bpy is there, else
        three plain skies.
    of : {"auto", "points", "image"}
        What is compressed: all points, or the image that was baked; `auto`: the image where there
        is one.
    report : callable(Progress), optional

    Returns
    -------
    dict or None
        What was made and how near it is (see `compress_steps`); None for `none`.

    Raises
    ------
    PRTError
        The bake cannot be read, or a setting is wrong.
    """
    asked = method, tolerance, megabytes, milliseconds, seed
    return run(compress_bake_steps(bake, *asked, lights=lights, of=of), report)


def compress_bake_steps(
    bake,
    method="auto",
    tolerance=None,
    megabytes=None,
    milliseconds=None,
    seed=0,
    lights=None,
    of="auto",
):
    """`compress_bake` as a generator of `Progress`; images are read at the first step."""
    if isinstance(method, str) and method == "none":
        expect(
            tolerance is megabytes is milliseconds is lights is None,
            "method 'none' removes the compressed form; it takes no tolerance, size, time or "
            "lights",
        )
        path = bake.path if isinstance(bake, Bake) else expect_path("bake", bake)
        remove_compressed(BakeStore(path, "r+"))
        return None
    settings = CompressSettings(method, tolerance, megabytes, milliseconds, seed, of)
    if lights is not None and not isinstance(lights, dict):
        lights = named_images(lights)
    if not isinstance(bake, Bake):
        bake = yield from beside("load", load, expect_path("bake", bake))
    if lights is None:
        lights = _studio_lights()
    steps = compress_steps(bake, settings, lights)
    result = yield from steps_beside(steps, Errands(), "compress")
    return result


def _studio_lights():
    """All environments that come with Blender; None without it."""
    try:
        import_bpy()
    except PRTError:
        return None
    from prt_core.blender.studio import ALL, studio_paths

    try:
        return {name: EnvironmentMap.read(path) for name, path in studio_paths(ALL).items()}
    except PRTError:
        return None


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
    transport="auto",
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
    transport : {"auto", "exact", "compressed"}
        Whether light from far away is relit from the compressed form; `auto`: where the bake has
        one that is its own (see `compress_bake`). Lamps and sharp suns are exact.

    Returns
    -------
    dict of str -> (n_corners, 3) float32
        Linear Rec.709 radiance in Blender's loop order, for each object that receives.
    """
    bake = _loaded(bake)
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
        transport=transport,
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
    transport="auto",
):
    """As `relight`, the radiance of all points, (n_points, 3) float32."""
    relighter = Relighter(_loaded(bake), caster, transport)
    try:
        return relighter.relight(
            read_environment(light),
            rotation=rotation,
            strength=strength,
            sharp_sun=sharp_sun,
            lamps=lamps,
            lamp_samples=lamp_samples,
            bounces=bounces,
        )
    finally:
        relighter.close()


def _loaded(bake):
    return bake if isinstance(bake, Bake) else load(expect_path("bake", bake))


def environment_light(bake, light, rotation=None, strength=1.0):
    """Light on the directions of a bake.

    Parameters
    ----------
    bake : Bake
    light : str, Path, EnvironmentMap, (n_directions, 3) array or None
    rotation : float, (3,) or (3, 3), optional
        See `rotation_matrix`.
    strength : float

    Returns
    -------
    (n_directions, 3) float32, or None
        For any light that `relight` takes.
    """
    expect_kind("bake", bake, Bake, "what `load` returns")
    if light is None:
        return None
    radiance = on_texels(bake, read_environment(light), rotation)
    expect_strength("light", radiance, strength)
    return radiance * np.float32(strength)
