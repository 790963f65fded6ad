"""A bake, or a light field, as a web page: a folder, or one file, that is opened from disk."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prt_core.bake.light_field_load import LightField
from prt_core.errors import (
    expect,
    expect_all,
    expect_flag,
    expect_kind,
    expect_offers,
    expect_whole,
)
from prt_core.export.web.error import error_steps
from prt_core.export.web.files import DATA, FIELD_DATA, expect_place, page_files, write_page
from prt_core.export.web.form import coded_form, form_steps, pack_bits, pack_form
from prt_core.export.web.gloss import mirrored_points, pack_gloss, pack_highlight
from prt_core.export.web.light_field import pack_light_field_steps
from prt_core.export.web.light_sets import image_paths, page_sets, read_sets
from prt_core.export.web.pack import Pack, shared_exponent
from prt_core.export.web.sources import (
    emitter_steps,
    expect_images,
    lamp_steps,
    page_images,
    rgbe,
)
from prt_core.export.web.start import start_of
from prt_core.export.web.surface import pack_share, pack_surface, surface_of
from prt_core.reflectance.mean_gloss import more_by_gloss
from prt_core.relight.lighting import MOST_LAMP_SAMPLES
from prt_core.runtime.main_thread import MainThreadCalls, in_thread, steps_in_thread
from prt_core.scene import ended_at
from prt_core.transport.sent import Sent
from prt_core.version import __version__

# Of glossy points the share from which a lamp looks wider than their lobes: then it is said that
# its highlight has not its shape (8 % off at one and a half times as wide).
_WIDE = 0.1


@dataclass(frozen=True)
class WebSettings:
    """What a page is to hold.

    Parameters
    ----------
    one_file : bool, optional
        One file instead of a folder; default: where the output is called NAME.html.
    bits : bool
        The visibility bits, by which suns are sharp; without them a page is small and suns soft.
    lights : sequence of str or Path, optional
        Images that it offers, shrunk; default: four of its own.
    sets : dict of str -> dict, or sequence of str or Path, optional
        Lights by name, or .json files of them (see `relight.light_file`): each has a button.
    title : str, optional
        Default: the name of the bake.
    lamp_samples : int
        Shadow rays a point and lamp.
    caster : str
        For those rays.
    """

    one_file: bool | None = None
    bits: bool = True
    lights: object = None
    sets: object = None
    title: str | None = None
    lamp_samples: int = 256
    caster: str = "auto"

    def __post_init__(self):
        if self.one_file is not None:
            expect_flag("one_file", self.one_file)
        expect_flag("bits", self.bits)
        if self.title is not None:
            expect_kind("title", self.title, str, "text")
        expect_whole("lamp_samples", self.lamp_samples, 1, MOST_LAMP_SAMPLES)
        expect_kind("caster", self.caster, str, "the name of one")


def write_web_steps(bake, output, settings=None, pace=None, field=None):
    """Write a bake as a web page, a light field, or both in one; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake, optional
        None: the page shows the light field alone.
    output : str or Path
        A folder, or NAME.html.
    settings : WebSettings, optional
    pace : float, optional
        Seconds a step of casting rays may take.
    field : LightField, optional

    Returns
    -------
    dict
        output, files (name to bytes), bytes, parts (packed bytes by name), form, points, notes,
        triangles, error, worst, worst_light, lights; of a light field alone `form` is what was
        coded, and `error` and `worst` are of so many `sides`. Of both, `field` is a dict of these.

    Raises
    ------
    PRTError
        The output cannot be written, a light cannot be read, or cameras see nothing.
    """
    settings = WebSettings() if settings is None else settings
    expect_kind("settings", settings, WebSettings)
    expect(bake is not None or field is not None, "bake: expected one, or a light field")
    if bake is not None:
        expect_offers("bake", bake, ("scene", "transport", "lamps"), "what `load` returns")
    if field is not None:
        expect_kind("light_field", field, LightField)
    output, folder, one_file = expect_place(output, settings.one_file)
    title, report, data, scripts = settings.title or _name_of(bake, field), {}, {}, []
    if bake is not None:
        report, pack = yield from _bake_steps(bake, settings, title, pace)
        data[DATA] = pack.script()
        scripts += ["exr.js"] + ["gloss.js"] * ("gloss" in pack.facts)
        scripts += ["sets.js"] * ("sets" in pack.facts)
    if field is not None:
        facts = {"title": title, "version": __version__, "look": _look(field)}
        pack = Pack({**facts, "sources": [], "images": []})
        shown = yield from pack_light_field_steps(pack, field)
        data[FIELD_DATA] = pack.script("PRT_FIELD")
        scripts.append("lightfield.js")
        shown["parts"] = pack.sizes
        report = {**report, "field": shown} if report else shown
    files = page_files(data, title, one_file, scripts)
    yield from in_thread("write", write_page, output, folder, files)
    sizes = {name: len(text.encode()) for name, text in files.items()}
    return {"output": str(output), "files": sizes, "bytes": sum(sizes.values()), **report}


def _bake_steps(bake, settings, title, pace):
    """What is to be told of a bake's page, and its `Pack`; a generator of `Progress`."""
    sets = [] if settings.sets is None else read_sets(settings.sets, bake)
    own = settings.lights
    own = [] if own is None else expect_all("lights", own, str | Path, "images")
    paths = image_paths(sets, own)
    images = yield from in_thread("lights", page_images, list(paths.values()) or settings.lights)
    expect_images(images)
    mirrored = mirrored_points(bake) if settings.bits else ()
    surface = yield from in_thread("surface", surface_of, bake.scene, mirrored)
    sources = yield from lamp_steps(bake, settings.caster, settings.lamp_samples, pace)
    sources += yield from emitter_steps(bake)
    steps = form_steps(bake)
    model, form = yield from steps_in_thread(steps, MainThreadCalls(), "compress")
    coded = yield from in_thread("codes", coded_form, model)
    errors = yield from error_steps(bake.transport, coded.model, images, settings.bits)
    even = bool(bake.reflections) and not settings.bits
    about = (
        f"{len(surface.points):,} points. Colours are within {errors['error']:.1%} of exact ones "
        f"in the mean, {errors['worst']:.1%} at worst, under these lights."
    )
    about += " Without visibility bits: suns are soft." * (not settings.bits)
    about += " Gloss is shown as an even colour." * even
    facts = {"title": title, "version": __version__, "look": _look(bake)}
    pack = Pack({**facts, "bits": settings.bits, "about": about})
    work = _pack, pack, pack.facts, bake, surface, sources, coded, images
    notes = yield from in_thread("pack", *work)
    if sets:
        pack.facts["sets"] = page_sets(sets, bake, sources, paths)
    report = {
        "parts": pack.sizes,
        "form": form,
        "notes": [*notes, *_notes(bake, pack.facts, images, sources)],
        "points": len(surface.points),
        "triangles": len(surface.triangles),
        **errors,
    }
    return report, pack


def _look(baked):
    """What the page begins to show colours by: as the scene does, where it is plain."""
    shown_by = baked.view_transform
    return "agx" if shown_by is None or shown_by.name != "Standard" else "srgb"


def _notes(bake, facts, images, sources):
    """What a page does not show as the bake has it, and what is to be said of its images."""
    notes, bits = [note for image in images.values() for note in image.notes], facts["bits"]
    if bake.reflections and not bits:
        notes.append(
            "gloss is shown as an even colour: a page without visibility bits has no highlights or "
            "reflections"
        )
    if bake.reflections and bits and any(s.lamp is None and s.kind != "emitter" for s in sources):
        notes.append("lamps that share a slider have no highlights")
    if bake.reflections and bits:
        notes += _wide_lamps(bake, sources)
        shine = any(each.lamp is not None and each.lamp.highlights for each in sources)
        if shine and facts["gloss"]["metal"]:
            notes.append("metal that is seen in metal reflects no lamps on the page")
    if bake.camera is not None and bake.camera.lens != "perspective":
        notes.append(f"the camera's lens is {bake.camera.lens}; the page begins with a view of all")
    return notes


def _wide_lamps(bake, sources):
    """A line on lamps whose highlights are not of their shape, where there are any."""
    points = bake.scene.points
    glossy = np.concatenate([part.points for part in bake.reflections])
    world = bake.scene.to_world(points.positions[glossy])
    materials = points.materials[glossy]
    coat = np.where(materials.coat[:, 0] > 0, materials.coat_roughness[:, 0], 1)
    alpha = np.minimum(materials.roughness[:, 0], coat) ** 2
    wide = [
        repr(source.name)
        for source in sources
        if source.lamp is not None and source.lamp.highlights
        and (source.lamp.seen_from(world)[1] > alpha).mean() > _WIDE
    ]  # fmt: skip
    if wide:
        yield f"lamps {', '.join(wide)}: look large; the page shows their highlights round and soft"


def _name_of(bake, field):
    path = bake.path if bake is not None else field.store.path
    return "bake" if path is None else path.stem


def _pack(pack, facts, bake, surface, sources, coded, images):
    """Put all that the page needs into a `Pack`; what it does not show as it is."""
    scene, transport, points = bake.scene, bake.transport, surface.points
    pack_surface(pack, scene, surface)
    facts.update(pack_form(pack, coded, points))
    facts["n_points"], facts["n_triangles"] = len(points), len(surface.triangles)
    facts["n_single"], facts["n_between"] = surface.n_single, len(surface.between)
    # Others see gloss in the mean of all views; where it is shown, pages take that off again.
    more = more_by_gloss(transport.materials) if facts["bits"] and bake.reflections else 0
    _pack_sent(pack, facts, transport, points, more)
    facts["sources"] = [
        {
            "name": each.name,
            "kind": each.kind,
            "in_world": each.in_world,
            "factor": _pack_source(pack, i, each, points),
        }
        for i, each in enumerate(sources)
    ]
    _pack_emission(pack, facts, scene, sources, points)
    facts["images"] = []
    for index, (name, image) in enumerate(images.items()):
        pack.add(f"image{index}", np.moveaxis(rgbe(image.pixels), -1, 0))
        facts["images"].append(Path(name).stem)
    if bake.world is not None:
        codes, facts["world_factor"] = shared_exponent(bake.world)
        pack.add("world", codes)
    facts["start"], notes = start_of(bake, surface), ()
    if facts["bits"]:
        pack_bits(pack, transport, points)
        if bake.reflections:
            notes, facts["gloss"] = pack_gloss(pack, bake, points)
            for i, each in enumerate(sources):
                if each.lamp is not None and each.lamp.highlights:
                    facts["sources"][i] |= pack_highlight(pack, i, each, bake.scene, points)
    return notes


def _pack_sent(pack, facts, transport, points, more):
    """What points send of what they (`more` of it) and their backs receive, where drawn."""
    sends, ended = transport.sends, ended_at(transport.materials[points])[:, None]
    through = isinstance(sends, Sent)
    front = (sends.albedo if through else sends) + more
    facts["albedo"] = pack_share(pack, "albedo", front[points] / ended)
    if not through:
        return
    facts["through"] = pack_share(pack, "through", sends.translucency[points] / ended)
    number = np.full(len(sends.opposite) + 1, len(points))
    number[points] = np.arange(len(points))
    pack.add("opposite", number[sends.opposite[points]].astype(np.uint32), differences=True)


def _pack_source(pack, index, source, points):
    received = source.received[points]
    # A lamp of negative power takes light away.
    sign = source.sign
    expect(
        (received * sign).min(initial=0) >= 0,
        f"lamp '{source.name}': adds light of one colour and takes that of another away, which a "
        "page cannot show; make two lamps of it",
    )
    codes, factor = shared_exponent(received * sign)
    pack.add(f"source{index}", codes)
    return factor * sign


def _pack_emission(pack, facts, scene, sources, points):
    """What points send out of their own, and by which source's slider."""
    emitter = scene.points.emitter[points]
    if not any(source.kind == "emitter" for source in sources):
        return
    own = np.full(len(scene.emitters) + 1, 255)
    for index, source in enumerate(sources):
        own[list(source.emitters)] = index
    materials = scene.points.materials[points]
    shining = materials.emission / ended_at(materials)[:, None]
    codes, facts["emission_factor"] = shared_exponent(shining)
    pack.add("emission", codes)
    pack.add("emitter", own[emitter].astype(np.uint8))
