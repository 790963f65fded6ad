"""`kill -9` at file events and at moments of bakes and compressions, which are then gone on with.

The events are counted by functions of `os` that are replaced in the process which is killed: files
made, written (half of the data, then the kill), renamed and removed, folders made and removed.
"""

import itertools
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from prt_core import BakeSettings, bake_steps, load, run
from prt_core.store import BakeStore, compressed_attributes
from tests.core.store import fuzz_worker

ROOT = Path(__file__).parents[3]
_NAMES = ("open", "replace", "rename", "mkdir", "unlink", "rmdir", "fsync")
# Imports once and is then copied for each process.
_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(["tests.core.store.kills"])


def replaced(path):
    """A finished bake with another seed, that a restart replaces."""
    settings = BakeSettings(resolution=4, tolerance=0.05, caster="auto", seed=5)
    run(bake_steps(fuzz_worker.scene(), path, settings))


def finished(path):
    run(fuzz_worker.steps(path, "exhaustive"))


# Of each kind of work: what is there before, and the work.
KINDS = {
    "exhaustive": (None, lambda path: run(fuzz_worker.steps(path, "exhaustive"))),
    "sampled": (None, lambda path: run(fuzz_worker.steps(path, "sampled"))),
    "restart": (replaced, lambda path: run(fuzz_worker.steps(path, "exhaustive", restart=True))),
    "compress": (finished, lambda path: fuzz_worker.compressed(path, "cpca")),
}


def _by_blender(kind):
    """The same work with Blender's own rays."""
    before, _ = KINDS[kind]

    def work(path):
        from prt_core.blender import casters

        casters.register()
        name, options = ("exhaustive", {"restart": True}) if kind == "restart" else (kind, {})
        run(fuzz_worker.steps(path, name, caster="blender", **options))

    return before, work


# In a process with Blender in it.
BLENDER_KINDS = {f"{kind} blender": _by_blender(kind) for kind in KINDS if kind != "compress"}
_WORKS = {**KINDS, **BLENDER_KINDS}


def arm(path, at, share=0.5, writes=False):
    """Kill this process at its event number `at` below the folder that `path` is in.

    Parameters
    ----------
    path : Path
    at : int or None
        None: count them only.
    share : float
        Of the data that is written before a kill in a write.
    writes : bool
        Whether writes are the only events.

    Returns
    -------
    list of int
        The number of events so far.
    """
    folder, counter, seen = str(path.parent), itertools.count(), [0]

    def dies():
        seen[0] = next(counter) + 1
        return seen[0] - 1 == at

    def event(function):
        def called(target, *rest, **named):
            inside = isinstance(target, int) or "dir_fd" in named or str(target).startswith(folder)
            reads = function is opened and not (rest and rest[0] & os.O_CREAT)
            if inside and not reads and dies():
                os.kill(os.getpid(), signal.SIGKILL)
            return function(target, *rest, **named)

        return called

    opened, built = os.open, os.fdopen
    for name in () if writes else _NAMES:
        setattr(os, name, event(getattr(os, name)))

    def fdopen(handle, mode="r", *rest, **named):
        file = built(handle, mode, *rest, **named)
        if "w" in mode:
            file = _Dying(file, dies, share)
        return file

    os.fdopen = fdopen
    return seen


class _Dying:
    def __init__(self, file, dies, share):
        self._file, self._dies, self._share = file, dies, share

    def write(self, data):
        if self._dies():
            self._file.write(bytes(data)[: int(self._share * len(data))])
            self._file.flush()
            os.kill(os.getpid(), signal.SIGKILL)
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._file.close()


def _child(path, kind, answer, at, share, writes):
    fuzz_worker.small_blocks()
    seen = arm(path, at, share, writes)
    _WORKS[kind][1](path)
    answer.put(seen[0])


def start(path, kind, at=None, share=0.5, writes=False):
    """A process that does the work; its queue gives the number of events at its end."""
    answer = _SERVER.SimpleQueue()
    process = _SERVER.Process(target=_child, args=(path, kind, answer, at, share, writes))
    process.start()
    return process, answer


class Kills:
    """The works, each done once without a kill, and kills of them.

    Parameters
    ----------
    folder : Path
        Empty.
    kinds : sequence of str
    writes : bool
        Whether only writes are events: then all kills are in the middle of one.
    """

    def __init__(self, folder, kinds=tuple(KINDS), writes=False):
        fuzz_worker.small_blocks()
        self.folder, self._writes = folder, writes
        self.events, self.seconds = {}, {}
        # The first process waits for the imports, which is no moment of a work.
        idle = _SERVER.Process(target=time.sleep, args=(0,))
        idle.start()
        idle.join()
        for kind in kinds:
            path = self._prepared(kind, folder / f"whole {kind}")
            begun = time.perf_counter()
            process, answer = start(path, kind, writes=writes)
            process.join()
            if process.exitcode != 0:
                raise RuntimeError(f"{kind}: ends with {process.exitcode} without a kill")
            self.events[kind] = answer.get()
            self.seconds[kind] = time.perf_counter() - begun

    def _prepared(self, kind, folder):
        before = _WORKS[kind][0]
        folder.mkdir()
        if before is not None:
            kept = self.folder / f"before {kind}" / "a.prt"
            if not kept.exists():
                kept.parent.mkdir()
                before(kept)
            shutil.copytree(kept, folder / "a.prt")
        return folder / "a.prt"

    def kill(self, kind, at=None, share=0.5, after=None):
        """Kill a work at an event or after some seconds, and go on with it.

        Returns
        -------
        str
            "equal", "too late" where the work was done before, or what went wrong.
        """
        case = self.folder / "case"
        shutil.rmtree(case, ignore_errors=True)
        path = self._prepared(kind, case)
        process, answer = start(path, kind, at, share, self._writes)
        if after is not None:
            process.join(after)
            process.kill()
        process.join()
        if process.exitcode == 0:
            return "too late"
        if process.exitcode != -signal.SIGKILL:
            return f"ended with {process.exitcode}"
        wrong = self._left(kind, path)
        if wrong:
            return wrong
        process, answer = start(path, kind)
        process.join()
        if process.exitcode != 0:
            return f"cannot go on: {process.exitcode}"
        return self._compare(kind, path)

    def _left(self, kind, path):
        """What is damaged by the kill alone."""
        if _WORKS[kind][0] is not None:
            # The old bake, or the new one, at any moment.
            lit = _lit(path)
            old, new = self.folder / f"before {kind}" / "a.prt", self._whole(kind)
            return "" if lit in (_lit(old), _lit(new)) else "the old bake is lost"
        stores = [BakeStore(path)] if (path / "zarr.json").exists() else []
        for store in stores:
            for name in store.names():
                array = store.array(name)
                for key in array._found():
                    array._chunks.load(key)
        return ""

    def _whole(self, kind):
        return self.folder / f"whole {kind}" / "a.prt"

    def _compare(self, kind, path):
        left = [p.name for p in path.parent.rglob("*.part*")]
        left += [p.name for p in path.parent.iterdir() if p.name != "a.prt"]
        if left:
            return f"left {left}"
        return compared(path, self._whole(kind))


def compared(path, whole):
    """ "equal", or how two bakes differ, their compressed forms included."""
    one, two = _content(path), _content(whole)
    if sorted(one) != sorted(two):
        return f"other arrays: {sorted(set(one) ^ set(two))}"
    for name, array in one.items():
        if array.dtype != two[name].dtype or not np.array_equal(array, two[name]):
            return f"'{name}' differs"
    load(path)
    return "equal"


def _lit(path):
    return load(path).transport.fingerprint()


def _content(path):
    """All arrays of a bake and its compressed form."""
    store = BakeStore(path)
    result = {name: store.read(name) for name in store.names()}
    form = compressed_attributes(store)
    if form:
        for name in form["arrays"]:
            result[f"compressed/{name}"] = store.read(f"{form['folder']}/{name}")
    return result


def events_of(count, kills):
    """Events to kill at: the first and the last ones, others evenly between; few all evenly."""
    if kills < 8:
        return np.linspace(0, count - 1, kills).astype(int).tolist()
    first = list(range(min(5, count)))
    between = np.linspace(5, count - 4, max(0, kills - 8)).astype(int).tolist()
    return sorted({*first, *between, *range(max(0, count - 3), count)})[:kills]


def kill_all(folder, kinds, kills, moments, seed=0, report=None):
    """Kill each kind of work at so many events and moments.

    Returns
    -------
    dict of str -> Counter
        Of each kind, what became of it.
    """
    rng = np.random.default_rng(seed)
    killer, table = Kills(folder, kinds), {}
    for kind in kinds:
        table[kind] = Counter()
        cases = [{"at": int(at)} for at in events_of(killer.events[kind], kills)]
        # A few more, for some of these moments come too late.
        cases += [{"after": killer.seconds[kind] * rng.random()} for _ in range(2 * moments)]
        for case in cases:
            if table[kind]["equal"] == kills + moments:
                break
            result = killer.kill(kind, **case, share=float(rng.random()))
            table[kind][result] += 1
            if report:
                report(kind, case, result)
    return table


def prt(*arguments, kill_after=None):
    """The command line in a process of its own, killed after some seconds; its exit code."""
    command = [sys.executable, "-m", "prt_core", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        return process.wait(kill_after)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
