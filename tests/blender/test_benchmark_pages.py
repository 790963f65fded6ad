"""What `make bench` measures has its place in docs/benchmarks."""

import shutil

import pytest

from tests.benchmarks import compress_tables, results, wavelet4d_tables, window
from tests.benchmarks.sections import PAGES, measured, write_sections

WRITERS = [
    *results.PARTS.values(),
    (wavelet4d_tables.PAGE, wavelet4d_tables.sections()),
    (window.PAGE, {window.TITLE: None}),
]


@pytest.mark.parametrize("page, sections", WRITERS)
def test_every_section_that_is_measured_stands_on_its_page(page, sections):
    lines = (PAGES / f"{page}.md").read_text().splitlines()
    # Nobody has run `huang_tables.py indirect` into the page yet.
    titles = [title for title in sections if title != "`huang_tables.py indirect`"]
    assert titles
    for title in titles:
        assert lines.count(f"## {title}") == 1, f"{page}.md has no section '{title}'"


def test_every_section_says_when_and_where_it_was_measured():
    """And the bench replaces that line together with the figures."""
    for path in PAGES.glob("[!R]*.md"):
        _, *sections = path.read_text().split("\n## ")
        assert sections, path
        for section in sections:
            title, said, empty, *_ = section.split("\n")
            assert said.startswith("*Measured on ") and said.endswith("*"), f"{path}: {title}"
            assert "prt_core" in said and "Python" in said and empty == "", f"{path}: {title}"
    assert measured().startswith("*Measured on ") and measured().endswith(".*")


def test_a_bench_of_one_part_leaves_all_others_alone(tmp_path):
    for path in PAGES.glob("*.md"):
        shutil.copy(path, tmp_path)
    titles = list(results.PARTS["compression"][1])
    write_sections(
        compress_tables.PAGE, {titles[1]: lambda: ["| new |"], titles[2]: lambda: []}, tmp_path
    )
    old = (PAGES / "compression.md").read_text().split("\n## ")
    new = (tmp_path / "compression.md").read_text().split("\n## ")
    assert len(new) == len(old)
    changed = [part for part, was in zip(new, old, strict=True) if part != was]
    assert len(changed) == 1 and changed[0].startswith(f"{titles[1]}\n*Measured on ")
    assert changed[0].strip().endswith("| new |")
    assert all(
        (tmp_path / path.name).read_text() == path.read_text()
        for path in PAGES.glob("*.md")
        if path.stem != compress_tables.PAGE
    )
