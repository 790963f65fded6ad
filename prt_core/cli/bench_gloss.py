"""`prt bench gloss`: forms of view-dependent transport side by side on the points of one bake."""

from pathlib import Path

from prt_core.bake.load import load
from prt_core.cli.arguments import quiet_arguments, view_named
from prt_core.cli.bench_scenes import expect_bench, images_or_skies, turned
from prt_core.cli.show import show_bench, working
from prt_core.errors import expect_whole
from prt_core.runtime.progress import run
from prt_core.scene import auto_camera
from prt_core.transport import View

_ROUGHNESS, _PHONG, _ROTATIONS, _SAMPLE = (0.3, 0.5, 0.7), (10.0,), (0.0, 120.0), 1000
_METHODS = ("dense", "default", "terms", "maps", "harmonics", "triple", "samples")


def add_bench_gloss(kinds):
    """Add `gloss` to the kinds of `prt bench`."""
    bench = kinds.add_parser(
        "gloss",
        help="ways to reflect light towards a view, speed against error: table, plot, report",
    )
    bench.add_argument("bake", metavar="NAME.prt", help="its points and visibility are lit")
    bench.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the report")
    bench.add_argument(
        "--methods", nargs="+", default=list(_METHODS), metavar="NAME",
        help=f"of {', '.join(_METHODS)} (all)",
    )  # fmt: skip
    bench.add_argument(
        "--roughness", nargs="*", type=float, default=list(_ROUGHNESS), metavar="R",
        help="sliders of white GGX lobes (0.3 0.5 0.7)",
    )  # fmt: skip
    bench.add_argument(
        "--phong", nargs="*", type=float, default=list(_PHONG), metavar="N",
        help="exponents of white Phong lobes (10)",
    )  # fmt: skip
    bench.add_argument(
        "--light", nargs="+", metavar="IMAGE",
        help="environments; default: some of Blender's own, plain skies where it is not installed",
    )  # fmt: skip
    bench.add_argument(
        "--rotate", nargs="+", type=float, default=list(_ROTATIONS), help="degrees of each (0 120)"
    )
    bench.add_argument(
        "--view", metavar="VIEW",
        help="camera or x,y,z; default: the bake's camera, or one that sees the whole scene",
    )  # fmt: skip
    bench.add_argument(
        "--sample", type=int, default=_SAMPLE, help=f"points where errors are measured ({_SAMPLE})"
    )
    quiet_arguments(bench)
    bench.set_defaults(run=_bench_gloss, seed=0)


def _bench_gloss(options):
    from prt_core.evaluate.bench.gloss import (
        expect_methods,
        gloss_reflectances,
        gloss_report,
        gloss_steps,
    )
    from prt_core.evaluate.bench.gloss_task import GlossTask
    from prt_core.evaluate.report import write_report

    expect_bench(options)
    expect_whole("--sample", options.sample, 1)
    methods = expect_methods(options.methods)
    lobes = gloss_reflectances(options.roughness, options.phong)
    with working(options.quiet or options.json) as bar:
        bake = load(options.bake)
        images = images_or_skies(options.light)
        view = view_named(options.view, bake) or View.of_camera(
            bake.camera or auto_camera(bake.scene)
        )
        outgoing = view.outgoing(bake.scene.to_world(bake.scene.points.positions))
        lights = turned(images, options.rotate, bake.cube_map)
        task = GlossTask(bake.transport, outgoing, lobes, lights, options.sample)
        rows = run(gloss_steps(task, methods), bar)
        page = write_report(options.output, gloss_report(task, rows, Path(options.bake).stem))
    return show_bench(options, rows, _print_rows, page, images)


def _print_rows(rows):
    width = max(len(row["form"]) for row in rows)
    print(f"{'lobe':10} {'form':{width}}  view us  view ms  light ms  seconds       MB    mean"
          "   worst")  # fmt: skip
    for row in rows:
        print(
            f"{row['reflectance']:10} {row['form']:{width}}  {row['view_us']:7.2f}  "
            f"{row['view_ms']:7.1f}  {row['light_ms']:8.1f}  {row['seconds']:7.1f}  "
            f"{row['megabytes']:7.1f}  {row['l2_mean']:6.2%}  {row['l2_worst']:6.2%}"
        )
    for warning in dict.fromkeys(row["warning"] for row in rows if row["warning"]):
        print(f"  note    {warning}")
