"""What a light is in the panel: its own, and those that are kept as sets."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from prt_core.blender.compat import PATH_OPTIONS

from . import live, studio


def changed(settings, _context):
    """The update of whatever the light depends on."""
    live.touch(settings.id_data)
    live.start()


class PRTEmitter(bpy.types.PropertyGroup):
    """How a material that emits light, or a lamp of a set, shines."""

    name: StringProperty(name="Emitter", description="A material that emits light, or a lamp")
    strength: FloatProperty(
        name="Strength", description="Factor on its light; 0 is off",
        default=1.0, min=0.0, soft_max=10.0, update=changed,
    )  # fmt: skip
    recolour: BoolProperty(
        name="Colour", description="Shine in another colour than its own",
        update=changed,
    )  # fmt: skip
    colour: FloatVectorProperty(
        name="Colour", description="In place of its own, as bright as its largest "
        "channel", subtype="COLOR", size=3, default=(1.0, 1.0, 1.0), min=0.0, soft_max=1.0,
        update=changed,
    )  # fmt: skip


class Light:
    """What shines, but for exposure, which is the picture's."""

    light: EnumProperty(
        name="Light",
        items=[
            ("WORLD", "World", "The scene's world, as its nodes say"),
            ("FILE", "Image", "An .exr or .hdr image"),
            ("STUDIO", "Studio", "One of Blender's own studio lights"),
        ],
        default="WORLD",
        update=changed,
    )
    file: StringProperty(
        name="Image", description="Equirectangular .exr or .hdr", subtype="FILE_PATH",
        options=PATH_OPTIONS, update=changed,
    )  # fmt: skip
    studio: EnumProperty(name="Studio Light", items=studio.items, update=changed)
    rotation: FloatProperty(
        name="Rotation", description="Turns the environment about the vertical",
        subtype="ANGLE", unit="ROTATION", default=0.0, update=changed,
    )  # fmt: skip
    strength: FloatProperty(
        name="Strength", description="Factor on the environment", default=1.0, min=0.0,
        soft_max=10.0, update=changed,
    )  # fmt: skip
    sharp_sun: BoolProperty(
        name="Sharp Sun",
        description="Cast shadow rays to what is far brighter than the rest of the image",
        update=changed,
    )
    use_lamps: BoolProperty(
        name="Lamps", description="Add the scene's lamps; their shadows are cast now",
        default=True, update=changed,
    )  # fmt: skip
    lamp_samples: IntProperty(
        name="Samples", description="Shadow rays of each point to each lamp", default=64, min=1,
        max=65536, soft_max=1024, update=changed,
    )  # fmt: skip
    emitters: CollectionProperty(type=PRTEmitter)


def _name_once(item, _context):
    """A name of a set is its own: what is exported goes by it."""
    names = [each.name for each in item.id_data.prt.sets if each != item]
    base, count = item.name.strip() or "Light", 2
    name = base
    while name in names:
        name, count = f"{base} {count}", count + 1
    if name != item.name:
        item.name = name
    changed(item, _context)


class PRTLightSet(Light, bpy.types.PropertyGroup):
    """A light that is kept by its name; several are blended by their weights."""

    name: StringProperty(name="Name", description="Of this light", update=_name_once)
    weight: FloatProperty(
        name="Weight", description="How much of this light there is: 0 is none, 1 is all of it",
        default=1.0, min=0.0, soft_max=1.0, update=changed,
    )  # fmt: skip
    lamps: CollectionProperty(type=PRTEmitter)
