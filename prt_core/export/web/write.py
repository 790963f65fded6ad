"""A bake as a web page: a folder, or one file, that a browser opens from disk.

A page that is opened from disk may load scripts and nothing else, so what it holds is text inside
of a script, and its own scripts are classic ones.
"""

from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from prt_core.errors import expect, expect_flag, expect_kind, expect_offers, expect_whole
from prt_core.export.web.error import error_steps
from prt_core.export.web.form import coded_form, form_steps, pack_bits, pack_form
from prt_core.export.web.pack import Pack, shared_exponent
from prt_core.export.web.sources import (
    emitter_steps,
    expect_images,
    lamp_steps,
    page_images,
    rgbe,
)
from prt_core.export.web.squeeze import squeezed
from prt_core.export.web.start import start_of
from prt_core.export.web.surface import pack_share, pack_surface, surface_of
from prt_core.relight.lighting import MOST_LAMP_SAMPLES
from prt_core.runtime.files import expect_output, new_folder, written
from prt_core.runtime.main_thread import MainThreadCalls, in_thread, steps_in_thread
from prt_core.transport.sent import Sent
from prt_core.version import __version__

_PAGE = Path(__file__).parent / "page"
# The page's scripts of its own, each of some in the order in which they are run.
SCRIPTS = {
    "page.js": (
        "core.js", "cube.js", "relight.js", "images.js", "filmic.js", "shaders.js", "gpu.js",
        "view.js", "page.js",
    ),
    "exr.js": ("exr.js", "piz.js"),
}  # fmt: skip
# By which a page of this project is known, in its first bytes.
_MARK, _HEAD = b'name="generator" content="prt_core"', 1024
_INDEX, _STYLE, _DATA = "index.html", "style.css", "data.js"


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


def write_web_steps(bake, output, settings=None, pace=None):
    """Write a bake as a web page; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
    output : str or Path
        A folder, or NAME.html.
    settings : WebSettings, optional
    pace : float, optional
        Seconds a step of casting rays may take.

    Returns
    -------
    dict
        output, files (name to bytes), bytes, parts (packed bytes by name), form, points, notes,
        triangles, error, worst, worst_light, lights.

    Raises
    ------
    PRTError
        The output cannot be written, a light cannot be read, or cameras see nothing.
    """
    settings = WebSettings() if settings is None else settings
    expect_kind("settings", settings, WebSettings)
    expect_offers("bake", bake, ("scene", "transport", "lamps"), "what `load` returns")
    output, folder, one_file = _expect_place(output, settings)
    images = yield from in_thread("lights", page_images, settings.lights)
    expect_images(images)
    surface = yield from in_thread("surface", surface_of, bake.scene)
    sources = yield from lamp_steps(bake, settings.caster, settings.lamp_samples, pace)
    sources += yield from emitter_steps(bake)
    steps = form_steps(bake)
    model, form = yield from steps_in_thread(steps, MainThreadCalls(), "compress")
    coded = yield from in_thread("codes", coded_form, model)
    errors = yield from error_steps(bake.transport, coded.model, images, settings.bits)
    title = settings.title or _name_of(bake)
    facts = {"title": title, "version": __version__, "error": errors["error"],
             "worst": errors["worst"], "bits": settings.bits,
             "gloss": bool(bake.reflections)}  # fmt: skip
    pack = Pack(facts)
    work = _pack, pack, facts, bake, surface, sources, coded, images
    yield from in_thread("pack", *work)
    files = _files(pack.script(), title, one_file)
    yield from in_thread("write", _write, output, folder, files)
    sizes = {name: len(text.encode()) for name, text in files.items()}
    return {
        "output": str(output),
        "files": sizes,
        "bytes": sum(sizes.values()),
        "parts": pack.sizes,
        "form": form,
        "notes": _notes(bake, images),
        "points": len(surface.points),
        "triangles": len(surface.triangles),
        **errors,
    }


def _notes(bake, images):
    """What a page does not show as the bake has it, and what is to be said of its images."""
    notes = [note for image in images.values() for note in image.notes]
    if bake.reflections:
        notes.append("gloss is shown as an even colour: pages have no highlights or reflections")
    if bake.camera is not None and bake.camera.lens != "perspective":
        notes.append(f"the camera's lens is {bake.camera.lens}; the page begins with a view of all")
    return notes


def _expect_place(output, settings):
    """The output, the folder to make or None, and whether it is one file."""
    named = Path(output).suffix.lower() in (".html", ".htm") if _is_path(output) else False
    if named:
        expect(settings.one_file is not False, f"{output}: is one file; name a folder instead")
        return expect_output("output", output, (".html", ".htm"), create=True), None, True
    folder = expect_output("output", output, None, folder=True, create=True)
    page = folder / _INDEX
    expect(
        not page.is_file() or _MARK in page.read_bytes()[:_HEAD],
        f"{page}: is another's page; name another folder",
    )
    return folder, folder, bool(settings.one_file)


def _is_path(value):
    return isinstance(value, str | Path)


def _name_of(bake):
    return "bake" if bake.path is None else bake.path.stem


def _pack(pack, facts, bake, surface, sources, coded, images):
    """Put all that the page needs into a `Pack`."""
    scene, transport, points = bake.scene, bake.transport, surface.points
    pack_surface(pack, scene, surface)
    facts.update(pack_form(pack, coded, points))
    facts["n_points"], facts["n_triangles"] = len(points), len(surface.triangles)
    facts["n_single"], facts["n_between"] = surface.n_single, len(surface.between)
    _pack_sent(pack, facts, transport, points)
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
    if facts["bits"]:
        pack_bits(pack, transport, points)
    facts["start"] = start_of(bake, surface)


def _pack_sent(pack, facts, transport, points):
    """What points send of what they and their backs receive."""
    sends = transport.sends
    if not isinstance(sends, Sent):
        facts["albedo"] = pack_share(pack, "albedo", sends[points])
        return
    facts["albedo"] = pack_share(pack, "albedo", sends.albedo[points])
    facts["through"] = pack_share(pack, "through", sends.translucency[points])
    number = np.full(len(sends.opposite) + 1, len(points))
    number[points] = np.arange(len(points))
    pack.add("opposite", number[sends.opposite[points]].astype(np.uint32), differences=True)


def _pack_source(pack, index, source, points):
    received = source.received[points]
    # A lamp of negative power takes light away.
    sign = -1.0 if received.max(initial=0) <= 0 else 1.0
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
    codes, facts["emission_factor"] = shared_exponent(scene.points.materials.emission[points])
    pack.add("emission", codes)
    pack.add("emitter", own[emitter].astype(np.uint8))


def _files(data, title, one_file):
    """{name: text} of a page; one that is called `index.html` alone where it is one file."""
    texts = {
        path.name: path.read_text("utf-8") for path in _PAGE.iterdir() if path.suffix != ".npz"
    }
    scripts = {
        name: "".join(squeezed(texts[part]) for part in parts) for name, parts in SCRIPTS.items()
    }
    page = texts[_INDEX].replace("TITLE", escape(title))
    if one_file:
        page = page.replace(f'<link rel="stylesheet" href="{_STYLE}">',
                            f"<style>\n{texts[_STYLE]}</style>")  # fmt: skip
        for name, text in {_DATA: data, **scripts}.items():
            page = page.replace(f'<script src="{name}"></script>', f"<script>\n{text}</script>")
        return {_INDEX: page}
    return {_DATA: data, **scripts, _STYLE: texts[_STYLE], _INDEX: page}


def _write(output, folder, files):
    """Write the files, each whole; the page itself last."""
    if folder is None:
        (text,) = files.values()
        with written(output) as part:
            part.write_bytes(text.encode())
        return
    with new_folder(folder):
        for name, text in files.items():
            with written(folder / name) as part:
                part.write_bytes(text.encode())
