"""The bake of a .blend file, or of an open scene, as a generator: read, refine, bake."""

from dataclasses import asdict
from functools import cache, partial

from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.distribute import distribute_steps
from prt_core.bake.earlier import earlier_of, has_form
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.plan import plan_steps
from prt_core.bake.refine import refine_meshes_steps
from prt_core.bake.visibility import chosen_method
from prt_core.blender_access import import_bpy, open_blend
from prt_core.errors import PRTError, expect, expect_all, expect_flag, expect_kind
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.main_thread import each_in_thread
from prt_core.sampling import RefineSettings
from prt_core.scene import Scene, mesh_digests
from prt_core.scene.remarks import grouped

_WITHOUT_FORM = (
    "the compressed form of the bake that was here is gone with it; 'prt compress' or Compress in "
    "the panel makes one of this"
)


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
    image=None,
    pictures=None,
    refine=None,
    memory=None,
    plan=False,
    cluster=None,
    reuse=None,
    update=False,
    only=None,
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
    image : ImageSettings, optional
    pictures : Pictures, optional
        See `bake_steps`.
    refine : RefineSettings, optional
        Default: meshes are baked as they are.
    memory : float, optional
        See `bake_steps`.
    plan : bool
        Whether the bake is only planned: then the result is a dict of its `stages`.
    cluster : str or distributed.Client, optional
        By whose workers blocks are computed (see `distribute_steps`).
    reuse, update, only
        See `bake`.
    """
    expect_kind("settings", settings, BakeSettings)
    objects = None if objects is None else _names("objects", objects)
    two_sided = _names("two_sided", two_sided)
    if restart != "changed":
        expect_flag("restart", restart)
    only = None if only is None else _names("only", only)
    expect(
        not (plan or cluster is not None) or (reuse is None and not update and only is None),
        "reuse: blocks of work are computed without an earlier bake; leave out reuse, update and "
        "only, or plan and dask",
    )
    reuse, restart = earlier_of(output, restart, reuse, update)
    image = ImageSettings() if image is None else expect_kind("image", image, ImageSettings)
    if refine is not None:
        expect_kind("refine", refine, RefineSettings)
        expect(
            image.atlas is None,
            "refine: the UV maps of a lightmap belong to the meshes as they are; bake it by itself",
        )
    messages = []
    if blend is None:
        import_bpy()
    else:
        messages += open_blend(blend)
    from prt_core.blender.camera import read_camera, read_cameras
    from prt_core.blender.depsgraph import read_meshes_steps
    from prt_core.blender.identity import origin_now, scene_of
    from prt_core.blender.lamps import lamp_seen, see_lamps, world_left_out
    from prt_core.blender.left_out import say_copies
    from prt_core.blender.studio import studio_images, studio_lights
    from prt_core.blender.unwrap import lightmap_uvs
    from prt_core.blender.view_transform import FILES, view_transform_of
    from prt_core.blender.world import (
        baked_world_steps,
        read_environment,
        world_on_texels_steps,
    )
    from prt_core.sphere import CubeMap

    scene = scene or import_bpy().context.scene
    uid, origin = scene.session_uid, origin_now(scene, expect_store_path("output", output).parent)
    camera, seen = read_camera(scene, messages), []
    cameras, view_transform = read_cameras(scene), view_transform_of(scene, FILES)

    def see_too(depsgraph):
        seen.extend(see_lamps(depsgraph.scene, depsgraph, messages))

    meshes = yield from read_meshes_steps(
        uid, objects, two_sided, messages, strict, pace, see_too, gloss=settings.gloss
    )
    scene = scene_of(uid)
    lamps = [lamp_seen(each, scene, messages) for each in seen]
    messages += world_left_out(lamps)
    world = sky = None
    try:
        light = read_environment(scene, messages)
        suns = [lamp for lamp in lamps if lamp.is_on_texels]
        world = yield from baked_world_steps(CubeMap(settings.resolution), light, suns)
        if refine is not None:
            sky = yield from world_on_texels_steps(CubeMap(settings.resolution), light, [])
        lamps += [] if light is None else light.suns
    except PRTError as error:
        messages.append(f"{error}; '--light world' is not there for this bake")
    say_copies(meshes, messages)
    # A bake is fresh while the meshes that were refined are as they were.
    cube_map, digests = CubeMap(settings.resolution), (mesh_digests, meshes)
    if refine is not None:
        asked = meshes, lamps, sky, refine, settings.caster, pace
        meshes, refinement = yield from refine_meshes_steps(*asked)
        messages.append(str(refinement))
    built, source = yield from each_in_thread("scene", (Scene.from_meshes, meshes), digests)
    built.messages[:] = grouped([*messages, *built.messages], meshes)
    built = yield from image_steps(built, meshes, camera, settings.caster, image, lightmap_uvs)
    lights = None
    method = chosen_method(settings.method, len(built.points), cube_map.n_directions)
    if settings.gloss or method != "exhaustive":
        # Where they are Blender tells here; they are read when a certificate first asks for them.
        lights = cache(partial(studio_lights, studio_images(), cube_map))
    if plan or cluster is not None:
        stages = yield from plan_steps(
            built, output, settings, lamps, world, camera, source, lights, origin, cameras, memory,
            finished=cluster is not None, view_transform=view_transform,
        )  # fmt: skip
        if cluster is not None:
            return (yield from distribute_steps(output, cluster, memory))
        return {"stages": [asdict(stage) for stage in stages]}
    had_form = has_form(output)
    result = yield from bake_steps(
        built, output, settings, lamps, world, camera, source, restart, pace, lights, origin,
        cameras, pictures, memory, reuse, only, view_transform,
    )  # fmt: skip
    if had_form and not has_form(output):
        result = {**result, "messages": [*result["messages"], _WITHOUT_FORM]}
    return result


def _names(what, names):
    """Names of objects, as a list."""
    names = sorted(names) if isinstance(names, set | frozenset) else names
    return expect_all(what, names, str, "objects' names")
