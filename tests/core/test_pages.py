"""The pages of the project lead to what is there, and claims are what the tables say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OTHERS = {"build", "demo_output", "node_modules"}
PAGES = [
    path
    for path in sorted(ROOT.rglob("*.md"))
    if not any(part.startswith(".") or part in OTHERS for part in path.relative_to(ROOT).parts)
]


def prose(path):
    """A page without its code, where brackets and hashes mean something else."""
    text = re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def links(path):
    """(target as it is written, file that is meant, section or '')."""
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if not re.match(r"[a-z]+:", target):
            file, _, section = target.partition("#")
            yield target, (path.parent / file if file else path).resolve(), section


def sections(path):
    """{name of a section, as links spell it: its text, with all below it}."""
    text = path.read_text()
    heads, result = list(re.finditer(r"^(#+) (.+)$", text, re.MULTILINE)), {}
    for index, head in enumerate(heads):
        after = (h.start() for h in heads[index + 1 :] if len(h[1]) <= len(head[1]))
        name = re.sub(r"[^\w\- ]", "", head[2].lower()).replace(" ", "-")
        result[name] = text[head.start() : next(after, len(text))]
    return result


def test_links_lead_to_files_and_sections_that_are_there():
    checked = 0
    for path in PAGES:
        for target, file, name in links(path):
            checked += 1
            assert file.exists(), f"{path.relative_to(ROOT)}: {target}"
            if name:
                assert name in sections(file), f"{path.relative_to(ROOT)}: {target}"
    assert checked > 40


CLAIM = re.compile(r"^\| (.+) \| (.+) \| ([AX]) \| (.+) \| \[\w+\]\(([^#]+)#([^)]+)\) \|$", re.M)
CLAIMS = CLAIM.findall((ROOT / "RESULTS.md").read_text())
MACHINES = {"A": "AMD EPYC", "X": "Intel(R) Xeon(R)"}


def test_results_are_about_twenty_claims():
    rows = [line for line in (ROOT / "RESULTS.md").read_text().splitlines() if line[:1] == "|"]
    assert len(rows) == len(CLAIMS) + 2 and 15 <= len(CLAIMS) <= 30


@pytest.mark.parametrize("claim, figures, machine, command, page, name", CLAIMS)
def test_claims_are_what_their_table_says(claim, figures, machine, command, page, name):
    table = sections(ROOT / page)[name]
    numbers = re.findall(r"(?<![\w.,])\d+(?:,\d+)*(?:\.\d+)?", figures)
    missing = [n for n in numbers if not re.search(rf"(?<![\d.,]){re.escape(n)}(?![.,]?\d)", table)]
    assert numbers and not missing, f"{claim}: {page} has no {missing}; was it measured again?"
    assert MACHINES[machine] in table.split("\n")[1], f"{claim}: not measured on {machine}"


DECISIONS = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
HEADINGS = ["## Decision", "## Why", "## Measured", "## Tried"]


@pytest.mark.parametrize("path", DECISIONS, ids=lambda path: path.stem)
def test_a_decision_has_its_headings_and_something_below_each(path):
    _, title, _, *parts = re.split(r"^(#+ .+)$", path.read_text(), flags=re.MULTILINE)
    assert title.startswith(f"# {int(path.stem[:4])}. ")
    headings, bodies = parts[::2], parts[1::2]
    assert headings in (HEADINGS, HEADINGS[:3])
    assert all(body.strip() for body in bodies), "an empty heading"


def test_decisions_are_numbered_without_gaps_and_listed():
    assert [int(path.stem[:4]) for path in DECISIONS] == list(range(1, len(DECISIONS) + 1))
    listed = re.findall(
        r"^\| \[(\d{4})\]\(([^)]+)\) \| (.+) \| .+ \|$",
        (ROOT / "docs" / "decisions" / "README.md").read_text(),
        re.MULTILINE,
    )
    wanted = []
    for path in DECISIONS:
        title = path.read_text().split("\n")[0].partition(". ")[2]
        wanted.append((path.stem[:4], path.name, title))
    assert listed == wanted
