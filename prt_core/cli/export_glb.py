"""`prt export glb`: a bake under a light as glTF 2.0, for game engines and browsers."""

import json

import prt_core
from prt_core.api.export import export_glb
from prt_core.cli.arguments import (
    bpy_for_rays,
    caster_argument,
    expect_used,
    form_argument,
    quiet_arguments,
    view_named,
)
from prt_core.cli.lighting import LIGHT_NEEDS, expect_light, lighting_arguments, lighting_of
from prt_core.cli.relight_lights import exposed_lights, refuse_one_light
from prt_core.cli.show import working
from prt_core.errors import expect
from prt_core.export.glb import GLBSettings
from prt_core.export.glb.settings import ENCODINGS, MATERIALS
from prt_core.runtime.files import expect_output

_NEEDED = {
    **LIGHT_NEEDS,
    "components": (("weights",), "--weights"),
    "texels": (("weights",), "--weights"),
}


def add_glb(kinds):
    """Add `glb` to what `export` writes."""
    glb = kinds.add_parser("glb", help="glTF 2.0 binary: objects with their colours")
    glb.add_argument("bake", help="NAME.prt")
    glb.add_argument("-o", "--output", required=True, metavar="GLB", help="NAME.glb")
    lighting_arguments(glb)
    glb.add_argument(
        "--lights", metavar="JSON",
        help="lights by name, as the add-on writes them: their sum, and each beside it for engines "
        "that blend",
    )  # fmt: skip
    glb.add_argument(
        "--view", metavar="VIEW",
        help="whom gloss is shown to, of a bake with gloss: 'camera', or a place as x,y,z",
    )  # fmt: skip
    what = glb.add_mutually_exclusive_group()
    what.add_argument(
        "--albedo", action="store_const", const="albedo", dest="colours",
        help="colours are what surfaces send out (default of unlit materials)",
    )  # fmt: skip
    what.add_argument(
        "--light-only", action="store_const", const="light", dest="colours",
        help="colours are the light that surfaces receive (default of multiplied ones)",
    )  # fmt: skip
    glb.add_argument(
        "--material", choices=MATERIALS, default=GLBSettings.material,
        help="unlit: colours are shown as they are (default); multiplied: by base colours",
    )  # fmt: skip
    glb.add_argument(
        "--colours", choices=ENCODINGS, default=GLBSettings.encoding, dest="encoding",
        help="COLOR_0 in float (default), or in 16 bits",
    )  # fmt: skip
    glb.add_argument(
        "--white", type=float, help="the radiance that is 1 in COLOR_0 (the brightest, at least 1)"
    )
    glb.add_argument(
        "--weights", action="store_true",
        help="weights and clusters of the compressed form (prt compress --method cpca): an engine "
        "relights with them",
    )  # fmt: skip
    glb.add_argument(
        "--components", type=int, help=f"weights of a vertex at most ({GLBSettings.components})"
    )
    glb.add_argument(
        "--texels", type=int, help="along a cube face that weights are relit from (as baked)"
    )
    glb.add_argument(
        "--harmonics", action="store_true", help="nine harmonics a vertex: an engine's low road"
    )
    form_argument(glb)
    caster_argument(glb)
    quiet_arguments(glb)
    glb.set_defaults(run=_export)


def _export(options):
    if options.lights:
        refuse_one_light(options)
    else:
        expect_light(options, "export glb")
    expect_used(options, _NEEDED)
    lighting = None if options.lights else lighting_of(options)
    settings = _settings(options)
    expect_output("--output", options.output, ".glb", create=True)
    expect(
        options.form == "auto" or options.light is not None or options.lights,
        "--form: lamps are always exact; it changes nothing without --light",
    )
    casts = options.lamps or options.sharp_sun or options.light == "world" or options.lights
    bpy_for_rays(options.caster, casts)
    baked = prt_core.load(options.bake)
    lights = exposed_lights(options, baked) if options.lights else None
    view = view_named(options.view, baked)
    with working(options.quiet or options.json) as bar:
        report = export_glb(
            baked,
            options.output,
            lighting,
            lights=lights,
            caster=options.caster,
            form=options.form,
            view=view,
            report=bar,
            **settings,
        )
    if options.json:
        print(json.dumps({"output": options.output, **report}))
        return 0
    print(
        f"{options.output}: {report['objects']} objects, {report['vertices']:,} vertices, "
        f"{report['triangles']:,} triangles, {report['bytes'] / 1e6:.1f} MB; relit "
        f"{'exactly' if report['used'] == 'exact' else 'compressed'}, COLOR_0 times "
        f"{report['scale']:.6g} is {report['colours']}"
    )
    for note in report["notes"]:
        print(f"  note    {note}")
    return 0


def _settings(options):
    """Keywords of `GLBSettings`, checked before any work."""
    given = {name: getattr(options, name) for name in GLBSettings.__dataclass_fields__}
    if given["components"] is None:
        del given["components"]
    GLBSettings(**given)
    return given
