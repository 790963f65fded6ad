"""Attributes of meshes, objects and instances as colours."""

import numpy as np

from tests.conformance.parts import add, box, geometry_nodes, grid, ground, painted, world
from tests.conformance.scene import scene


@scene(quick=True)
def colour_attribute_by_name(on):
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeVertexColor", layer_name="paint" if on else "other"
    ).outputs[0]))  # fmt: skip
    _colours(item, "other", (0.5, 0.5, 0.5), "BYTE_COLOR", "CORNER")
    _colours(item, "paint", None, "BYTE_COLOR", "CORNER")
    world()


@scene()
def colour_attribute_for_renders(on):
    item = ground(painted("ground", lambda tree: add(tree, "ShaderNodeVertexColor").outputs[0]))
    _colours(item, "first", (0.8, 0.1, 0.1))
    _colours(item, "second", (0.1, 0.1, 0.8))
    item.data.color_attributes.render_color_index = int(on)
    item.data.color_attributes.active_color_index = 0
    world()


def _colours(item, name, colour=None, kind="FLOAT_COLOR", domain="POINT"):
    data = item.data.color_attributes.new(name, kind, domain).data
    rgba = np.ones((len(data), 4), np.float32)
    rgba[:, :3] = (
        np.random.default_rng(1).uniform(0, 1, (len(data), 3)) if colour is None else colour
    )
    data.foreach_set("color", rgba.ravel())


def _attribute(on, kind, domain, values):
    """The ground painted by an attribute of this domain."""
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="paint"
    ).outputs["Color"]))  # fmt: skip
    data = item.data.attributes.new("paint", kind, domain).data
    values = np.asarray(
        values(len(data)) if on else np.full_like(values(len(data)), 0.5), np.float32
    )
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.ravel())
    world()


@scene()
def attribute_of_faces(on):
    _attribute(on, "FLOAT_VECTOR", "FACE", lambda n: np.linspace(0, 1, 3 * n).reshape(n, 3))


@scene()
def attribute_of_points(on):
    _attribute(on, "FLOAT", "POINT", lambda n: np.linspace(0, 1, n))


@scene(quick=True)
def attribute_of_corners(on):
    _attribute(
        on, "FLOAT_VECTOR", "CORNER", lambda n: np.random.default_rng(5).uniform(0, 1, (n, 3))
    )


@scene()
def attribute_of_the_object(on):
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="paint", attribute_type="OBJECT"
    ).outputs["Color"]))  # fmt: skip
    item["paint"] = [0.1, 0.7, 0.3] if on else [0.5, 0.5, 0.5]
    world()


@scene()
def colour_of_the_object(on):
    item = ground(
        painted("ground", lambda tree: add(tree, "ShaderNodeObjectInfo").outputs["Color"])
    )
    item.color = (0.1, 0.7, 0.3, 1) if on else (0.5, 0.5, 0.5, 1)
    world()


@scene()
def attribute_of_the_instancer(on):
    ground()
    world()
    seeds = grid("seeds", 1, 2.4, location=(0, 0, 0.4))
    tinted = painted("cubes", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="tint", attribute_type="INSTANCER"
    ).outputs["Color"])  # fmt: skip

    def instances(tree, geometry):
        cube = add(tree, "GeometryNodeMeshCube", {"Size": (0.8, 0.8, 0.8)}).outputs[0]
        paint = {"Geometry": cube, "Material": tinted}
        cube = add(tree, "GeometryNodeSetMaterial", paint).outputs[0]
        kind = {"data_type": "FLOAT_COLOR", "domain": "INSTANCE"}
        put_on = {"Points": geometry, "Instance": cube}
        cubes = add(tree, "GeometryNodeInstanceOnPoints", put_on).outputs[0]
        store = {"Geometry": cubes, "Name": "tint"}
        node = add(tree, "GeometryNodeStoreNamedAttribute", store, **kind)
        value = next(s for s in node.inputs if s.enabled and s.name == "Value")
        value.default_value = (0.9, 0.1, 0.1, 1) if on else (0.1, 0.1, 0.1, 1)
        return node.outputs[0]

    geometry_nodes(seeds, instances)


@scene(quick=True)
def random_of_the_object(on):
    def colour(tree):
        info = add(tree, "ShaderNodeObjectInfo")
        ramp = add(tree, "ShaderNodeValToRGB", {0: info.outputs["Random"] if on else 0.0})
        ramp.color_ramp.elements[0].color = (0.9, 0.1, 0.1, 1)
        ramp.color_ramp.elements[1].color = (0.1, 0.1, 0.9, 1)
        return ramp.outputs[0]

    ground()
    world()
    material = painted("cubes", colour)
    for number, x in enumerate((-1.2, 0, 1.2)):
        box(f"box {number}", material, 0.8, location=(x, 0, 0.5))
