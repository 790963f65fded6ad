"""Images baked beside the meshes: what a camera sees, or the texels of an object's surface."""

from dataclasses import dataclass

from prt_core.errors import expect, expect_kind, expect_one_of, expect_pair, expect_whole, shown
from prt_core.rays import make_caster
from prt_core.runtime.machine import expect_memory
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress
from prt_core.scene import (
    PARAMETRISATIONS,
    geometry_layout,
    with_camera_image,
    with_geometry_image,
)

_MOST_SIDE, _MOST_SAMPLES = 8192, 8
# Bytes of a ray while an image is made: origin, direction, hit, and the point it becomes.
_RAY_BYTES = 300


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

    Raises
    ------
    PRTError
        It cannot be baked so, whatever the scene is; or both images are asked for.
    """

    camera_pixels: tuple | None = None
    pixel_samples: int = 2
    geometry_image: tuple | None = None
    parametrisation: str = "auto"

    def __post_init__(self):
        expect(
            self.camera_pixels is None or self.geometry_image is None,
            "image: a bake holds one; give --camera-pixels or --geometry-image, not both",
        )
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


def image_steps(scene, meshes, camera, caster, settings):
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

    Raises
    ------
    PRTError
        There is no camera, no such object, no UV map or surface like a sphere.
    """
    expect_kind("image", settings, ImageSettings)
    if settings.camera_pixels is None and settings.geometry_image is None:
        return scene
    yield Progress("image", 0, 1)
    before = len(scene.points)
    if settings.camera_pixels is not None:
        size, samples = settings.camera_pixels, settings.pixel_samples
        expect(
            camera is not None, "camera pixels: the scene has no perspective camera; add one to it"
        )
        tracer = scene.make_caster(caster)
        try:
            scene = with_camera_image(scene, tracer, camera, *size, samples)
        finally:
            tracer.close()
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
