"""Imports run one way, every module is on a floor, and only one folder knows Blender."""

import ast
from pathlib import Path

import prt_core

ROOT = Path(prt_core.__file__).parent
# From the ground. Folders and modules of the root by name; no floor imports one above it, and
# neighbours do not import each other. `__init__` is the package as `import prt_core` finds it.
FLOORS = [
    {"errors", "version"},
    {"runtime", "sphere"},
    {"rays", "basis", "reconstruct"},
    {"reflectance"},
    {"light", "scene"},
    {"transport", "store", "blender"},
    {"sampling", "compress"},
    {"evaluate", "lightfield"},
    {"relight"},
    {"bake", "blender_access"},
    {"export"},
    {"api"},
    {"__init__"},
    {"cli"},
    {"__main__"},
]
OUTSIDE = {"tests", "blender_addon", "scripts", "examples", "blend_scenes"}


def floors_of(folder):
    return [i for i, floor in enumerate(FLOORS) if folder in floor]


def place_of(file):
    """The folder or module of the root that a file belongs to."""
    return file.relative_to(ROOT).parts[0].removesuffix(".py")


def named(tree):
    """Dotted names that a module imports, or hands to what imports by a string."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "expected absolute imports"
            if node.module == "prt_core":
                yield from (f"prt_core.{alias.name}" for alias in node.names)
            else:
                yield node.module
        elif isinstance(node, ast.Call) and called(node) in {"import_module", "__import__"}:
            assert isinstance(node.args[0], ast.Constant), "expected a name that can be read here"
            yield node.args[0].value


def called(node):
    function = node.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", None)


def imports():
    """(file, its place, imported place of the core or outside module)."""
    for file in ROOT.rglob("*.py"):
        for name in named(ast.parse(file.read_text())):
            parts = name.split(".")
            if parts[0] == "prt_core":
                yield file, place_of(file), next(filter(floors_of, parts[1:2]), "__init__")
            else:
                yield file, place_of(file), parts[0]


def test_every_module_is_on_one_floor():
    places = {place_of(file) for file in ROOT.rglob("*.py")}
    assert places == set().union(*FLOORS)
    assert all(len(floors_of(place)) == 1 for place in places)


def test_no_floor_knows_one_above_it():
    checked = 0
    for file, place, imported in imports():
        (mine,), other = floors_of(place), floors_of(imported)
        if other and imported != place:
            checked += 1
            assert other[0] <= mine, f"{file} imports {imported}"
            assert other[0] < mine, f"{file} imports its neighbour {imported}"
    assert checked > 300


def test_the_package_stands_by_itself():
    for file, _, imported in imports():
        assert imported not in OUTSIDE, f"{file} imports {imported}"


def test_only_the_doors_know_blender():
    for file, place, imported in imports():
        if imported == "blender":
            assert place in {"blender", "blender_access", "api", "cli"}, file
        if imported in {"bpy", "mathutils"}:
            assert place in {"blender", "blender_access"}, file


def test_no_private_name_leaves_its_module():
    checked = 0
    for folder in (ROOT, ROOT.parent / "blender_addon", ROOT.parent / "scripts"):
        for file in folder.rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom):
                    checked += 1
                    private = [a.name for a in node.names if a.name.startswith("_")]
                    private = [name for name in private if not name.startswith("__")]
                    assert not private, f"{file} imports {', '.join(private)}"
    assert checked > 500
