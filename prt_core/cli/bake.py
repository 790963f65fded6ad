"""`prt bake`: a .blend file into NAME.prt."""

import json
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path

import prt_core
from prt_core.bake.images import ATLAS_UV
from prt_core.bake.report_lines import report_lines
from prt_core.blender_access import import_bpy
from prt_core.cli.arguments import (
    bounces,
    caster_argument,
    expect_used,
    quiet_arguments,
    scene_argument,
    size,
    vertices,
)
from prt_core.cli.bake_blocks import finish_planned, say_plan
from prt_core.cli.bake_pictures import BakePictures
from prt_core.cli.show import working
from prt_core.errors import expect
from prt_core.light import EnvironmentMap
from prt_core.runtime.files import expect_output
from prt_core.scene import PARAMETRISATIONS
from prt_core.store import BakeStore, expect_store_output


def add_bake(commands, in_blender):
    """Add `bake` to the commands."""
    bake = commands.add_parser("bake", help="bake a .blend file into NAME.prt")
    scene_argument(bake, in_blender)
    bake.add_argument("-o", "--output", help="default: the scene's name with .prt")
    bake.add_argument("--resolution", type=int, default=32, help="texels along a cube edge (32)")
    bake.add_argument("--objects", nargs="+", metavar="NAME", help="that receive; default all")
    bake.add_argument(
        "--two-sided",
        nargs="+",
        metavar="NAME",
        default=[],
        help="whose backs have points, seen or not",
    )
    bake.add_argument("--bounces", type=bounces, default=None, help="auto or a number (auto)")
    bake.add_argument(
        "--tolerance", type=float, default=1e-2, help="relative error of relit colours (0.01)"
    )
    bake.add_argument(
        "--method", default="auto",
        help="which entries are traced: exhaustive, agreement, huang, or auto, the cheapest that "
        "meets the tolerance",
    )  # fmt: skip
    bake.add_argument(
        "--gloss", action="store_true", help="read materials with their gloss, which views show"
    )
    bake.add_argument(
        "--camera-pixels", type=size, metavar="WxH", help="bake what the camera sees as an image"
    )
    bake.add_argument("--pixel-samples", type=int, help="points along a side of its pixels (2)")
    bake.add_argument(
        "--geometry-image", nargs=2, metavar=("OBJECT", "N"),
        help="bake an image of N x N texels of an object's surface",
    )  # fmt: skip
    bake.add_argument(
        "--parametrisation", choices=PARAMETRISATIONS,
        help="of that surface: its UV map, or the sphere for closed ones; auto: UV where there is",
    )  # fmt: skip
    bake.add_argument(
        "--refine", action="store_true",
        help="split edges where vertices are too few for shadows, and bake the finer meshes",
    )  # fmt: skip
    bake.add_argument(
        "--refine-tolerance", type=float, metavar="T",
        help="relative error that drawing between vertices may make (0.02)",
    )  # fmt: skip
    bake.add_argument(
        "--refine-vertices", type=vertices, metavar="N|1.5x",
        help="of objects that receive, at most: a number, or so many times those there are (1.5x)",
    )  # fmt: skip
    bake.add_argument(
        "--atlas", type=_atlas, metavar="N|WxH",
        help="bake a lightmap: one image of the surfaces of several objects",
    )  # fmt: skip
    bake.add_argument(
        "--atlas-objects",
        nargs="+",
        metavar="NAME",
        help="that are in it; default all that receive",
    )
    bake.add_argument(
        "--atlas-uv", choices=ATLAS_UV,
        help="new: unwrap them (default); packed: their own charts, scaled by area and packed "
        "apart; own: their UV maps as they are",
    )  # fmt: skip
    bake.add_argument("--atlas-margin", type=int, help="texels between packed charts (4)")
    bake.add_argument(
        "--show-png", metavar="PNG",
        help="a picture from the scene's camera, written anew as the bake comes nearer",
    )  # fmt: skip
    bake.add_argument(
        "--show-light", metavar="IMAGE",
        help="of that picture: .exr or .hdr, or 'world' (all that shines in the scene)",
    )  # fmt: skip
    bake.add_argument(
        "--reuse", metavar="OLD.prt",
        help="a bake of the scene as it was: only what has changed since is baked",
    )  # fmt: skip
    bake.add_argument(
        "--update", action="store_true",
        help="the same from what the output holds, which the new bake replaces",
    )  # fmt: skip
    bake.add_argument(
        "--only", nargs="+", metavar="NAME",
        help="with either: objects that are asked again; the others stay as they were",
    )  # fmt: skip
    caster_argument(bake)
    bake.add_argument("--seed", type=int, default=0)
    bake.add_argument("--restart", action="store_true", help="replace what the output holds")
    bake.add_argument(
        "--memory", type=float, metavar="GB",
        help="that the bake may take, beside the scene; default: half of what there is",
    )  # fmt: skip
    bake.add_argument(
        "--plan", action="store_true",
        help="only put the scene into the output, whose blocks 'prt bake-blocks' computes, on any "
        "machine",
    )  # fmt: skip
    bake.add_argument(
        "--finish", action="store_true",
        help="instead of a .blend, NAME.prt that was planned: close it, or say which blocks are "
        "missing (exit code 3)",
    )  # fmt: skip
    bake.add_argument(
        "--dask", metavar="ADDRESS|local:N",
        help="compute blocks by the workers of a Dask cluster that see the output: a scheduler's "
        "address or .json file, or N workers on this machine",
    )  # fmt: skip
    bake.add_argument(
        "--open", action="store_true",
        help="with --finish: that blocks are missing is no failure (exit code 0), for farms that "
        "stop at one",
    )  # fmt: skip
    bake.add_argument(
        "--compute", action="store_true", help="with --finish: compute those that are missing here"
    )
    quiet_arguments(bake)
    bake.set_defaults(run=partial(_bake, bake))


def _geometry_image(words):
    if words is None:
        return None
    name, size = words
    good = name and size.isdecimal()
    expect(good, f"--geometry-image: expected OBJECT N, got {' '.join(words)}")
    return name, int(size)


def _atlas(text):
    """(width, height) of N or WxH."""
    return size(f"{text}x{text}" if text.isdecimal() else text)


_NEEDED = {
    **{f"atlas_{name}": (("atlas",), "--atlas") for name in ("objects", "uv", "margin")},
    "pixel_samples": (("camera_pixels",), "--camera-pixels"),
    "parametrisation": (("geometry_image",), "--geometry-image"),
    "refine_tolerance": (("refine",), "--refine"),
    "refine_vertices": (("refine",), "--refine"),
    "show_light": (("show_png",), "--show-png"),
    "compute": (("finish",), "--finish"),
    "open": (("finish",), "--finish"),
    "only": (("reuse", "update"), "--reuse or --update"),
}


# What '--finish' goes by; all else was said when the bake was planned.
_FINISHING = {"command", "scene", "finish", "compute", "open", "dask", "memory", "json", "quiet"}


def _bake(parser, options):
    expect_used(options, _NEEDED)
    expect(not (options.plan and options.finish), "--plan: ask for one of --plan and --finish")
    if options.finish:
        expect(options.scene is not None, "--finish: expected NAME.prt of 'prt bake --plan'")
        others = [
            name
            for name, value in vars(options).items()
            if name not in {*_FINISHING, "run"} and value != parser.get_default(name)
        ]
        expect(
            not others,
            f"--{''.join(others[:1]).replace('_', '-')}: changes nothing with --finish; the bake "
            "is closed where it is, as it was planned",
        )
        return finish_planned(options)
    samples = 2 if options.pixel_samples is None else options.pixel_samples
    blend = options.scene
    if blend is None:
        name = import_bpy().data.filepath
        expect(options.output or name, "output: the open scene has no file; name one with -o")
    else:
        name = blend
    output = options.output if options.output is not None else Path(name).with_suffix(".prt")
    output = expect_store_output("--output", output, ".prt")
    silent, pictures = options.quiet or options.json, None
    if options.show_png is not None:
        path = expect_output("--show-png", options.show_png, ".png")
        if options.show_light not in (None, "world"):
            # What is wrong with it is said before the bake.
            EnvironmentMap.read(options.show_light)
        pictures = BakePictures(path, options.show_light, options.caster, silent)
    with closing(pictures or ExitStack()), working(silent) as bar:
        report = prt_core.bake(
            blend,
            output,
            objects=options.objects,
            two_sided=options.two_sided,
            restart=options.restart,
            report=bar,
            on_picture=pictures,
            resolution=options.resolution,
            bounces=options.bounces,
            tolerance=options.tolerance,
            caster=options.caster,
            seed=options.seed,
            method=options.method,
            gloss=options.gloss,
            camera_pixels=options.camera_pixels,
            pixel_samples=samples,
            geometry_image=_geometry_image(options.geometry_image),
            parametrisation=options.parametrisation or "auto",
            refine=options.refine,
            refine_tolerance=options.refine_tolerance,
            refine_vertices=options.refine_vertices,
            atlas=options.atlas,
            atlas_objects=options.atlas_objects,
            atlas_uv=options.atlas_uv or "new",
            atlas_margin=4 if options.atlas_margin is None else options.atlas_margin,
            memory=options.memory,
            plan=options.plan,
            dask=options.dask,
            reuse=options.reuse,
            update=options.update,
            only=options.only,
        )
    if options.plan:
        say_plan(options, output, report["stages"])
        return 0
    if options.json:
        print(json.dumps({"bake": str(output), **report}))
    else:
        print(*report_lines(output, report, BakeStore(output).attributes["origin"]), sep="\n")
    return 0
