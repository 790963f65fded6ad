"""Ambient occlusion, sky visibility and bent normals of the loaded bake, into attributes."""

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from prt_core.bake.occlusion import baked_occlusion_steps
from prt_core.blender import colours
from prt_core.errors import expect
from prt_core.transport import Occlusion
from prt_core.transport.occlusion import as_colours

from . import freshness, preview, work
from .buttons import Asks, BakeButton
from .work import LongWork

_NAMES = {"ambient": "AO", "sky": "Sky", "bent-normal": "Bent Normal"}


class PRT_OT_occlusion(Asks, LongWork, BakeButton, bpy.types.Operator):
    """Ambient occlusion, visible sky or bent normals, from what the loaded bake sees, as an
    attribute of the meshes or a channel of one"""

    bl_idname = "prt.occlusion"
    bl_label = "Occlusion to Attribute"
    title = "Occlusion"
    call = "occlusion"
    asked = (
        "kind", "weight", "distance", "falloff", "attribute", "domain", "channel", "encoding",
    )  # fmt: skip

    kind: EnumProperty(
        name="Kind",
        items=[
            ("ambient", "Ambient Occlusion", "The open share above the surface, as Cycles has it"),
            ("sky", "Visible Sky", "The share of the sky that is seen; open ground sees all of it"),
            ("bent-normal", "Bent Normal", "The mean open direction, in world space"),
        ],
    )
    weight: EnumProperty(
        name="Directions",
        items=[
            ("cosine", "By Cosine", "As even light falls on the surface"),
            ("even", "All Alike", "Each direction counts the same"),
        ],
    )
    distance: FloatProperty(
        name="Distance", description="What is farther away is not in the way; 0: everything is. "
        "Rays are cast for it", subtype="DISTANCE", default=0.0, min=0.0,
    )  # fmt: skip
    falloff: EnumProperty(
        name="Falloff",
        items=[
            ("constant", "Constant", "All within the distance counts alike, as in Cycles"),
            ("linear", "Linear", "Less with the distance"),
            ("smooth", "Smooth", "Near and far ends are soft"),
            ("sharp", "Sharp", "Mostly what is near"),
        ],
    )
    attribute: StringProperty(
        name="Attribute", description="Empty: AO, Sky or Bent Normal; an existing one keeps its "
        "other channels",
    )  # fmt: skip
    domain: EnumProperty(
        name="Domain", items=[("CORNER", "Face Corner", ""), ("POINT", "Vertex", "")]
    )
    channel: EnumProperty(
        name="Channel",
        items=[("RGB", "All", "Grey"), *((c, c, f"Into {c}; the others stay") for c in "RGBA")],
    )
    encoding: EnumProperty(
        name="Stored as",
        items=[
            ("VECTOR", "Vector", "A vector attribute"),
            ("COLOUR", "Color", "0.5 + 0.5 of its components, as in normal maps"),
        ],
    )

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        other = "channel" if self.kind == "bent-normal" else "encoding"
        for name in self.asked:
            if name != other:
                row = layout.row()
                row.enabled = name != "falloff" or self.distance > 0
                row.prop(self, name)

    def steps(self, context, pace):
        scene = self.begin(context)
        distance = self.distance or None
        falloff = self.falloff if distance else "constant"
        asked = Occlusion(self.kind, distance, falloff, self.weight)
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        values = yield from baked_occlusion_steps(held.bake, asked, self.scene.prt.caster, pace)
        return held, values

    def finish(self, context, result):
        held, values = result
        scene, bent = self.scene, self.kind == "bent-normal"
        name = self.attribute.strip() or _NAMES[self.kind]
        expect(
            name != scene.prt.attribute,
            f"attribute: '{name}' is the preview's and goes with it; use another name",
        )
        vector = bent and self.encoding == "VECTOR"
        by_object = held.bake.colours(values if vector else as_colours(values))
        channels = "RGB" if bent else self.channel
        if channels == "A":
            by_object = {item: value[:, [0, 0, 0, 0]] for item, value in by_object.items()}
        realised, _ = colours.keep_all(
            held.bake.scene,
            by_object,
            name,
            self.domain,
            places=preview.places_now(scene, held),
            target=scene,
            channels=channels,
            vector=vector,
        )
        text = f"'{name}' written on {len(by_object)} objects"
        if realised:
            text += f", {len(realised)} of them realised"
        self.report({"INFO"}, text)
        work.say(text)


register, unregister = bpy.utils.register_classes_factory((PRT_OT_occlusion,))
