"""The light field of a scene or of a bake, from Python."""

from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_transport import TransportCamera
from prt_core.bake.load import load
from prt_core.blender_access import import_bpy, open_blend
from prt_core.errors import expect, expect_all, expect_flag, expect_whole
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.main_thread import each_in_thread, in_thread
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from prt_core.store import expect_store_output


def light_field(
    source,
    output,
    *,
    objects=None,
    two_sided=(),
    grid=None,
    hidden=None,
    lamps=False,
    restart=False,
    report=None,
    plan=False,
    share=None,
    **settings,
):
    """Capture the light field of objects: radiance of their points in all directions.

    Parameters
    ----------
    source : str, Path or None
        A .blend file, rendered by Cycles (Blender 4.5 or later); None: the scene that is open; or
        a bake, NAME.prt, whose transport then gives the field of its diffuse surfaces.
    output : str or Path
        `NAME.slf`.
    objects : sequence of str, optional
        Those that have points. Default: all.
    two_sided : sequence of str
        Objects with points on their backs as well; sheets have them anyway.
    grid : int, optional
        Points at n x n texels of the surface of the one object instead of its vertices: of its UV
        map, or, where it is closed and has none, over the sphere.
    hidden : int, optional
        Points within large triangles, at most; default: half of the others, at least 2,000.
    lamps : bool
        A field of each lamp, of each object that emits and of the world, from the same render.
    restart : bool
        Begin anew whatever `output` holds.
    report : callable(Progress), optional
    plan : bool
        Only put the scene into `output`, which others then capture in shares.
    share : (int, int), optional
        (I, N): capture every N-th block from number I on of what was planned with the same
        arguments. Without a share what is missing is captured, and the light field closed.
    **settings
        See `LightFieldSettings`: angles, samples, tolerance, denoise, seed.

    Returns
    -------
    dict
        The report, or how many `blocks` were planned or captured (see `capture_light_field`).

    Raises
    ------
    PRTError
        bpy is missing or too old, a name is wrong, or the store holds something else.
    """
    known = LightFieldSettings.__dataclass_fields__
    unknown = sorted(set(settings) - set(known))
    expect(not unknown, f"{', '.join(unknown)}: no such setting; there are {', '.join(known)}")
    output = expect_store_output("output", output, ".slf", create=True)
    asked = LightFieldSettings(**settings), objects, two_sided, grid, hidden, lamps, restart
    steps = light_field_steps(source, output, *asked, plan=plan, share=share)
    return run(steps, report)


def light_field_steps(
    source,
    output,
    settings,
    objects=None,
    two_sided=(),
    grid=None,
    hidden=None,
    lamps=False,
    restart=False,
    pace=None,
    scene=None,
    plan=False,
    share=None,
):
    """`light_field` as a generator of `Progress`.

    Parameters
    ----------
    pace : float, optional
        Seconds a step may take, but for renders, then about a second each; default: no limits,
        and renders of some twenty seconds. The bits are the same.
    scene : bpy.types.Scene, optional
        Where `source` is None; default: the current one.
    """
    expect_flag("lamps", lamps)
    if hidden is not None:
        expect_whole("hidden", hidden)
    if grid is not None:
        expect_whole("grid", grid, 1)
    if source is not None and expect_store_path("source", source).suffix == ".prt":
        given = objects is not None or two_sided or grid is not None or hidden is not None
        expect(not given, f"{source}: its points are those of the bake; name none, and no grid")
        bake = yield from in_thread("load", load, source)
        camera = yield from in_thread("light", TransportCamera, bake, lamps)
        steps = capture_light_field(
            bake.scene,
            camera,
            output,
            settings,
            bake.camera,
            bake.origin,
            restart,
            plan=plan,
            share=share,
            cameras=bake.cameras,
            view_transform=bake.view_transform,
        )
        return (yield from steps)
    messages = [] if source is None else list(open_blend(source))
    bpy = import_bpy()
    from prt_core.blender.camera import read_cameras
    from prt_core.blender.identity import origin_now, scene_of
    from prt_core.blender.light_field_scene import light_field_camera, light_field_meshes_steps
    from prt_core.blender.view_transform import FILES, view_transform_of

    scene = scene or bpy.context.scene
    uid, origin = scene.session_uid, origin_now(scene, expect_store_path("output", output).parent)
    objects = None if objects is None else expect_all("objects", objects, str, "objects' names")
    two_sided = expect_all("two_sided", two_sided, str, "objects' names")
    meshes = yield from light_field_meshes_steps(uid, objects, two_sided, lamps, pace)
    (built,) = yield from each_in_thread("scene", (Scene.from_meshes, meshes, hidden))
    messages += built.messages
    built.messages[:] = []
    if grid is not None:
        names = [mesh.name for mesh in meshes if mesh.receives]
        expect(
            len(names) == 1,
            f"grid: is of one object; name one of {', '.join(names)} (--objects)",
        )
        image = ImageSettings(geometry_image=(names[0], grid))
        built = yield from image_steps(built, meshes, None, "auto", image)
        messages += built.messages
    camera, view = light_field_camera(uid, built, lamps, messages)
    scene = scene_of(uid)
    given = view, origin, restart, messages, pace, plan, share, read_cameras(scene)
    shown = view_transform_of(scene, FILES)
    steps = capture_light_field(built, camera, output, settings, *given, shown)
    return (yield from steps)
