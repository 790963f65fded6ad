"""Damaged and forged bakes: what becomes of each, as a table.

    python -m tests.benchmarks.store_fuzz --count 1200 --seed 1

Ends with code 1 where a colour was wrong in silence, a traceback came, something hung, asked for
more than 2 GB, or touched a file outside of the bake.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import zarr

from prt_core.compress import candidate_names
from tests.core.store.fuzz import GOOD, fuzz, table_lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    begun = time.perf_counter()

    def report(number, mutation, kind, verdict, text):
        if verdict not in GOOD:
            print(f"{number}: {mutation} of {kind}: {verdict}: {text}", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        result = fuzz(
            Path(folder), options.count, options.seed, [*candidate_names(), "irradiance"], report
        )
    table, bad, peak, slowest = result
    print(*table_lines(table), sep="\n")
    spent = time.perf_counter() - begun
    print(
        f"{options.count} runs with zarr {zarr.__version__} in {spent:.0f} s: {len(bad)} bad; "
        f"peak {peak / 1e6:.0f} MB, longest answer {slowest:.1f} s"
    )
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
