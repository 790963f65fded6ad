"""What there is to know of a material without understanding its nodes.

Cycles says what a surface is. But whether it can differ from place to place, what Cycles' passes do
not tell apart, and which files are missing, is seen from which nodes there are.
"""

from dataclasses import dataclass, field

import bpy

from prt_core.blender.compat import has_nodes
from prt_core.blender.passes.closure_normals import ClosureNormals
from prt_core.blender.passes.closures import CLOSURES, OTHERS
from prt_core.blender.passes.light_paths import CERTAIN, tells_gloss_apart

# Nodes that give the same everywhere on one object, when what goes into them does.
_EVEN = {
    "BSDF_PRINCIPLED", "BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_TRANSPARENT",
    "BSDF_TRANSLUCENT", "BSDF_GLASS", "BSDF_REFRACTION", "BSDF_SHEEN", "BSDF_TOON", "BSDF_METALLIC",
    "BSDF_VELVET", "SUBSURFACE_SCATTERING", "EMISSION", "HOLDOUT", "BACKGROUND", "MIX_SHADER",
    "ADD_SHADER", "RGB", "VALUE", "MATH", "VECT_MATH", "MIX", "MIX_RGB", "VALTORGB", "CURVE_RGB",
    "CURVE_FLOAT", "CURVE_VEC", "HUE_SAT", "GAMMA", "INVERT", "BRIGHTCONTRAST", "SEPARATE_COLOR",
    "COMBINE_COLOR", "SEPRGB", "COMBRGB", "SEPHSV", "COMBHSV", "SEPXYZ", "COMBXYZ", "MAP_RANGE",
    "CLAMP", "BLACKBODY", "WAVELENGTH", "RGBTOBW", "SHADERTORGB", "GROUP_INPUT", "GROUP_OUTPUT",
    "REROUTE", "FRAME", "OUTPUT_MATERIAL", "OBJECT_INFO", "LIGHT_PATH",
}  # fmt: skip
# Shaders that pass on what others reflect.
_JOINTS = {"MIX_SHADER", "ADD_SHADER", "GROUP", "GROUP_INPUT", "REROUTE", "SHADERTORGB"}
# The anisotropy of Glossy BSDFs that is 1 of Principled ones: (1 - x)^2 = 1 - 0.9.
_MOST_ANISOTROPY = 1 - 0.1**0.5
# Nodes that depend on UV maps alone, if they do (see `_by_uv`).
_LAID_ON = {"TEX_IMAGE", "UVMAP", "TEX_COORD"}
# Nodes whose pattern has no corners.
_SMOOTH = {
    "TEX_COORD", "UVMAP", "MAPPING", "NEW_GEOMETRY", "ATTRIBUTE", "VERTEX_COLOR", "TEX_NOISE",
    "TEX_MUSGRAVE", "TEX_GRADIENT", "TEX_WAVE", "TEX_MAGIC", "GROUP",
}  # fmt: skip
# Nodes that ask Cycles for rays of their own, whose answer is noisy.
_NOISY = {"AMBIENT_OCCLUSION", "BEVEL"}
# What nodes say that differs from one side of a face to the other, and from one view to another.
_OF_A_SIDE = {
    "NEW_GEOMETRY": {"Backfacing", "Normal", "True Normal", "Incoming"},
    "TEX_COORD": {"Normal", "Reflection"},
}
_OF_A_VIEW = {
    "LAYER_WEIGHT": {"Fresnel", "Facing"},
    "FRESNEL": {"Factor", "Fac"},
    "NEW_GEOMETRY": {"Incoming"},
    "TEX_COORD": {"Reflection"},
}
# What nodes say that is of the camera's own.
_OF_A_CAMERA = {
    "TEX_COORD": {"Camera", "Window"},
    "CAMERA": {"View Vector", "View Z Depth", "View Distance"},
}


@dataclass
class Graph:
    """What the nodes of a material tell.

    Attributes
    ----------
    name : str
    even : bool
        Whether it is the same everywhere on one object.
    flat : bool
        Whether all that differs comes from images laid on by UV maps.
    smooth : bool
        Whether what differs has no corners, as a chequer and the pixels of an image have.
    bends : bool
        Whether shading normals may differ from those of the mesh.
    softens : bool
        Whether light near the horizon is dimmed where they do.
    noisy : bool
    backs : bool
        Whether it may tell which side is seen.
    views : bool
        Whether it asks from where it is seen.
    paths : list of bpy.types.Node
        Light Path nodes, which ask by which kind of ray.
    shadows : bool
        Whether they tell shadow rays from diffuse ones.
    lengths : bool
        Whether they ask how long rays are, or how often they were reflected.
    rough, scatters, tinted, toon, portals : bool
        Whether diffuse reflection is rough; light scatters below the surface; what is transparent
        may have a colour; light leaves in steps; rays go on from elsewhere.
    bumpy : bool
        Whether there is bump that is left out; Cycles' bakes leave it out as well.
    translucent : list of bpy.types.Node
    images : list of bpy.types.Image
    without_image : list of str
        Nodes that have none.
    bumps : list of bpy.types.Node
        Bump nodes.
    holdouts : list of bpy.types.Node
        Holes in pictures; to light they are black.
    displaced : list of bpy.types.NodeLink
        What moves the surface, or bends its normals as if it did.
    left_out : set of str
        What of its gloss is not carried, by the keys of `closures.LEFT_OUT`.
    """

    name: str
    even: bool = True
    flat: bool = True
    smooth: bool = True
    bends: bool = False
    softens: bool = True
    noisy: bool = False
    backs: bool = False
    views: bool = False
    shadows: bool = False
    lengths: bool = False
    rough: bool = False
    scatters: bool = False
    tinted: bool = False
    toon: bool = False
    portals: bool = False
    bumpy: bool = False
    translucent: list = field(default_factory=list)
    paths: list = field(default_factory=list)
    bumps: list = field(default_factory=list)
    holdouts: list = field(default_factory=list)
    displaced: list = field(default_factory=list)
    images: list = field(default_factory=list)
    without_image: list = field(default_factory=list)
    left_out: set = field(default_factory=set)


def graph_of(material, gloss=False):
    """The `Graph` of a material; None is Blender's default surface.

    `gloss` : bool
        Whether it counts that gloss may lie otherwise at each place of an object.
    """
    graph = Graph(material.name if material is not None else "")
    if material is None or not has_nodes(material):
        return graph
    cycles = getattr(material, "cycles", None)
    graph.softens = getattr(cycles, "use_bump_map_correction", True)
    tree = material.node_tree
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return graph
    graph.displaced = [link for link in output.inputs["Displacement"].links if not link.is_muted]
    bends = getattr(material, "displacement_method", "BUMP") == "BUMP"
    graph.bumpy = bool(graph.displaced) and bends
    nodes = list(_nodes_behind(output.inputs["Surface"]))
    for node in nodes:
        _note(graph, node)
        if gloss and not node.mute:
            _note_gloss(graph, node)
    if gloss:
        _note_normals(graph, ClosureNormals(nodes))
    return graph


def asks_camera(node):
    """Whether a node gives something in coordinates or pixels that are a camera's own."""
    if node.type == "VECT_TRANSFORM":
        return "CAMERA" in (node.convert_from, node.convert_to)
    if node.type == "WIREFRAME":
        return node.use_pixel_size
    asked = {socket.name for socket in node.outputs if socket.is_linked}
    return bool(asked & _OF_A_CAMERA.get(node.type, set()))


def _nodes_behind(socket):
    """Every node that feeds a socket, those of groups as well."""
    seen, waiting = set(), [link.from_node for link in socket.links]
    while waiting:
        node = waiting.pop()
        key = node.as_pointer()
        if key in seen:
            continue
        seen.add(key)
        yield node
        waiting += [link.from_node for socket in node.inputs for link in socket.links]
        inner = getattr(node, "node_tree", None)
        if isinstance(inner, bpy.types.NodeTree):
            waiting += [n for n in inner.nodes if n.type == "GROUP_OUTPUT"]


def _note(graph, node):
    if node.mute:
        return
    kind = node.type
    if kind == "GROUP":
        graph.even &= node.node_tree is not None
    elif kind not in _EVEN:
        graph.even = False
        graph.flat &= kind in _LAID_ON and _by_uv(node)
    graph.flat &= kind != "OBJECT_INFO"
    graph.smooth &= kind in _EVEN or kind in _SMOOTH
    graph.noisy |= kind in _NOISY
    asked = {socket.name for socket in node.outputs if socket.is_linked}
    graph.backs |= bool(asked & _OF_A_SIDE.get(kind, set()))
    graph.views |= bool(asked & _OF_A_VIEW.get(kind, set())) or asks_camera(node)
    graph.toon |= kind == "BSDF_TOON"
    graph.portals |= kind == "BSDF_RAY_PORTAL"
    before = [link.from_node for s in node.inputs if s.name == "Normal" for link in s.links]
    if any(other.type != "BUMP" for other in before):
        graph.bends, graph.flat = True, False
    if kind == "BUMP":
        graph.bumps.append(node)
        graph.bumpy = True
    elif kind == "LIGHT_PATH":
        graph.paths.append(node)
        graph.shadows |= bool(asked & {"Is Shadow Ray", "Is Diffuse Ray", "Is Reflection Ray"})
        graph.lengths |= bool(asked - CERTAIN)
    elif kind == "HOLDOUT":
        graph.holdouts.append(node)
    elif kind == "BSDF_TRANSLUCENT":
        graph.translucent.append(node)
    elif kind == "BSDF_DIFFUSE":
        graph.rough |= _may_be(node, "Roughness")
    elif kind == "BSDF_PRINCIPLED":
        graph.rough |= _may_be(node, "Diffuse Roughness")
        graph.scatters |= _may_be(node, "Subsurface Weight")
    elif kind == "SUBSURFACE_SCATTERING":
        graph.scatters = True
    elif kind == "BSDF_TRANSPARENT":
        socket = node.inputs["Color"]
        red, green, blue = socket.default_value[:3]
        graph.tinted |= socket.is_linked or not red == green == blue
    elif kind == "TEX_IMAGE":
        if node.image is None:
            graph.without_image.append(node.name)
        else:
            graph.images.append(node.image)


def _note_gloss(graph, node):
    """What of gloss differs with the place on an object, and what is not carried."""
    kind, left_out = node.type, graph.left_out
    if any(_is_some(node, name) for name in ("Anisotropic", "Anisotropy")):
        # Tangents do; they have no corners.
        graph.even = graph.flat = False
    glossy = node.inputs.get("Anisotropy") if kind in {"BSDF_GLOSSY", "BSDF_ANISOTROPIC"} else None
    if glossy is not None and (glossy.is_linked or abs(glossy.default_value) > _MOST_ANISOTROPY):
        left_out.add("anisotropy")
    if any(s.type == "SHADER" for s in node.outputs) and kind not in {*CLOSURES, *_JOINTS}:
        left_out.add(OTHERS.get(kind, "closure"))
    for name, socket in (("sheen", "Sheen Weight"), ("thin film", "Thin Film Thickness")):
        if _is_some(node, socket):
            left_out.add(name)
    ior = node.inputs.get("IOR") if kind in {"BSDF_PRINCIPLED", "BSDF_GLASS"} else None
    if ior is not None and not ior.is_linked and ior.default_value < 1:
        left_out.add("ior")
    if kind == "SCRIPT":
        left_out.add("script")
    if kind == "LIGHT_PATH" and tells_gloss_apart(node):
        left_out.add("glossy rays")
    if getattr(node, "distribution", "") in {"BECKMANN", "ASHIKHMIN_SHIRLEY"}:
        if kind != "BSDF_REFRACTION":
            left_out.add("distribution")


def _note_normals(graph, normals):
    """What of normals that are bent is not carried."""
    if graph.bends:
        graph.left_out.add("bent")
    if normals.differ():
        graph.left_out.add("normals")
    if normals.coat_differs():
        graph.left_out.add("coat normal")


def _by_uv(node):
    """Whether a node gives what UV maps and images say, and nothing else of the object."""
    if node.type == "TEX_COORD":
        return not any(s.is_linked for s in node.outputs if s.name != "UV")
    if node.type == "UVMAP":
        return not node.from_instancer
    return node.projection == "FLAT" and node.image is not None and node.image.size[0] > 0


def _may_be(node, name):
    """Whether an input of a node is there and may be other than 0."""
    socket = node.inputs.get(name)
    return socket is not None and (socket.is_linked or socket.default_value > 0)


def _is_some(node, name):
    """The same of one that may be negative."""
    socket = node.inputs.get(name)
    return socket is not None and (socket.is_linked or socket.default_value != 0)
