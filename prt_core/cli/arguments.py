"""What several commands take, and what is refused before any work."""

import argparse
import sys
from contextlib import suppress

import numpy as np

from prt_core.blender_access import import_bpy
from prt_core.compress import candidate_names, method_names
from prt_core.errors import PRTError, expect, shown
from prt_core.rays.caster import known_casters
from prt_core.transport import View

_IN_BLENDER = "the scene that is open"


def scene_argument(parser, in_blender):
    """Add the .blend file; inside Blender (`in_blender`) the open one is the default."""
    if in_blender:
        parser.add_argument("scene", nargs="?", help=f".blend; default: {_IN_BLENDER}")
    else:
        parser.add_argument("scene", help=".blend")


def expect_used(options, needed):
    """Refuse options that would change nothing.

    Parameters
    ----------
    options : argparse.Namespace
        None or False where an option was not given.
    needed : dict of str -> (tuple of str, str)
        For an option those of which one must be given as well, and how they are called.
    """
    for name, (others, reason) in needed.items():
        given = getattr(options, name) not in (None, False)
        used = any(getattr(options, other) not in (None, False) for other in others)
        expect(not given or used, f"--{name.replace('_', '-')}: changes nothing without {reason}")


def caster_argument(parser):
    """Add `--caster`."""
    parser.add_argument(
        "--caster", default="auto", choices=("auto", "blender", "bvhtree", "embree"),
        help="who traces rays; auto: Embree where installed, else Blender",
    )  # fmt: skip


def bpy_for_rays(caster, casts=True):
    """Load Blender where its rays are asked for by name, or `auto` may come to them.

    Parameters
    ----------
    caster : str
        Of `--caster`.
    casts : bool
        Whether any rays are cast.
    """
    if caster in ("blender", "bvhtree"):
        import_bpy()
    elif casts and caster == "auto" and "embree" not in known_casters():
        # Where there is neither, who makes the caster says what to install.
        with suppress(PRTError):
            import_bpy()


def methods_help():
    """What can be asked of compressors, for `--method` and `--methods`."""
    tried = candidate_names()
    others = [name for name in method_names() if name not in tried]
    return f"{', '.join(tried)}; by name alone {', '.join(others)}; settings as NAME:key=value,…"


class _Renamed(argparse.Action):
    """Stores what an option is given; by its old name it warns."""

    def __init__(self, option_strings, dest, old, **keywords):
        super().__init__(option_strings, dest, **keywords)
        self._old = old

    def __call__(self, parser, namespace, values, option_string=None):
        """See `argparse.Action`."""
        if option_string == self._old:
            print(f"{option_string} is {self.option_strings[0]} now", file=sys.stderr)
        setattr(namespace, self.dest, values)


def view_transform_argument(parser):
    """Add `--view-transform`."""
    parser.add_argument(
        "--view-transform", choices=("scene", "standard"),
        help="how pictures are shown: as a render of the scene is, with its view transform, look "
        "and exposure (the default), or plain sRGB",
    )  # fmt: skip


def view_transform_asked(options, baked):
    """The `ViewTransform` of `--view-transform`, of a bake or light field; None: plain sRGB."""
    if options.view_transform == "standard":
        return None
    expect(
        options.view_transform is None or baked.view_transform is not None,
        "--view-transform: what was baked does not say how its scene shows colours; bake it again "
        "from its .blend, or leave it out",
    )
    return baked.view_transform


def form_argument(parser):
    """Add `--form`."""
    parser.add_argument(
        "--form", "--transport", action=_Renamed, old="--transport", default="auto",
        choices=("auto", "exact", "compressed"),
        help="what distant light is relit from; auto: the compressed form where it is fresh",
    )  # fmt: skip


def quiet_arguments(parser):
    """Add `--json` and `--quiet`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def bounces(text):
    """A number of bounces; None for auto, "baked" as it is."""
    if text == "auto":
        return None
    if text == "baked":
        return text
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected auto or a number >= 0, got '{text}'")
    return value


def size(text):
    """(width, height) of WIDTHxHEIGHT."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, got '{text}'")
    return int(width), int(height)


def vertices(text):
    """A number of vertices, or a text as 1.5x: so many times those there are."""
    return int(text) if text.isdecimal() else text


def share_named(text):
    """(I, N) of a text as I/N, I from 0 to N - 1.

    Parameters
    ----------
    text : str

    Returns
    -------
    (int, int)

    Raises
    ------
    PRTError
        It is no such text.
    """
    number, slash, of = text.partition("/")
    good = slash and number.isdecimal() and of.isdecimal() and int(number) < int(of)
    expect(good, f"--share: expected I/N with I from 0 to N - 1, as 0/4, got {shown(text)}")
    return int(number), int(of)


def view_named(text, baked):
    """The `View` of 'camera', a camera of the scene by name, or x,y,z; None of None."""
    camera = camera_named(text, baked)
    if camera is not None:
        return View.of_camera(camera)
    return None if text is None else View(place_named(text))


def camera_named(text, baked):
    """The `Camera` of `--view`: 'camera', or a name; None of None, and of a place as x,y,z.

    Parameters
    ----------
    text : str, or None
    baked : Bake or LightField
    """
    if text is None or (text not in baked.cameras and is_place(text)):
        return None
    expect(
        text != "camera" or baked.camera is not None or text in baked.cameras,
        "--view camera: the baked scene has no camera whose lens is followed; give x,y,z",
    )
    try:
        return baked.camera_named(text)
    except PRTError as error:
        raise PRTError(
            f"--view: {str(error).partition(': ')[2]}, or give a place as x,y,z"
        ) from error


def is_place(text):
    """Whether a text is a place as x,y,z."""
    return place_named(text) is not None


def place_named(text):
    """(3,) float64 of x,y,z; None of other texts."""
    try:
        place = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return None
    return place if len(place) == 3 and np.isfinite(place).all() else None
