"""Remarks on a scene: those that say the same of several objects become one line.

A remark is a line `NAME: what is to be said`, where NAME is that of an object, or a kind and a
name, as in `material 'NAME'`, or both, as in `material 'NAME' on NAME`. What concerns most of the
scene's surface comes first.
"""

import re

import numpy as np

# Names that are written out.
_SHOWN = 4
_KIND = re.compile(r"^([a-z][a-z ]* )('.*?'): (.*)$")


def grouped(messages, meshes):
    """Messages, fewer and in order.

    Those of the whole scene, and of what has no surface, come first, the others by the area of the
    objects that are named; messages of equal weight stay in their order.

    Parameters
    ----------
    messages : sequence of str
    meshes : sequence of Mesh

    Returns
    -------
    list of str
    """
    areas = _areas(meshes)
    colons = sorted((name for name in areas if ": " in name), key=len, reverse=True)
    groups = {}
    for message in messages:
        kind, name, text = _parts(message, colons)
        names = groups.setdefault((kind, text), [])
        if name is not None and name not in names:
            names.append(name)
    weights = {}
    for (kind, text), names in groups.items():
        known = [areas.get(kind + name, np.inf) for name in names]
        weights[kind, text] = sum(known) if names else np.inf
    ordered = sorted(groups, key=lambda group: -weights[group])
    return [_line(kind, groups[kind, text], text, areas) for kind, text in ordered]


def _line(kind, names, text, areas):
    if not names:
        return text
    names = sorted(names, key=lambda name: -areas.get(kind + name, 0.0))
    shown = ", ".join(names[:_SHOWN])
    if len(names) > _SHOWN:
        shown += f" and {len(names) - _SHOWN} more"
    if kind and len(names) > 1:
        kind = f"{kind.strip()}s "
    return f"{kind}{shown}: {text}"


def _parts(message, colons):
    """(kind, name or None, text) of a message."""
    match = _KIND.match(message)
    if match:
        return match.groups()
    # Names may hold a colon themselves.
    name = next((n for n in colons if message.startswith(f"{n}: ")), None)
    head, colon, text = message.partition(": ")
    if name is not None:
        return "", name, message[len(name) + 2 :]
    return ("", head, text) if colon else ("", None, message)


def _areas(meshes):
    """Area by the names that remarks may begin with: of meshes, their owners, their materials."""
    areas = {}
    for mesh in meshes:
        corners = mesh.triangle_corners
        a, b, c = np.moveaxis(mesh.vertices[mesh.corner_vertex[corners]], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        for name in {mesh.name, mesh.owner, mesh.name.rpartition("/")[2]}:
            areas[name] = areas.get(name, 0.0) + float(area.sum())
        if not mesh.material_names or not len(corners):
            continue
        slot = np.minimum(mesh.corner_material[corners[:, 0]], len(mesh.material_names) - 1)
        of_slot = np.bincount(slot, area, len(mesh.material_names))
        for name, part in zip(mesh.material_names, of_slot, strict=True):
            for key in (f"material '{name}'", f"material '{name}' on {mesh.name}"):
                areas[key] = areas.get(key, 0.0) + float(part)
    return areas
