"""A few of the kills of `tests/benchmarks/store_kills.py`."""

import sys

import pytest

from tests.core.store.kills import KINDS, kill_all

if not sys.platform.startswith("linux"):
    pytest.skip("processes are copied and killed as Linux does", allow_module_level=True)


def test_whatever_is_killed_goes_on_to_the_same_bytes(quick_folder):
    table = kill_all(quick_folder, list(KINDS), kills=3, moments=1)
    for kind, result in table.items():
        assert set(result) <= {"equal", "too late"} and result["equal"] >= 3, (kind, result)
