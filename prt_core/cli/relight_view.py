"""Whom `prt relight` shows gloss to, and pictures with it."""

from prt_core.cli.arguments import camera_named, view_named
from prt_core.compress.subject import Subject


def asked_view(options, baked):
    """The `Camera` that pictures are seen from, and the `View` of gloss; None where not asked for.

    A picture of a bake without gloss is only seen from the camera.
    """
    camera = camera_named(options.view, baked)
    if camera is not None and not baked.reflections and not (options.output or options.blend):
        return camera, None
    return camera, view_named(options.view, baked)


def wants_points(options, view):
    """Whether any output shows the radiance of points: a picture with gloss does not."""
    return view is None or bool(options.output or options.blend or options.image)


def image_of(baked, relighter, lighting, radiance, of, light_only=False):
    """The image that was baked, (height, width, 3): with its camera's gloss, where it has some.

    Parameters
    ----------
    baked : Bake
    relighter : Relighter
    lighting : Lighting
    radiance : (height, width, 3) or (n_points, 3) float32
        Of the image, or of points.
    of : {"points", "image"}
        Which.
    light_only : bool
        Whether it is light that points receive, not what they send.

    Returns
    -------
    (height, width, 3) float32
    """
    if of == "image":
        return radiance
    if not light_only and Subject.of_bake(baked, "image").shows_gloss:
        return relighter.radiance(lighting, of="image")
    return baked.image(radiance)


def write_picture(path, pictures, relighter, lighting, view=None, radiance=None):
    """A picture from the camera: of points, or of pixels with gloss where there is a view.

    Parameters
    ----------
    path : str or Path
    pictures : PictureWriter
    relighter : Relighter
    lighting : Lighting
    view : View, optional
    radiance : (n_points, 3) float32, optional
        Of points; needed without a view.
    """
    if view is None:
        pictures.write(path, radiance, background=relighter.sky(lighting))
    else:
        pictures.write_picture(path, relighter.picture(pictures.rays(), lighting))


def notes_of(relighter):
    """What is to be said of a light, and of the last picture."""
    notes, rays = list(relighter.notes), relighter.mirror_rays
    if rays:
        notes.append(f"mirrors are traced for the picture, by {rays:,} rays")
    known = relighter.bake.world_image is not None
    if relighter.lit is not None and relighter.lit.is_world and not known:
        n = relighter.bake.cube_map.resolution
        notes.append(
            f"the baked world is known on 6 x {n} x {n} texels, which gloss shows; an image "
            "(--light IMAGE) is reflected as sharp as it is"
        )
    return notes


def how_relit(relighter):
    """How colours were made, for the line that reports them."""
    gloss = relighter.gloss_used
    gloss = f", gloss by {gloss}" if gloss else ""
    if relighter.used == "exact":
        return f"exactly{gloss}"
    attributes = relighter.compressed().attributes
    return f"compressed ({attributes['method']}, error {attributes['error']:.2%}){gloss}"
