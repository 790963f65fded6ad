"""`prt export web`: a bake as a web page that relights it, a light field, or both."""

import json

from prt_core.cli.arguments import quiet_arguments
from prt_core.cli.show import working


def add_web(commands):
    """Add `web` to the commands of `prt export`."""
    web = commands.add_parser("web", help="a page that relights the bake, opened from disk")
    web.add_argument("bake", help="NAME.prt, or a light field NAME.slf")
    web.add_argument(
        "-o", "--output", required=True, metavar="FOLDER|NAME.html",
        help="a folder, or one file where the name ends in .html",
    )  # fmt: skip
    web.add_argument("--one-file", action="store_true", help="one file in the folder, too")
    web.add_argument(
        "--no-bits", action="store_true", help="small: without visibility bits; suns are soft"
    )
    web.add_argument(
        "--light", nargs="+", metavar="IMAGE",
        help="images of light that the page offers (without any here or in --lights: four of its "
        "own)",
    )  # fmt: skip
    web.add_argument(
        "--lights", nargs="+", metavar="JSON", help="lights by name, as the add-on writes them: a "
        "button each",
    )  # fmt: skip
    web.add_argument(
        "--light-field", metavar="NAME.slf", help="shown on the same page beside the bake"
    )
    web.add_argument("--title", help="of the page (the name of the bake)")
    web.add_argument("--lamp-samples", type=int, default=256, help="shadow rays a lamp (256)")
    web.add_argument(
        "--caster", default="auto", choices=("auto", "embree"),
        help="who traces the rays of lamps; auto: Embree where installed, else Blender",
    )  # fmt: skip
    quiet_arguments(web)
    web.set_defaults(run=_web)


def _web(options):
    from prt_core import export_web

    with working(options.quiet or options.json) as bar:
        report = export_web(
            options.bake,
            options.output,
            light_field=options.light_field,
            one_file=options.one_file or None,
            bits=not options.no_bits,
            lights=options.light,
            sets=options.lights,
            title=options.title,
            lamp_samples=options.lamp_samples,
            caster=options.caster,
            report=bar,
        )
    if options.json:
        print(json.dumps({"bake": options.bake, **report}))
        return 0
    print(f"{report['output']}: {report['bytes'] / 1e6:.1f} MB, {report['points']:,} points")
    for part in filter(None, (report, report.get("field"))):
        _say(part)
    if options.no_bits and "lights" in report:
        print("  note    without visibility bits: suns are soft")
    return 0


def _say(report):
    """Lines of a bake, or of a light field."""
    of = (
        f"({report['worst_light']}), of {report['lights']} turned lights"
        if "lights" in report
        else (f"from {report['sides']} sides, of the light field")
    )
    print(f"  form    {report['form']}")
    print(
        f"  error   {100 * report['error']:.2f} % in the mean, {100 * report['worst']:.2f} % at "
        f"worst {of}"
    )
    for line in report["notes"]:
        print(f"  note    {line}")
