"""docs/conventions.md says what the code does: its blocks run, and every one of them asserts."""

import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "conventions.md"


def test_the_page_is_what_the_code_does():
    text, names = PAGE.read_text(), {}
    blocks = list(re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    assert len(blocks) > 10
    for block in blocks:
        assert "assert " in block[1], block[1]
        # Lines are counted as they are in the page, for the message where one is wrong.
        before = text[: block.start(1)].count("\n")
        exec(compile("\n" * before + block[1], str(PAGE), "exec"), names)
