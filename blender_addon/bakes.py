"""The bakes in a scene's folder, as the panel lists them."""

from pathlib import Path

import bpy

from prt_core import BakeStore, PRTError
from prt_core.blender.identity import origin_of
from prt_core.errors import expect
from prt_core.scene import changes
from prt_core.store import compressed_attributes, is_removable
from prt_core.store.places import beside

from . import plan, preview


def refresh(scene, select=""):
    """Read the folder again; what is no bake is passed over, one that cannot be read is listed
    with the reason, so that it can be deleted.

    Parameters
    ----------
    scene : bpy.types.Scene
    select : str, optional
        Path of the bake to select; default: the one that was, else the one that is shown.
    """
    status = bpy.context.window_manager.prt
    if not select and listed(scene) and 0 <= status.active_bake < len(status.bakes):
        select = status.bakes[status.active_bake].path
    status.bakes.clear()
    status.bakes_folder = str(plan.folder(scene))
    for path in sorted(plan.folder(scene).glob("*.prt")):
        try:
            store = BakeStore(path)
            attributes, n_bytes = store.attributes, store.nbytes()
        except (PRTError, OSError) as error:
            if is_removable(path):
                item = status.bakes.add()
                item.name, item.path, item.unreadable = path.stem, str(path), str(error)
            continue
        report = attributes.get("report") or {}
        item = status.bakes.add()
        item.name, item.path = path.stem, str(path)
        item.complete = bool(attributes.get("complete"))
        item.waiting = beside(path).is_dir()
        item.megabytes = n_bytes / 1e6
        item.seconds = sum((attributes.get("seconds") or {}).values())
        item.error = -1.0 if report.get("error") is None else report["error"]
        item.error_enclosed = report.get("error_enclosed") or -1.0
        item.points = report.get("points", 0)
        item.method = report.get("method") or "exhaustive"
        item.entries = report.get("entries_percent") or 0.0
        visibility_error = report.get("visibility_error")
        item.visibility_error = -1.0 if visibility_error is None else visibility_error
        item.back_end = report.get("back_end", "")
        item.rate = report.get("rays_per_second") or 0.0
        item.gloss = bool((attributes.get("settings") or {}).get("gloss"))
        item.compressed = _compressed_line(store)
        item.origin = of_another(scene, attributes, path) or ""
        item.notes = "\n".join(report.get("messages") or ())
        for name, digest in (attributes.get("source") or {}).items():
            source = item.source.add()
            source.name, source.digest = name, digest
    order = [item.path for item in status.bakes]
    wanted = [path for path in (select, preview.path_of(scene)) if path in order]
    status.active_bake = order.index(wanted[0]) if wanted else 0


def listed(scene):
    """Whether the list is of the scene's folder; not so after another file or scene came."""
    return bpy.context.window_manager.prt.bakes_folder == str(plan.folder(scene))


def goes_on(scene):
    """Whether a bake of the scene, or the one that is to replace it, was stopped."""
    path = str(plan.output_path(scene))
    return any(
        item.path == path and not item.unreadable and (item.waiting or not item.complete)
        for item in bpy.context.window_manager.prt.bakes
    )


def is_there(scene):
    """Whether the bake that the button makes is in the folder, whole."""
    path = str(plan.output_path(scene))
    return any(b.path == path and b.complete for b in bpy.context.window_manager.prt.bakes)


def of_another(scene, attributes, path):
    """The file and scene that a bake is of in words, where it is not this one; else None."""
    origin = attributes.get("origin")
    if not origin:
        return None
    folder, here = Path(path).parent, origin_of(scene, Path(path).parent)
    file, name = str(origin.get("file") or ""), origin.get("scene")
    moved = Path(file).name == Path(here["file"]).name and not (folder / file).exists()
    if name == here["scene"] and (file == here["file"] or moved):
        return None
    return f"'{file or 'a file without a name'}', scene '{name}'"


def expect_ours(scene, path):
    """Refuse to replace what the scene may not: a bake of another file, or of another scene.

    Raises
    ------
    PRTError
        `path` is one.
    """
    remedy = "give this one another Name under Bake Settings, or delete that one under Bakes"
    for other in bpy.data.scenes:
        expect(
            other == scene or preview.path_of(other) != str(path),
            f"{path.name}: is shown by the scene '{other.name}'; {remedy}",
        )
    try:
        # To be written: what was stopped in its first moments is nobody's.
        attributes = BakeStore(path, "a").attributes
    except PRTError as error:
        raise PRTError(f"{error}; {remedy}") from error
    # What has no identity yet was stopped before it held anything.
    known = not attributes.get("identity") or attributes.get("origin")
    known = known or preview.path_of(scene) == str(path)
    expect(known, f"{path.name}: is a bake of an unknown file; {remedy}")
    another = of_another(scene, attributes, path)
    expect(another is None, f"{path.name}: is a bake of {another}; {remedy}")


def _compressed_line(store):
    """The compressed form of a bake in one line, empty where there is none."""
    try:
        attributes = compressed_attributes(store)
    except PRTError:
        return "damaged; compress again"
    if attributes is None:
        return ""
    as_asked = "" if attributes["tolerance_met"] is not False else " (NOT as asked)"
    return (
        f"{attributes['method']}, error {attributes['error']:.2%}{as_asked}, "
        f"{attributes['bytes'] / 1e6:.1f} MB, {attributes['milliseconds']:.1f} ms"
    )


def state(scene, item):
    """(text, icon) of a bake: stopped, fresh, stale, or not known yet."""
    if item.unreadable:
        return item.unreadable, "ERROR"
    if not item.complete:
        return "stopped", "PAUSE"
    read, holds = plan.reading(scene)
    if read is None or not holds or not read.digests or read.gloss != item.gloss:
        return "not checked", "QUESTION"
    differences = changes({s.name: s.digest for s in item.source}, read.digests)
    return ("fresh", "CHECKMARK") if differences.fresh else (f"stale: {differences}", "ERROR")


def rate(name):
    """Rays a second of a back-end as the newest bake in the list has it, or None."""
    rates = [b.rate for b in bpy.context.window_manager.prt.bakes if b.back_end == name and b.rate]
    return rates[-1] if rates else None
