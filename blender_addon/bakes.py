"""The bakes in a scene's folder, as the panel lists them."""

import bpy

from prt_core import BakeStore, PRTError
from prt_core.scene import changes
from prt_core.store import compressed_facts

from . import plan


def refresh(scene):
    """Read the folder again; what is no bake is passed over."""
    status = bpy.context.window_manager.prt
    status.bakes.clear()
    status.bakes_folder = str(plan.folder(scene))
    for path in sorted(plan.folder(scene).glob("*.prt")):
        try:
            store = BakeStore(path)
            facts, n_bytes = store.facts, store.nbytes()
        except (PRTError, OSError):
            continue
        report = facts.get("report") or {}
        item = status.bakes.add()
        item.name, item.path = path.stem, str(path)
        item.complete = bool(facts.get("complete"))
        item.megabytes = n_bytes / 1e6
        item.seconds = sum((facts.get("seconds") or {}).values())
        item.error = -1.0 if report.get("error") is None else report["error"]
        item.points = report.get("points", 0)
        item.method = report.get("method") or "exhaustive"
        item.entries = report.get("entries_percent") or 0.0
        found = report.get("visibility_error")
        item.visibility_error = -1.0 if found is None else found
        item.back_end = report.get("back_end", "")
        item.rate = report.get("rays_per_second") or 0.0
        item.compressed = _compressed_line(store)
        for name, digest in (facts.get("source") or {}).items():
            source = item.source.add()
            source.name, source.digest = name, digest


def _compressed_line(store):
    """The compressed form of a bake in one line, empty where there is none."""
    try:
        facts = compressed_facts(store)
    except PRTError:
        return "damaged; compress again"
    if facts is None:
        return ""
    return (
        f"{facts['method']}, error {facts['error']:.2%}, {facts['bytes'] / 1e6:.1f} MB, "
        f"{facts['milliseconds']:.1f} ms"
    )


def state(scene, item):
    """(text, icon) of a bake: stopped, fresh, stale, or not known yet."""
    if not item.complete:
        return "stopped", "PAUSE"
    made, holds = plan.of(scene)
    if made is None or not holds or not made.digests:
        return "not checked", "QUESTION"
    found = changes({s.name: s.digest for s in item.source}, made.digests)
    return ("fresh", "CHECKMARK") if found.fresh else (f"stale: {found}", "ERROR")


def rate(name):
    """Rays a second of a back-end as the newest bake in the list has it, or None."""
    rates = [b.rate for b in bpy.context.window_manager.prt.bakes if b.back_end == name and b.rate]
    return rates[-1] if rates else None
