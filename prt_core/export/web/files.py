"""The files of a page: its scripts, made shorter, and where they go.

A page that is opened from disk may load scripts and nothing else, so what it holds is text inside
of a script, and its own scripts are classic ones.
"""

from html import escape
from pathlib import Path

from prt_core.errors import expect
from prt_core.export.web.squeeze import short_names, squeezed
from prt_core.runtime.files import expect_output, new_folder, written
from prt_core.store.attributes import FILE

_PAGE = Path(__file__).parent / "page"
# The page's scripts of its own, each of some in the order in which they are run.
SCRIPTS = {
    "page.js": (
        "core.js", "cube.js", "relight.js", "images.js", "filmic.js", "shaders.js", "gpu.js",
        "view.js", "page.js",
    ),
    "exr.js": ("exr.js", "piz.js"),
    "gloss.js": ("gloss_shaders.js", "gloss.js"),
    "lightfield.js": ("lightfield.js",),
    "sets.js": ("sets.js",),
}  # fmt: skip
# By which a page of this project is known, in its first bytes.
_MARK, _HEAD = b'name="generator" content="prt_core"', 1024
_INDEX, _STYLE = "index.html", "style.css"
# What a page shows: a bake, a light field.
DATA, FIELD_DATA = "data.js", "field.js"


def expect_place(output, one_file):
    """The output, the folder to make or None, and whether it is one file."""
    named = Path(output).suffix.lower() in (".html", ".htm") if _is_path(output) else False
    if named:
        expect(one_file is not False, f"{output}: is one file; name a folder instead")
        return expect_output("output", output, (".html", ".htm"), create=True), None, True
    folder = expect_output("output", output, None, folder=True, create=True)
    expect(
        not (folder / FILE).exists(),
        f"{folder}: is a bake or a light field, which goes when it is baked anew; name another "
        "folder",
    )
    page = folder / _INDEX
    expect(
        not page.is_file() or _MARK in page.read_bytes()[:_HEAD],
        f"{page}: is another's page; name another folder",
    )
    # Without a page, files of these names are of somebody else.
    names = () if one_file or page.is_file() else (_STYLE, DATA, FIELD_DATA, *SCRIPTS)
    there = [name for name in names if (folder / name).exists()]
    expect(
        not there,
        f"{folder}: has a {there and there[0]} already, which is of no page of prt; name another "
        "folder, or delete it",
    )
    return folder, folder, bool(one_file)


def _is_path(value):
    return isinstance(value, str | Path)


def page_files(data, title, one_file, scripts=()):
    """What a page consists of.

    Parameters
    ----------
    data : dict of str -> str
        Scripts that hold what it shows, by the names of their files.
    title : str
    one_file : bool
    scripts : sequence of str
        Those of `SCRIPTS` that it needs besides `page.js`.

    Returns
    -------
    dict of str -> str
        Texts by names of files; one that is called `index.html` alone where it is one file.
    """
    texts = {
        path.name: path.read_text("utf-8") for path in _PAGE.iterdir() if path.suffix != ".npz"
    }
    names = short_names([text for name, text in texts.items() if name.endswith(".js")])
    made = {
        name: "".join(squeezed(texts[part], names) for part in SCRIPTS[name])
        for name in ("page.js", *scripts)
    }
    page = texts[_INDEX].replace("TITLE", escape(title))
    for name in (DATA, FIELD_DATA, *SCRIPTS):
        if name not in data and name not in made:
            page = page.replace(f'<script src="{name}"></script>\n', "")
    if one_file:
        page = page.replace(f'<link rel="stylesheet" href="{_STYLE}">',
                            f"<style>\n{texts[_STYLE]}</style>")  # fmt: skip
        for name, text in {**data, **made}.items():
            page = page.replace(f'<script src="{name}"></script>', f"<script>\n{text}</script>")
        return {_INDEX: page}
    return {**data, **made, _STYLE: texts[_STYLE], _INDEX: page}


def write_page(output, folder, files):
    """Write files by name, each whole and the page itself last: into a folder, or as one file."""
    if folder is None:
        (text,) = files.values()
        with written(output) as part:
            part.write_bytes(text.encode())
        return
    with new_folder(folder):
        for name, text in files.items():
            with written(folder / name) as part:
                part.write_bytes(text.encode())
