"""The light fields in a scene's folder, as the panel lists them."""

import bpy

from prt_core import BakeStore, PRTError
from prt_core.bake.light_field_load import KIND
from prt_core.errors import expect
from prt_core.store import AGAIN, compressed_attributes, damage_as_error, is_removable

from . import bakes, light_fields, plan
from .naming import bake_name, file_name


def output_path(scene, file=None):
    """Where the next light field goes; `file` as in `plan.folder`."""
    file = bpy.data.filepath if file is None else file
    chosen = scene.prt.field.name
    name = file_name(chosen) if chosen else bake_name(scene, file)
    return plan.folder(scene, file) / f"{name}.slf"


def refresh(scene, select=""):
    """Read the folder again; what cannot be read is listed with the reason.

    Parameters
    ----------
    scene : bpy.types.Scene
    select : str, optional
        Path of the one to select; default: the one that was, else the one that is shown.
    """
    status = bpy.context.window_manager.prt
    if not select and 0 <= status.active_field < len(status.fields):
        select = status.fields[status.active_field].path
    status.fields.clear()
    for path in sorted(plan.folder(scene).glob("*.slf")):
        try:
            store = BakeStore(path)
            attributes, n_bytes = store.attributes, store.nbytes()
            expect(attributes.get("kind") == KIND, f"{path.name}: is no light field")
        except (PRTError, OSError) as error:
            if is_removable(path):
                item = status.fields.add()
                item.name, item.path, item.unreadable = path.stem, str(path), str(error)
            continue
        item = status.fields.add()
        item.name, item.path, item.megabytes = path.stem, str(path), n_bytes / 1e6
        item.complete = store.is_complete
        report = attributes.get("report") or {}
        if report:
            rows, columns = report["angles"]
            n_lights = len(report["lights"])
            item.about = (
                f"{report['points']:,} points, {rows} x {columns} directions, "
                f"{n_lights} light{'s' if n_lights > 1 else ''}, noise {report['noise']:.1%}"
            )
        item.notes = "\n".join(report.get("messages") or ())
        item.compressed = _compressed(store)
    order = [item.path for item in status.fields]
    wanted = [path for path in (select, light_fields.path_of(scene)) if path in order]
    status.active_field = order.index(wanted[0]) if wanted else 0


def _compressed(store):
    """What a light field's compressed form is, empty where it has none."""
    try:
        form = compressed_attributes(store)
        if form is None:
            return ""
        with damage_as_error(store.path, "what is said of its compressed form", AGAIN):
            size, error = form["coded_nbytes"] / 1e6, form["error"]
            return f"{form['method']}, {size:.3g} MB, error {error:.2%} of white"
    except PRTError as error:
        return str(error)


def expect_ours(scene, path):
    """Refuse to replace what the scene may not: a bake, or a light field of another scene.

    Raises
    ------
    PRTError
        `path` is one.
    """
    if not path.exists():
        return
    remedy = "give this one another Name, or delete that one"
    try:
        attributes = BakeStore(path, "a").attributes
    except PRTError as error:
        raise PRTError(f"{error}; {remedy}") from error
    is_field = attributes.get("kind") in (KIND, None) and "point_positions" not in attributes
    is_field = attributes.get("kind") == KIND or (is_field and not attributes.get("identity"))
    expect(is_field, f"{path.name}: is a bake, not a light field; {remedy}")
    another = bakes.of_another(scene, attributes, path)
    expect(another is None, f"{path.name}: is a light field of {another}; {remedy}")
