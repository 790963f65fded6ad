"""The light field in memory, and its colours on the meshes of the scene.

Its objects are its own: it takes them over from the preview of a bake, and gives them back.
"""

import os
from pathlib import Path

import bpy
import numpy as np

from prt_core.bake.light_field_compress import compressed_light_field
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_viewer import FieldViewer
from prt_core.blender import colours, preview_look
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import holds
from prt_core.blender.stand_ins import COPY
from prt_core.errors import expect
from prt_core.runtime.main_thread import in_thread

from . import preview
from .preview import LIGHT_FIELD

# One light field at a time: its tables fill the memory.
_HELD = []
# Vertices are where they were captured within this share of the scene's size.
_SAME = 1e-4


class ShownField:
    """A light field in memory.

    Attributes
    ----------
    path : str
    field : prt_core.bake.light_field_load.LightField
    viewer : FieldViewer
    use_compressed, has_compressed : bool
        Whether its compressed form is shown where there is one, and whether there is.
    rows : dict of str -> (n_corners,) int32
        Of each of its objects: the point of the field of each corner; -1 where there is none.
    shown : tuple
        What the colours on the meshes were made from, None where unknown.
    solid : tuple
        The key of the view transform that Solid mode shows them by; None where it does not.
    warned : str
        What was said last about how the scene differs from it.
    """

    def __init__(self, path, use_compressed=True):
        self.path, self.field = path, load_light_field(path)
        self.use_compressed = use_compressed
        scene = self.field.scene
        expect(
            scene.image is None,
            f"{Path(path).name}: has points at the texels of an image, which no mesh can show; "
            "bake one without --grid",
        )
        compressed = compressed_light_field(self.field)
        self.has_compressed = compressed is not None
        self.viewer = FieldViewer(self.field, compressed if use_compressed else None)
        row = np.full(len(scene.points) + 1, -1, np.int32)
        row[self.field.point] = np.arange(len(self.field), dtype=np.int32)
        self.rows = {o.name: row[o.corner_point] for o in scene.objects if o.receives}
        self.shown, self.solid, self.warned = None, None, ""

    def colours(self, radiance):
        """{name: (n_corners, 3) float32} of radiance (n, 3) of its points; black without one."""
        with_black = np.concatenate([radiance, np.zeros((1, 3), np.float32)])
        return {name: with_black.take(rows, axis=0) for name, rows in self.rows.items()}


def held(scene=None):
    """The `ShownField` in memory, of a scene; None where it is not loaded as that asks for."""
    if not _HELD or (scene is not None and _HELD[0].path != path_of(scene)):
        return None
    if scene is not None and _HELD[0].use_compressed != scene.prt.field.use_compressed:
        return None
    return _HELD[0]


def path_of(scene):
    """Absolute path of the light field a scene shows, empty where none."""
    loaded = scene.prt.field.loaded
    return os.path.normpath(bpy.path.abspath(loaded)) if loaded else ""


def load_steps(path, use_compressed=True):
    """Load a light field into memory, in place of the one there; returns the `ShownField`."""
    path = str(path)
    if not _HELD or (_HELD[0].path, _HELD[0].use_compressed) != (path, use_compressed):
        forget()
        shown = yield from in_thread("load", ShownField, path, use_compressed)
        forget()
        _HELD.append(shown)
    return _HELD[0]


def forget():
    """Let go of the light field in memory."""
    _HELD.clear()


def relocated(old, new):
    """A light field lies elsewhere now."""
    if _HELD and _HELD[0].path == old:
        _HELD[0].path = new


def weights(scene, shown):
    """(n_lights, 3) float32: factors of its lights as the panel has them."""
    lamps, exposure = scene.prt.field.lamps, 2.0**scene.prt.exposure
    strengths = {
        name: [exposure * lamp.strength * channel for channel in lamp.colour]
        for name in shown.field.lights
        if (lamp := lamps.get(name)) is not None
    }
    return shown.field.weights({"*": exposure, **strengths})


def add_lamps(scene, shown):
    """A row in the panel for each of its lights."""
    for name in shown.field.lights:
        if name not in scene.prt.field.lamps:
            scene.prt.field.lamps.add().name = name


def write(scene, shown, radiance, key):
    """Colours onto the meshes, and the preview's look as the panel asks for it.

    Raises
    ------
    PRTError
        An object is gone or has another mesh now; then nothing was written.
    """
    settings, baked = scene.prt, shown.field.scene
    ours = settings.shown or settings.attribute
    by_object = shown.colours(radiance)
    if shown.shown is None:
        _take_over(scene, shown, ours)
    layers, solid, shown.solid = preview.layers_of(scene, LIGHT_FIELD, shown, radiance)
    colours.write_all(
        baked, by_object, LIGHT_FIELD, settings.domain, target=scene, others=[ours], layers=layers,
        solid=solid,
    )  # fmt: skip
    # A field is what surfaces look like: there is no light apart for their own materials.
    look = "SOLID" if settings.look == "SOLID" else "COLOURS"
    preview_look.show_colours(baked, LIGHT_FIELD, look, names=by_object)
    shown.shown = key


def _take_over(scene, shown, attribute):
    """Its objects no longer show a bake, and what showed another light field is given back."""
    mine = [item for item in shown.field.scene.objects if item.name in shown.rows]
    owners = {(item.owner, item.library) for item in mine if item.own_mesh}
    objects = objects_by_place()
    own = {objects[place].session_uid for place in owners if place in objects}

    def is_wanted(item):
        return item.session_uid in own or item.get(COPY) in shown.rows

    preview_look.restore(
        scene, [attribute], lambda item: is_wanted(item) and holds(item, [attribute])
    )
    preview_look.restore(
        scene, [LIGHT_FIELD], lambda item: not is_wanted(item) and holds(item, [LIGHT_FIELD])
    )


def clear(scene):
    """Give the objects of light fields back, to the preview of a bake where there is one.

    Returns
    -------
    int
        How many objects changed.
    """
    changed = preview_look.restore(scene, [LIGHT_FIELD], lambda o: holds(o, [LIGHT_FIELD]))
    if _HELD:
        _HELD[0].shown = None
    preview.rewrite(scene)
    return changed


def present(scene):
    """Whether a scene shows a light field, or an object has its colours."""
    return bool(scene.prt.field.loaded) or any(holds(o, [LIGHT_FIELD]) for o in scene.objects)


def check_moved(scene, shown):
    """Note for the panel what is not where it was captured; the line that says so, or ""."""
    names = list(_moved(shown))
    shown.warned = ""
    if names:
        few = ", ".join(names[:3]) + (" …" if len(names) > 3 else "")
        shown.warned = (
            f"{Path(shown.path).name}: {few} changed since its light was captured; bake it again"
        )
    return shown.warned


def _moved(shown):
    """Names of the objects with meshes of their own that are elsewhere, or of another shape."""
    scene, objects, first = shown.field.scene, objects_by_place(), 0
    for item in scene.objects:
        begin, first = first, first + item.n_vertices
        present = objects.get((item.owner, item.library))
        if not (item.own_mesh and item.receives) or present is None or present.type != "MESH":
            continue
        vertices, corners = present.data.vertices, np.empty(len(present.data.loops), np.int32)
        present.data.loops.foreach_get("vertex_index", corners)
        if len(vertices) != item.n_vertices or not np.array_equal(corners, item.corner_vertex):
            yield item.name
            continue
        places = np.empty(3 * len(vertices), np.float32)
        vertices.foreach_get("co", places)
        matrix = np.array(present.matrix_world, np.float64)
        places = places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        captured = scene.to_world(scene.vertices[begin:first])
        if not np.allclose(places, captured, rtol=0, atol=_SAME * scene.size):
            yield item.name
