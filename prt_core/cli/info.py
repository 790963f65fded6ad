"""`prt info`: what a bake holds."""

import json

import numpy as np

from prt_core.bake.load import load
from prt_core.bake.report_lines import compressed_lines, object_lines, report_lines
from prt_core.errors import PRTError, expect
from prt_core.evaluate import write_png
from prt_core.evaluate.refined_picture import refined_picture
from prt_core.relight.forms import load_compressed
from prt_core.relight.gloss_form import load_gloss_form
from prt_core.runtime.files import expect_output
from prt_core.scene import Camera
from prt_core.store import GLOSS_FORM, BakeStore, compressed_attributes, damage_as_error


def add_info(commands):
    """Add `info` to the commands."""
    info = commands.add_parser("info", help="what a bake holds")
    info.add_argument("bake", help="NAME.prt")
    info.add_argument("--json", action="store_true")
    info.add_argument(
        "--refined", metavar="PNG", help="a picture of the edges that --refine has split"
    )
    info.set_defaults(run=_info)


def _info(options):
    if options.refined is not None:
        expect_output("--refined", options.refined, ".png")
    store = BakeStore(options.bake)
    # All of it is read, so that damage is said here and not only where it is used.
    bake = load(options.bake) if store.is_complete else None
    if options.refined is not None:
        _write_refined(options.bake, bake, options.refined)
    with damage_as_error(options.bake, "its report"):
        if options.json:
            print(json.dumps(_found(store)))
        elif bake is None:
            print(f"{options.bake}: not finished; the same 'prt bake' goes on with it")
        else:
            print(*list(_lines(options.bake, bake, store)), sep="\n")
    return 0


def _write_refined(path, bake, output):
    expect(bake is not None, f"{path}: not finished; there is no picture of its meshes yet")
    caster = bake.make_caster("auto", "camera")
    try:
        size = (bake.camera or Camera(np.eye(4), 1)).size()
        write_png(output, refined_picture(bake.scene, caster, bake.camera, *size))
    finally:
        caster.close()


def _found(store):
    attributes = store.attributes
    forms = {
        "compressed": compressed_attributes(store),
        "compressed_gloss": compressed_attributes(store, GLOSS_FORM),
    }
    keys = ("complete", "version", "settings", "objects", "lamps", "camera", "origin", "report")
    hidden = ("folder", "values", "arrays")
    return {
        **{key: attributes.get(key) for key in keys},
        **{
            name: form and {key: value for key, value in form.items() if key not in hidden}
            for name, form in forms.items()
        },
        **(attributes.get("report") or {}),
        "bytes": store.nbytes(),
    }


def _lines(path, bake, store):
    yield from report_lines(path, bake.report, bake.origin)
    settings = ", ".join(f"{key} {value}" for key, value in bake.settings.items())
    yield f"  made    by prt {bake.report['versions']['prt_core']} with {settings}"
    yield from object_lines(store.attributes["objects"])
    for lamp in bake.lamps:
        yield f"  lamp    {lamp.name}: {lamp.kind}"
    if bake.view_transform is not None:
        yield f"  shown   by {bake.view_transform}"
    for item in bake.report.get("emitters", ()):
        radiance = " ".join(f"{value:.4g}" for value in item["radiance"])
        yield f"  emitter {item['name']}: radiance {radiance}, {item['area']:.3g} square units"
    attributes = compressed_attributes(store)
    if attributes:
        try:
            form, why = load_compressed(bake)
        except PRTError as error:
            form, why = None, str(error)
        yield "compressed:" if form else f"compressed (not used: {why}):"
        yield from compressed_lines(attributes)
    attributes = compressed_attributes(store, GLOSS_FORM)
    if attributes:
        try:
            form, why = load_gloss_form(bake)
        except PRTError as error:
            form, why = None, str(error)
        yield "gloss:" if form else f"gloss (not used: {why}):"
        yield from compressed_lines(attributes)
