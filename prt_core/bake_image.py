"""Images baked beside the meshes: what a camera sees, or the texels of an object's UV layout."""

from prt_core.errors import expect
from prt_core.progress import Progress
from prt_core.rays import make_caster
from prt_core.scene import atlas_triangles, with_atlas_image, with_camera_image


def image_steps(scene, meshes, camera, caster, camera_pixels, pixel_samples, geometry_image):
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

    Raises
    ------
    PRTError
        There is no camera, no such object or no UV map; or both images are asked for.
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
        tracer = make_caster(caster, scene.vertices, scene.triangles)
        try:
            scene = with_camera_image(scene, tracer, camera, *camera_pixels, pixel_samples)
        finally:
            tracer.close()
    else:
        name, size = geometry_image
        found = [mesh for mesh in meshes if mesh.name == name]
        names = ", ".join(mesh.name for mesh in meshes)
        expect(found, f"geometry image: there is no object '{name}'; there are {names}")
        tracer = make_caster(caster, *atlas_triangles(scene, found[0]))
        try:
            scene = with_atlas_image(scene, tracer, name, size)
        finally:
            tracer.close()
    image = scene.image
    scene.messages.append(
        f"image of {image.width} x {image.height} pixels: {len(scene.points) - before:,} points"
    )
    return scene
