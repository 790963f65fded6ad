"""`Materials` of Blender's: at face corners, and of image textures between them."""

from dataclasses import replace

import numpy as np

from prt_core.blender.colours import ACTIVE_BEFORE
from prt_core.blender.compat import has_nodes
from prt_core.blender.textures import Picture, Texture, TexturePaint
from prt_core.errors import PRTError
from prt_core.reflectance import QUANTITIES, Materials

# What Blender shows for a face without material.
_NO_MATERIAL = (0.8, 0.8, 0.8)


def corner_materials(source, data, corner_slot, corner_vertex, messages, pictures=None):
    """Those of the corners of a mesh; what is not understood is said in `messages`.

    Parameters
    ----------
    source : bpy.types.Object
        Evaluated, for its material slots.
    data : bpy.types.Mesh
    corner_slot, corner_vertex : (n_corners,) int
    messages : list of str
    pictures : dict, optional
        Images that were read already, by their `session_uid`.

    Returns
    -------
    materials : Materials
    paint : TexturePaint or None
        What is between the corners, where images are.
    """
    albedo, textures = np.empty((len(corner_slot), 3)), {}
    emission = np.zeros_like(albedo)
    pictures = {} if pictures is None else pictures
    for slot in np.unique(corner_slot):
        which = corner_slot == slot
        material = None
        if source.material_slots:
            material = source.material_slots[min(slot, len(source.material_slots) - 1)].material
        if material is None:
            albedo[which] = _NO_MATERIAL
            continue
        emission[which] = _material_emission(material, messages)
        reads = data, corner_vertex, which, messages, pictures
        found = _material_albedo(material, *reads)
        if isinstance(found, Texture):
            textures[int(slot)] = found
            found = found.at(found.uv[which])
        albedo[which] = found
    if (albedo < 0).any() or (albedo > 1).any():
        _say(messages, f"{source.name}: albedo outside 0..1 was cut to it")
    albedo = np.clip(np.nan_to_num(albedo), 0, 1)
    paint = TexturePaint(corner_slot, albedo, textures) if textures else None
    most = QUANTITIES["emission"].most
    if not ((emission >= 0) & (emission <= most)).all():
        _say(messages, f"{source.name}: emission that is negative or no number was cut to 0")
    emission = np.clip(np.nan_to_num(emission, posinf=most), 0, most)
    return Materials(albedo=albedo, emission=emission), paint


def _material_emission(material, messages):
    """Radiance that a material emits, (3,), from constants."""
    shader = _surface_shader(material)
    names = {"EMISSION": ("Color", "Strength")}
    names["BSDF_PRINCIPLED"] = "Emission Color", "Emission Strength"
    if shader is None or shader.type not in names:
        return np.zeros(3)
    colour, strength = (shader.inputs[name] for name in names[shader.type])
    what = f"material '{material.name}'"
    if colour.is_linked:
        _say(messages, f"{what}: a texture on '{colour.name}' is ignored, its value is used")
    return np.array(colour.default_value[:3]) * _constant(strength, what, messages)


def _say(messages, text):
    if text not in messages:
        messages.append(text)


def _material_albedo(material, data, corner_vertex, which, messages, pictures):
    """An albedo, one for each of some corners, or a `Texture`."""
    what = f"material '{material.name}'"
    shader = _surface_shader(material)
    if shader is None:
        _say(messages, f"{what}: no surface shader; its viewport colour was used")
        return np.array(material.diffuse_color[:3])
    if shader.type == "EMISSION":
        return np.zeros(3)
    if shader.type == "BSDF_DIFFUSE":
        return _colour(shader.inputs["Color"], data, corner_vertex, which, what, messages, pictures)
    if shader.type == "BSDF_PRINCIPLED":
        base = shader.inputs["Base Color"]
        colour = _colour(base, data, corner_vertex, which, what, messages, pictures)
        share = 1.0
        for name in ("Metallic", "Transmission Weight"):
            amount = _constant(shader.inputs[name], what, messages)
            if amount:
                _say(
                    messages,
                    f"{what}: {name.split()[0].lower()} {amount:.2g} is not baked, "
                    "only its diffuse share is",
                )
                share *= 1 - amount
        ignored = [
            label
            for name, label, neutral in (
                ("Specular IOR Level", "specular reflection", 0),
                ("Alpha", "transparency", 1),
                ("Subsurface Weight", "subsurface scattering", 0),
                ("Coat Weight", "coat", 0),
                ("Sheen Weight", "sheen", 0),
            )
            if shader.inputs[name].is_linked or shader.inputs[name].default_value != neutral
        ]
        if ignored:
            _say(messages, f"{what}: {', '.join(ignored)} ignored, the diffuse colour is baked")
        if isinstance(colour, Texture):
            return replace(colour, factor=share)
        return colour * share
    _say(
        messages,
        f"{what}: shader '{shader.name}' is not understood (Diffuse and Principled are); "
        "its viewport colour was used",
    )
    return np.array(material.diffuse_color[:3])


def _surface_shader(material):
    if not has_nodes(material):
        return None
    output = material.node_tree.get_output_node("CYCLES") or material.node_tree.get_output_node(
        "ALL"
    )
    link = linked_to(output.inputs["Surface"]) if output else None
    return link.node if link else None


def linked_to(socket):
    """The output socket that feeds an input, past reroutes; None when nothing does."""
    while socket.is_linked:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def _constant(socket, what, messages):
    if socket.is_linked:
        _say(messages, f"{what}: a texture on '{socket.name}' is ignored, its value is used")
    return float(socket.default_value)


def _colour(socket, data, corner_vertex, which, what, messages, pictures):
    source = linked_to(socket)
    if source is None:
        return np.array(socket.default_value[:3])
    node = source.node
    if node.type == "RGB":
        return np.array(source.default_value[:3])
    if node.type in {"VERTEX_COLOR", "ATTRIBUTE"} and source.name == "Color":
        name = node.layer_name if node.type == "VERTEX_COLOR" else node.attribute_name
        found = _attribute_colour(data, name, corner_vertex, which)
        if found is not None:
            return found
        _say(messages, f"{what}: there is no colour attribute '{name}'; its viewport grey is used")
        return np.array(_NO_MATERIAL)
    if node.type == "TEX_IMAGE" and source.name == "Color" and node.image is not None:
        uv = _texture_coordinates(node, data, what, messages)
        if uv is not None:
            try:
                picture = Picture.of(node.image, pictures)
                return Texture(picture, uv, node.interpolation, node.extension)
            except PRTError as error:
                _say(messages, f"{what}: {error}; grey is used")
                return np.array(_NO_MATERIAL)
    _say(
        messages,
        f"{what}: node '{node.name}' is not understood as a colour; the socket's own is used",
    )
    return np.array(socket.default_value[:3])


def _attribute_colour(data, name, corner_vertex, which):
    # The preview makes its own colours the active ones and remembers which were.
    name = name or data.get(ACTIVE_BEFORE)
    attribute = data.color_attributes.get(name) if name else data.color_attributes.active_color
    if attribute is None or attribute.domain not in {"CORNER", "POINT"}:
        return None
    values = np.empty(len(attribute.data) * 4, np.float32)
    # "color" is linear for both kinds of colour attribute.
    attribute.data.foreach_get("color", values)
    values = values.reshape(-1, 4)[:, :3].astype(np.float64)
    return values[which] if attribute.domain == "CORNER" else values[corner_vertex[which]]


def _texture_coordinates(node, data, what, messages):
    """(n_corners, 2) float32, or None where they are not understood."""
    source = linked_to(node.inputs["Vector"])
    name = None
    if source is not None:
        if source.node.type == "UVMAP":
            name = source.node.uv_map
        elif not (source.node.type == "TEX_COORD" and source.name == "UV"):
            _say(messages, f"{what}: texture coordinates of '{source.node.name}' not understood")
            return None
    if node.projection != "FLAT":
        _say(messages, f"{what}: projection '{node.projection}' of '{node.name}' not understood")
        return None
    layer = data.uv_layers.get(name) if name else data.uv_layers.active
    if layer is None:
        _say(messages, f"{what}: no UV map for the texture '{node.image.name}'")
        return None
    uv = np.empty(len(data.loops) * 2, np.float32)
    layer.data.foreach_get("uv", uv)
    return uv.reshape(-1, 2)
