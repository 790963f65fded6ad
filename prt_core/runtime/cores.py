"""How many cores this process may use: its share of the machine, for others work there as well."""

import os

from prt_core.errors import expect, shown
from prt_core.runtime.machine import limit_blas

# The variable that says it: of the cluster's script, or of whoever starts several on one machine.
THREADS = "PRT_THREADS"


def n_cores():
    """Threads that work is cut into: PRT_THREADS, or the cores that the system lets us run on.

    Raises
    ------
    PRTError
        PRT_THREADS is no whole number from 1.
    """
    asked = os.environ.get(THREADS, "").strip()
    if not asked:
        affinity = getattr(os, "sched_getaffinity", None)
        return len(affinity(0)) if affinity else os.cpu_count() or 1
    good = asked.isdecimal() and len(asked) < 5 and int(asked) > 0
    expect(good, f"{THREADS}: expected a whole number from 1, got {shown(asked)}")
    return int(asked)


def keep_to_share():
    """Let matrix products take no more threads than `n_cores`, where PRT_THREADS says how many."""
    if os.environ.get(THREADS, "").strip():
        limit_blas(n_cores())
