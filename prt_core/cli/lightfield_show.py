"""`prt lightfield show`: a picture of a light field from any side, its lights dimmed, coloured."""

import time

import numpy as np

from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_view import (
    GREY,
    camera_at,
    field_picture,
    field_toward,
    uncaptured,
    view_of,
)
from prt_core.cli.arguments import (
    bpy_for_rays,
    camera_named,
    caster_argument,
    place_named,
    size,
    view_transform_argument,
    view_transform_asked,
)
from prt_core.errors import PRTError, expect
from prt_core.evaluate import to_display, write_png
from prt_core.evaluate.view import expect_view
from prt_core.relight.emission import emission_of
from prt_core.runtime.files import expect_output
from prt_core.scene import Camera

# Objects that are named of those without a field.
_NAMED = 5


def add_show(kinds):
    """Add `show` to what `lightfield` does."""
    show = kinds.add_parser("show", help="a picture of a light field")
    show.add_argument("field", help="NAME.slf")
    show.add_argument("--png", required=True, metavar="PNG", help="the picture")
    show.add_argument(
        "--view", default="camera", metavar="VIEW",
        help="who looks: 'camera', that of the scene (the default), a camera of it by its name, or "
        "a place as x,y,z, from which the field is looked at",
    )  # fmt: skip
    show.add_argument(
        "--lamps", nargs="+", metavar="NAME=HOW", default=[],
        help="how lights shine that were captured apart: NAME=0.5, NAME=#ff8800, NAME=#ff8800:2 "
        "for a factor, a colour or both; *=0 for all others",
    )  # fmt: skip
    show.add_argument("--exposure", type=float, default=0.0, help="stops (0)")
    show.add_argument("--size", type=size, help="of the picture (as the scene's camera has it)")
    show.add_argument(
        "--form", default="auto", choices=("auto", "exact", "compressed"),
        help="what is shown; auto: the compressed form where there is one",
    )  # fmt: skip
    view_transform_argument(show)
    caster_argument(show)
    show.set_defaults(run=_show)


def _show(options):
    strengths = _strengths(options.lamps)
    output = expect_output("--png", options.png, ".png")
    field = load_light_field(options.field)
    shown_by = view_transform_asked(options, field)
    named = camera_named(options.view, field)
    camera = named or camera_at(field, place_named(options.view))
    width, height = options.size or (named or field.camera or Camera(np.eye(4), 1)).size()
    expect_view(width, height)
    bpy_for_rays(options.caster)
    begun = time.perf_counter()
    radiance, used = field_toward(field, view_of(camera), strengths, options.form)
    spent = time.perf_counter() - begun
    caster = field.scene.make_caster(options.caster, "camera")
    try:
        # As grey at any exposure.
        grey = GREY / 2.0**options.exposure
        picture = field_picture(field, radiance, camera, caster, width, height, grey)
    finally:
        caster.close()
    write_png(output, to_display(picture, shown_by, options.exposure))
    print(f"{output}: {len(field):,} points towards the view in {1e3 * spent:.0f} ms, {used}")
    names = uncaptured(field)
    if names:
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        print(f"not captured, drawn in grey: {', '.join(names[:_NAMED])}{more}")
    return 0


def _strengths(words):
    """Name -> (3,) factors of the words after --lamps."""
    settings = {}
    for word in words:
        name, sign, how = word.rpartition("=")
        expect(
            sign and name and how,
            f"--lamps: expected NAME=HOW, got '{word}'; HOW is a factor, #rrggbb or #rrggbb:factor",
        )
        settings[name] = how
    try:
        parsed = emission_of(settings)
    except PRTError as error:
        raise PRTError(f"--lamps:{str(error).removeprefix('emission:')}") from error
    return {
        name: factor * (np.ones(3) if colour is None else np.asarray(colour, np.float64))
        for name, colour, factor in parsed
    }
