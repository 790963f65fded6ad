"""Sections of RESULTS.md, each replaced on its own."""

import re


def write_section(path, title, lines, keep=False):
    """Replace a section of a Markdown file, or add it at the end.

    With `keep`, parts of it (`### …`) that `lines` do not have stay where they are: they were
    measured at another time.
    """
    text = path.read_text() if path.exists() else ""
    pattern = re.compile(rf"^{re.escape(title)}$.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    found = pattern.search(text)
    section = "\n".join([title, *lines]).rstrip() + "\n"
    if found and keep:
        section = _joined(found.group(), section)
    if found:
        text = pattern.sub(lambda _: section + "\n", text).rstrip() + "\n"
    else:
        text = text.rstrip() + "\n\n" + section
    path.write_text(text)


def _joined(old, new):
    """The parts of a new section, and behind their old neighbours those that only the old has."""
    old, parts = _parts(old), _parts(new)
    before = None
    for heading, body in old.items():
        if heading not in parts:
            items = list(parts.items())
            place = 1 + list(parts).index(before)
            parts = dict([*items[:place], (heading, body), *items[place:]])
        before = heading
    return "\n\n".join(parts.values()) + "\n"


def _parts(section):
    """{heading: text} of a section; its beginning is under its own title."""
    parts = re.split(r"^(?=### )", section, flags=re.MULTILINE)
    return {part.partition("\n")[0]: part.rstrip() for part in parts}
