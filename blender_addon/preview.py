"""The bake in memory, and its colours on the meshes of the scene."""

import os
from pathlib import Path

import bpy
import numpy as np

from prt_core import load
from prt_core.blender import colours, preview_look
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import PREVIEW, holds
from prt_core.blender.stand_ins import ORIGINAL, is_kept
from prt_core.blender.view_transform import transform_key, view_transform_of
from prt_core.errors import expect
from prt_core.relight.blend import LightBlend
from prt_core.runtime.main_thread import in_thread
from prt_core.scene import changes

from . import plan, rendering, views, work
from .own_changes import own_changes

# The colour attribute of light fields: objects that have it are theirs, not a bake's.
LIGHT_FIELD = "PRT Light Field"
# One bake at a time: large ones fill the memory.
_HELD = []
# A share of the scene that is burnt out from which on that is said; what is burnt out and what is
# nearly white, as the display shows it; the share of points that is no brighter than that; how
# many points are looked at.
MOST_BURNT, _BURNT, _NEARLY_WHITE, _BRIGHT, _SAMPLED = 0.2, 0.98, 0.85, 0.95, 4096


class Preview:
    """A bake in memory.

    Attributes
    ----------
    path : str
    bake : prt_core.Bake
    blend : prt_core.relight.blend.LightBlend
    shown : Request
        What the colours on the meshes were made from, None where unknown.
    radiance : (n_points, 3) float32
        Their radiance, None before there were any.
    received : (n_points, 3) float32
        The light that they have this radiance under; None before there was any.
    solid : tuple
        The key of the view transform that Solid mode shows them by; None where it does not.
    burnt : float
        Share of its points of which a display shows nothing but white.
    has_old_materials : bool
        Whether the user's materials have changed since they were copied to be relit.
    warned : str
        What was said last about how the scene differs from it.
    """

    def __init__(self, path, bake, caster):
        self.path, self.bake = path, bake
        self.blend = LightBlend(bake, caster)
        self.shown, self.radiance, self.received, self.warned = None, None, None, ""
        self.solid, self.burnt, self.has_old_materials = None, 0.0, False
        self._compared = None, None

    def compare(self, read):
        """`Changes` from the bake to a `plan.Reading`, and the places of its meshes now."""
        if self._compared[0] is not read:
            digests, baked = read.digests, self.bake.source
            if read.gloss != self.gloss:
                # What was read otherwise tells no more than what is there.
                digests = {name: baked.get(name, digest) for name, digest in digests.items()}
            differences, places, uids = changes(baked, digests), {}, {}
            for item in self.items:
                name = differences.renamed.get(item.name, item.name)
                place = read.places.get(name)
                # Another mesh may have its name by now: then it is where it was, or nowhere.
                same = item.name in differences.renamed or (place and place[1] == item.library)
                if same and item.name not in differences.missing:
                    places[item.name] = place
                    if name in read.uids:
                        uids[item.name] = read.uids[name]
            self._compared = read, (differences, places, uids)
        return self._compared[1]

    @property
    def relighter(self):
        """The `Relighter` of the panel's own light."""
        return self.blend.relighter("")

    @property
    def gloss(self):
        """Whether its materials were read with their gloss."""
        return bool(self.bake.settings.get("gloss"))

    @property
    def items(self):
        """The bake's `SceneObject`s."""
        return self.bake.scene.objects


def held(scene=None):
    """The `Preview` in memory, of a scene; None where it is not loaded."""
    if not _HELD or (scene is not None and _HELD[0].path != path_of(scene)):
        return None
    return _HELD[0]


def no_gloss(held):
    """Why a `Preview`, or None, shows no gloss; empty where it does."""
    if held is None:
        return "No bake is shown"
    if held.bake.reflections:
        return ""
    if held.gloss:
        return "The materials of this bake have no gloss"
    return "Baked without Gloss, see above"


def path_of(scene):
    """Absolute path of the bake a scene shows, empty where none."""
    return os.path.normpath(bpy.path.abspath(scene.prt.loaded)) if scene.prt.loaded else ""


def relative(path, file=None):
    """A path as the file (default: the open one) keeps it: seen from there where it can be."""
    file = bpy.data.filepath if file is None else file
    try:
        return bpy.path.relpath(str(path), start=str(Path(file).parent)) if file else str(path)
    except ValueError:
        return str(path)


def load_steps(path, caster="auto"):
    """Load a bake into memory, in place of the one there; returns the `Preview`."""
    path = str(path)
    if not _HELD or _HELD[0].path != path:
        bake = yield from in_thread("load", load, path)
        forget()
        _HELD.append(Preview(path, bake, caster))
    return _HELD[0]


def forget():
    """Let go of the bake in memory."""
    while _HELD:
        _HELD.pop().blend.close()


def relocated(old, new):
    """A bake lies elsewhere now."""
    if _HELD and _HELD[0].path == old:
        _HELD[0].path, _HELD[0].bake.path = new, Path(new)


def write(scene, preview, radiance, asked):
    """Colours onto the meshes, and the preview's look as the panel asks for it.

    Objects that show a light field are left to that.

    Raises
    ------
    PRTError
        An object is gone or has another mesh now; then nothing was written.
    """
    settings = scene.prt
    places, baked = places_now(scene, preview), preview.bake.scene
    expect(
        settings.attribute != LIGHT_FIELD,
        f"attribute: '{LIGHT_FIELD}' is that of light fields; use another name",
    )
    if settings.shown and settings.shown != settings.attribute:
        preview_look.restore(scene, [settings.shown], is_ours)
    theirs = preview_look.held_by(baked, LIGHT_FIELD, scene, places)
    by_object = {n: c for n, c in preview.bake.colours(radiance).items() if n not in theirs}
    layers, solid, preview.solid = layers_of(scene, settings.attribute, preview.bake, radiance)
    if settings.look == "MATERIALS" and preview.received is not None:
        light = preview.bake.colours(preview.received)
        layers[colours.light_name(settings.attribute)] = light
    if preview.has_old_materials:
        preview_look.materials_changed(settings.attribute)
        preview.has_old_materials = False
    domain, others = settings.domain, [LIGHT_FIELD]
    colours.write_all(
        baked, by_object, settings.attribute, domain, places=places, target=scene, others=others,
        layers=layers, solid=solid,
    )  # fmt: skip
    preview_look.show_colours(
        baked, settings.attribute, settings.look, places, by_object, target=scene
    )
    if settings.shown != settings.attribute:
        settings.shown = settings.attribute
    preview.shown, preview.radiance = asked, radiance
    if not rendering.is_under_way():
        shown = view_transform_of(scene).display(_sample(radiance))
        preview.burnt = float((shown.min(axis=1) > _BURNT).mean())
    add_rows(scene, preview)


def add_rows(scene, preview=None):
    """The panel's light and each set have a row for each emitter of a `Preview` (default: the one
    that is shown); a set has one for each lamp of the scene."""
    emitting = emitters(held(scene) if preview is None else preview)
    lamps = [item.name for item in scene.objects if item.type == "LIGHT"]
    wanted = [(scene.prt.emitters, emitting)]
    for each in scene.prt.sets:
        wanted += [(each.emitters, emitting), (each.lamps, lamps)]
    for rows, names in wanted:
        for name in names:
            if name not in rows:
                rows.add().name = name


def layers_of(scene, attribute, source, radiance):
    """What Solid mode shows of radiance, where a view is in that mode.

    Parameters
    ----------
    scene : bpy.types.Scene
    attribute : str
        That of the colours.
    source : object
        What has `colours(radiance)`: a bake, or a light field that is shown.
    radiance : (n, 3) float32

    Returns
    -------
    dict of str -> dict
        For `write_all`; empty where no view is in Solid mode.
    str or None
        The attribute that Solid mode shows.
    tuple or None
        The key of the view transform that it shows it by.
    """
    if rendering.is_under_way() or not views.in_solid():
        return {}, None, None
    transform, name = view_transform_of(scene), colours.solid_name(attribute)
    return {name: source.colours(transform.for_solid(radiance))}, name, transform_key(scene)


def is_seen_otherwise(scene, shown):
    """Whether Solid mode shows a `Preview`, or `ShownField`, as another view transform had it."""
    if shown is None or shown.shown is None or not views.in_solid():
        return False
    return shown.solid != transform_key(scene)


def is_ours(item):
    """Whether an object does not show a light field: a bake's preview may change it."""
    return not holds(item, [LIGHT_FIELD])


def rewrite(scene):
    """Write the colours once more: objects were given back by a light field."""
    preview = held(scene)
    if preview is not None and preview.radiance is not None:
        write(scene, preview, preview.radiance, preview.shown)


def see_again(scene):
    """A view went into Solid mode, or the view transform changed: the same colours, as it has
    them."""
    held_now = held(scene)
    if held_now is not None and held_now.radiance is not None:
        if is_seen_otherwise(scene, held_now):
            try:
                with own_changes(scene):
                    rewrite(scene)
            except work.FAILURES:
                # The meshes are not those of the bake any more, which is said elsewhere.
                held_now.solid = transform_key(scene)


def outdate_materials(scene):
    """Materials of the user's have changed: their relit copies are made again with the next
    colours. Whether a scene shows such copies."""
    held_now = held(scene)
    if held_now is None or scene.prt.look != "MATERIALS":
        return False
    held_now.has_old_materials = True
    return True


def emitters(preview):
    """Names of the materials that emit light in a bake; `preview` may be None."""
    emission = None if preview is None else preview.bake.emission
    return () if emission is None else emission.names


def fitting_stops(scene, radiance):
    """Stops of exposure after which radiance is well shown by a scene's view transform.

    The brightest but a few of the points become nearly white.

    Returns
    -------
    float, or None where all is black
    """
    bright = float(np.quantile(_sample(radiance).max(axis=1), _BRIGHT))
    if bright <= 0:
        return None
    transform, low, high = view_transform_of(scene), -24.0, 24.0
    for _ in range(24):
        middle = (low + high) / 2
        shown = transform.display(np.full((1, 3), bright * 2.0**middle, np.float32))
        low, high = (low, middle) if shown.mean() > _NEARLY_WHITE else (middle, high)
    return low


def _sample(radiance):
    """Some of the points, spread over all."""
    return radiance[:: max(1, len(radiance) // _SAMPLED)]


def clear(scene):
    """Take the preview off a scene; how many objects changed."""
    names = {scene.prt.shown or scene.prt.attribute}
    changed = preview_look.restore(scene, names, is_ours)
    scene.prt.shown = ""
    if _HELD:
        _HELD[0].shown = None
    return changed


def present(scene):
    """Whether anything of a bake's preview is in the file, or in how its windows show it."""
    blocks = (*bpy.data.materials, *bpy.data.node_groups)
    marked = any(
        block.get(PREVIEW) not in (None, LIGHT_FIELD) and block.users and not block.library
        for block in blocks
    )
    seen = views.shown() and not scene.prt.field.loaded
    return bool(scene.prt.loaded or scene.prt.shown or marked or seen)


def behind_kept(scene):
    """How many objects are hidden behind what was kept of them."""
    return len({item[ORIGINAL] for item in scene.objects if is_kept(item) and item.get(ORIGINAL)})


def places_now(scene, preview):
    """Where the meshes of a bake are now, by the last reading; those unknown are left out."""
    read, _ = plan.reading(scene)
    return {} if read is None else preview.compare(read)[1]


def missing(scene, preview):
    """Whether an object that is coloured itself is not, under its name, the one last seen there."""
    read, _ = plan.reading(scene)
    _, places, uids = ({},) * 3 if read is None else preview.compare(read)
    objects = objects_by_place()
    for item in preview.items:
        if item.own_mesh and item.receives:
            present = objects.get(places.get(item.name, (item.owner, item.library)))
            if present is None or uids.get(item.name, present.session_uid) != present.session_uid:
                return True
    return False
