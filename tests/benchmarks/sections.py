"""Sections of the pages in docs/benchmarks, each replaced on its own.

A benchmark names its page and, for each section, what measures it:

    PAGE = "rays"
    SECTIONS = {"Back-ends": back_ends}    # a function that returns the lines

No lines: what it needs is not on this machine, and the section stays as it is.
"""

import os
import platform
import re
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import prt_core

PAGES = Path(__file__).resolve().parents[2] / "docs" / "benchmarks"


def write_sections(page, sections, pages=PAGES):
    """Measure sections one after another; each is written as soon as it is there."""
    for title, measure in sections.items():
        lines = measure()
        if lines:
            write_section(pages / f"{page}.md", title, lines, measured())


def write_section(path, title, lines, said):
    """Replace a section of a page, or add it at the end.

    Parameters
    ----------
    title : str
        Without `## `.
    lines : sequence of str
        What follows the title and the line that says when and where it was measured.
    said : str
        That line. Where the others are what stands there already, the old one stays.
    """
    text = path.read_text()
    pattern = re.compile(rf"^## {re.escape(title)}\n.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    body = "\n".join(lines).strip()
    section = f"## {title}\n{said}\n\n{body}\n"
    old = pattern.search(text)
    if old is None:
        path.write_text(f"{text.rstrip()}\n\n{section}")
    elif old.group().partition("\n\n")[2].strip() != body:
        text = pattern.sub(lambda _: f"{section}\n", text)
        path.write_text(f"{text.rstrip()}\n")


def measured():
    """When and where: date, processor, versions."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    try:
        blender = f"bpy {version('bpy')}, "
    except PackageNotFoundError:
        blender = ""
    return (
        f"*Measured on {time.strftime('%Y-%m-%d')}: {names[0] if names else platform.processor()}, "
        f"{os.cpu_count()} cores, Python {platform.python_version()}, {blender}"
        f"prt_core {prt_core.__version__}.*"
    )
