"""What the fuzzer judges, in a process of its own: it may hang, or ask for all memory.

Reads requests, one JSON object a line, and answers each with one: what became of the bake there.
"""

import contextlib
import hashlib
import io
import json
import os
import resource
import sys
import traceback
from dataclasses import replace

import numpy as np

from prt_core import BakeSettings, PRTError, bake_steps, compress, load, run
from prt_core.bake.measure import standing_lights
from prt_core.cli import main
from prt_core.relight.relighter import Relighter
from prt_core.runtime.machine import peak_bytes, reset_peak
from tests.core.store.conftest import LAMPS
from tests.meshes import ball_on_paint, leaf

# Points that are stored together, so that there are several blocks of few.
BLOCK = 128
MEMORY = 2 << 30
ORIGIN = {"file": "../scene.blend", "scene": "Scene"}
SETTINGS = {
    "exhaustive": BakeSettings(resolution=4, tolerance=0.05, caster="auto"),
    "sampled": BakeSettings(resolution=4, tolerance=0.05, caster="auto", method="agreement"),
}


def scene():
    """With all that a bake may hold."""
    return ball_on_paint(more=[leaf()], max_hidden=300)


def world():
    return np.random.default_rng(3).random((96, 3)).astype(np.float32)


def small_blocks():
    sys.modules["prt_core.bake.visibility"].BLOCK = BLOCK
    sys.modules["prt_core.store.journal"].CHUNK = 4096


def steps(path, settings, caster="auto", **options):
    """The steps of the bake that every subject is one of."""
    settings = replace(SETTINGS[settings], caster=caster)
    return bake_steps(scene(), path, settings, LAMPS, world(), origin=ORIGIN, **options)


def compressed(path, method):
    compress(path, method=method, tolerance=0.3, lights=standing_lights())


def colours(path, form="exact"):
    """Digests of what relighting gives, and whether it is finite."""
    bake = load(path)
    relighter = Relighter(bake, form=form)
    radiance = [relighter.radiance(light) for light in (world()[::-1].copy(), "world")]
    radiance.append(relighter.radiance(None, lamps=True, lamp_samples=3))
    named = bake.colours(radiance[0])
    digest = hashlib.sha256("".join(named).encode())
    for array in (*radiance, *named.values()):
        digest.update(np.ascontiguousarray(array))
    finite = all(bool(np.isfinite(array).all()) for array in radiance)
    return digest.hexdigest(), finite


def info(path):
    """`prt info` must end with a code and, where that is 2, one line of error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["info", str(path)])
    lines = err.getvalue().splitlines()
    if code != 0 and (code != 2 or len(lines) != 1 or not lines[0].startswith("prt: ")):
        raise AssertionError(f"prt info: code {code}, {lines}")


def work(request):
    path = request["path"]
    if request["do"] == "bake":
        options = {"restart": True} if request.get("restart") else {}
        run(steps(path, request["settings"], **options))
    else:
        info(path)
    return colours(path, request.get("form", "exact"))


def answer(request):
    reset_peak()
    try:
        digest, finite = work(request)
        result = {"colours": digest, "finite": finite}
    except PRTError as error:
        result = {"error": str(error)}
    except BaseException:
        result = {"traceback": traceback.format_exc()}
    return {**result, "peak": peak_bytes()}


def serve():
    small_blocks()
    # Embree and BLAS ask for more addresses than memory: what a request may add is what counts.
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, now + MEMORY))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    serve()
