"""`prt bench …`: measure on this machine."""

from prt_core.cli.bench_compress import add_bench_compress
from prt_core.cli.bench_gloss import add_bench_gloss
from prt_core.cli.bench_lightfield import add_bench_lightfield
from prt_core.cli.bench_rays import add_bench_rays
from prt_core.cli.bench_sampling import add_bench_sampling


def add_bench(commands, in_blender):
    """Add `bench` and its kinds to the commands."""
    bench = commands.add_parser("bench", help="measure on this machine")
    kinds = bench.add_subparsers(required=True, metavar="WHAT")
    add_bench_rays(kinds, in_blender)
    add_bench_sampling(kinds, in_blender)
    add_bench_compress(kinds, in_blender)
    add_bench_lightfield(kinds)
    add_bench_gloss(kinds)
