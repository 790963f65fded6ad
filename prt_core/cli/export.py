"""`prt export`: a bake for other programs."""

from prt_core.cli.export_glb import add_glb
from prt_core.cli.export_web import add_web


def add_export(commands):
    """Add `export` to the commands."""
    export = commands.add_parser("export", help="a bake for other programs")
    kinds = export.add_subparsers(required=True, metavar="KIND")
    add_glb(kinds)
    add_web(kinds)
