"""What a user sets: on scenes and objects (saved), and what is under way (never saved)."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from prt_core.blender.compat import PATH_OPTIONS

from . import following, live, studio
from .light_properties import Light, PRTEmitter, PRTLightSet, changed


def _plan_changed(settings, _context):
    live.settings_changed(settings.id_data)


def _object_changed(settings, context):
    live.geometry_changed(context.scene)


def _field_changed(_settings, _context):
    following.start()


def _shown_changed(settings, _context):
    live.touch(settings.id_data, show=True)


class PRTLamp(bpy.types.PropertyGroup):
    """How a light of a light field shines."""

    name: StringProperty(name="Light", description="A light that has a field of its own")
    strength: FloatProperty(
        name="Strength", description="Factor on this light; 0 is off", default=1.0, min=0.0,
        soft_max=10.0, update=_field_changed,
    )  # fmt: skip
    colour: FloatVectorProperty(
        name="Colour", description="A filter before this light; white changes nothing",
        subtype="COLOR", size=3, default=(1.0, 1.0, 1.0), min=0.0, soft_max=1.0,
        update=_field_changed,
    )  # fmt: skip


class PRTLightField(bpy.types.PropertyGroup):
    """Settings of light fields, and the one that is shown."""

    name: StringProperty(
        name="Name", description="Of the light field; empty: the names of the file and the scene"
    )
    angles: IntVectorProperty(
        name="Angles",
        description="Directions over the hemisphere of each point, as rows and columns of a "
        "square: more show sharper reflections",
        size=2, default=(32, 16), min=2, max=256,
    )  # fmt: skip
    samples: IntProperty(
        name="Samples", description="Paths of each direction", default=32, min=1, max=65536,
        soft_max=1024,
    )  # fmt: skip
    each: BoolProperty(
        name="Each Light Apart",
        description="A field of each lamp, of each object that emits and of the world, from the "
        "same render; each can then be dimmed and given another colour",
    )
    denoise: BoolProperty(name="Denoise", description="Where that keeps the energy of the light")
    loaded: StringProperty(
        name="Light Field", description="The light field that is shown", update=_field_changed
    )
    follow: EnumProperty(
        name="Follow",
        items=[
            ("VIEW", "3D View", "As seen from the 3D view that moved last"),
            ("CAMERA", "Camera", "As seen from the scene's camera"),
        ],
        default="VIEW",
        update=_field_changed,
    )
    use_compressed: BoolProperty(
        name="Use Compressed", description="Show the compressed form where there is one",
        default=True, update=_field_changed,
    )  # fmt: skip
    lamps: CollectionProperty(type=PRTLamp)


# What the presets of quality set.
_QUALITIES = (
    {"resolution": "16", "tolerance": 0.05, "all_bounces": False, "bounces": 2},
    {"resolution": "32", "tolerance": 0.01, "all_bounces": True},
)
_CUSTOM = len(_QUALITIES)


def _get_quality(settings):
    """The preset that the settings are those of, unless a person asked for their own."""
    if settings.custom:
        return _CUSTOM
    for index, preset in enumerate(_QUALITIES):
        values = {name: getattr(settings, name) for name in preset}
        if all(round(v, 6) == preset[n] if n == "tolerance" else v == preset[n]
               for n, v in values.items()):  # fmt: skip
            return index
    return _CUSTOM


def _set_quality(settings, index):
    settings.custom = index == _CUSTOM
    if index != _CUSTOM:
        for name, value in _QUALITIES[index].items():
            setattr(settings, name, value)


class PRTScene(Light, bpy.types.PropertyGroup):
    """Bake, light and preview settings of a scene."""

    custom: BoolProperty(options={"HIDDEN"})
    quality: EnumProperty(
        name="Quality",
        items=[
            ("DRAFT", "Draft", "Soft shadows of the sky, two bounces, 5 % error: to look at soon"),
            ("FINAL", "Final", "Shadows of the sky as sharp as most need, all bounces, 1 % error"),
            ("CUSTOM", "Custom", "Settings of your own"),
        ],
        get=_get_quality,
        set=_set_quality,
        options=set(),
    )
    resolution: EnumProperty(
        name="Shadow Detail",
        description="How sharp shadows of the sky can be: texels along an edge of the cube map",
        items=[(str(n), str(n), f"{6 * n * n:,} directions") for n in (8, 16, 32, 64)],
        default="32",
        update=_plan_changed,
    )
    all_bounces: BoolProperty(
        name="All Bounces",
        description="As many bounces as the tolerance needs",
        default=True,
        update=_plan_changed,
    )
    bounces: IntProperty(
        name="Bounces", description="0 is direct light only", default=2, min=0, soft_max=16,
        update=_plan_changed,
    )  # fmt: skip
    tolerance: FloatProperty(
        name="Bounce Error",
        description="How far bounced light may be off, as a share of the colours",
        default=0.01, min=0.001, max=0.5, precision=3, update=_plan_changed,
    )  # fmt: skip
    caster: EnumProperty(
        name="Ray Caster",
        items=[
            ("auto", "Automatic", "Embree where it is there, else Blender"),
            ("embree", "Embree", "Fastest"),
            ("blender", "Blender", "Geometry Nodes' ray casts, on all cores"),
            ("bvhtree", "BVH Tree", "One ray a call; slow"),
        ],
        default="auto",
        update=_plan_changed,
    )
    method: EnumProperty(
        name="Rays",
        items=[
            ("auto", "Automatic", "The cheapest that keeps the error"),
            ("agreement", "Where It Varies", "Where neighbours see different things; the rest is "
             "filled in and checked"),
            ("huang", "Sparse", "After Huang and Ramamoorthi; to compare with"),
            ("exhaustive", "All", "Every direction of every point"),
        ],
        default="auto",
        update=_plan_changed,
    )  # fmt: skip
    gloss: BoolProperty(
        name="Gloss",
        description="Bake what metal and glossy surfaces reflect as well; it is shown to the view",
        default=False,
        update=_plan_changed,
    )
    selection_only: BoolProperty(
        name="Selection Only",
        description="Bake What Moved asks selected objects alone: others keep their colours",
        default=False,
    )
    refine: BoolProperty(
        name="Refine",
        description="Split edges where vertices are too few for shadows under the scene's lights: "
        "colours go to finer copies, Restore brings the objects back",
        default=False,
        update=_plan_changed,
    )
    refine_tolerance: FloatProperty(
        name="Between Vertices",
        description="Relative error that drawing colours between vertices may make",
        default=0.02, min=0.001, max=0.5, precision=3, update=_plan_changed,
    )  # fmt: skip
    refine_vertices: FloatProperty(
        name="Vertices",
        description="So many times the vertices there are, at most", default=1.5, min=1.0,
        soft_max=8.0, max=100.0, precision=2, update=_plan_changed,
    )  # fmt: skip
    folder: StringProperty(
        name="Folder", description="Where bakes are kept", default="//prt", subtype="DIR_PATH",
        options=PATH_OPTIONS, update=_plan_changed,
    )  # fmt: skip
    name: StringProperty(
        name="Name", description="Of the bake; empty: the names of the file and the scene"
    )
    loaded: StringProperty(name="Bake", description="The bake that is shown", update=changed)

    exposure: FloatProperty(
        name="Exposure", description="Stops, on the colours", default=0.0, soft_min=-10.0,
        soft_max=10.0, update=changed,
    )  # fmt: skip
    show_gloss: BoolProperty(
        name="Gloss", description="Show what materials reflect towards the view, where the bake "
        "was made with gloss", default=True, update=changed,
    )  # fmt: skip
    seen_from: EnumProperty(
        name="Seen from",
        description="Gloss looks different from everywhere: it is that which is seen from here. "
        "Renders look through the camera",
        items=[
            ("VIEW", "3D View", "From the 3D view that moved last"),
            ("CAMERA", "Camera", "From the scene's camera"),
        ],
        default="VIEW",
        update=changed,
    )
    seen_by: PointerProperty(
        name="Camera",
        description="Which camera of the scene; without one its own. Renders look through that",
        type=bpy.types.Object,
        poll=lambda _, item: item.type == "CAMERA",
        update=changed,
    )

    sets: CollectionProperty(type=PRTLightSet)
    active_set: IntProperty(options=set())
    field: PointerProperty(type=PRTLightField)

    compress_tolerance: FloatProperty(
        name="Added Error",
        description="How far the compressed form may be off, as a share of the colours",
        default=0.01, min=0.001, max=0.5, precision=3,
    )  # fmt: skip
    use_compressed: BoolProperty(
        name="Use Compressed",
        description="Relight from the compressed form where the bake has one; lamps stay exact",
        default=True, update=changed,
    )  # fmt: skip
    live: BoolProperty(
        name="Live", description="Colours follow the light, the lamps, the timeline, and with "
        "gloss the view",
        default=True, update=changed,
    )  # fmt: skip
    attribute: StringProperty(
        name="Attribute", description="The colour attribute of the preview", default="PRT",
        update=_shown_changed,
    )  # fmt: skip
    domain: EnumProperty(
        name="Domain",
        items=[
            ("CORNER", "Face Corner", "Sharp edges keep both their colours"),
            ("POINT", "Vertex", "The mean of the corners"),
        ],
        default="CORNER",
        update=_shown_changed,
    )
    look: EnumProperty(
        name="Look",
        description="What Material Preview and renders show",
        items=[
            ("COLOURS", "Colours", "The colours, without reflections of Blender's own"),
            ("MATERIALS", "Materials", "The baked light on the objects' own materials: "
             "textures stay, and EEVEE adds its reflections of gloss, metal and glass"),
            ("SOLID", "Solid Only", "The scene as it is; only Solid mode shows the colours"),
        ],
        default="COLOURS",
        update=_shown_changed,
    )  # fmt: skip
    shown: StringProperty(
        name="Shown", description="The attribute that holds the preview now", options={"HIDDEN"}
    )


class PRTObject(bpy.types.PropertyGroup):
    """What an object does in a bake."""

    receives: BoolProperty(
        name="Receives", description="Gets colours; otherwise it only casts and bounces",
        default=True, update=_object_changed,
    )  # fmt: skip
    two_sided: BoolProperty(
        name="Two-sided",
        description="Back sides have points even where rays do not find that they matter",
        update=_object_changed,
    )  # fmt: skip


class PRTSource(bpy.types.PropertyGroup):
    """A mesh that a bake was made from, and its digest."""

    digest: StringProperty()


class PRTBakeItem(bpy.types.PropertyGroup):
    """One bake of the folder."""

    path: StringProperty()
    complete: BoolProperty()
    megabytes: FloatProperty()
    seconds: FloatProperty()
    error: FloatProperty(default=-1.0)
    points: IntProperty()
    method: StringProperty()
    entries: FloatProperty()
    visibility_error: FloatProperty(default=-1.0)
    error_enclosed: FloatProperty(default=-1.0)
    back_end: StringProperty()
    rate: FloatProperty()
    gloss: BoolProperty()
    compressed: StringProperty()
    origin: StringProperty()
    notes: StringProperty()
    unreadable: StringProperty()
    waiting: BoolProperty()
    source: CollectionProperty(type=PRTSource)


class PRTFieldItem(bpy.types.PropertyGroup):
    """One light field of the folder."""

    path: StringProperty()
    complete: BoolProperty()
    megabytes: FloatProperty()
    about: StringProperty()
    compressed: StringProperty()
    notes: StringProperty()
    unreadable: StringProperty()


class PRTStatus(bpy.types.PropertyGroup):
    """What is under way; on the window manager, so that no file keeps it."""

    running: BoolProperty(options={"SKIP_SAVE"})
    cancel: BoolProperty(options={"SKIP_SAVE"})
    title: StringProperty(options={"SKIP_SAVE"})
    stage: StringProperty(options={"SKIP_SAVE"})
    done: FloatProperty(options={"SKIP_SAVE"}, subtype="FACTOR", min=0, max=1)
    message: StringProperty(options={"SKIP_SAVE"})
    failed: BoolProperty(options={"SKIP_SAVE"})
    notes: StringProperty(options={"SKIP_SAVE"})
    active_object: IntProperty(options={"SKIP_SAVE"})
    bakes_folder: StringProperty(options={"SKIP_SAVE"})
    bakes: CollectionProperty(type=PRTBakeItem, options={"SKIP_SAVE"})
    active_bake: IntProperty(options={"SKIP_SAVE"})
    fields: CollectionProperty(type=PRTFieldItem, options={"SKIP_SAVE"})
    active_field: IntProperty(options={"SKIP_SAVE"})


_CLASSES = (
    PRTEmitter,
    PRTLightSet,
    PRTLamp,
    PRTLightField,
    PRTScene,
    PRTObject,
    PRTSource,
    PRTBakeItem,
    PRTFieldItem,
    PRTStatus,
)


def register():
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.prt = PointerProperty(type=PRTScene)
    bpy.types.Object.prt = PointerProperty(type=PRTObject)
    bpy.types.WindowManager.prt = PointerProperty(type=PRTStatus)


def unregister():
    for owner in (bpy.types.Scene, bpy.types.Object, bpy.types.WindowManager):
        del owner.prt
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
    studio.forget()
