"""A bake, or a light field, as a web page, from Python."""

from prt_core.bake import Bake
from prt_core.bake.light_field_load import LightField, load_light_field
from prt_core.bake.load import load
from prt_core.errors import expect
from prt_core.export.web import WebSettings, write_web_steps
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import run


def export_web(bake, output, *, light_field=None, report=None, **settings):
    """Write a bake as a web page that relights it, and opens from disk without a network.

    Parameters
    ----------
    bake : Bake, LightField, str or Path
        From `load`, or its folder NAME.prt; or a light field, or its folder NAME.slf.
    output : str or Path
        A folder, which is made, or NAME.html for one file.
    light_field : LightField, str or Path, optional
        Shown on the same page beside a bake.
    report : callable(Progress), optional
    **settings
        See `WebSettings`: one_file, bits, lights, sets, title, lamp_samples, caster.

    Returns
    -------
    dict
        What was written, and how near its colours are (see `write_web_steps`).

    Raises
    ------
    PRTError
        The bake or a light cannot be read, a setting is wrong, or the output cannot be written.
    """
    return run(export_web_steps(bake, output, light_field=light_field, **settings), report)


def export_web_steps(bake, output, *, light_field=None, pace=None, **settings):
    """`export_web` as a generator of `Progress`, each of which takes about `pace` seconds."""
    known = WebSettings.__dataclass_fields__
    unknown = sorted(set(settings) - set(known))
    expect(not unknown, f"{', '.join(unknown)}: no such setting; there are {', '.join(known)}")
    settings, field = WebSettings(**settings), light_field
    if isinstance(bake, LightField) or (
        not isinstance(bake, Bake) and expect_store_path("bake", bake).suffix == ".slf"
    ):
        expect(field is None, "light_field: the first argument is one already; name one of them")
        bake, field = None, bake
    elif not isinstance(bake, Bake):
        bake = yield from in_thread("load", load, expect_store_path("bake", bake))
    if field is not None and not isinstance(field, LightField):
        path = expect_store_path("light_field", field)
        field = yield from in_thread("load", load_light_field, path)
    return (yield from write_web_steps(bake, output, settings, pace, field))
