"""Images baked beside the meshes: what a camera sees, or the texels of objects' surfaces."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_kind,
    expect_one_of,
    expect_pair,
    expect_whole,
    shown,
)
from prt_core.rays import make_caster
from prt_core.rays.caster import known_casters
from prt_core.runtime.machine import expect_memory
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress
from prt_core.scene import (
    PARAMETRISATIONS,
    geometry_layout,
    with_atlas,
    with_camera_image,
    with_geometry_image,
)

_MOST_SIDE, _MOST_SAMPLES = 8192, 8
# Bytes of a ray while an image is made: origin, direction, hit, and the point it becomes.
_RAY_BYTES = 300
# Where the UV maps of an atlas come from.
ATLAS_UV = ("new", "packed", "own")


@dataclass(frozen=True)
class ImageSettings:
    """The image that is baked beside the meshes: one or none.

    Parameters
    ----------
    camera_pixels : (int, int), optional
        Width and height of what the scene's camera sees.
    pixel_samples : int
        Points along each side of such a pixel.
    geometry_image : (str, int), optional
        An object, by its name in the bake, whose surface is one, and texels along each side.
    parametrisation : {"auto", "uv", "sphere"}
        Of the geometry image (see `geometry_layout`).
    atlas : (int, int), optional
        Width and height of one image of the surfaces of several objects.
    atlas_objects : sequence of str, optional
        Which, by their names in the bake; default: all that receive.
    atlas_uv : {"new", "packed", "own"}
        Where it shows them: unwrapped anew; their own charts, scaled by the area of their surface
        and packed apart; or their own UV maps as they are.
    atlas_margin : int
        Texels between charts, where they are packed.

    Raises
    ------
    PRTError
        It cannot be baked so, whatever the scene is; or both images are asked for.
    """

    camera_pixels: tuple | None = None
    pixel_samples: int = 2
    geometry_image: tuple | None = None
    parametrisation: str = "auto"
    atlas: tuple | None = None
    atlas_objects: tuple | None = None
    atlas_uv: str = "new"
    atlas_margin: int = 4

    def __post_init__(self):
        asked = [self.camera_pixels, self.geometry_image, self.atlas]
        expect(
            sum(each is not None for each in asked) < 2,
            "image: a bake holds one; give one of --camera-pixels, --geometry-image and --atlas, "
            "not both",
        )
        expect_one_of("atlas_uv", self.atlas_uv, ATLAS_UV)
        expect_whole("atlas margin", self.atlas_margin, 0, 64)
        if self.atlas_objects is not None:
            names = expect_all("atlas objects", self.atlas_objects, str, "objects' names")
            expect(names, "atlas objects: expected at least one name")
        if self.atlas is not None:
            width, height = expect_pair("atlas", self.atlas, 1, _MOST_SIDE)
            what = f"atlas: {width} x {height} texels"
            expect_memory(what, _RAY_BYTES * width * height, "take fewer")
        samples = expect_whole("pixel samples", self.pixel_samples, 1, _MOST_SAMPLES)
        expect_one_of("parametrisation", self.parametrisation, PARAMETRISATIONS)
        if self.camera_pixels is not None:
            width, height = expect_pair("camera pixels", self.camera_pixels, 1, _MOST_SIDE)
            needed = _RAY_BYTES * width * height * samples**2
            what = f"camera pixels: {width} x {height} with {samples} x {samples} points each"
            expect_memory(what, needed, "take fewer pixels or points")
        if self.geometry_image is not None:
            asked = self.geometry_image
            good = isinstance(asked, list | tuple) and len(asked) == 2
            good = good and isinstance(asked[0], str)
            expect(good, f"geometry image: expected (object, size), got {shown(asked)}")
            size = expect_whole("geometry image: size", asked[1], 1, _MOST_SIDE)
            what = f"geometry image: {size} x {size} texels"
            expect_memory(what, _RAY_BYTES * size**2, "take fewer")

    @property
    def atlas_made(self):
        """How an atlas comes about, for `Atlas.made`."""
        names = None if self.atlas_objects is None else sorted(self.atlas_objects)
        return {"uv": self.atlas_uv, "margin": self.atlas_margin, "objects": names}


def image_steps(scene, meshes, camera, caster, settings, unwrap=None):
    """A scene with the points of an image; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    meshes : sequence of Mesh
        What it was made of.
    camera : Camera or None
    caster : str
        See `make_caster`.
    settings : ImageSettings
    unwrap : callable(meshes, ImageSettings) -> dict of str -> (n_corners, 2), optional
        Makes UV maps for an atlas that is not of the objects' own.

    Raises
    ------
    PRTError
        There is no camera, no such object, no UV map or surface like a sphere.
    """
    expect_kind("image", settings, ImageSettings)
    if settings.camera_pixels is settings.geometry_image is settings.atlas is None:
        return scene
    yield Progress("image", 0, 1)
    before = len(scene.points)
    if settings.camera_pixels is not None:
        size, samples = settings.camera_pixels, settings.pixel_samples
        expect(
            camera is not None,
            "camera pixels: the scene has no camera whose lens is followed; add one",
        )
        tracer = scene.make_caster(caster, "camera")
        try:
            scene = with_camera_image(scene, tracer, camera, *size, samples)
        finally:
            tracer.close()
    elif settings.atlas is not None:
        scene = yield from _atlas_steps(scene, meshes, caster, settings, unwrap)
    else:
        name, size = settings.geometry_image
        named = [mesh for mesh in meshes if mesh.name == name]
        names = ", ".join(mesh.name for mesh in meshes)
        expect(named, f"geometry image: there is no object '{name}'; there are {names}")
        layout = yield from in_thread("image", geometry_layout, named[0], settings.parametrisation)
        if layout.message:
            scene.messages.append(layout.message)
        tracer = make_caster(caster, layout.vertices, layout.triangles)
        try:
            scene = with_geometry_image(scene, tracer, layout, size)
        finally:
            tracer.close()
    image = scene.image
    scene.messages.append(
        f"image of {image.width} x {image.height} pixels: {len(scene.points) - before:,} points"
    )
    return scene


def _atlas_steps(scene, meshes, caster, settings, unwrap):
    names = settings.atlas_objects
    if names is not None:
        there = {mesh.name for mesh in meshes}
        missing = sorted(set(names) - there - {mesh.owner for mesh in meshes})
        expect(
            not missing,
            f"atlas: there is no object {', '.join(map(repr, missing))}; there are "
            f"{', '.join(sorted(there))}",
        )
    if names is None:
        chosen = [mesh for mesh in meshes if mesh.receives]
    else:
        # The name of an object that shows instances means all of them.
        chosen = [mesh for mesh in meshes if {mesh.name, mesh.owner} & set(names)]
    chosen = [mesh for mesh in chosen if len(mesh.solid_triangles())]
    expect(chosen, "atlas: none of its objects has a face with an area")
    own = settings.atlas_uv == "own"
    if own:
        bare = [mesh.name for mesh in chosen if mesh.corner_uv is None]
        expect(
            not bare,
            f"atlas: {', '.join(bare)}: no UV map; unwrap it, or have UV maps made by 'new' or "
            "'packed'",
        )
        maps = {mesh.name: mesh.corner_uv for mesh in chosen}
    else:
        expect(unwrap is not None, "atlas: UV maps are made by Blender, which is not here; use "
               "'own'")  # fmt: skip
        maps = unwrap(chosen, settings)
        yield Progress("image", 0, 1)
    factory = partial(make_caster, caster)
    work = with_atlas, scene, meshes, maps, settings.atlas, factory, settings.atlas_made
    if caster in ("embree", "brute") or (caster == "auto" and "embree" in known_casters()):
        scene = yield from in_thread("image", *work)
    else:
        # Blender's rays are cast where the caller is.
        scene = work[0](*work[1:])
    image = scene.image
    texels = len(np.unique(image.point))
    scene.messages.append(
        f"atlas of {len(maps):,} objects: {texels / image.pixel.size:.0%} of its texels show a "
        "surface, the others the nearest of those"
    )
    return scene
