"""Kernels of OpenBLAS for processors that are newer than it.

Wheels of numpy 1.26, which Blender until 5.0 needs, hold one that takes Intel's cores since 2023
for the oldest there are: matrix products then take five times as long. It asks the environment
first, once, when it is loaded; so this module is imported before numpy, and chooses then.
"""

import os
import platform
import sys
from pathlib import Path

_NAME = "OPENBLAS_CORETYPE"
_PROCESSOR = Path("/proc/cpuinfo")
# Kernels by what a processor must know for them, the newest first.
_KERNELS = {
    "SkylakeX": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "fma"},
    "Haswell": {"avx2", "fma"},
}


def choose_kernels():
    """Name them in the environment, where it names none and numpy is yet to be loaded.

    Only on Linux, and for Intel's processors; the others are known by their families.
    """
    if _NAME in os.environ or "numpy" in sys.modules or platform.machine() != "x86_64":
        return
    try:
        facts = _PROCESSOR.read_text()
    except OSError:
        # Another system.
        return
    kernels = kernels_for(facts)
    if kernels is not None:
        os.environ[_NAME] = kernels


def kernels_for(facts):
    """The kernels for a processor, or None where OpenBLAS is to choose.

    Parameters
    ----------
    facts : str
        As /proc/cpuinfo has them.
    """
    lines = (line.partition(":") for line in facts.splitlines())
    first = {}
    for name, _, value in lines:
        first.setdefault(name.strip(), value.strip())
    if first.get("vendor_id") != "GenuineIntel":
        return None
    flags = set(first.get("flags", "").split())
    return next((name for name, needed in _KERNELS.items() if needed <= flags), None)


choose_kernels()
