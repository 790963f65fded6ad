"""Imports run one way, and only one folder knows Blender."""

import ast
from pathlib import Path

import prt_core

ROOT = Path(prt_core.__file__).parent
FLOORS = [{"sphere"}, {"rays", "basis", "light"}, {"scene"}, {"transport"}, {"reconstruct"},
          {"sampling"}, {"compress"}, {"store"}, {"evaluate"}]  # fmt: skip


def imports():
    """(file, folder, imported folder of the core or outside module)."""
    for file in ROOT.rglob("*.py"):
        folder = file.relative_to(ROOT).parts[0]
        for node in ast.walk(ast.parse(file.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            for name in names:
                parts = name.split(".")
                core = parts[0] == "prt_core" and len(parts) > 1
                yield file, folder, parts[1] if core else parts[0]


def floor_of(folder):
    return next((i for i, floor in enumerate(FLOORS) if folder in floor), None)


def test_no_floor_knows_one_above_it():
    checked = 0
    for file, folder, imported in imports():
        mine, other = floor_of(folder), floor_of(imported)
        if mine is not None and other is not None:
            checked += 1
            assert other <= mine, f"{file} imports {imported}"
            assert other < mine or folder == imported, f"{file} imports its neighbour {imported}"
    assert checked > 20


def test_only_the_doors_know_blender():
    for file, folder, imported in imports():
        if imported == "blender":
            assert folder in {"blender", "api.py", "cli"}, file
        if imported in {"bpy", "mathutils"}:
            assert folder in {"blender", "api.py"}, file


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
