"""`prt compress`: a bake in fewer bytes, relit in milliseconds."""

import json
import sys

from prt_core.bake.report_lines import compressed_lines, gloss_lines, missed, trial_lines
from prt_core.cli.arguments import methods_help, quiet_arguments
from prt_core.cli.show import working
from prt_core.errors import expect


def add_compress(commands):
    """Add `compress` to the commands."""
    compress = commands.add_parser("compress", help="compress a bake, to relight in milliseconds")
    compress.add_argument("bake", help="NAME.prt")
    compress.add_argument(
        "--method", default="auto", metavar="NAME[:key=value,…]",
        help=f"auto tries on a sample: {methods_help()}; transfer for what views show of rough "
        "gloss; none removes what is there",
    )  # fmt: skip
    compress.add_argument(
        "--tolerance", type=float, help="relative error of relit colours (0.01, if nothing else)"
    )
    compress.add_argument("--megabytes", type=float, help="at most so large")
    compress.add_argument("--milliseconds", type=float, help="at most so long for a new light")
    compress.add_argument(
        "--light", nargs="+", metavar="IMAGE",
        help="environments it is chosen and measured under; default: Blender's own",
    )  # fmt: skip
    compress.add_argument(
        "--of", choices=("points", "image"),
        help="what is compressed; default: the image that was baked, where there is one",
    )  # fmt: skip
    compress.add_argument("--seed", type=int, help="of random numbers (0)")
    quiet_arguments(compress)
    compress.set_defaults(run=_compress)


def _compress(options):
    from prt_core import compress

    for name in ("seed", "of"):
        expect(
            options.method != "none" or getattr(options, name) is None,
            f"--{name}: changes nothing with --method none",
        )
    with working(options.quiet or options.json) as bar:
        report = compress(
            options.bake,
            method=options.method,
            tolerance=options.tolerance,
            megabytes=options.megabytes,
            milliseconds=options.milliseconds,
            seed=options.seed or 0,
            lights=options.light,
            of=options.of or "auto",
            report=bar,
        )
    if options.json:
        print(json.dumps({"bake": options.bake, **(report or {"method": "none"})}))
        for line in missed(report) if report else ():
            print(f"prt: {line}", file=sys.stderr)
        return 0
    if report is None:
        print(f"{options.bake}: holds no compressed form any more")
        return 0
    for line in (*trial_lines(report), f"{options.bake}:", *compressed_lines(report)):
        print(line)
    if "gloss" in report:
        print(*gloss_lines(report["gloss"]), sep="\n")
    return 0
