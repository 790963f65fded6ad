"""`prt lightfield bake | compress | show | info`: what surfaces look like from any side."""

import argparse
import json
from pathlib import Path

from prt_core.bake.light_field_compress import (
    compress_light_field_steps,
    compressed_light_field,
)
from prt_core.bake.light_field_load import KIND, load_light_field
from prt_core.bake.light_field_report import compressed_field_lines, light_field_lines
from prt_core.blender_access import import_bpy
from prt_core.cli.arguments import quiet_arguments, scene_argument, share_named
from prt_core.cli.lightfield_show import add_show
from prt_core.cli.show import working
from prt_core.errors import expect
from prt_core.lightfield.methods import METHODS
from prt_core.runtime.progress import run
from prt_core.store import BakeStore, compressed_attributes, damage_as_error, expect_store_output


def add_lightfield(commands, in_blender):
    """Add `lightfield` and what it does to the commands."""
    field = commands.add_parser("lightfield", help="what surfaces look like from any side")
    kinds = field.add_subparsers(required=True, metavar="WHAT")
    _add_bake(kinds, in_blender)
    _add_compress(kinds)
    add_show(kinds)
    info = kinds.add_parser("info", help="what a light field holds")
    info.add_argument("field", help="NAME.slf")
    info.add_argument("--json", action="store_true")
    info.set_defaults(run=_info)


def _add_bake(kinds, in_blender):
    bake = kinds.add_parser(
        "bake", help="capture the light field of a .blend by Cycles, or of a bake NAME.prt"
    )
    scene_argument(bake, in_blender)
    bake.add_argument("-o", "--output", help="default: the scene's name with .slf")
    bake.add_argument("--objects", nargs="+", metavar="NAME", help="that have points; default all")
    bake.add_argument(
        "--two-sided", nargs="+", metavar="NAME", default=[],
        help="whose backs have points as well; sheets have them anyway",
    )  # fmt: skip
    bake.add_argument(
        "--angles", type=_angles, default=(32, 16), metavar="ROWSxCOLUMNS",
        help="directions over the hemisphere, as a square (32x16)",
    )  # fmt: skip
    bake.add_argument("--samples", type=int, help="paths of each direction (32)")
    bake.add_argument(
        "--tolerance", type=float,
        help="as many samples as make two seeds agree to this, relative L2; not with --samples",
    )  # fmt: skip
    bake.add_argument("--lamps", action="store_true", help="a field of each light")
    bake.add_argument("--denoise", action="store_true", help="where that keeps the energy")
    bake.add_argument(
        "--grid", type=int, metavar="N", help="points at N x N texels of the one object's surface"
    )
    bake.add_argument(
        "--hidden", type=int, metavar="N", help="points within large triangles, at most"
    )
    bake.add_argument("--seed", type=int, default=0)
    bake.add_argument("--restart", action="store_true", help="replace what the output holds")
    bake.add_argument(
        "--plan", action="store_true",
        help="only put the scene into the output, which several Blenders capture by --share",
    )  # fmt: skip
    bake.add_argument(
        "--share", metavar="I/N",
        help="capture the share with number I (from 0) of N of what was planned with the same "
        "flags; the same line without it then closes the light field",
    )  # fmt: skip
    quiet_arguments(bake)
    bake.set_defaults(run=_bake)


def _add_compress(kinds):
    compress = kinds.add_parser("compress", help="a light field in fewer bytes, beside it")
    compress.add_argument("field", help="NAME.slf")
    compress.add_argument(
        "--method", default="ceob", metavar="NAME[:key=value,…]",
        help=f"{', '.join(METHODS)}; none removes what is there (ceob)",
    )  # fmt: skip
    compress.add_argument(
        "--tolerance", type=float,
        help="error of a direction as a share of the white level (0.02)",
    )  # fmt: skip
    compress.add_argument(
        "--psnr", type=float, help="decibels below the brightest radiance that are reached"
    )
    compress.add_argument("--megabytes", type=float, help="at most so large")
    compress.add_argument("--coefficients", type=int, help="of luma at each point, at most")
    compress.add_argument(
        "--clusters", type=_clusters, default=1, help="auto: as many as make it smallest (1)"
    )
    compress.add_argument(
        "--peak", type=float,
        help="radiance of the brightest lamp, from which decibels are counted (the largest of the "
        "field; with --tolerance the white level)",
    )  # fmt: skip
    compress.add_argument("--seed", type=int, default=0, help="of random numbers (0)")
    quiet_arguments(compress)
    compress.set_defaults(run=_compress)


def _clusters(text):
    if text == "auto":
        return None
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected auto or a number >= 1, got '{text}'")
    return int(text)


def _compress(options):
    steps = compress_light_field_steps(
        options.field, options.method, options.psnr, options.megabytes, options.coefficients,
        options.clusters, options.seed, options.tolerance, options.peak,
    )  # fmt: skip
    with working(options.quiet or options.json) as bar:
        report = run(steps, bar)
    if options.json:
        print(json.dumps({"light_field": options.field, **(report or {"method": "none"})}))
    elif report is None:
        print(f"{options.field}: holds no compressed form any more")
    else:
        print(f"{options.field}:", *compressed_field_lines(report), sep="\n")
    return 0


def _angles(text):
    rows, _, columns = text.partition("x")
    if not (rows.isdecimal() and columns.isdecimal()):
        raise argparse.ArgumentTypeError(f"expected ROWSxCOLUMNS, such as 32x16, got '{text}'")
    return int(rows), int(columns)


def _bake(options):
    from prt_core.api.light_field import light_field

    expect(
        options.samples is None or options.tolerance is None,
        "--tolerance: chooses the samples; leave out --samples",
    )
    name = options.scene
    if name is None:
        name = import_bpy().data.filepath
        expect(options.output or name, "output: the open scene has no file; name one with -o")
    output = options.output if options.output is not None else Path(name).with_suffix(".slf")
    output = expect_store_output("--output", output, ".slf")
    samples = 32 if options.samples is None and options.tolerance is None else options.samples
    more = {} if options.tolerance is None else {"tolerance": options.tolerance}
    with working(options.quiet or options.json) as bar:
        report = light_field(
            options.scene,
            output,
            objects=options.objects,
            two_sided=options.two_sided,
            grid=options.grid,
            hidden=options.hidden,
            lamps=options.lamps,
            restart=options.restart,
            report=bar,
            plan=options.plan,
            share=None if options.share is None else share_named(options.share),
            angles=options.angles,
            samples=samples,
            denoise=options.denoise,
            seed=options.seed,
            **more,
        )
    if options.json:
        print(json.dumps({"light_field": str(output), **report}))
    elif "blocks" in report:
        done = "planned" if options.plan else "captured"
        print(f"{output}: {report['blocks']:,} blocks {done}; the same line without --plan and "
              "--share closes it")  # fmt: skip
    else:
        origin = BakeStore(output).attributes["origin"]
        print(*light_field_lines(output, report, origin=origin), sep="\n")
    return 0


def _info(options):
    store = BakeStore(options.field)
    attributes = store.attributes
    expect(
        attributes.get("kind") == KIND,
        f"{options.field}: is a bake, not a light field; 'prt info' tells what it holds",
    )
    # All of it is read, so that damage is said here and not only where it is used.
    field = load_light_field(options.field) if store.is_complete else None
    if field is not None:
        for _ in field.tables(field.weights()):
            pass
    with damage_as_error(options.field, "its report"):
        if options.json:
            keys = (
                "complete",
                "version",
                "kind",
                "settings",
                "objects",
                "lights",
                "camera",
                "origin",
            )
            found = {key: attributes.get(key) for key in keys}
            print(
                json.dumps({**found, **(attributes.get("report") or {}), "bytes": store.nbytes()})
            )
        elif field is None:
            print(f"{options.field}: not finished; the same 'prt lightfield bake' goes on with it")
        else:
            shown = field.report, field.settings, field.origin
            print(*light_field_lines(options.field, *shown), sep="\n")
            attributes = compressed_attributes(store)
            if attributes is not None:
                compressed_light_field(field)
                print("compressed:", *compressed_field_lines(attributes), sep="\n")
    return 0
