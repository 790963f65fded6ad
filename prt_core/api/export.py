"""Bakes for other programs, in one call: a .glb under a light."""

from dataclasses import replace
from pathlib import Path

from prt_core.bake import Bake
from prt_core.bake.load import load
from prt_core.errors import expect, expect_all, expect_kind
from prt_core.export.glb import GLBSettings, glb_steps
from prt_core.relight.blend import LightBlend, WeightedLight
from prt_core.relight.environments import Environments
from prt_core.relight.forms import load_compressed
from prt_core.relight.gloss import NO_VIEW
from prt_core.relight.light_file import read_lights
from prt_core.relight.lighting import lighting_of
from prt_core.relight.received import as_received
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.files import expect_output
from prt_core.runtime.main_thread import MainThreadCalls, maybe_in_thread, steps_in_thread
from prt_core.runtime.progress import run

_SETTINGS = tuple(GLBSettings.__dataclass_fields__)


def export_glb(bake, output, light=None, *, lights=None, caster="auto", form="auto", view=None,
               report=None, **keywords):  # fmt: skip
    """Write a baked scene under a light as a .glb: glTF 2.0, for engines and browsers.

    Objects are nodes of their own, with UV maps, normals and materials; COLOR_0 has the colours in
    0 to 1, `_PRT_RADIANCE` as they are. On request there is what an engine relights from.

    Parameters
    ----------
    bake : Bake, str or Path
        From `load`, or its folder.
    output : str or Path
        NAME.glb.
    light : Lighting, or what its environment may be, optional
        As `relight` takes it.
    lights : str or Path, or sequence of WeightedLight, optional
        In place of one light several by name, or their NAME.json (see `read_lights`): colours are
        those of their sum, and vertices have those of each beside it, for engines that blend.
    caster, form, view
        As `relight` takes them.
    report : callable(Progress), optional
    **keywords
        Of `GLBSettings`: colours, material, weights, harmonics, encoding, white, components,
        texels; and the fields of `Lighting`, as `relight` takes them.

    Returns
    -------
    dict
        objects, meshes, vertices, triangles, bytes; colours : "radiance" or "light", what COLOR_0
        times the scale is; scale; used : "exact" or "compressed", what the colours were made
        with; notes : list of str, what is to be said.

    Raises
    ------
    PRTError
        The bake, the light or a setting is wrong, or the file cannot be written.
    """
    settings = {name: keywords.pop(name) for name in _SETTINGS if name in keywords}
    settings, lighting = GLBSettings(**settings), None
    if lights is None:
        lighting = lighting_of(light, **keywords)
    else:
        given = [*keywords, *(["light"] if light is not None else [])]
        expect(not given, f"{given and given[0]}: is of one light; leave it out with 'lights'")
    output = expect_output("output", output, ".glb", create=True)
    bake = bake if isinstance(bake, Bake) else load(expect_store_path("bake", bake))
    if lights is None:
        lights = [WeightedLight("", lighting)]
    elif isinstance(lights, str | Path):
        lights = read_lights(lights, bake)
    return run(export_glb_steps(bake, output, lights, settings, caster, form, view), report)


def export_glb_steps(
    bake,
    output,
    lights,
    settings,
    caster="auto",
    form="auto",
    view=None,
    pace=None,
    blend=None,
):
    """`export_glb` as a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
    output : str or Path
    lights : sequence of WeightedLight
        One without a name, or several by their names.
    settings : GLBSettings
    caster : str
    form : {"auto", "exact", "compressed"}
    view : View, optional
    pace : float, optional
        Seconds a step may take (see `Relighter.steps`).
    blend : LightBlend, optional
        Of the bake, with what it knows already and with its own form; it stays open. Light alone
        needs another.
    """
    expect_kind("bake", bake, Bake, "what `load` returns")
    lights = expect_all("lights", lights, WeightedLight, "WeightedLight values")
    expect(lights, "lights: expected at least one")
    several = len(lights) > 1 or bool(lights[0].name)
    expect_kind("settings", settings, GLBSettings)
    shown, own = bake, blend is None or settings.of_light
    if settings.of_light:
        expect(view is None, "view: light that is received has none; leave out the view")
        expect(
            form != "compressed",
            "form: light without albedo is relit exactly; leave out 'compressed'",
        )
        shown, form = as_received(bake), "exact"
    compressed, why = None, ""
    if settings.weights:
        compressed, why = yield from maybe_in_thread(pace, "weights", load_compressed, bake)
        expect(compressed is not None, f"weights: {why}")
        expect(
            compressed.of == "points",
            "weights: the compressed form is of the image; run 'prt compress --of points' first",
        )
    if view is not None:
        points = bake.scene.points
        view = view.above(bake.scene.to_world(points.positions), points.normals)
    blend, apart = LightBlend(shown, caster, form) if own else blend, []
    try:
        # Each at weight 1 is kept; then the sum costs nothing.
        for light in lights if several else ():
            alone = [replace(each, weight=float(each is light)) for each in lights]
            said = {"name": light.name, "weight": light.weight, **_said(light.lighting)}
            apart.append((said, (yield from blend.steps(alone, pace, view=view))))
        radiance = yield from blend.steps(lights, pace, view=view)
        used = blend.used
        notes = [note for light in lights for note in blend.relighter(light.name).notes]
        if bake.reflections and view is None and not settings.of_light:
            notes.append(NO_VIEW)
    finally:
        if own:
            blend.close()
    light = None
    if settings.weights or settings.harmonics:
        light = yield from maybe_in_thread(pace, "light", _on_texels, bake, lights)
        if any(each.lighting.lamps or each.lighting.sharp_sun for each in lights):
            notes.append("lamps and sharp suns are in the colours, not in what relights")
    steps = glb_steps(
        bake, output, radiance, settings, form=compressed, light=light,
        said=None if several else _said(lights[0].lighting), lights=apart,
    )  # fmt: skip
    # In a window vertices are made beside it.
    report = yield from steps if pace is None else steps_in_thread(steps, MainThreadCalls(), "glTF")
    return {**report, "used": used, "notes": [*dict.fromkeys(notes), *report["notes"]]}


def _on_texels(bake, lights):
    """What of lights comes from far away, exposed, (n_directions, 3) float32; None of lamps."""
    environments, total = Environments(bake), None
    for each in lights:
        lighting = each.lighting
        light = environments.on_texels(lighting, without_sun=lighting.sharp_sun)
        if light is not None:
            light = light * (each.weight * lighting.exposure_factor)
            total = light if total is None else total + light
    return None if total is None else total.astype("float32")


def _said(lighting):
    """What the file says of a light (dict)."""
    light = lighting.environment
    name = light.name if isinstance(light, Path) else getattr(light, "name", None)
    return {
        "environment": "world" if lighting.is_world else name,
        "rotation": lighting.matrix.tolist(),
        "strength": lighting.strength,
        "exposure": lighting.exposure,
    }
