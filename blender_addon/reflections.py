"""What EEVEE reflects in Material Preview while own materials are shown: the light of the panel.

Blender's own choice there is a studio light, which has nothing to do with what was baked. The
views get theirs back with Restore, or with another look.
"""

import math
from contextlib import suppress
from pathlib import Path

import bpy

from prt_core import PRTError

from .request import image_of
from .views import of_windows

# Of screens: what their views reflected before, by the number of their area.
_KEPT = "prt_reflections_before"
_NAMES = (
    "use_scene_world", "use_scene_lights", "studio_light", "studiolight_rotate_z",
    "studiolight_intensity",
)  # fmt: skip
# What each view of this file was last told, so that what a person changes afterwards stays.
_TOLD = {}


def another_file():
    """Forget what the views of the file before were told."""
    _TOLD.clear()


def follow(scene):
    """Let views in Material Preview reflect what the panel says, or what they did before."""
    if scene.prt.look != "MATERIALS" or not scene.prt.loaded:
        restore()
        return
    for screen, key, shading in of_windows():
        if shading.type != "MATERIAL":
            continue
        wanted = _wanted(scene)
        place = screen.name, key
        if wanted is None or _TOLD.get(place) == wanted:
            continue
        kept = screen[_KEPT].to_dict() if _KEPT in screen else {}
        if key not in kept:
            kept[key] = {name: getattr(shading, name) for name in _NAMES}
            screen[_KEPT] = kept
        _TOLD[place] = wanted
        _tell(shading, wanted)


def restore():
    """Give the views back what they reflected; those that are in another mode wait for theirs."""
    for screen, key, shading in of_windows():
        kept = screen[_KEPT].to_dict() if _KEPT in screen else {}
        if key in kept and shading.type == "MATERIAL":
            _tell(shading, kept.pop(key))
            _TOLD.pop((screen.name, key), None)
            if kept:
                screen[_KEPT] = kept
            else:
                del screen[_KEPT]


def _wanted(scene):
    """What a view reflects under the panel's light; None where that cannot be said."""
    light = scene.prt
    if light.sets:
        light = max(light.sets, key=lambda each: each.weight)
    wanted = {"use_scene_lights": light.use_lamps, "use_scene_world": light.light == "WORLD"}
    if light.light != "WORLD":
        try:
            name = _loaded(image_of(light))
        except PRTError:
            return None
        wanted |= {
            "studio_light": name,
            # Blender turns what is looked up, so that the light turns the other way.
            "studiolight_rotate_z": math.remainder(-light.rotation, 2 * math.pi),
            "studiolight_intensity": light.strength * 2.0**scene.prt.exposure,
        }
    return wanted


def _loaded(path):
    """The name of an image among Blender's studio lights; it is added for this session."""
    lights = bpy.context.preferences.studio_lights
    for light in lights:
        if light.type == "WORLD" and Path(light.path) == path:
            return light.name
    light = lights.load(str(path), "WORLD")
    if light is None:
        raise PRTError(f"{path}: Blender cannot show it")
    return light.name


def _tell(shading, values):
    for name, value in values.items():
        if getattr(shading, name) != value:
            # A studio light may not be there any more.
            with suppress(TypeError):
                setattr(shading, name, type(getattr(shading, name))(value))
