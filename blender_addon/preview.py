"""The bake in memory, and its colours on the meshes of the scene."""

import os
from pathlib import Path

import bpy

from prt_core import load
from prt_core.blender import colours, preview_look
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import PREVIEW, holds
from prt_core.blender.stand_ins import ORIGINAL, is_kept
from prt_core.errors import expect
from prt_core.relight.relighter import Relighter
from prt_core.runtime.main_thread import in_thread
from prt_core.scene import changes

from . import plan, views

# The colour attribute of light fields: objects that have it are theirs, not a bake's.
LIGHT_FIELD = "PRT Light Field"
# One bake at a time: large ones fill the memory.
_HELD = []


class Preview:
    """A bake in memory.

    Attributes
    ----------
    path : str
    bake : prt_core.Bake
    relighter : prt_core.relight.relighter.Relighter
    shown : Request
        What the colours on the meshes were made from, None where unknown.
    radiance : (n_points, 3) float32
        Their radiance, None before there were any.
    warned : str
        What was said last about how the scene differs from it.
    """

    def __init__(self, path, bake, caster):
        self.path, self.bake = path, bake
        self.relighter = Relighter(bake, caster)
        self.shown, self.radiance, self.warned = None, None, ""
        self._lit = None, None
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

    def note_light(self, key):
        """Its relighter has worked out the light of a `Request.key`, for any view."""
        self._lit = key, self.relighter.lit

    def has_light(self, key):
        """Whether another view under the light of a `Request.key` is only a matter of lobes."""
        lit = self.relighter.lit
        return lit is not None and self._lit[1] is lit and self._lit[0] == key

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
    return "Baked without Gloss: turn it on under Bake Settings and bake again"


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
        _HELD.pop().relighter.close()


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
    domain, others = settings.domain, [LIGHT_FIELD]
    colours.write_all(
        baked, by_object, settings.attribute, domain, places=places, target=scene, others=others
    )
    preview_look.show_colours(baked, settings.attribute, settings.material, places, by_object)
    if settings.shown != settings.attribute:
        settings.shown = settings.attribute
    preview.shown, preview.radiance = asked, radiance
    for name in emitters(preview):
        if name not in settings.emitters:
            settings.emitters.add().name = name


def is_ours(item):
    """Whether an object does not show a light field: a bake's preview may change it."""
    return not holds(item, [LIGHT_FIELD])


def rewrite(scene):
    """Write the colours once more: objects were given back by a light field."""
    preview = held(scene)
    if preview is not None and preview.radiance is not None:
        write(scene, preview, preview.radiance, preview.shown)


def emitters(preview):
    """Names of the materials that emit light in a bake; `preview` may be None."""
    emission = None if preview is None else preview.bake.emission
    return () if emission is None else emission.names


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
