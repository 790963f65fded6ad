"""`prt export`: a bake as what others open."""

from prt_core.cli.export_web import add_web


def add_export(commands):
    """Add `export` to the commands."""
    export = commands.add_parser("export", help="a bake as a web page")
    kinds = export.add_subparsers(required=True, metavar="KIND")
    add_web(kinds)
