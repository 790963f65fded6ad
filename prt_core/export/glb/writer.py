"""A bake under a light as a .glb: objects, their colours, and what an engine relights from."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_numbers,
    expect_offers,
)
from prt_core.export.glb import colours, harmonics
from prt_core.export.glb.clusters import ClusterWeights, described, weight_names
from prt_core.export.glb.document import Document
from prt_core.export.glb.geometry import Geometry
from prt_core.export.glb.settings import GLBSettings
from prt_core.export.glb.surfaces import material_of
from prt_core.runtime.files import expect_output
from prt_core.runtime.progress import Progress
from prt_core.scene import ended_at
from prt_core.transport.sent import Sent

# Objects whose losses are named in a note.
_NAMED = 3
VERSION = 1


@dataclass
class _Attributes:
    """Of all points: what vertices take of each, by the name of the attribute."""

    values: dict
    described: dict


def glb_steps(bake, path, radiance, settings=None, *, form=None, light=None, said=None, lights=()):
    """Write colours of a bake as a .glb; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
    path : str or Path
        NAME.glb.
    radiance : (n_points, 3) float32
        Of all points, or the light that they receive where the settings ask for that.
    settings : GLBSettings, optional
    form : CompressedForm, optional
        Of the points of the bake; needed for weights.
    light : (n_directions, 3) float32, optional
        The part of the light that came from far away, on texels, for weights and harmonics.
    said : dict, optional
        What is to be said of the light in the file.
    lights : sequence of (dict, (n_points, 3) float32), optional
        Lights that an engine blends: what is to be said of each, with its `name` and `weight`, and
        its colours at weight 1. `radiance` is their sum.

    Returns
    -------
    dict
        objects, meshes, vertices, triangles, bytes; colours : "radiance" or "light"; scale; notes :
        list of str.

    Raises
    ------
    PRTError
        Colours are no numbers, nothing has a surface, or the file cannot be written.
    """
    expect_offers("bake", bake, ("scene", "transport"), "what `load` returns")
    path = expect_output("output", path, ".glb", create=True)
    settings = expect_kind("settings", settings or GLBSettings(), GLBSettings)
    shape = bake.transport.n_points, 3
    radiance = _expect_colours(bake.scene, radiance, shape)
    if light is not None:
        light = expect_array("light", light, (bake.cube_map.n_directions, 3), np.float32)
    document, notes = Document(), []
    attributes = yield from _attributes_steps(bake, document, settings, form, light, notes)
    _add_lights(attributes, lights, bake.scene, shape)
    points = bake.scene.points
    # What is blended shows more than it sends of all light (see `material_of`).
    most = radiance if settings.of_light else radiance / ended_at(points.materials)[:, None]
    scale = colours.scale_of(most[points.visible], settings.white)
    shown = SimpleNamespace(radiance=radiance, scale=scale, cut=0)
    counts = yield from _objects_steps(bake, document, settings, attributes, shown, notes)
    colours_are = "light" if settings.of_light else "radiance"
    document.extras["PRT"] = {
        "version": VERSION,
        "colours": colours_are,
        "scale": scale,
        "light": said or {},
        **attributes.described,
    }
    if shown.cut:
        notes.append(f"{shown.cut:,} colours are brighter than {scale:g} and cut in COLOR_0")
    yield Progress("write", 0, 1)
    counts["bytes"] = document.write(path)
    return {**counts, "colours": colours_are, "scale": scale, "notes": notes}


def _add_lights(attributes, lights, scene, shape):
    """Add the colours of each light to what vertices take, and their names to what is said."""
    if lights:
        attributes.described["lights"] = []
    for number, (said, radiance) in enumerate(lights):
        name = f"_PRT_LIGHT{number}"
        attributes.values[name] = _expect_colours(scene, radiance, shape)
        attributes.described["lights"].append({**said, "attribute": name})


def _expect_colours(scene, radiance, shape):
    """Radiance as float32; whose colours are no numbers is said by the name of the object."""
    radiance = expect_numbers("radiance", radiance)
    if radiance.shape == shape and not np.isfinite(radiance).all():
        owner = scene.points.object_index[~np.isfinite(radiance).all(axis=1)]
        colours.refuse(scene.objects[owner[0]].name, int((owner == owner[0]).sum()))
    return expect_array("radiance", radiance, shape, np.float32)


def _attributes_steps(bake, document, settings, form, light, notes):
    """The `_Attributes` that an engine relights from, where they are asked for."""
    values, said = {}, {}
    transport = bake.transport
    if settings.harmonics:
        shown = yield from harmonics.coefficients_steps(transport, settings.of_light)
        values |= dict(zip(harmonics.NAMES, shown, strict=True))
        under = None if light is None else harmonics.light_coefficients(light, bake.cube_map)
        said["harmonics"] = {
            "attributes": list(harmonics.NAMES),
            "functions": harmonics.basis_formula(),
            "light": None if under is None else under.tolist(),
        }
    if settings.weights:
        expect(form is not None, "weights: the bake has no compressed form; run 'prt compress'")
        yield Progress("weights", 0, 1)
        weights = ClusterWeights(form, settings.components, settings.texels)
        if light is not None:
            under = weights.on_texels(light, bake.cube_map.resolution)
        said["weights"] = described(document, weights, None if light is None else under)
        values["_PRT_CLUSTER"] = weights.cluster.astype(np.float32)
        padded = np.pad(weights.weights, ((0, 0), (0, -weights.components % 4)))
        for name, four in zip(
            weight_names(weights.components), np.split(padded, padded.shape[1] // 4, 1), strict=True
        ):
            values[name] = four
        if not settings.of_light:
            values["_PRT_ALBEDO"] = transport.materials.front.astype(np.float32)
            if isinstance(transport.sends, Sent):
                notes.append("weights are of the light on fronts; what shines through is left out")
        if weights.cut:
            notes.append(f"{weights.components} components are written, the form has more")
    return _Attributes(values, said)


def _objects_steps(bake, document, settings, attributes, shown, notes):
    """Add the objects that receive light; returns what there is of them (dict of int)."""
    scene, geometry = bake.scene, Geometry(bake.scene)
    counts = {"objects": 0, "vertices": 0, "triangles": 0}
    lost, without, flat = {}, 0, []
    for number, item in enumerate(scene.objects):
        yield Progress("objects", number, len(scene.objects))
        if not item.receives:
            without += 1
            continue
        placement, surfaces = geometry.surfaces(number)
        if not surfaces:
            flat.append(item.name)
            continue
        primitives = []
        for surface in surfaces:
            materials = scene.points.materials[surface.points]
            material, missing, ended = material_of(
                surface.material, materials, settings.material == "multiplied"
            )
            if missing:
                lost.setdefault(missing, []).append(item.name)
            primitives.append(
                {
                    "attributes": _vertices(document, surface, settings, attributes, shown, ended),
                    "indices": _indices(document, surface),
                    "material": document.add_material(material),
                }
            )
            counts["vertices"] += len(surface.points)
            counts["triangles"] += len(surface.triangles)
        mesh = {"primitives": primitives, "extras": {"prt_scale": shown.scale}}
        counts["objects"] += 1
        document.nodes.append(
            {
                "name": item.name,
                "mesh": document.add_mesh(mesh),
                **placement.node(),
                "extras": _origin(item),
            }
        )
    expect(counts["objects"], "objects: none of those that receive light has a surface")
    if without:
        notes.append(f"{without} objects receive no colours and are not written")
    if flat:
        notes.append(f"{_some(flat)}: without surface, not written")
    if any(item.parts is None for item in scene.objects):
        notes.append(
            "the bake is of a version that kept no UV maps, materials and places of objects; bake "
            "again for them"
        )
    for what, names in lost.items():
        notes.append(f"{_some(names)}: {what} differs from place to place and is not written")
    counts["meshes"] = document.n_meshes
    return counts


def _vertices(document, surface, settings, attributes, shown, ended):
    """Attributes of a primitive: numbers of accessors by name."""
    add, points = document.add_array, surface.points
    # Light alone is multiplied with base colours, where there are such.
    whole = settings.of_light or (ended == 1).all()
    radiance = shown.radiance[points] if whole else shown.radiance[points] / ended[:, None]
    shown.cut += int((radiance > shown.scale).any(axis=1).sum())
    encoded = colours.encoded(radiance, shown.scale, settings.encoding)
    result = {
        "POSITION": add(surface.positions, bounds=True),
        "NORMAL": add(surface.normals),
        "COLOR_0": add(encoded, normalised=settings.encoding != "float"),
        "_PRT_RADIANCE": add(radiance),
    }
    if surface.uv is not None:
        result["TEXCOORD_0"] = add(surface.uv)
    for name, values in attributes.values.items():
        own = values[points]
        if not whole and (name == "_PRT_ALBEDO" or name in harmonics.NAMES):
            own = own / ended[:, None]
        result[name] = add(own)
    return result


def _indices(document, surface):
    # The largest number of each type has a meaning of its own.
    kind = np.uint16 if len(surface.points) < (1 << 16) else np.uint32
    return document.add_array(surface.triangles.reshape(-1).astype(kind), "index")


def _origin(item):
    """What a person knows the object by, for the node (dict)."""
    known = {"prt_object": item.owner, "prt_library": item.library, "prt_source": item.source}
    return {name: text for name, text in known.items() if text}


def _some(names):
    names = list(dict.fromkeys(names))
    return ", ".join(names[:_NAMED]) + (" …" if len(names) > _NAMED else "")
