"""Images baked beside the meshes: what a camera sees, or the texels of an object's surface."""

from prt_core.errors import expect
from prt_core.progress import Progress, beside
from prt_core.rays import make_caster
from prt_core.scene import geometry_layout, with_camera_image, with_geometry_image


def image_steps(
    scene, meshes, camera, caster, camera_pixels, pixel_samples, geometry_image,
    parametrisation="auto",
):  # fmt: skip
    """A scene with the points of an image; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    meshes : sequence of Mesh
        What it was made of.
    camera : dict or None
        See `camera_rays`.
    caster : str
        See `make_caster`.
    camera_pixels : (int, int) or None
        Width and height of what the camera sees.
    pixel_samples : int
        Points along each side of a camera's pixel.
    geometry_image : (str, int) or None
        An object, by its name in the bake, and texels along each side.
    parametrisation : {"auto", "uv", "sphere"}
        Of the geometry image (see `geometry_layout`).

    Raises
    ------
    PRTError
        There is no camera, no such object, no UV map or surface like a sphere; or both images are
        asked for.
    """
    if camera_pixels is None and geometry_image is None:
        return scene
    expect(
        camera_pixels is None or geometry_image is None,
        "image: a bake holds one; give --camera-pixels or --geometry-image, not both",
    )
    yield Progress("image", 0, 1)
    before = len(scene.points)
    if camera_pixels is not None:
        expect(
            camera is not None, "camera pixels: the scene has no perspective camera; add one to it"
        )
        tracer = scene.make_caster(caster)
        try:
            scene = with_camera_image(scene, tracer, camera, *camera_pixels, pixel_samples)
        finally:
            tracer.close()
    else:
        name, size = geometry_image
        found = [mesh for mesh in meshes if mesh.name == name]
        names = ", ".join(mesh.name for mesh in meshes)
        expect(found, f"geometry image: there is no object '{name}'; there are {names}")
        layout = yield from beside("image", geometry_layout, found[0], parametrisation)
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
