"""`prt bake | relight | compress | info | bench`: the command line, also `python -m prt_core`."""

import argparse
import json
import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import prt_core
from prt_core.api import read_environment
from prt_core.cli_bench import add_bench
from prt_core.cli_compress import add_compress, transport_argument, used
from prt_core.cli_info import add_info
from prt_core.errors import PRTError, expect
from prt_core.evaluate.sequence import PictureWriter, frame_path, write_npz
from prt_core.light import EnvironmentMap, rotation_matrix
from prt_core.relighter import Relighter
from prt_core.report import report_lines
from prt_core.scene import PARAMETRISATIONS

_IN_BLENDER = "the scene that is open"


def main(argv=None, in_blender=False):
    """Run one command; returns the exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Default: the command line.
    in_blender : bool
        Inside a running Blender: the scene that is open is used where no .blend is named.
    """
    parser = _parser(in_blender)
    options = parser.parse_args(argv)
    try:
        return options.run(options) or 0
    except PRTError as error:
        print(f"prt: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("prt: stopped; the same command goes on where it was", file=sys.stderr)
        return 130


def _parser(in_blender):
    parser = argparse.ArgumentParser(
        prog="prt", description="Bake how light travels in a scene once, relight it at once."
    )
    parser.add_argument("--version", action="version", version=f"prt {prt_core.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    bake = commands.add_parser("bake", help="bake a .blend file into NAME.prt")
    _scene_argument(bake, in_blender)
    bake.add_argument("-o", "--output", help="default: the scene's name with .prt")
    bake.add_argument("--resolution", type=int, default=32, help="texels along a cube edge (32)")
    bake.add_argument("--objects", nargs="+", metavar="NAME", help="that receive; default all")
    bake.add_argument(
        "--two-sided", nargs="+", metavar="NAME", default=[], help="whose backs are lit as well"
    )
    bake.add_argument("--bounces", type=_bounces, default=None, help="auto or a number (auto)")
    bake.add_argument(
        "--tolerance", type=float, default=1e-2, help="relative error of relit colours (0.01)"
    )
    bake.add_argument(
        "--method", default="auto",
        help="which entries are traced: exhaustive, agreement, huang, or auto, the cheapest that "
        "meets the tolerance",
    )  # fmt: skip
    bake.add_argument(
        "--camera-pixels", type=_size, metavar="WxH", help="bake what the camera sees as an image"
    )
    bake.add_argument(
        "--pixel-samples", type=int, default=2, help="points along a side of its pixels (2)"
    )
    bake.add_argument(
        "--geometry-image", nargs=2, metavar=("OBJECT", "N"),
        help="bake an image of N x N texels of an object's surface",
    )  # fmt: skip
    bake.add_argument(
        "--parametrisation", default="auto", choices=PARAMETRISATIONS,
        help="of that surface: its UV map, or the sphere for closed ones; auto: UV where there is",
    )  # fmt: skip
    _caster_argument(bake)
    bake.add_argument("--seed", type=int, default=0)
    bake.add_argument("--restart", action="store_true", help="replace what the output holds")
    _quiet_arguments(bake)
    bake.set_defaults(run=_bake, in_blender=in_blender)

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
    relight.add_argument("--lamp-samples", type=int, default=256, help="shadow rays a lamp (256)")
    relight.add_argument(
        "--bounces", type=_bounces, default="baked", help="default: as baked; 0 is direct light"
    )
    relight.add_argument("--output", metavar="NPZ", help="colours of each object's corners")
    relight.add_argument("--png", metavar="PNG", help="a picture from the scene's camera")
    relight.add_argument("--image", metavar="PNG", help="the image that was baked")
    relight.add_argument(
        "--turn", type=_frames, metavar="N", help="a whole turn of the light in N numbered files"
    )
    relight.add_argument("--size", type=_size, default=(960, 540), help="of the picture (960x540)")
    relight.add_argument("--blend", metavar="BLEND", help="a .blend with the colours")
    relight.add_argument(
        "--scene", metavar="BLEND", help="the baked .blend, to colour a copy of it (for --blend)"
    )
    relight.add_argument("--attribute", default="PRT", help="name of the colour attribute (PRT)")
    relight.add_argument("--domain", choices=("corner", "point"), default="corner")
    transport_argument(relight)
    _caster_argument(relight)
    relight.set_defaults(run=_relight, in_blender=in_blender)

    show = SimpleNamespace(Bar=_Bar, Hushed=_Hushed)
    add_info(commands)
    add_compress(commands, _quiet_arguments, show)
    add_bench(commands, _scene_argument, _quiet_arguments, show, in_blender)
    return parser


def _scene_argument(parser, in_blender):
    if in_blender:
        parser.add_argument("scene", nargs="?", help=f".blend; default: {_IN_BLENDER}")
    else:
        parser.add_argument("scene", help=".blend")


def _caster_argument(parser):
    parser.add_argument(
        "--caster", default="auto", choices=("auto", "blender", "bvhtree", "embree"),
        help="who traces rays; auto: Embree where installed, else Blender",
    )  # fmt: skip


def _quiet_arguments(parser):
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def _bounces(text):
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


def _size(text):
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 0 < int(width) * int(height) < 1 << 28):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, got '{text}'")
    return int(width), int(height)


def _frames(text):
    if not (text.isdigit() and 0 < int(text) < 100000):
        raise argparse.ArgumentTypeError(f"expected a number of frames, got '{text}'")
    return int(text)


class _Bar:
    """Shows `Progress` as one bar a stage, on stderr."""

    def __init__(self, silent):
        self._silent = silent or not sys.stderr.isatty()
        self._stage, self._bar = None, None

    def __call__(self, progress):
        # A total of 0: a call that cannot be cut is at work.
        if self._silent or not progress.total:
            return
        from tqdm import tqdm

        if progress.stage != self._stage or progress.done < self._bar.n:
            self.close()
            self._stage = progress.stage
            self._bar = tqdm(total=progress.total, desc=progress.stage, unit=" points")
        self._bar.update(progress.done - self._bar.n)

    def close(self):
        if self._bar is not None:
            self._bar.close()


class _Hushed:
    """Blender writes its own lines to stdout; keep them off it while `--json` is asked for."""

    def __enter__(self):
        sys.stdout.flush()
        self._kept = os.dup(1)
        os.dup2(2, 1)

    def __exit__(self, *_):
        sys.stdout.flush()
        os.dup2(self._kept, 1)
        os.close(self._kept)


def _geometry_image(words):
    if words is None:
        return None
    expect(words[1].isdigit(), f"--geometry-image: expected OBJECT N, got {' '.join(words)}")
    return words[0], int(words[1])


def _bake(options):
    blend = options.scene
    if blend is None:
        from prt_core.api import import_bpy

        name = import_bpy().data.filepath
        expect(options.output or name, "output: the open scene has no file; name one with -o")
    else:
        name = blend
    output = Path(options.output or Path(name).with_suffix(".prt"))
    bar = _Bar(options.quiet or options.json)
    with _Hushed():
        try:
            report = prt_core.bake(
                blend,
                output,
                objects=options.objects,
                two_sided=options.two_sided,
                restart=options.restart,
                report=bar,
                resolution=options.resolution,
                bounces=options.bounces,
                tolerance=options.tolerance,
                caster=options.caster,
                seed=options.seed,
                method=options.method,
                camera_pixels=options.camera_pixels,
                pixel_samples=options.pixel_samples,
                geometry_image=_geometry_image(options.geometry_image),
                parametrisation=options.parametrisation,
            )
        finally:
            bar.close()
    if options.json:
        print(json.dumps({"bake": str(output), **report}))
    else:
        print(*report_lines(output, report), sep="\n")
    return 0


def _relight(options):
    expect(
        options.output or options.png or options.blend or options.image,
        "relight: nothing to write; give --output NPZ, --png PNG, --image PNG or --blend BLEND",
    )
    expect(
        options.light or options.lamps,
        "relight: no light; give --light IMAGE, --light world or --lamps",
    )
    needs_bpy = options.caster in ("blender", "bvhtree") or options.blend
    if needs_bpy:
        _load_bpy()
    for path, suffix in ((options.output, ".npz"), (options.blend, ".blend")):
        expect(
            path is None or Path(path).suffix == suffix,
            f"{path}: expected a name that ends in {suffix}",
        )
    baked = prt_core.load(options.bake)
    if options.turn:
        return _relight_turn(baked, options)
    _bpy_for(options)
    start = time.perf_counter()
    relighter = Relighter(baked, options.caster, options.transport)
    try:
        radiance = relighter.relight(read_environment(options.light), **_light_options(options))
        spent, how = time.perf_counter() - start, used(relighter)
    finally:
        relighter.close()
    radiance = radiance * np.float32(2.0**options.exposure)
    colours = baked.colours(radiance)
    if options.output:
        write_npz(options.output, colours)
    if options.png:
        _write_png(baked, radiance, options)
    if options.image:
        from prt_core.evaluate import to_srgb, write_png

        write_png(options.image, to_srgb(baked.image(radiance)))
    if options.blend:
        _write_blend(baked, colours, options)
    outputs = options.output, options.png, options.image, options.blend
    written = ", ".join(p for p in outputs if p)
    print(f"{written}: {len(baked.scene.points):,} points relit {how} in {spent:.2f} s")
    return 0


def _relight_turn(baked, options):
    """A turntable: the light turns once, what the camera sees is traced once."""
    expect(
        options.light not in (None, "world") and not options.blend,
        "--turn: turns an image's light into numbered .npz and .png files; give --light IMAGE",
    )
    _bpy_where_needed()
    light = read_environment(options.light)
    relighter = Relighter(baked, options.caster, options.transport)
    pictures = PictureWriter(baked, options.size, options.caster)
    start = time.perf_counter()
    for frame in range(options.turn):
        rotation = (options.rotate or 0.0) + 360.0 * frame / options.turn
        radiance = relighter.relight(light, **{**_light_options(options), "rotation": rotation})
        radiance = radiance * np.float32(2.0**options.exposure)
        if options.output:
            write_npz(frame_path(options.output, frame + 1), baked.colours(radiance))
        if options.png:
            sky = _sky(light, rotation, options)
            pictures.write(frame_path(options.png, frame + 1), radiance, background=sky)
    spent = (time.perf_counter() - start) / options.turn
    first = frame_path(options.png or options.output, 1)
    print(f"{first} and on: {options.turn} frames relit {used(relighter)}, {spent:.2f} s each")
    return 0


def _load_bpy():
    from prt_core.api import import_bpy

    return import_bpy()


def _bpy_for(options):
    """Blender's rays for shadows where there are no others."""
    if (options.lamps or options.sharp_sun) and options.caster == "auto":
        _bpy_where_needed()


def _light_options(options):
    """What `Relighter.relight` takes, from the command line."""
    return {
        "rotation": options.rotate,
        "strength": options.strength,
        "sharp_sun": options.sharp_sun,
        "lamps": options.lamps,
        "lamp_samples": options.lamp_samples,
        "bounces": options.bounces,
    }


def _bpy_where_needed():
    """`auto` may need Blender's rays where Embree is not installed."""
    from prt_core.rays.caster import known_casters

    if "embree" not in known_casters():
        _load_bpy()


def _write_png(baked, radiance, options):
    from prt_core.evaluate import render_view, to_srgb, write_png

    _bpy_where_needed()
    caster = baked.make_caster(options.caster)
    try:
        sky = None
        if options.light and options.light != "world":
            sky = _sky(EnvironmentMap.read(options.light), options.rotate, options)
        picture = render_view(baked, radiance, caster, *options.size, background=sky)
    finally:
        caster.close()
    write_png(options.png, to_srgb(picture))


def _sky(environment, rotation, options):
    """The environment behind the scene, at the exposure of the picture."""
    back = rotation_matrix(rotation)
    factor = np.float32(options.strength * 2.0**options.exposure)
    return lambda directions: environment.sample(directions @ back) * factor


def _write_blend(baked, colours, options):
    """Colours on the meshes of the scene that is open, of a named .blend, or on built ones."""
    from prt_core.api import open_blend
    from prt_core.blender.colours import save_scene, write_all

    bpy = _load_bpy()
    with _Hushed():
        if options.scene:
            open_blend(options.scene)
        elif not options.in_blender:
            bpy.ops.wm.read_factory_settings(use_empty=True)
        fresh = not options.scene and not options.in_blender
        write_all(baked.scene, colours, options.attribute, options.domain.upper(), all_copies=fresh)
        save_scene(options.blend)


if __name__ == "__main__":
    sys.exit(main())
