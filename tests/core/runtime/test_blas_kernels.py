import os
import subprocess
import sys

import pytest

from prt_core.runtime.blas_kernels import kernels_for

AVX512 = "avx2 fma avx512f avx512bw avx512cd avx512dq avx512vl"


@pytest.mark.parametrize(
    "vendor, flags, wanted",
    [
        ("GenuineIntel", AVX512, "SkylakeX"),
        ("GenuineIntel", "sse4_2 avx avx2 fma", "Haswell"),
        ("GenuineIntel", "sse4_2 avx", None),
        ("AuthenticAMD", AVX512, None),
    ],
)
def test_kernels_go_with_what_a_processor_knows(vendor, flags, wanted):
    one = f"processor\t: 0\nvendor_id\t: {vendor}\nflags\t\t: fpu {flags}\n\n"
    assert kernels_for(one + one.replace("avx2", "")) == wanted
    assert kernels_for("") is None


def named(before, **more):
    """What the environment names after `import prt_core`."""
    code = before + "import os, prt_core; print(os.environ.get('OPENBLAS_CORETYPE'))"
    kept = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    run = subprocess.run(
        [sys.executable, "-c", code], env={**kept, **more}, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_what_is_asked_for_or_too_late_stays():
    assert named("", OPENBLAS_CORETYPE="Nehalem") == "Nehalem"
    assert named("import numpy; ") == "None"
