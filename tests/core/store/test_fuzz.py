"""A part of the fuzzer's runs (`tests/benchmarks/store_fuzz.py` does the many)."""

import sys

import pytest

from tests.core.store.fuzz import fuzz, table_lines
from tests.core.store.mutations import MUTATIONS

if not sys.platform.startswith("linux"):
    pytest.skip("pipes and limits of memory are those of Linux", allow_module_level=True)


def test_no_damage_is_wrong_in_silence_or_more_than_a_line(quick_folder):
    table, bad, peak, _ = fuzz(quick_folder, 203, seed=0)
    assert not bad, "\n".join([*table_lines(table), *map(str, bad[:3])])
    assert {name for name, _ in table} == {mutation.__name__ for mutation in MUTATIONS}
    total = sum(table.values(), start=type(next(iter(table.values())))())
    # It must not be that everything is refused, or that nothing was damaged.
    assert min(total["harmless"], total["repaired"], total["refused"]) > 20
    assert peak < 1 << 31
