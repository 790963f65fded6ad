"""Points, spots, suns and areas, with every setting of their shape."""

import math

from tests.conformance.parts import add, box, ground, lamp_above
from tests.conformance.scene import scene


@scene(light="lamps", quick=True)
def point_lamp(on):
    ground()
    lamp_above("POINT", 60 if on else 40, shadow_soft_size=0.2)
    box(size=0.5, location=(0.7, 0.6, 0.3))


@scene(light="lamps", quick=True)
def point_lamp_of_no_radius(on):
    ground()
    lamp_above("POINT", shadow_soft_size=0.0 if on else 0.8)
    box(size=0.5, location=(0, 0, 0.3))


@scene(light="lamps")
def point_lamp_with_soft_falloff(on):
    ground()
    lamp_above("POINT", location=(0, 0, 0.6), shadow_soft_size=0.5, use_soft_falloff=on)


@scene(light="lamps", quick=True)
def point_lamp_that_is_a_ball(on):
    ground()
    lamp_above("POINT", location=(0, 0, 0.6), shadow_soft_size=0.5, use_soft_falloff=not on)


@scene(light="lamps")
def point_lamp_scaled(on):
    # Scale changes neither its power nor its radius.
    ground()
    box(location=(0, 0, 0.55))
    radius = 0.2 if on else 0.8
    lamp_above("POINT", location=(0, 0, 2.2), scale=(4, 4, 4), shadow_soft_size=radius)


@scene(light="lamps", quick=True)
def spot_lamp(on):
    ground()
    lamp_above("SPOT", 200, spot_size=1.2 if on else 2.0, spot_blend=0.5, shadow_soft_size=0.05)


@scene(light="lamps")
def spot_lamp_without_blend(on):
    ground()
    lamp_above("SPOT", 200, spot_size=1.4, spot_blend=0.0 if on else 1.0, shadow_soft_size=0.0)


@scene(light="lamps", quick=True)
def spot_lamp_of_full_blend(on):
    ground()
    lamp_above("SPOT", 200, spot_size=1.4, spot_blend=1.0 if on else 0.0, shadow_soft_size=0.1)


@scene(light="lamps")
def spot_lamp_stretched(on):
    ground()
    scale = (1, 2.5, 1) if on else (1, 1, 1)
    lamp_above("SPOT", 200, scale=scale, spot_size=0.8, spot_blend=0.7, shadow_soft_size=0.05)


@scene(light="lamps")
def spot_lamp_that_is_a_ball(on):
    ground()
    ball = {"shadow_soft_size": 0.5, "use_soft_falloff": not on}
    lamp_above("SPOT", 200, (0, 0, 0.7), (0, 0, 0), spot_size=2.2, spot_blend=0.6, **ball)


@scene(light="lamps", quick=True)
def sun_lamp(on):
    ground()
    box(location=(0, 0, 0.5))
    lamp_above("SUN", 3, rotation=(0.5, 0.6, 0) if on else (0, 0, 0), angle=0.05)


@scene(light="lamps")
def sun_lamp_of_no_angle(on):
    ground()
    box(location=(0, 0, 0.5))
    lamp_above("SUN", 3, rotation=(0.5, 0.6, 0), angle=0.0 if on else 0.6)


@scene(light="lamps")
def sun_lamp_of_a_wide_angle(on):
    ground()
    box(location=(0, 0, 0.5))
    lamp_above("SUN", 3, rotation=(0.5, 0.6, 0), angle=1.2 if on else 0.0)


def _area(shape, **settings):
    ground()
    box(size=0.4, location=(0.4, 0.4, 0.25))
    return lamp_above("AREA", **{"shape": shape, "size": 1.0} | settings)


@scene(light="lamps", quick=True)
def area_lamp_square(on):
    _area("SQUARE", size=1.0 if on else 3.0)


@scene(light="lamps", quick=True)
def area_lamp_rectangle(on):
    _area("RECTANGLE" if on else "SQUARE", size=0.3, size_y=3.0)


@scene(light="lamps")
def area_lamp_disc(on):
    _area("DISK" if on else "SQUARE", size=2.5, location=(0, 0, 0.6))


@scene(light="lamps")
def area_lamp_ellipse(on):
    _area("ELLIPSE" if on else "DISK", size=0.4, size_y=3.0)


@scene(light="lamps")
def area_lamp_of_a_narrow_spread(on):
    _area("SQUARE", spread=0.5 if on else math.pi, size=0.5)


@scene(light="lamps", quick=True)
def area_lamp_stretched(on):
    _area("SQUARE", scale=(0.3, 3, 1) if on else (1, 1, 1))


@scene(light="lamps")
def area_lamp_mirrored(on):
    _area("RECTANGLE", size=0.3, size_y=2, scale=(1, 1, 1 if not on else -1))


@scene(light="lamps", since=(4, 5))
def area_lamp_that_is_not_normalised(on):
    _area("SQUARE", size=2.0, energy=5, normalize=not on)


@scene(light="lamps")
def area_lamp_without_a_size(on):
    _area("SQUARE", size=0.0 if on else 2.0)


@scene(light="lamps")
def area_lamp_of_a_pattern_mirrored(on):
    ground()
    data = lamp_above(
        "AREA", 60, rotation=(0.3, 0, 0), scale=(-1 if on else 1, 1, 1), size=1.5
    ).data
    data.use_nodes = True
    tree = data.node_tree
    tree.nodes.clear()
    place = add(tree, "ShaderNodeTexCoord").outputs["UV"]
    across = add(tree, "ShaderNodeTexGradient", {"Vector": place}).outputs["Color"]
    shine = add(tree, "ShaderNodeEmission", {"Color": across}).outputs[0]
    add(tree, "ShaderNodeOutputLight", {0: shine})
