"""Writes the reference: a page for each folder of the core, of all that it exports.

python docs/reference.py   # into docs/api, which is not kept in the repository
"""

import importlib
import inspect
import pkgutil
from pathlib import Path

import prt_core

# What needs Blender is left to its docstrings, and the command line to its --help.
LEFT_OUT = {"prt_core.blender", "prt_core.cli", "prt_core.api"}


def packages():
    """`prt_core` and each folder within it that exports something: (name, module)."""
    yield "prt_core", prt_core
    for info in pkgutil.walk_packages(prt_core.__path__, "prt_core."):
        if info.ispkg and not any(info.name.startswith(name) for name in LEFT_OUT):
            module = importlib.import_module(info.name)
            if getattr(module, "__all__", ()):
                yield info.name, module


def page_of(name, module, indexed):
    """reStructuredText of one folder; `indexed` are those that another page describes already."""
    # Not by automodule: a folder may have the name of a call, as `prt_core.bake` has.
    text = inspect.getdoc(module).replace("|", "\\|")
    lines = [name, "=" * len(name), "", text, ""]
    for member in sorted(module.__all__, key=str.lower):
        thing = getattr(module, member)
        if not callable(thing):
            continue
        is_class = isinstance(thing, type)
        lines += [f".. {'autoclass' if is_class else 'autofunction'}:: {name}.{member}"]
        lines += ["   :members:"] * is_class
        # What several folders export is found under the innermost, by the index and by references.
        lines += ["   :no-index:"] * (thing in indexed) + [""]
        indexed.add(thing)
    return "\n".join(lines) + "\n"


def write(folder):
    """Write all pages and their index into a folder; files that are the same stay as they are."""
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    indexed, pages = set(), {}
    for name, module in sorted(packages(), key=lambda each: (-each[0].count("."), each[0])):
        pages[f"{name}.rst"] = page_of(name, module, indexed)
    tree = "\n".join(f"   {name}" for name in sorted(page.removesuffix(".rst") for page in pages))
    pages["index.rst"] = (
        "Reference\n=========\n\nWhat each folder of ``prt_core`` exports, from its docstrings.\n\n"
        f".. toctree::\n   :maxdepth: 1\n\n{tree}\n"
    )
    for name, text in pages.items():
        if not (folder / name).exists() or (folder / name).read_text() != text:
            (folder / name).write_text(text)
    for old in folder.glob("*.rst"):
        if old.name not in pages:
            old.unlink()


if __name__ == "__main__":
    write(Path(__file__).resolve().parent / "api")
