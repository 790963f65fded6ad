"""The calls most people need: bake a .blend, relight a bake, capture a light field."""

from contextlib import suppress

from prt_core.api.bake_blend import bake_blend_steps as bake_blend_steps
from prt_core.api.blocks import finish as finish
from prt_core.api.export import export_glb as export_glb
from prt_core.api.export import export_glb_steps as export_glb_steps
from prt_core.api.export_web import export_web as export_web
from prt_core.api.export_web import export_web_steps as export_web_steps
from prt_core.api.light_field import light_field as light_field
from prt_core.api.light_field import light_field_steps as light_field_steps
from prt_core.api.occlusion import occlusion as occlusion
from prt_core.bake import Bake, BakeSettings
from prt_core.bake.compress import CompressSettings, compress_steps
from prt_core.bake.distribute import expect_cluster
from prt_core.bake.images import ImageSettings
from prt_core.bake.load import load
from prt_core.bake.memory import Memory
from prt_core.bake.pictures import Pictures, handed_out
from prt_core.bake.refine import refine_settings
from prt_core.blender_access import open_blend as open_blend
from prt_core.blender_access import studio_lights
from prt_core.errors import (
    PRTError,
    expect,
    expect_flag,
    expect_kind,
    shown,
)
from prt_core.light.environment import named_images
from prt_core.relight.environments import Environments
from prt_core.relight.lighting import Lighting, lighting_of
from prt_core.relight.relighter import Relighter
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.main_thread import MainThreadCalls, in_thread, steps_in_thread
from prt_core.runtime.progress import run
from prt_core.runtime.renamed import renamed_keyword, warn_renamed
from prt_core.store import BakeStore, expect_store_output, remove_compressed
from prt_core.transport import View


def bake(
    blend,
    output,
    *,
    objects=None,
    two_sided=(),
    restart=False,
    report=None,
    on_picture=None,
    camera_pixels=None,
    pixel_samples=2,
    geometry_image=None,
    parametrisation="auto",
    refine=False,
    refine_tolerance=None,
    refine_vertices=None,
    atlas=None,
    atlas_objects=None,
    atlas_uv="new",
    atlas_margin=4,
    memory=None,
    plan=False,
    dask=None,
    reuse=None,
    update=False,
    only=None,
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
    on_picture : callable(PartialBake), optional
        Called whenever the bake under way knows enough more to be shown: with a `Bake` that
        relights as any does, its `known_percent` and `error`; the last one is the finished bake.
        The bake waits for it; what it raises ends the bake, which goes on when called again.
    camera_pixels : (int, int), optional
        Bake what the scene's camera sees as well, width x height pixels.
    pixel_samples : int
        Points along each side of such a pixel.
    geometry_image : (str, int), optional
        Bake a square image of an object's surface as well: its name, and texels a side.
    parametrisation : {"auto", "uv", "sphere"}
        How that surface becomes a square: by its UV map, or, where it is closed and has no
        handles, over the sphere. `auto`: the UV map where there is one.
    refine : bool
        Split edges of the meshes where vertices are too few for shadows; the bake is then of the
        finer meshes, which stand in for the objects where colours are shown or kept.
    refine_tolerance : float, optional
        Relative error that drawing between vertices may make (0.02).
    refine_vertices : int or str, optional
        Vertices of all objects that receive, at most: a number, or as "1.5x" of those there are,
        which is the default.
    atlas : (int, int), optional
        Bake one image of the surfaces of several objects as well, a lightmap: width x height.
    atlas_objects : sequence of str, optional
        Which; default: all that receive.
    atlas_uv : {"new", "packed", "own"}
        Unwrap them anew; or take their own charts, scaled by area and packed apart; or their UV
        maps as they are.
    atlas_margin : int
        Texels between packed charts.
    memory : float, optional
        Gigabytes that the bake may take, beside the scene; default: half of what there is.
    plan : bool
        Only put the scene and its settings into `output`, whose blocks of work are then computed
        anywhere (see `prt_core.bake.blocks`), and closed by `finish`.
    dask : str or distributed.Client, optional
        Blocks of work are computed by the workers of a Dask cluster, all of which must see
        `output`: "local:N" starts N on this machine; or the address of a scheduler, its .json file,
        or a client.
    reuse : str or Path, optional
        A finished bake of the scene as it was, of the same settings: only what has changed since
        is baked, what it cannot have touched is taken from there. The report's `reused` says what
        was, or why nothing could be.
    update : bool
        The same from what `output` holds, which is replaced once the new bake is finished.
    only : sequence of str, optional
        Objects that are asked again, of those that have changed or see a change; the colours of
        the others stay as they were until they are updated as well.
    **settings
        See `BakeSettings`: resolution, bounces, tolerance, caster, seed, method, gloss.

    Returns
    -------
    dict
        The report (see `bake_steps`); of a plan its `stages`, a list of dicts of name and blocks.

    Raises
    ------
    PRTError
        bpy is missing, the file or a name is wrong, or the store holds something else.
    """
    known = BakeSettings.__dataclass_fields__
    unknown = sorted(set(settings) - set(known))
    expect(not unknown, f"{', '.join(unknown)}: no such setting; there are {', '.join(known)}")
    settings = BakeSettings(**settings)
    output = expect_store_output("output", output, ".prt", create=True)
    image = ImageSettings(
        camera_pixels, pixel_samples, geometry_image, parametrisation, atlas, atlas_objects,
        atlas_uv, atlas_margin,
    )  # fmt: skip
    refined = refine_settings(refine, refine_tolerance, refine_vertices)
    Memory.of(memory)
    if dask is not None:
        expect(not plan, "dask: a plan computes nothing; leave out one of dask and plan")
        expect(restart is False, "restart: workers replace no bake; remove the old one first")
        expect(on_picture is None, "on_picture: what workers compute is not shown; leave it out")
        expect_cluster(dask)
    if expect_flag("plan", plan):
        expect(restart is False, "restart: a plan replaces nothing; remove the old bake first")
        expect(on_picture is None, "on_picture: a plan computes nothing that could be shown")
    pictures = None
    if on_picture is not None:
        expect(callable(on_picture), f"on_picture: expected a function, got {shown(on_picture)}")
        pictures = Pictures()
    steps = bake_blend_steps(
        blend, output, settings, objects, two_sided, restart, image=image, pictures=pictures,
        refine=refined, memory=memory, plan=plan, cluster=dask, reuse=reuse, update=update,
        only=only,
    )  # fmt: skip
    return run(steps if pictures is None else handed_out(steps, pictures, on_picture), report)


def compress(
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


def compress_bake(bake, **keywords):
    """As `compress`: its old name, for one release."""
    warn_renamed("prt_core.compress_bake", "prt_core.compress")
    return compress(bake, **keywords)


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
    """`compress` as a generator of `Progress`; images are read at the first step."""
    if isinstance(method, str) and method == "none":
        expect(
            tolerance is megabytes is milliseconds is lights is None,
            "method 'none' removes the compressed form; it takes no tolerance, size, time or "
            "lights",
        )
        path = bake.path if isinstance(bake, Bake) else expect_store_path("bake", bake)
        remove_compressed(BakeStore(path, "r+"))
        return None
    settings = CompressSettings(method, tolerance, megabytes, milliseconds, seed, of)
    if lights is not None and not isinstance(lights, dict):
        lights = named_images(lights)
    if not isinstance(bake, Bake):
        bake = yield from in_thread("load", load, expect_store_path("bake", bake))
    if lights is None:
        with suppress(PRTError):  # without Blender plain skies stand in
            lights = studio_lights()
    steps = compress_steps(bake, settings, lights)
    result = yield from steps_in_thread(steps, MainThreadCalls(), "compress")
    return result


@renamed_keyword(transport="form")
def relight(bake, light=None, *, caster="auto", form="auto", view=None, **keywords):
    """Colours of a baked scene under a light.

    Parameters
    ----------
    bake : Bake, str or Path
        From `load`, or its folder.
    light : Lighting, or str, Path, EnvironmentMap or (n_directions, 3) array, optional
        All that shines; or the environment: an image, or "world", the light of the baked scene's
        own world.
    caster : str
        For the shadow rays of lamps and sharp suns.
    form : {"auto", "exact", "compressed"}
        Whether light from far away is relit from the compressed form; `auto`: where the bake has
        one that is its own (see `compress`). Lamps and sharp suns are exact.
    view : View or str, optional
        From where a bake with gloss is looked at, or the name of a camera of its scene ("camera":
        its own); default: only what leaves evenly to all sides.
    **keywords
        The other fields of `Lighting`: rotation, strength, sharp_sun, lamps, lamp_strength,
        lamp_samples, bounces, exposure, emission.

    Returns
    -------
    dict of str -> (n_corners, 3) float32
        Linear Rec.709 radiance in Blender's loop order, for each object that receives.
    """
    bake = _loaded(bake)
    asked = {"caster": caster, "form": form, "view": view, **keywords}
    return bake.colours(relight_points(bake, light, **asked))


@renamed_keyword(transport="form")
def relight_points(bake, light=None, *, caster="auto", form="auto", view=None, **keywords):
    """As `relight`, the radiance of all points, (n_points, 3) float32."""
    lighting, bake = lighting_of(light, **keywords), _loaded(bake)
    relighter = Relighter(bake, caster, form)
    try:
        return run(relighter.steps(lighting, view=_view_of(bake, view)))
    finally:
        relighter.close()


def _view_of(bake, view):
    """A `View` as it is; that of a camera of the baked scene by its name."""
    if not isinstance(view, str):
        return view
    try:
        return View.of_camera(bake.camera_named(view))
    except PRTError as error:
        raise PRTError(f"view: {str(error).partition(': ')[2]}") from error


def _loaded(bake):
    return bake if isinstance(bake, Bake) else load(expect_store_path("bake", bake))


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
    return (
        light
        if light is None
        else Environments(bake).on_texels(Lighting(light, rotation, strength))
    )
