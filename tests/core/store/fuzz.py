"""Bakes that were damaged in every way that comes to mind, and what becomes of them.

Judged is what loading and relighting give, or, for a bake that was not finished, baking on: the
original colours, bit by bit, or one line of error; never another exception, a hang, more than 2 GB,
or a file outside that was touched.
"""

import hashlib
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from prt_core import run
from tests.core.store import fuzz_worker
from tests.core.store.mutations import FORGED, MUTATIONS, Nothing, pick

ROOT = Path(__file__).parents[3]
SECONDS = 60
GOOD = ("harmless", "repaired", "refused", "forged, finite")
BAD = ("WRONG", "traceback", "hang", "memory", "touched outside")


class Worker:
    """A process that is asked what became of a bake; another one where it does not answer."""

    def __init__(self, folder):
        self._log = folder / "worker.log"
        self._process = None

    def ask(self, **request):
        """Its answer; `{"hang": True}` where there is none in time, `{"died": code}`."""
        if self._process is None:
            self._start()
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        self._process.stdin.flush()
        ready, _, _ = select.select([self._process.stdout], [], [], SECONDS)
        if not ready:
            self.close()
            return {"hang": True}
        line = self._process.stdout.readline()
        if not line:
            code = self._process.wait()
            self._process = None
            return {"died": code}
        return json.loads(line)

    def said(self):
        """What it wrote besides answers: nothing, but for warnings at its start."""
        return self._log.read_text()

    def _start(self):
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "tests.core.store.fuzz_worker"],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log.open("ab"),
        )

    def close(self):
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


class Fuzzer:
    """Subjects, and the judgement of mutations of them.

    Parameters
    ----------
    folder : Path
        Empty.
    methods : sequence of str
        Of the compressed forms among the subjects.
    """

    def __init__(self, folder, methods=("cpca", "haar", "harmonics")):
        self.folder, self.worker = folder, Worker(folder)
        self.peak = self.slowest = 0.0
        self.canary = folder / "canary"
        self.subjects, self._colours = {}, {}
        self._make_subjects(methods)
        self._make_canary()

    def _make_subjects(self, methods):
        fuzz_worker.small_blocks()
        keep = self.folder / "subjects"
        keep.mkdir()
        for settings in fuzz_worker.SETTINGS:
            whole = keep / f"{settings}.prt"
            run(fuzz_worker.steps(whole, settings))
            self._add(settings, whole, settings)
            for count in (3, 9, 14):
                # Stopped after so many steps.
                path, going = keep / f"{settings}{count}.prt", None
                going = fuzz_worker.steps(path, settings)
                for _ in range(count):
                    next(going, None)
                going.close()
                self._add(f"{settings}, stopped", path, settings, finished=False)
        for method in methods:
            path = shutil.copytree(keep / "exhaustive.prt", keep / f"{method}.prt")
            fuzz_worker.compressed(path, method)
            self._add("compressed", path, "exhaustive", method=method)

    def _add(self, kind, path, settings, finished=True, method=None):
        subject = {"path": path, "settings": settings, "finished": finished, "method": method}
        self.subjects.setdefault(kind, []).append(subject)
        if finished and settings not in self._colours:
            self._colours[settings] = self.worker.ask(do="load", path=str(path))["colours"]
        if method:
            asked = {"do": "load", "path": str(path), "form": "compressed"}
            self._colours[method] = self.worker.ask(**asked)["colours"]

    def _make_canary(self):
        (self.canary / "folder").mkdir(parents=True)
        (self.canary / "file").write_bytes(b"mine")
        (self.canary / "folder" / "file").write_bytes(b"mine as well")
        shutil.copytree(self.folder / "subjects" / "exhaustive.prt", self.canary / "bake.prt")
        self._canary = _fingerprint(self.canary)

    def judge(self, kind, mutation, seed):
        """(verdict, what was said) of one mutation of one subject of a kind."""
        rng = np.random.default_rng(seed)
        path = self.folder / "case" / "a.prt"
        for turn in range(99):
            # Some bakes that were stopped early have too little to work on.
            subject = pick(rng, self.subjects[kind if turn < 9 else "exhaustive"])
            shutil.rmtree(path.parent, ignore_errors=True)
            path.parent.mkdir()
            shutil.copytree(subject["path"], path)
            try:
                mutation(rng, path, self.canary)
                break
            except Nothing:
                continue
        # What was planted beside the bake and is no bake stays there.
        planted = {
            p.name: _fingerprint(p)
            for p in path.parent.iterdir()
            if p != path and (not p.is_dir() or (p / "notes.txt").exists())
        }
        verdict = self._verdict(subject, path, mutation in FORGED)
        if _fingerprint(self.canary) != self._canary:
            shutil.rmtree(self.canary)
            self._make_canary()
            return "touched outside", verdict[1]
        beside = {p.name: _fingerprint(p) for p in path.parent.iterdir() if p != path}
        if {name: beside.get(name) for name in planted} != planted:
            return "touched outside", f"{list(planted)}: {verdict[1]}"
        return verdict

    def _verdict(self, subject, path, forged):
        asked = {"path": str(path), "settings": subject["settings"]}
        want = self._colours[subject["settings"]]
        if not subject["finished"]:
            answer = self._ask(do="bake", **asked)
            verdict = _plain_verdict(answer, want, path, forged, "repaired")
        else:
            answer = self._ask(do="load", **asked)
            verdict = _plain_verdict(answer, want, path, forged, "harmless")
            if verdict[0] == "harmless" and subject["method"]:
                verdict = self._compressed_verdict(subject, path, asked, want, forged)
            elif verdict[0] == "refused":
                answer = self._ask(do="bake", **asked)
                again = _plain_verdict(answer, want, path, forged, "repaired")
                verdict = again if again[0] != "refused" else verdict
        if verdict[0] == "refused":
            # The way out that every refusal has in the end, but for what is not ours to remove.
            answer = self._ask(do="bake", restart=True, **asked)
            again = _plain_verdict(answer, want, path, forged, "repaired")
            verdict = verdict if again[0] in ("repaired", "refused") else again
        return verdict

    def _ask(self, **request):
        begun = time.perf_counter()
        answer = self.worker.ask(**request)
        self.slowest = max(self.slowest, time.perf_counter() - begun)
        self.peak = max(self.peak, answer.get("peak", 0))
        return answer

    def _compressed_verdict(self, subject, path, asked, exact, forged):
        own = self._colours[subject["method"]]
        answer = self._ask(do="load", form="compressed", **asked)
        verdict = _plain_verdict(answer, own, path, forged, "harmless")
        if verdict[0] not in GOOD:
            return verdict
        # Without the word the bake itself is taken, where its form is not what it was.
        answer = self._ask(do="load", form="auto", **asked)
        want = exact if answer.get("colours") == exact else own
        quiet = _plain_verdict(answer, want, path, forged, "harmless")
        return verdict if quiet[0] in GOOD else quiet

    def close(self):
        self.worker.close()


def _plain_verdict(answer, want, path, forged, good):
    if "hang" in answer or "died" in answer:
        return "hang", str(answer)
    if answer["peak"] > fuzz_worker.MEMORY:
        return "memory", f"{answer['peak'] / 1e9:.1f} GB"
    if "traceback" in answer:
        return "traceback", answer["traceback"]
    if "error" in answer:
        text = answer["error"]
        one_line = text.strip() and len(text.splitlines()) == 1 and len(text) < 1000
        return ("refused", text) if one_line else ("traceback", text)
    if answer["colours"] == want:
        return good, ""
    return ("forged, finite" if forged and answer["finite"] else "WRONG"), "other colours"


def _fingerprint(top):
    """Names, kinds and contents of a file, or of a folder and all that is in it."""
    inside = [] if top.is_symlink() else top.rglob("*")
    return {
        str(path.relative_to(top)): (
            path.lstat().st_mode,
            hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "",
        )
        for path in (top, *inside)
    }


def fuzz(folder, count, seed=0, methods=("cpca", "haar", "harmonics"), report=None):
    """Judge so many mutations, of all kinds and subjects in turn.

    Returns
    -------
    table : dict of (mutation, subject) -> Counter of verdicts
    bad : list of (mutation, subject, number, verdict, text)
    peak : int
        Most memory that was taken, in bytes.
    slowest : float
        Longest answer, in seconds.
    """
    fuzzer = Fuzzer(folder, methods)
    table, bad = {}, []
    kinds = list(fuzzer.subjects)
    try:
        for number in range(count):
            turn, place = divmod(number, len(MUTATIONS))
            # Each turn has subjects of all kinds, and each mutation another kind in each turn.
            mutation, kind = MUTATIONS[place], kinds[(turn + place) % len(kinds)]
            verdict, text = fuzzer.judge(kind, mutation, [seed, number])
            table.setdefault((mutation.__name__, kind), Counter())[verdict] += 1
            if verdict not in GOOD:
                bad.append((mutation.__name__, kind, number, verdict, text))
            if report:
                report(number, mutation.__name__, kind, verdict, text)
        said = fuzzer.worker.said()
        if said:
            bad.append(("worker", "", 0, "traceback", said))
    finally:
        fuzzer.close()
    return table, bad, fuzzer.peak, fuzzer.slowest


def table_lines(table):
    """The table, a line for each mutation."""
    names = list(dict.fromkeys(name for name, _ in table))
    columns = ["harmless", "repaired", "refused", "forged, finite", *BAD]
    yield "mutation".ljust(18) + "".join(c.rjust(max(9, len(c) + 2)) for c in columns)
    total = Counter()
    for name in [*names, None]:
        row = sum((result for (n, _), result in table.items() if n == name), Counter())
        total += row
        row = total if name is None else row
        cells = "".join(str(row[c] or ".").rjust(max(9, len(c) + 2)) for c in columns)
        yield (name or "all").ljust(18) + cells
