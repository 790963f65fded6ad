"""`prt relight`: colours, pictures and .blend files of a bake under a light."""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import prt_core
from prt_core.blender_access import expect_blend, import_bpy, open_blend
from prt_core.cli.arguments import (
    bounces,
    caster_argument,
    expect_used,
    form_argument,
    size,
    view_named,
)
from prt_core.cli.relight_lights import add_lights, relight_lights
from prt_core.cli.relight_view import bpy_where_needed, notes_of, wants_points, write_picture
from prt_core.cli.show import Hushed
from prt_core.errors import PRTError, expect
from prt_core.evaluate.sequence import PictureWriter, frame_path, write_npz
from prt_core.evaluate.view import expect_view
from prt_core.light import write_image
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from prt_core.runtime.files import expect_output
from prt_core.scene import Camera

_OUTPUTS = {"output": ".npz", "png": ".png", "image": (".png", ".exr"), "blend": ".blend"}
_NEEDED = {
    "progressive": (("turn",), "--turn"),
    "size": (("png",), "--png"),
    "scene": (("blend",), "--blend"),
    "attribute": (("blend",), "--blend"),
    "domain": (("blend",), "--blend"),
    "rotate": (("light",), "--light IMAGE"),
    "sharp_sun": (("light",), "--light IMAGE"),
    "lamp_samples": (("lamps", "sharp_sun"), "--lamps or --sharp-sun"),
    "weights": (("lights",), "--lights JSON"),
    "each": (("lights",), "--lights JSON"),
}
# Flags that are not called as what they fill in of `Lighting`.
_FLAGS = {"rotation": "rotate"}


def add_relight(commands, in_blender):
    """Add `relight` to the commands."""
    relight = commands.add_parser("relight", help="light a bake")
    relight.add_argument("bake", help="NAME.prt")
    relight.add_argument("--light", metavar="IMAGE", help=".exr or .hdr, or 'world'")
    relight.add_argument("--rotate", type=float, help="degrees about z")
    relight.add_argument("--strength", type=float, default=1.0, help="factor on the light (1)")
    relight.add_argument("--exposure", type=float, default=0.0, help="stops, of every output (0)")
    relight.add_argument(
        "--sharp-sun", action="store_true", help="cast the shadow rays of the image's sun"
    )
    relight.add_argument("--lamps", action="store_true", help="add the lamps of the scene")
    relight.add_argument("--lamp-samples", type=int, help="shadow rays a lamp (256)")
    relight.add_argument(
        "--emission", nargs="+", metavar="NAME=HOW",
        help="of materials that emit light: all (default), none, or NAME=2.5, NAME=#ff8800, "
        "NAME=#ff8800:2 for a factor, a colour or both",
    )  # fmt: skip
    relight.add_argument(
        "--bounces", type=bounces, default="baked", help="default: as baked; 0 is direct light"
    )
    relight.add_argument(
        "--view", metavar="VIEW",
        help="whom gloss is shown to, of a bake with gloss: 'camera', or a place as x,y,z (a "
        "picture is seen from the camera: 'camera' with --png, each pixel by itself)",
    )  # fmt: skip
    relight.add_argument("--output", metavar="NPZ", help="colours of each object's corners")
    relight.add_argument("--png", metavar="PNG", help="a picture from the scene's camera")
    relight.add_argument(
        "--image", metavar="PNG", help="the image that was baked; as .exr in linear radiance"
    )
    relight.add_argument(
        "--turn", type=_frames, metavar="N", help="a whole turn of the light in N numbered files"
    )
    relight.add_argument(
        "--progressive", action="store_true",
        help="each frame of --turn adds what changed most, in a compressed form by haar",
    )  # fmt: skip
    relight.add_argument(
        "--size", type=size, help="of the picture (960 along the longer side of the scene's own)"
    )
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


def _relight(options):
    if options.lights:
        return relight_lights(options)
    lighting = _expect_request(options)
    if options.caster in ("blender", "bvhtree") or options.blend:
        import_bpy()
    baked = prt_core.load(options.bake)
    expect(
        not options.image or baked.scene.image is not None,
        "--image: this bake holds none; bake with --camera-pixels or --geometry-image",
    )
    options.size = options.size or (baked.camera or Camera(np.eye(4), 1)).size()
    if options.turn:
        return _relight_turn(baked, lighting, options)
    view = view_named(options.view, baked)
    _bpy_for(options)
    start = time.perf_counter()
    relighter, of = Relighter(baked, options.caster, options.form), _of(options)
    radiance = None
    try:
        if wants_points(options):
            radiance = relighter.radiance(lighting, of=of, view=view)
            spent = time.perf_counter() - start
        if options.png:
            bpy_where_needed()
            pictures = PictureWriter(baked, options.size, options.caster)
            write_picture(options.png, pictures, relighter, lighting, view, radiance)
        if radiance is None:
            spent = time.perf_counter() - start
        how, notes = _how(relighter), notes_of(relighter)
    finally:
        relighter.close()
    if of == "image":
        _write_image(options.image, radiance)
        print(f"{options.image}: {_shown(baked, of)} relit {how} in {spent:.2f} s")
        _print_notes(baked, options, notes)
        return 0
    if options.output:
        write_npz(options.output, baked.colours(radiance))
    if options.image:
        _write_image(options.image, baked.image(radiance))
    if options.blend:
        _write_blend(baked, baked.colours(radiance), options)
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
    expect(
        options.light is not None or options.lamps or options.emission,
        "relight: no light; give --light IMAGE, --light world, --lamps or --emission all",
    )
    expect_used(options, _NEEDED)
    _fill_in(options)
    lighting = _lighting(options)
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
            not options.png or options.view == "camera",
            "--view: a picture is seen from the camera; give --view camera with --png",
        )
    paths = []
    for name, path in outputs.items():
        if path is not None:
            path = frame_path(path, 1) if options.turn else path
            paths.append(expect_output(f"--{name}", path, _OUTPUTS[name]).resolve())
    twice = [path for path in paths if paths.count(path) > 1]
    expect(not twice, f"{twice and twice[0]}: named for two outputs; give each its own")
    if options.scene:
        scene = expect_blend(options.scene).resolve()
        expect(scene not in paths, f"{options.scene}: would be replaced by its own copy; give "
               "--blend another name")  # fmt: skip
    return lighting


def _fill_in(options):
    if options.lamp_samples is None:
        options.lamp_samples = Lighting.lamp_samples
    expect(
        options.attribute is None or options.attribute.strip(),
        "--attribute: expected a name, got an empty one",
    )
    options.attribute = options.attribute or "PRT"
    options.domain = options.domain or "corner"


def _lighting(options):
    """The `Lighting` of the command line; what is wrong with it is said by the names of flags."""
    try:
        return Lighting(
            options.light,
            rotation=options.rotate,
            strength=options.strength,
            sharp_sun=options.sharp_sun,
            lamps=options.lamps,
            lamp_samples=options.lamp_samples,
            bounces=options.bounces,
            exposure=options.exposure,
            emission=_emission(options.emission),
        )
    except PRTError as error:
        field, _, said = str(error).partition(":")
        flag = _FLAGS.get(field, field).replace("_", "-")
        raise PRTError(f"--{flag}:{said}") from error


def _emission(words):
    """What `Lighting` takes of the words after --emission."""
    if words is None or words == ["all"]:
        return words and "all"
    settings = {}
    for word in words:
        name, sign, how = word.rpartition("=")
        if word == "none":
            settings["*"] = 0.0
        elif word != "all":
            expect(
                sign and name and how,
                f"emission: expected all, none or NAME=HOW, got '{word}'; HOW is a factor, "
                "#rrggbb or #rrggbb:factor",
            )
            settings[name] = how
    return settings


def _outputs(options):
    return {name: getattr(options, name) for name in _OUTPUTS}


def _relight_turn(baked, lighting, options):
    """A turntable: the light turns once, what the camera sees is traced once."""
    bpy_where_needed()
    # What is added to has to be there: the exact way has no state.
    form = "compressed" if options.progressive else options.form
    relighter = Relighter(baked, options.caster, form, options.progressive)
    of, view = _of(options), view_named(options.view, baked)
    pictures = PictureWriter(baked, options.size, options.caster)
    start, spent = time.perf_counter(), []
    for frame in range(options.turn):
        turn = (options.rotate or 0.0) + 360.0 * frame / options.turn
        lighting = replace(lighting, rotation=turn)
        begun, radiance = time.perf_counter(), None
        if wants_points(options):
            radiance = relighter.radiance(lighting, of=of, view=view)
            spent.append(time.perf_counter() - begun)
        if options.image:
            shown = radiance if of == "image" else baked.image(radiance)
            _write_image(frame_path(options.image, frame + 1), shown)
        if options.output:
            write_npz(frame_path(options.output, frame + 1), baked.colours(radiance))
        if options.png:
            path = frame_path(options.png, frame + 1)
            write_picture(path, pictures, relighter, lighting, view, radiance)
        if radiance is None:
            spent.append(time.perf_counter() - begun)
    whole = (time.perf_counter() - start) / options.turn
    first = frame_path(options.png or options.output or options.image, 1)
    print(
        f"{first} and on: {options.turn} frames of {_shown(baked, of)} relit "
        f"{_how(relighter)}, {whole:.2f} s each, {1e3 * float(np.median(spent)):.1f} ms of them "
        "to relight"
    )
    _print_notes(baked, options, notes_of(relighter))
    return 0


def _how(relighter):
    """How colours were made, for the line that reports them."""
    if relighter.used == "exact":
        return "exactly"
    attributes = relighter.compressed().attributes
    return f"compressed ({attributes['method']}, error {attributes['error']:.2%})"


def _print_notes(baked, options, notes):
    if options.png and baked.camera is None:
        notes = [
            *notes,
            "the baked scene has no camera whose lens is followed: seen from the front",
        ]
    for note in notes:
        print(f"  note    {note}")


def _bpy_for(options):
    """Blender's rays for shadows where there are no others."""
    casts = options.lamps or options.sharp_sun or options.light == "world"
    if casts and options.caster == "auto":
        bpy_where_needed()


def _of(options):
    """What is relit: the image alone, for which its own compressed form will do, or all points."""
    alone = options.image and not (options.output or options.png or options.blend)
    return "image" if alone else "points"


def _shown(baked, of):
    """What was relit, for the line that reports it."""
    if of == "image":
        return f"{baked.scene.image.width} x {baked.scene.image.height} pixels"
    return f"{len(baked.scene.points):,} points"


def _write_image(path, pixels):
    """Linear pixels as a picture for the eye, or as they are in .exr."""
    if Path(path).suffix.lower() == ".exr":
        write_image(path, pixels)
        return
    from prt_core.evaluate import to_srgb, write_png

    write_png(path, to_srgb(pixels))


def _write_blend(baked, colours, options):
    """Colours on the meshes of the scene that is open, of a named .blend, or on built ones."""
    from prt_core.blender.colours import save_scene, write_all

    bpy = import_bpy()
    with Hushed():
        if options.scene:
            open_blend(options.scene)
        elif not options.in_blender:
            bpy.ops.wm.read_factory_settings(use_empty=True)
        fresh = not options.scene and not options.in_blender
        differs = "" if fresh else _differs(baked)
        write_all(baked.scene, colours, options.attribute, options.domain.upper(), all_copies=fresh)
        save_scene(options.blend)
    if differs:
        print(f"  note    the scene is not the one that was baked ({differs}); bake again")


def _differs(baked):
    """How the open scene differs from the one that was baked, in words; empty where it does not."""
    from prt_core.blender.depsgraph import read_meshes
    from prt_core.scene import changes, mesh_digests

    baked_as = {item.name: item for item in baked.scene.objects}
    meshes = read_meshes(gloss=baked.settings.get("gloss", False))
    for mesh in meshes:
        item = baked_as.get(mesh.name, mesh)
        mesh.receives, mesh.two_sided = item.receives, item.two_sided
    differences = changes(baked.source, mesh_digests(meshes))
    return "" if differences.fresh else str(differences)
