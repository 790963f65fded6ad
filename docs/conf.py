"""How `make docs` turns these pages, the tutorials and the docstrings into a site."""

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import reference  # noqa: E402  (lies beside this file)

from prt_core.version import __version__  # noqa: E402

project, author = "prt", "the prt developers"
copyright = "the prt developers, GPL-3.0-or-later"
version = release = __version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "tutorials/*.rst", "tutorials/*.md", "sg_execution_times.rst"]
html_theme, html_title = "furo", f"prt {release}"
myst_heading_anchors = 4
nitpicky = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "tutorials",
    "gallery_dirs": "learn",
    "filename_pattern": r"/\d\d_",
    "ignore_pattern": r"/(pictures|__init__)\.py",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib",),
    "download_all_examples": False,
    "show_memory": False,
    "abort_on_example_error": True,
    # Each opens scenes of its own in the one Blender that a process has.
    "parallel": False,
}

# Pages that lie outside this folder and are part of the site.
GUESTS = {
    "results.md": ROOT / "RESULTS.md",
    "technical.md": ROOT / "TECHNICAL.md",
    "changes.md": ROOT / "CHANGELOG.md",
    "contributing.md": ROOT / "CONTRIBUTING.md",
    "examples.md": ROOT / "examples" / "README.md",
}
LINK = re.compile(r"(!?)\[((?:[^\]\[]|\[[^\]]*\])*)\]\(([^)\s#]+)(#[^)\s]*)?\)")


def moved(text, source, page):
    """A page's text with links as they are seen from another place; links to code become code.

    Parameters
    ----------
    text : str
    source : Path
        Where it lies in the repository.
    page : Path
        Where it lies in the site, below `DOCS`.
    """
    places = {path: DOCS / name for name, path in GUESTS.items()}
    places[ROOT / "README.md"] = DOCS / "index.md"
    places[DOCS / "tutorials" / "GALLERY_HEADER.rst"] = DOCS / "learn" / "index.rst"

    def link(match):
        image, label, target, section = match[1], match[2], match[3], match[4] or ""
        if re.match(r"[a-z]+:", target):
            return match[0]
        file = (source.parent / target).resolve()
        file = places.get(file, file)
        if not file.is_relative_to(DOCS):
            return f"{label} (`{file.relative_to(ROOT)}`)" if "`" not in label else label
        return f"{image}[{label}]({_relative(file, page.parent)}{section})"

    return LINK.sub(link, text)


def _relative(file, folder):
    up = 0
    while not file.is_relative_to(folder):
        folder, up = folder.parent, up + 1
    return "../" * up + str(file.relative_to(folder))


def read_page(app, name, source):
    """Give a guest's page its text, and every Markdown page links that lead somewhere."""
    page = DOCS / f"{name}.md"
    if page.exists():
        origin = GUESTS.get(f"{name}.md", page)
        source[0] = moved(origin.read_text(), origin, page)
        if page.name == "README.md":
            source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"


def read_docstring(app, what, name, thing, options, lines):
    """Bars are the size of a vector here, not a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    for name, path in GUESTS.items():
        page = DOCS / name
        note = f"<!-- {path.relative_to(ROOT)}, as `make docs` shows it -->\n"
        if not page.exists() or page.read_text() != note:
            page.write_text(note)
    reference.write(DOCS / "api")
    app.connect("source-read", read_page)
    app.connect("autodoc-process-docstring", read_docstring)
