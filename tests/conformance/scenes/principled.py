"""The inputs of the Principled BSDF."""

from tests.conformance.parts import (
    BESIDE,
    BLUE,
    GREEN,
    GREY,
    RED,
    add,
    ground,
    lamp,
    plate,
    principled,
    shaded,
    wall,
    world,
)
from tests.conformance.scene import scene


@scene(quick=True)
def principled_base_colour(on):
    ground(principled("ground", {"Base Color": (*(BLUE if on else GREY), 1)}))
    world()


@scene(says=("wall", "specular"), quick=True)
def principled_metal(on):
    # Metal whose diffuse colour alone is looked at is black.
    metal = {"Base Color": (*(RED if on else (0, 0, 0)), 1), "Metallic": 1.0, "Roughness": 0.6}
    ground()
    wall(principled("wall", metal), **BESIDE)
    world()


@scene(says=("ground", "specular"))
def principled_specular(on):
    gloss = {"Base Color": (*BLUE, 1), "Specular IOR Level": 1.0 if on else 0.0, "Roughness": 0.5}
    gloss |= {"IOR": 2.5}
    ground(principled("ground", gloss))
    world()


@scene(light="lamps", says=("ground", "roughness"), since=(4, 3))
def principled_diffuse_roughness(on):
    rough = {"Base Color": (*GREY, 1), "Diffuse Roughness": float(on)}
    ground(principled("ground", rough))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, 1.3, 0))


@scene(targets=("wall",), says=("wall", "subsurface"), samples=4096)
def principled_subsurface(on):
    skin = {"Base Color": (*GREEN, 1), "Subsurface Weight": float(on), "Subsurface Scale": 1.0}
    wall(principled("wall", skin), **BESIDE)
    ground()
    world()


@scene(says=("ground", "sheen"), quick=True)
def principled_sheen(on):
    ground(
        principled(
            "ground",
            {"Base Color": (*GREEN, 1), "Sheen Weight": float(on), "Sheen Roughness": 1.0},
        )
    )
    world()


@scene(says=("ground", "coat"))
def principled_coat(on):
    coat = {"Base Color": (*GREEN, 1), "Coat Weight": float(on), "Coat IOR": 2.5}
    ground(principled("ground", coat))
    world()


@scene(says=("ground", "transmission"))
def principled_transmission(on):
    ground(principled("ground", {"Base Color": (*GREEN, 1), "Transmission Weight": 0.5 * on}))
    world()


@scene()
def principled_emission(on):
    glow = {"Base Color": (*GREY, 1), "Emission Color": (1, 0.3, 0.1, 1)}
    glow["Emission Strength"] = 2.0 * on
    ground()
    world(0.5)
    plate(material=principled("plate", glow), location=(0, 0, 0.7))


@scene(quick=True)
def principled_of_glTF_defaults(on):
    # As importers write it: metal by a number, roughness 1, the factor of the base colour mixed in.
    def surface(tree):
        factor = add(tree, "ShaderNodeMix", data_type="RGBA", blend_type="MULTIPLY")
        factor.inputs[0].default_value = 1
        factor.inputs[6].default_value = (*GREY, 1)
        factor.inputs[7].default_value = (0.9, 0.4, 0.2, 1) if on else (1, 1, 1, 1)
        inputs = {"Base Color": factor.outputs[2], "Metallic": 0.0, "Roughness": 1.0}
        inputs["Specular IOR Level"] = 0.0
        return add(tree, "ShaderNodeBsdfPrincipled", inputs).outputs[0]

    ground(shaded("ground", surface))
    world()
