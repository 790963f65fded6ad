"""A bake as a web page, from Python."""

from prt_core.bake import Bake
from prt_core.bake.load import load
from prt_core.errors import expect
from prt_core.export.web import WebSettings, write_web_steps
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import run


def export_web(bake, output, *, report=None, **settings):
    """Write a bake as a web page that relights it, and opens from disk without a network.

    Parameters
    ----------
    bake : Bake, str or Path
        From `load`, or its folder.
    output : str or Path
        A folder, which is made, or NAME.html for one file.
    report : callable(Progress), optional
    **settings
        See `WebSettings`: one_file, bits, lights, title, lamp_samples, caster.

    Returns
    -------
    dict
        What was written, and how near its colours are (see `write_web_steps`).

    Raises
    ------
    PRTError
        The bake or a light cannot be read, a setting is wrong, or the output cannot be written.
    """
    return run(export_web_steps(bake, output, **settings), report)


def export_web_steps(bake, output, *, pace=None, **settings):
    """`export_web` as a generator of `Progress`, each of which takes about `pace` seconds."""
    known = WebSettings.__dataclass_fields__
    unknown = sorted(set(settings) - set(known))
    expect(not unknown, f"{', '.join(unknown)}: no such setting; there are {', '.join(known)}")
    settings = WebSettings(**settings)
    if not isinstance(bake, Bake):
        bake = yield from in_thread("load", load, expect_store_path("bake", bake))
    return (yield from write_web_steps(bake, output, settings, pace))
