"""`prt relight`: colours, pictures and .blend files of a bake under a light."""

import argparse
import time
from dataclasses import replace

import numpy as np

from prt_core.blender_access import expect_blend
from prt_core.cli.arguments import (
    bpy_for_rays,
    caster_argument,
    expect_used,
    form_argument,
    is_place,
    size,
    view_transform_argument,
    view_transform_asked,
)
from prt_core.cli.each_light import each_light
from prt_core.cli.lighting import LIGHT_NEEDS, expect_light, lighting_arguments, lighting_of
from prt_core.cli.outputs import (
    baked_for,
    expect_no_input,
    expect_png_bits,
    image_notes,
    write_blend,
    write_pixels,
)
from prt_core.cli.relight_lights import add_lights, relight_lights
from prt_core.cli.relight_view import (
    asked_view,
    how_relit,
    image_of,
    notes_of,
    wants_points,
    write_picture,
)
from prt_core.errors import expect
from prt_core.evaluate.sequence import PictureWriter, frame_path, write_npz
from prt_core.evaluate.view import expect_view
from prt_core.relight.gloss import NO_VIEW
from prt_core.relight.relighter import Relighter
from prt_core.runtime.files import expect_output
from prt_core.scene import Camera

_OUTPUTS = {"output": ".npz", "png": ".png", "image": (".png", ".exr"), "blend": ".blend"}
_NEEDED = {
    "frames": (("turn",), "--turn"),
    "progressive": (("turn",), "--turn"),
    "size": (("png",), "--png"),
    "bits": (("image",), "--image"),
    "view_transform": (("png", "image"), "--png or --image"),
    "scene": (("blend",), "--blend"),
    "attribute": (("blend",), "--blend"),
    "domain": (("blend",), "--blend"),
    **LIGHT_NEEDS,
    "weights": (("lights",), "--lights JSON"),
    "each": (("lights",), "--lights JSON"),
}


def add_relight(commands, in_blender):
    """Add `relight` to the commands."""
    relight = commands.add_parser("relight", help="light a bake")
    relight.add_argument("bake", help="NAME.prt")
    lighting_arguments(relight, several=True)
    relight.add_argument(
        "--apart",
        action="store_true",
        help="outputs of each light by itself: of each --light, of each lamp, of the emission",
    )
    relight.add_argument(
        "--light-only",
        action="store_true",
        help="what surfaces receive, irradiance / pi, without their colour: to multiply with it",
    )
    relight.add_argument(
        "--view", metavar="VIEW",
        help="whom gloss is shown to, of a bake with gloss: 'camera', a camera of the scene by its "
        "name, or a place as x,y,z (--png is seen from the camera, each pixel by itself)",
    )  # fmt: skip
    relight.add_argument("--output", metavar="NPZ", help="colours of each object's corners")
    relight.add_argument("--png", metavar="PNG", help="a picture from the scene's camera")
    relight.add_argument(
        "--image", metavar="PNG",
        help="the image or atlas that was baked; as .exr in linear radiance",
    )  # fmt: skip
    relight.add_argument("--bits", type=int, choices=(8, 16), help="of a channel of its .png (8)")
    relight.add_argument(
        "--turn", type=_frames, metavar="N", help="a whole turn of the light in N numbered files"
    )
    relight.add_argument(
        "--frames", type=_range, metavar="A-B",
        help="only these of --turn, from 1 on, so that several machines share them",
    )  # fmt: skip
    relight.add_argument(
        "--progressive", action="store_true",
        help="each frame of --turn adds what changed most, in a compressed form by haar",
    )  # fmt: skip
    relight.add_argument(
        "--size", type=size, help="of the picture (960 along the longer side of the scene's own)"
    )
    view_transform_argument(relight)
    relight.add_argument("--blend", metavar="BLEND", help="a .blend with the colours")
    relight.add_argument(
        "--scene", metavar="BLEND", help="the baked .blend, to colour a copy of it (for --blend)"
    )
    relight.add_argument("--attribute", help="name of the colour attribute (PRT)")
    relight.add_argument("--domain", choices=("corner", "point"), help="of the colours (corner)")
    add_lights(relight)
    form_argument(relight)
    caster_argument(relight)
    relight.set_defaults(run=_relight, in_blender=in_blender)


def _frames(text):
    if not (text.isdecimal() and 0 < int(text) < 100000):
        raise argparse.ArgumentTypeError(f"expected 1 to 99,999 frames, got '{text}'")
    return int(text)


def _range(text):
    """(first, last) of A-B or A."""
    first, dash, last = text.partition("-")
    good = first.isdecimal() and (last.isdecimal() if dash else True)
    if not (good and 0 < int(first) <= int(last or first)):
        raise argparse.ArgumentTypeError(f"expected A-B or A, frames from 1 on, got '{text}'")
    return int(first), int(last or first)


def _relight(options):
    if options.lights:
        return relight_lights(options)
    options.light, lights = (options.light or [None])[0], options.light
    if options.apart or len(lights or ()) > 1:
        return each_light(options, lights or [], _OUTPUTS, _relight_one, _expect_request)
    return _relight_one(options)


def _relight_one(options):
    lighting = _expect_request(options)
    baked = baked_for(options)
    camera, view = asked_view(options, baked)
    shown_by = view_transform_asked(options, baked)
    expect(
        not options.view_transform or options.png or baked.scene.image.camera,
        "--view-transform: an image that surfaces wear is no picture: renders show it by theirs; "
        "leave it out",
    )
    options.size = options.size or (camera or baked.camera or Camera(np.eye(4), 1)).size()
    if options.turn:
        return _relight_turn(baked, lighting, options, camera, view, shown_by)
    _bpy_for(options)
    start = time.perf_counter()
    relighter, of = Relighter(baked, options.caster, options.form), _of(options)
    radiance = None
    try:
        if wants_points(options, view):
            radiance = relighter.radiance(lighting, of=of, view=view)
            radiance = relighter.received if options.light_only else radiance
            spent = time.perf_counter() - start
        if options.png:
            bpy_for_rays(options.caster)
            pictures = PictureWriter(baked, options.size, options.caster, camera, shown_by)
            write_picture(options.png, pictures, relighter, lighting, view, radiance)
        if radiance is None:
            spent = time.perf_counter() - start
        if options.image:
            pixels = image_of(baked, relighter, lighting, radiance, of, options.light_only)
        how, notes = how_relit(relighter), notes_of(relighter)
    finally:
        relighter.close()
    if options.image:
        image = baked.scene.image
        shown_by = shown_by if image.camera else None
        write_pixels(options.image, pixels, options.bits or 8, view_transform=shown_by)
        notes = [*notes, *image_notes(options.image, pixels, image, shown_by)]
    if of == "image":
        print(f"{options.image}: {_shown(baked, of)} relit {how} in {spent:.2f} s")
        _print_notes(baked, options, notes)
        return 0
    if options.output:
        write_npz(options.output, baked.colours(radiance))
    if options.blend:
        write_blend(baked, baked.colours(radiance), options, lambda: _wear(baked, options))
    written = ", ".join(p for p in _outputs(options).values() if p)
    print(f"{written}: {_shown(baked, of)} relit {how} in {spent:.2f} s")
    _print_notes(baked, options, notes)
    return 0


def _expect_request(options):
    """The `Lighting` that is asked for; defaults are filled in.

    What cannot be done, or would change nothing, is refused before any work.
    """
    outputs = _outputs(options)
    expect(
        any(path is not None for path in outputs.values()),
        "relight: nothing to write; give --output NPZ, --png PNG, --image PNG or --blend BLEND",
    )
    expect_light(options, "relight")
    expect_used(options, _NEEDED)
    expect_png_bits(options)
    expect(
        not options.light_only or options.view is None,
        "--light-only: gloss is no light that is received; leave out --view",
    )
    _fill_in(options)
    lighting = lighting_of(options)
    expect(
        options.form == "auto" or options.light is not None,
        "--form: lamps are always exact; it changes nothing without --light",
    )
    expect(
        not options.progressive or options.form != "exact",
        "--progressive: adds to a compressed form; leave out --form exact",
    )
    expect(
        options.caster == "auto"
        or options.png
        or options.lamps
        or options.sharp_sun
        or options.light == "world",
        "--caster: no ray is cast; it changes nothing without --png, --lamps or --sharp-sun",
    )
    if options.frames:
        expect(
            options.frames[1] <= options.turn,
            f"--frames: --turn {options.turn} has frames 1 to {options.turn}, got "
            f"{options.frames[0]}-{options.frames[1]}",
        )
        expect(
            not options.progressive,
            "--frames: with --progressive a frame adds to the one before; leave out one of them",
        )
    if options.turn:
        expect(
            lighting.is_image and not options.blend,
            "--turn: turns an image's light into numbered files; give --light IMAGE, and --output, "
            "--png or --image",
        )
    if options.png and options.size:
        expect_view(*options.size)
    if options.view is not None:
        expect(
            options.output or options.png or options.blend,
            "--view: an image that was baked is not shown again; give --output, --png or --blend",
        )
        expect(
            not options.png or not is_place(options.view),
            "--view: a picture is seen from the camera; give --view camera with --png, or the "
            "name of another",
        )
    paths = []
    for name, path in outputs.items():
        if path is not None:
            path = frame_path(path, 1) if options.turn else path
            paths.append(expect_output(f"--{name}", path, _OUTPUTS[name]).resolve())
    twice = [path for path in paths if paths.count(path) > 1]
    expect(not twice, f"{twice and twice[0]}: named for two outputs; give each its own")
    expect_no_input(paths, options.light)
    if options.scene:
        scene = expect_blend(options.scene).resolve()
        expect(scene not in paths, f"{options.scene}: would be replaced by its own copy; give "
               "--blend another name")  # fmt: skip
    return lighting


def _fill_in(options):
    expect(
        options.attribute is None or options.attribute.strip(),
        "--attribute: expected a name, got an empty one",
    )
    options.attribute = options.attribute or "PRT"
    options.domain = options.domain or "corner"


def _outputs(options):
    return {name: getattr(options, name) for name in _OUTPUTS}


def _wear(baked, options):
    """The atlas that was written, on the objects of the open scene."""
    if options.image and baked.scene.image.atlas is not None:
        from prt_core.blender.lightmaps import load_lightmap, wear_lightmap

        wear_lightmap(baked.scene, load_lightmap(options.image), kept=False)


def _relight_turn(baked, lighting, options, camera, view, shown_by):
    """A turntable: the light turns once, what the camera sees is traced once."""
    bpy_for_rays(options.caster)
    # What is added to has to be there: the exact way has no state.
    form = "compressed" if options.progressive else options.form
    relighter = Relighter(baked, options.caster, form, options.progressive)
    of = _of(options)
    pictures = PictureWriter(baked, options.size, options.caster, camera, shown_by)
    image_by = shown_by if options.image and baked.scene.image.camera else None
    start, spent = time.perf_counter(), []
    first, last = options.frames or (1, options.turn)
    for frame in range(first - 1, last):
        turn = (options.rotate or 0.0) + 360.0 * frame / options.turn
        lighting = replace(lighting, rotation=turn)
        begun, radiance = time.perf_counter(), None
        if wants_points(options, view):
            radiance = relighter.radiance(lighting, of=of, view=view)
            radiance = relighter.received if options.light_only else radiance
            spent.append(time.perf_counter() - begun)
        if options.image:
            shown = image_of(baked, relighter, lighting, radiance, of, options.light_only)
            path = frame_path(options.image, frame + 1)
            write_pixels(path, shown, options.bits or 8, view_transform=image_by)
        if options.output:
            write_npz(frame_path(options.output, frame + 1), baked.colours(radiance))
        if options.png:
            path = frame_path(options.png, frame + 1)
            write_picture(path, pictures, relighter, lighting, view, radiance)
        if radiance is None:
            spent.append(time.perf_counter() - begun)
    count = last - first + 1
    whole = (time.perf_counter() - start) / count
    path = frame_path(options.png or options.output or options.image, first)
    print(
        f"{path} and on: {count} frames of {_shown(baked, of)} relit "
        f"{how_relit(relighter)}, {whole:.2f} s each, {1e3 * float(np.median(spent)):.1f} ms of "
        "them to relight"
    )
    _print_notes(baked, options, notes_of(relighter))
    return 0


def _print_notes(baked, options, notes):
    if options.png and baked.camera is None and options.view is None:
        notes = [
            *notes,
            "the baked scene has no camera whose lens is followed: seen from the front",
        ]
    if baked.reflections and options.view is None and not options.light_only:
        others = options.output or options.png or options.blend
        notes = [*notes, NO_VIEW] if others else notes
    for note in notes:
        print(f"  note    {note}")


def _bpy_for(options):
    """Blender's rays for shadows where there are no others."""
    casts = options.lamps or options.sharp_sun or options.light == "world"
    bpy_for_rays(options.caster, casts)


def _of(options):
    """What is relit: the image alone, for which its own compressed form will do, or all points.

    That form holds what surfaces make of light: what they receive only points tell.
    """
    alone = options.image and not (options.output or options.png or options.blend)
    return "image" if alone and not options.light_only else "points"


def _shown(baked, of):
    """What was relit, for the line that reports it."""
    if of == "image":
        return f"{baked.scene.image.width} x {baked.scene.image.height} pixels"
    return f"{len(baked.scene.points):,} points"
