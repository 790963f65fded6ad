"""Sections of RESULTS.md, each replaced on its own."""

import re


def write_section(path, title, lines):
    """Replace a section of a Markdown file, or add it at the end."""
    text = path.read_text() if path.exists() else ""
    section = "\n".join([title, *lines]) + "\n"
    pattern = re.compile(rf"^{re.escape(title)}$.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    if pattern.search(text):
        text = pattern.sub(lambda _: section + "\n", text).rstrip() + "\n"
    else:
        text = text.rstrip() + "\n\n" + section
    path.write_text(text)
