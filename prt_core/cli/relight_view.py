"""Whom `prt relight` shows gloss to, and pictures with it."""

from prt_core.evaluate import to_srgb, write_png


def wants_points(options):
    """Whether any output shows the radiance of points: a picture with gloss does not."""
    return options.view is None or bool(options.output or options.blend or options.image)


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
        write_png(path, to_srgb(relighter.picture(pictures.rays(), lighting)))


def notes_of(relighter):
    """What is to be said of a light, and of the last picture."""
    rays = relighter.mirror_rays
    traced = f"mirrors are traced for the picture, by {rays:,} rays"
    return [*relighter.notes, traced] if rays else list(relighter.notes)
