"""`prt bench compress`: compressors side by side on one bake."""

import tempfile
from pathlib import Path

from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.load import load
from prt_core.cli.arguments import methods_help, quiet_arguments, scene_argument
from prt_core.cli.bench_scenes import expect_bench, images_named, scene_named, turned
from prt_core.cli.show import show_bench, working
from prt_core.compress import candidate_names, method_from_text
from prt_core.errors import expect
from prt_core.runtime.progress import run


def add_bench_compress(kinds, in_blender):
    """Add `compress` to the kinds of `prt bench`."""
    compress = kinds.add_parser(
        "compress", help="ways to compress a bake, at several budgets: table, plots, report"
    )
    scene_argument(compress, in_blender)
    compress.add_argument(
        "--methods", nargs="+", default=candidate_names(), metavar="NAME[:key=value,…]",
        help=f"of {methods_help()} (all that auto tries)",
    )  # fmt: skip
    compress.add_argument(
        "--budgets", nargs="+", type=int, metavar="N",
        help="budgets: which of each method's settings, 0 the smallest (all)",
    )  # fmt: skip
    compress.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the report")
    compress.add_argument("--resolution", type=int, help="of a scene that is baked (32)")
    compress.add_argument(
        "--light", nargs="+", metavar="IMAGE", help="environments; default: Blender's own eight"
    )
    compress.add_argument(
        "--rotate", nargs="+", type=float, default=[45.0 * turn for turn in range(8)],
        help="degrees of each (eight, evenly)",
    )  # fmt: skip
    compress.add_argument("--seed", type=int, default=0)
    quiet_arguments(compress)
    compress.set_defaults(run=_bench_compress)


def _bench_compress(options):
    from prt_core.evaluate.bench.compress import bench_compress_steps
    from prt_core.evaluate.bench.compress_report import compress_report
    from prt_core.evaluate.report import write_report

    expect_bench(options)
    expect(
        options.budgets is None or min(options.budgets) >= 0,
        f"budgets: expected whole numbers >= 0, got {options.budgets}",
    )
    expect(
        options.resolution is None or not _is_bake(options.scene),
        "--resolution: changes nothing for a bake that is there",
    )
    for name in options.methods:
        method_from_text(name)
    silent = options.quiet or options.json
    with working(silent) as bar, tempfile.TemporaryDirectory() as folder:
        images = images_named(options.light, every=True)
        name, bake = _baked(options, Path(folder), bar)
        lights = turned(images, options.rotate, bake.cube_map)
        evaluators = {}
        steps = bench_compress_steps(
            bake, name, options.methods, lights, options.budgets, options.seed, evaluators
        )
        rows = run(steps, bar)
        caster = bake.make_caster()
        first = next(iter(lights.items()))
        report = compress_report(bake, caster, rows, evaluators, *first, len(lights))
        caster.close()
        page = write_report(options.output, report)
    return show_bench(options, rows, _print_rows, page, images)


def _is_bake(scene):
    return scene is not None and Path(scene).suffix == ".prt"


def _baked(options, folder, bar):
    """(name, Bake): a bake that is there, or one of a scene, made for the occasion."""
    if _is_bake(options.scene):
        return Path(options.scene).stem, load(options.scene)
    resolution = 32 if options.resolution is None else options.resolution
    settings = BakeSettings(resolution=resolution, seed=options.seed)
    name, scene = scene_named(options.scene)
    run(bake_steps(scene, folder / "bench.prt", settings), bar)
    return name, load(folder / "bench.prt")


def _print_rows(rows):
    width = max(len(row["label"]) for row in rows)
    print(f"{'method':{width}}       MB    bits  seconds  ms median   worst   matrix  relit  worst"
          "    seam")  # fmt: skip
    for row in rows:
        if row.get("failure"):
            print(f"{row['label']:{width}}  out: {row['failure']}")
            continue
        seconds = "" if row["seconds"] is None else f"{row['seconds']:.1f}"
        matrix = "" if row["matrix_l2"] is None else f"{row['matrix_l2']:.2%}"
        seam = "" if row["seam"] is None else f"{row['seam']:.1%}"
        print(
            f"{row['label']:{width}}  {row['bytes'] / 1e6:7.1f}  {row['bits_a_coefficient']:6.3f}  "
            f"{seconds:>7}  {row['ms_median']:9.2f}  {row['ms_worst']:6.1f}  {matrix:>7}  "
            f"{row['relit_l2_mean']:.2%}  {row['relit_l2_worst']:.2%}  {seam:>6}"
        )
