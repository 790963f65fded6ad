"""`prt bake | bake-blocks | relight | occlusion | compress | export | info | lightfield | bench`.

Also `python -m prt_core`.
"""

import argparse
import os
import sys

from prt_core.cli.bake import add_bake
from prt_core.cli.bake_blocks import add_bake_blocks
from prt_core.cli.bench import add_bench
from prt_core.cli.compress import add_compress
from prt_core.cli.export import add_export
from prt_core.cli.info import add_info
from prt_core.cli.lightfield import add_lightfield
from prt_core.cli.occlusion import add_occlusion
from prt_core.cli.relight import add_relight
from prt_core.errors import PRTError, system_errors
from prt_core.runtime.cores import keep_to_share
from prt_core.version import __version__

__all__ = ["main"]


def main(argv=None, in_blender=False):
    """Run one command; returns the exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Default: the command line.
    in_blender : bool
        Inside a running Blender: the scene that is open is used where no .blend is named.
    """
    if hasattr(sys.stdout, "reconfigure"):
        # Names of objects may have letters that a terminal has not.
        sys.stdout.reconfigure(errors="backslashreplace")
    parser = _parser(in_blender)
    options = parser.parse_args(argv)
    try:
        with system_errors():
            keep_to_share()
            code = options.run(options) or 0
            # What cannot be printed is known now, and not when Python ends.
            sys.stdout.flush()
        return code
    except PRTError as error:
        _forget_lines()
        if isinstance(error.__cause__, BrokenPipeError):
            # Whoever read the lines has seen enough.
            return 0
        print(f"prt: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("prt: stopped; the same command goes on where it was", file=sys.stderr)
        return 130


def _forget_lines():
    """Lines that could not be printed are not tried again when Python ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message):
        self.exit(2, f"prt: {message}; '{self.prog} --help' tells what there is\n")


def _parser(in_blender):
    parser = _Parser(
        prog="prt", description="Bake how light travels in a scene once, relight it at once."
    )
    parser.add_argument("--version", action="version", version=f"prt {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_bake(commands, in_blender)
    add_bake_blocks(commands)
    add_relight(commands, in_blender)
    add_occlusion(commands, in_blender)
    add_info(commands)
    add_compress(commands)
    add_export(commands)
    add_lightfield(commands, in_blender)
    add_bench(commands, in_blender)
    return parser
