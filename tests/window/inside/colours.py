"""Colours that meshes have, and those that the core makes of a bake, loaded anew from the disk."""

from pathlib import Path

import bpy
import numpy as np


def attribute_of(item, name):
    """(n, 3) float32 of a colour attribute of an object; None where it has none of that name."""
    attributes = getattr(item.data, "color_attributes", {})
    if name not in attributes:
        return None
    data = attributes[name].data
    values = np.empty(4 * len(data), np.float32)
    data.foreach_get("color", values)
    return values.reshape(-1, 4)[:, :3]


def on_meshes():
    """{object: (n_corners, 3) float32} of the preview, as Blender has them."""
    scene = bpy.context.scene
    shown = {o.name: attribute_of(o, scene.prt.attribute) for o in scene.objects}
    return {name: values for name, values in shown.items() if values is not None}


def from_core(view=None):
    """{object: (n_corners, 3) float32} under the light of the panel as it is now.

    The light is read here, not by the add-on: what that asks for is tested as well. `view` is from
    where gloss is seen (see `viewpoint`), None where it is not shown.
    """
    import prt_core
    from prt_core.relight.relighter import Relighter

    scene = bpy.context.scene
    bake = prt_core.load(bpy.path.abspath(scene.prt.loaded))
    if view is not None and scene.prt.seen_from == "CAMERA":
        points = bake.scene.points
        view = view.above(bake.scene.to_world(points.positions), points.normals)
    relighter = Relighter(bake, scene.prt.caster)
    try:
        return bake.colours(relighter.radiance(view=view, **_light(scene)))
    finally:
        relighter.close()


def _light(scene):
    """What `Relighter.radiance` takes, of the panel."""
    from prt_core.blender.lamps import read_lamps
    from prt_core.blender.world import read_environment
    from prt_core.sphere import rotation_matrix

    settings = scene.prt
    light, turn = settings.file, rotation_matrix(float(np.degrees(settings.rotation)))
    strength, lamps = settings.strength, read_lamps(scene) if settings.use_lamps else []
    if settings.light == "WORLD":
        world = read_environment(scene)
        lamps = world.turned_suns(turn, strength) + lamps
        light, turn, strength = world.map, turn @ world.rotation, strength * world.strength
    elif settings.light == "STUDIO":
        lights = bpy.context.preferences.studio_lights
        (light,) = (each.path for each in lights if each.name == settings.studio)
    return {
        "light": light if settings.light == "WORLD" else Path(light),
        "rotation": turn, "strength": strength, "lamps": lamps, "lamp_strength": 1.0,
        "exposure": settings.exposure, "lamp_samples": settings.lamp_samples,
    }  # fmt: skip


def viewpoint():
    """The `View` from where gloss is seen: the camera's or the 3D view's; None where it is off."""
    from prt_core.transport import View

    scene = bpy.context.scene
    if not scene.prt.show_gloss:
        return None
    return View(position=np.array(scene.camera.matrix_world.translation
                if scene.prt.seen_from == "CAMERA" else eye()))  # fmt: skip


def eye():
    """Where the 3D view is looked from."""
    areas = bpy.context.window_manager.windows[0].screen.areas
    view = next(area for area in areas if area.type == "VIEW_3D").spaces.active.region_3d
    return view.view_matrix.inverted().translation


def from_light_field(name):
    """(n_corners, 3) float32 of an object by the light field that is shown, from the 3D view."""
    from prt_core.bake.light_field_load import load_light_field
    from prt_core.bake.light_field_view import field_toward
    from prt_core.transport import View

    settings = bpy.context.scene.prt.field
    field = load_light_field(bpy.path.abspath(settings.loaded))
    strengths = {
        lamp.name: [lamp.strength * channel for channel in lamp.colour]
        for lamp in settings.lamps
        if lamp.name in field.lights
    }
    radiance, _ = field_toward(field, View(position=np.array(eye())), strengths)
    (item,) = [o for o in field.scene.objects if o.name == name]
    return radiance[item.corner_point]


def largest_difference(colours, others):
    """Of any corner and channel, as a share of the largest of `others`."""
    largest = max(values.max() for values in others.values())
    return max(float(np.abs(colours[n] - others[n]).max()) for n in others) / largest


def mean_difference(colours, others):
    """Over all corners and channels, as a share of the mean of `others`."""
    one, two = (np.concatenate([v[n] for n in sorted(others)]) for v in (colours, others))
    return float(np.abs(one - two).mean() / two.mean())


def relative_l2(colours, others):
    """Relative L2 difference, the largest of all objects."""
    return max(
        float(np.linalg.norm(colours[name] - others[name]) / np.linalg.norm(others[name]))
        for name in others
    )


def means(colours):
    """{object: mean colour}, as report.json holds it."""
    return {name: values.mean(axis=0).tolist() for name, values in colours.items()}
