"""`prt bench sampling`: ways to sample the visibility against every entry traced."""

from prt_core.cli.arguments import quiet_arguments, scene_argument
from prt_core.cli.bench_scenes import expect_bench, images_named, scene_named, turned
from prt_core.cli.show import show_bench, working
from prt_core.runtime.progress import run
from prt_core.sphere import CubeMap

_METHODS = ("agreement", "huang")


def add_bench_sampling(kinds, in_blender):
    """Add `sampling` to the kinds of `prt bench`."""
    sampling = kinds.add_parser(
        "sampling",
        help="ways to sample the visibility against every entry traced: table, plot, report",
    )
    scene_argument(sampling, in_blender)
    sampling.add_argument(
        "--methods", nargs="+", default=list(_METHODS), metavar="NAME[:key=value,…]",
        help="samplers and settings of theirs (agreement huang)",
    )  # fmt: skip
    sampling.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the report")
    sampling.add_argument("--resolution", type=int, default=32, help="texels along a cube edge")
    sampling.add_argument(
        "--caster", nargs="+", default=["auto"], choices=("auto", "blender", "bvhtree", "embree"),
        help="back-ends, measured one after the other",
    )  # fmt: skip
    sampling.add_argument(
        "--light", nargs="+", metavar="IMAGE", help="environments; default: some of Blender's own"
    )
    sampling.add_argument(
        "--rotate", nargs="+", type=float, default=[0.0, 120.0], help="degrees of each (0 120)"
    )
    sampling.add_argument("--seed", type=int, default=0)
    quiet_arguments(sampling)
    sampling.set_defaults(run=_bench_sampling)


def _bench_sampling(options):
    from prt_core.evaluate.bench.sampling import bench_sampling_steps, parse_method
    from prt_core.evaluate.bench.sampling_report import sampling_report
    from prt_core.evaluate.report import write_report

    expect_bench(options)
    methods = [parse_method(text) for text in options.methods]
    for method in methods:
        method.made_settings(options.seed)
    cube_map = CubeMap(options.resolution)
    rows = []
    with working(options.quiet or options.json) as bar:
        images = images_named(options.light)
        name, scene = scene_named(options.scene)
        lights = turned(images, options.rotate, cube_map)
        for back_end in options.caster:
            caster = scene.make_caster(back_end)
            try:
                steps = bench_sampling_steps(
                    scene, cube_map, caster, methods, lights, name, options.seed
                )
                more, results = run(steps, bar)
                rows += more
                report = sampling_report(scene, cube_map, caster, rows, results, lights)
            finally:
                caster.close()
        page = write_report(options.output, report)
    return show_bench(options, rows, _print_rows, page, images)


def _print_rows(rows):
    width = max(len(row["label"]) for row in rows)
    print(f"{'method':{width}}  back-end  object      entries %  seconds   ratio  matrix L2"
          "  interval           worst point  relit L2")  # fmt: skip
    for row in rows:
        interval = f"{row['interval_low']:.2%} to {row['interval_high']:.2%}"
        relit = "" if row["relit_l2"] is None else f"{row['relit_l2']:.2%}"
        print(
            f"{row['label']:{width}}  {row['back_end']:8}  {row['object'][:10]:10}  "
            f"{row['entries_percent']:9.2f}  {row['seconds']:7.2f}  {row['time_ratio']:6.3f}  "
            f"{row['matrix_l2']:9.2%}  {interval:17}  {row['worst_point']:11.1%}  {relit:>8}"
        )
