"""`prt bench lightfield`: compressors side by side on light fields."""

from pathlib import Path

from prt_core.bake.light_field_load import load_light_field
from prt_core.cli.arguments import quiet_arguments
from prt_core.cli.show import show_bench, working
from prt_core.errors import expect_number, expect_whole
from prt_core.lightfield.methods import METHODS
from prt_core.runtime.files import expect_output
from prt_core.runtime.progress import run

_COUNTS, _PSNRS = (4, 8, 16, 32), (35.0, 40.0, 45.0)


def add_bench_lightfield(kinds):
    """Add `lightfield` to the kinds of `prt bench`."""
    bench = kinds.add_parser(
        "lightfield", help="ways to compress light fields, at several sizes: table, plots, report"
    )
    bench.add_argument("fields", nargs="+", metavar="NAME.slf")
    bench.add_argument(
        "--methods", nargs="+", default=list(METHODS), metavar="NAME[:key=value,…]",
        help=f"of {', '.join(METHODS)} (all)",
    )  # fmt: skip
    bench.add_argument(
        "--coefficients", nargs="*", type=int, default=_COUNTS, metavar="N",
        help=f"of luma at each point; none: only --psnr ({' '.join(map(str, _COUNTS))})",
    )  # fmt: skip
    bench.add_argument(
        "--psnr", nargs="*", type=float, default=_PSNRS, metavar="DB",
        help="decibels that are reached; none: only --coefficients "
        f"({' '.join(f'{p:g}' for p in _PSNRS)})",
    )  # fmt: skip
    bench.add_argument("--clusters", type=int, default=1, help="of each light's points (1)")
    bench.add_argument(
        "--peak", type=float, help="radiance of the brightest lamp (the largest of the field)"
    )
    bench.add_argument("-o", "--output", required=True, metavar="FOLDER", help="of the report")
    bench.add_argument("--seed", type=int, default=0)
    quiet_arguments(bench)
    bench.set_defaults(run=_bench_lightfield)


def _bench_lightfield(options):
    from prt_core.bake.light_field_bench import (
        bench_light_field_steps,
        light_field_bench_report,
        models_of,
    )
    from prt_core.evaluate.report import expect_plots, write_report

    expect_output("--output", options.output, None, folder=True)
    expect_whole("--clusters", options.clusters, 1)
    if options.peak is not None:
        expect_number("--peak", options.peak, above=0)
    asked = (
        options.methods, options.coefficients, options.psnr, options.clusters, options.peak,
        options.seed,
    )  # fmt: skip
    models_of(*asked)
    expect_plots()
    fields = {path: load_light_field(path) for path in dict.fromkeys(options.fields)}
    rows = []
    with working(options.quiet or options.json) as bar:
        for path, field in fields.items():
            rows += run(bench_light_field_steps(field, Path(path).stem, *asked), bar)
        page = write_report(options.output, light_field_bench_report(rows))
    return show_bench(options, rows, _print_rows, page, {})


def _print_rows(rows):
    names = max(len(row["field"]) for row in rows)
    width = max(len(row["label"]) for row in rows)
    print(f"{'field':{names}}  {'method':{width}}  goal              PSNR   luma  sample"
          "  fixed %  coded %  coded MB  seconds  ms decoded  ms coefficients")  # fmt: skip
    for row in rows:
        head = f"{row['field']:{names}}  {row['label']:{width}}  {row['goal']:15}"
        if row["failure"]:
            print(f"{head}  out: {row['failure']}")
            continue
        decibels = (row[key] for key in ("psnr", "luma_psnr", "psnr_per_sample"))
        psnr, luma, sample = ("none" if v is None else f"{v:.1f}" for v in decibels)
        print(
            f"{head}  {psnr:>5}  {luma:>5}  {sample:>6}  {row['fixed_percent']:7.3f}  "
            f"{row['coded_percent']:7.3f}  {row['coded_bytes'] / 1e6:8.3f}  {row['seconds']:7.1f}"
            f"  {row['decoded_ms']:10.2f}  {row['coefficients_ms']:15.2f}"
        )
