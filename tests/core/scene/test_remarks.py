"""Remarks of one kind become one line, ordered by how much of the scene they concern."""

from prt_core.scene.remarks import grouped
from tests.meshes import plane


def scene_of(**halves):
    """Squares by name, of so many units from the middle to the rim."""
    meshes = []
    for name, half in halves.items():
        mesh = plane(3, -half, half, name=name)
        mesh.material_names = (f"paint of {name}",)
        meshes.append(mesh)
    return meshes


def test_one_remark_on_many_objects_is_one_line_with_the_largest_first():
    names = {f"o{i}": 1 + i for i in range(7)}
    lines = grouped([f"{name}: it leaks" for name in names], scene_of(**names))
    assert lines == ["o6, o5, o4, o3 and 3 more: it leaks"]


def test_what_concerns_more_of_the_scene_comes_first():
    meshes = scene_of(small=1, large=5, middle=3)
    remarks = ["small: is dull", "material 'paint of middle': shines", "large: is dull too",
               "the sky is missing", "fog: its volume is not baked"]  # fmt: skip
    assert grouped(remarks, meshes) == [
        "the sky is missing",
        "fog: its volume is not baked",
        "large: is dull too",
        "material 'paint of middle': shines",
        "small: is dull",
    ]


def test_materials_and_lamps_of_one_remark_are_named_in_the_plural():
    remarks = ["material 'a': shines", "lamp 'x': flickers", "material 'b': shines", "a: shines"]
    assert grouped(remarks, []) == ["materials 'a', 'b': shines", "lamp 'x': flickers", "a: shines"]


def test_a_remark_is_not_said_twice_and_names_may_hold_colons():
    meshes = scene_of(**{"a: b": 2, "c": 1})
    remarks = ["a: b: is thin", "c: is thin", "a: b: is thin"]
    assert grouped(remarks, meshes) == ["a: b, c: is thin"]
    assert grouped(["3 objects hold colours", "3 objects hold colours"], meshes) == [
        "3 objects hold colours"
    ]


def test_equal_weights_stay_in_their_order():
    assert grouped(["b is off", "a is off"], []) == ["b is off", "a is off"]
