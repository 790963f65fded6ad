"""A part of the fuzzer's runs (`tests/benchmarks/store_fuzz.py` does the many)."""

import sys
from collections import Counter

import pytest

from prt_core import run
from prt_core.store import BakeStore, read_scene
from tests.core.store import fuzz_worker
from tests.core.store.fuzz import fuzz, table_lines
from tests.core.store.mutations import MUTATIONS

if not sys.platform.startswith("linux"):
    pytest.skip("pipes and limits of memory are those of Linux", allow_module_level=True)


def test_no_damage_is_wrong_in_silence_or_more_than_a_line(quick_folder):
    table, bad, peak, _ = fuzz(quick_folder, 2 * len(MUTATIONS), seed=0)
    assert not bad, "\n".join([*table_lines(table), *map(str, bad[:3])])
    # Each of two kinds of bakes, and of each kind a tenth of all at least.
    assert len(table) == 2 * len(MUTATIONS)
    kinds = Counter(kind for _, kind in table)
    assert len(kinds) == 5 and min(kinds.values()) * 10 > len(table)
    total = sum(table.values(), start=type(next(iter(table.values())))())
    # It must not be that everything is refused, or that nothing was damaged.
    assert min(total["harmless"], total["repaired"], total["refused"]) > 8
    assert peak < 1 << 31


def test_what_is_damaged_holds_all_that_a_bake_may(tmp_path):
    path = tmp_path / "a.prt"
    run(fuzz_worker.steps(path, "exhaustive"))
    store = BakeStore(path)
    kept = read_scene(store)
    assert {"emission", "opacity", "translucency"} <= set(store.attributes["materials"])
    assert kept.emitters == ("ball", "leaf") and len(kept.details) > 1
    assert (kept.lattice_back >= 0).any()
    # Of fronts and backs, and to shadow rays another.
    assert kept.opacity.back is not None and kept.shadow_opacity is not kept.opacity
    parts = {"emission_direct", "emission_received", "opacity_back", "shadow_opacity_cells"}
    assert parts <= set(store.names())
