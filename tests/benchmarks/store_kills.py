"""`kill -9` of bakes and compressions at file events and moments, as a table.

    python -m tests.benchmarks.store_kills                       # 60 of each kind of work
    python -m tests.benchmarks.store_kills --writes 200          # in the middle of writes alone
    python -m tests.benchmarks.store_kills --caster blender      # with Blender's own rays
    python -m tests.benchmarks.store_kills --blend SCENE.blend   # `prt` of both, at moments

The scene of `tests.benchmarks.store_scene` has all that a bake may hold.

Ends with code 1 where something does not go on to the same bytes.
"""

import argparse
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import zarr

from tests.core.store.kills import BLENDER_KINDS, KINDS, Kills, compared, kill_all, prt

_GOOD = {"equal", "too late"}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=60, help="of each kind of work (60)")
    parser.add_argument("--moments", type=int, default=20, help="at random moments (20)")
    parser.add_argument("--writes", type=int, help="so many kills in the middle of writes")
    parser.add_argument("--blend", help="kill `prt bake` and `prt compress` of this scene")
    parser.add_argument("--caster", choices=("auto", "blender"), default="auto")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    kinds = BLENDER_KINDS if options.caster == "blender" else KINDS
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        if options.blend:
            table = _command_line(Path(folder), options)
        elif options.writes:
            table = _writes(Path(folder), options)
        else:
            table = kill_all(
                Path(folder), list(kinds), options.kills, options.moments, options.seed, _report
            )
    print(f"zarr {zarr.__version__}, {time.perf_counter() - begun:.0f} s")
    for kind, result in table.items():
        what = ", ".join(f"{count} {name}" for name, count in result.most_common())
        print(f"{kind:12}  {sum(result.values()):4} kills: {what}")
    return int(any(set(result) - _GOOD for result in table.values()))


def _report(kind, case, found):
    if found not in _GOOD:
        print(f"{kind} {case}: {found}", flush=True)


def _writes(folder, options):
    """Half-way through the data of a file, wherever in the work."""
    rng, killer = np.random.default_rng(options.seed), Kills(folder, writes=True)
    table = {kind: Counter() for kind in KINDS}
    for number in range(options.writes):
        kind = list(KINDS)[number % len(KINDS)]
        case = {"at": int(rng.integers(killer.events[kind])), "share": float(rng.random())}
        result = killer.kill(kind, **case)
        table[kind][result] += 1
        _report(kind, case, result)
    return table


def _command_line(folder, options):
    """`prt bake` by Blender's rays and Embree's, and `prt compress`, at random moments."""
    rng, table = np.random.default_rng(options.seed), {}
    for caster in ("blender", "embree"):
        bake = ("bake", options.blend, "--caster", caster, "--quiet", "-o")
        table[f"bake {caster}"] = _kill_command(bake, folder / caster, options, rng)
    compress = ("compress", "--method", "cpca", "--tolerance", "0.05", "--quiet")
    before = folder / "embree" / "whole.prt"
    table["compress"] = _kill_command(compress, folder / "compress", options, rng, before)
    return table


def _kill_command(command, folder, options, rng, before=None):
    whole, broken, result = folder / "whole.prt", folder / "broken.prt", Counter()
    folder.mkdir()
    if before:
        shutil.copytree(before, whole)
    begun = time.perf_counter()
    if prt(*command, whole) != 0:
        raise SystemExit(f"prt {command[0]} fails")
    seconds = time.perf_counter() - begun
    for _ in range(options.moments):
        if before:
            shutil.copytree(before, broken)
        # Twice, for what goes on may be killed as well.
        moments = seconds * rng.random(2)
        codes = [prt(*command, broken, kill_after=moment) for moment in moments]
        codes.append(prt(*command, broken))
        good = codes[-1] == 0 and set(codes) <= {0, -9}
        name = compared(broken, whole) if good else f"exit codes {codes}"
        name = "too late" if codes[0] == 0 and name == "equal" else name
        _report(command[0], moments.round(1).tolist(), name)
        result[name] += 1
        shutil.rmtree(broken)
    return result


if __name__ == "__main__":
    sys.exit(main())
