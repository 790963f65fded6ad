"""Which material a face has."""

from tests.conformance.parts import (
    BESIDE,
    BLUE,
    RED,
    add,
    geometry_nodes,
    grid,
    ground,
    plain,
    put,
    wall,
    world,
)
from tests.conformance.scene import scene


@scene(quick=True)
def slots_by_face(on):
    ground()
    world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(plain("other", BLUE))
    item.data.polygons.foreach_set("material_index", [int(on)] * len(item.data.polygons))


@scene(targets=("ground", "wall"), since=(5, 0), quick=True)
def slots_that_are_empty_or_missing(on):
    ground()
    world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(None)
    slots = [0, 1, 2, 7] if on else [0] * 4
    item.data.polygons.foreach_set("material_index", slots * (len(item.data.polygons) // 4))


@scene()
def slot_of_the_object(on):
    ground()
    world()
    slot = wall(plain("wall", RED), **BESIDE).material_slots[0]
    if on:
        slot.link, slot.material = "OBJECT", plain("other", BLUE)


@scene()
def slot_by_geometry_nodes(on):
    ground()
    world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(plain("other", BLUE))
    if on:
        geometry_nodes(item, lambda tree, geometry: add(
            tree, "GeometryNodeSetMaterialIndex", {"Geometry": geometry, "Material Index": 1}
        ).outputs[0])  # fmt: skip


@scene()
def no_material(on):
    ground()
    world()
    item = wall(plain("wall", RED), **BESIDE)
    if on:
        item.data.materials.clear()


@scene(targets=("ground", "first", "second"), quick=True)
def one_mesh_of_two_objects(on):
    ground()
    world()
    first = grid("first", 4, 1.5, plain("red", RED), location=(-1.5, 0, 0.8))
    second = put("second", first.data, location=(1.5, 0, 0.8))
    if on:
        slot = second.material_slots[0]
        slot.link, slot.material = "OBJECT", plain("blue", BLUE)
