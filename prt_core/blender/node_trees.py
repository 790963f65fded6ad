"""Node trees of worlds and lamps: whether they have changed, and copies for one kind of ray."""

import hashlib
from pathlib import Path

import bpy
import numpy as np

# What a node looks like in its editor does not count.
_LOOK = {p.identifier for p in bpy.types.Node.bl_rna.properties} - {"mute"}
# What a diffuse ray that has left a surface finds at its Light Path node; what is not here, and
# the length of the ray, is as Cycles has it.
_DIFFUSE_RAY = {
    "Is Camera Ray": 0.0,
    "Is Shadow Ray": 0.0,
    "Is Diffuse Ray": 1.0,
    "Is Glossy Ray": 0.0,
    "Is Singular Ray": 0.0,
    "Is Reflection Ray": 1.0,
    "Is Transmission Ray": 0.0,
    "Is Volume Scatter Ray": 0.0,
    "Ray Depth": 1.0,
    "Diffuse Depth": 1.0,
    "Glossy Depth": 0.0,
    "Transparent Depth": 0.0,
    "Transmission Depth": 0.0,
    "Portal Depth": 0.0,
}
_DEPTHS = {name for name in _DIFFUSE_RAY if name.endswith("Depth")}


def linked_to(socket):
    """The output socket that feeds an input, past reroutes; None when nothing does."""
    while socket.is_linked:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def all_nodes(tree):
    """Every node of a tree, those of its groups after it."""
    trees, seen = [tree], set()
    while trees:
        tree = trees.pop(0)
        if tree is None or tree.session_uid in seen:
            continue
        # Trees that are embedded in a world or lamp have no number of their own.
        seen |= {tree.session_uid} - {0}
        for node in tree.nodes:
            yield node
            if hasattr(node, "node_tree"):
                trees.append(node.node_tree)


def counts_bounces(tree):
    """Whether a tree asks how often light was reflected or let through."""
    return any(
        output.is_linked and output.name in _DEPTHS
        for node in all_nodes(tree) if node.bl_idname == "ShaderNodeLightPath"
        for output in node.outputs
    )  # fmt: skip


def numbers_of(*blocks):
    """{name: value} of the custom properties that Attribute nodes can read; the last one counts.

    Parameters
    ----------
    blocks : bpy.types.bpy_struct or None
    """
    values = {}
    for block in blocks:
        for key in block.keys() if block is not None else ():
            value = block[key]
            value = tuple(value.to_list()) if hasattr(value, "to_list") else value
            if isinstance(value, int | float | tuple):
                values[key] = value
    return values


def tree_signature(tree, frame=0):
    """Bytes that change when what a tree evaluates to may change.

    Parameters
    ----------
    tree : bpy.types.NodeTree
    frame : int
        Counts only where an image of the tree is a film or a sequence.
    """
    digest = hashlib.blake2b(digest_size=16)
    for node in all_nodes(tree):
        digest.update(f"{node.name} {node.bl_idname} {node.id_data.name};".encode())
        for value in _values(node, _LOOK):
            digest.update(value)
        image = getattr(node, "image", None)
        if image is not None and image.source in {"MOVIE", "SEQUENCE"}:
            digest.update(f"frame {frame};".encode())
        for socket in [*node.inputs, *node.outputs]:
            digest.update(_plain(getattr(socket, "default_value", None)))
            for link in socket.links if not socket.is_output else ():
                ends = link.from_node.name, link.from_socket.identifier, socket.identifier
                digest.update(f"{ends} {link.is_muted};".encode())
    return digest.digest()


def _values(owner, skipped=frozenset({"rna_type"})):
    """The properties of a node, and of what belongs to it such as colour ramps, as bytes."""
    for prop in owner.bl_rna.properties:
        name = prop.identifier
        if name in skipped or name == "rna_type":
            continue
        value = getattr(owner, name)
        yield name.encode()
        if prop.type == "COLLECTION":
            for item in value:
                yield from _values(item)
        elif prop.type != "POINTER":
            yield _plain(value)
        elif isinstance(value, bpy.types.ID):
            yield _block(value)
        elif value is not None:
            yield from _values(value)


def _plain(value):
    if isinstance(value, bpy.types.ID):
        return _block(value)
    if hasattr(value, "__len__") and not isinstance(value, str | set | bytes):
        value = tuple(tuple(v) if hasattr(v, "__len__") else v for v in value)
    return repr(value).encode()


def _block(block):
    text = f"{block.name_full} {block.session_uid};"
    if isinstance(block, bpy.types.Image):
        path = Path(bpy.path.abspath(block.filepath, library=block.library))
        stamp = path.stat().st_mtime_ns if block.filepath and path.is_file() else 0
        text += f"{path} {stamp} {tuple(block.size)} {block.colorspace_settings.name}"
        if block.is_dirty:
            pixels = np.empty(len(block.pixels), np.float32)
            block.pixels.foreach_get(pixels)
            text += hashlib.blake2b(pixels).hexdigest()
    elif isinstance(block, bpy.types.Object):
        text += str([tuple(row) for row in block.matrix_world])
    elif isinstance(block, bpy.types.Text):
        text += block.as_string()
    return text.encode()


def as_diffuse_rays_see(tree, keep):
    """`with_answers` of what diffuse rays find everywhere."""
    with_answers(tree, keep, {"ShaderNodeLightPath": _DIFFUSE_RAY})


def with_answers(tree, keep, answers):
    """Change a tree, and copies of its groups, so that outputs of some nodes are numbers.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        A copy already.
    keep : callable(block) -> block
        Takes each copy of a group that is made.
    answers : dict of str -> dict of str -> float
        By the `bl_idname` of nodes and the names of their outputs.
    """
    copies, trees = {}, [tree]
    while trees:
        tree = trees.pop()
        for node in list(tree.nodes):
            _answer(tree, node, answers.get(node.bl_idname, {}))
            group = getattr(node, "node_tree", None)
            if group is None:
                continue
            if group.session_uid not in copies:
                copies[group.session_uid] = keep(group.copy())
                trees.append(copies[group.session_uid])
            node.node_tree = copies[group.session_uid]


def _answer(tree, node, answers):
    for output in node.outputs:
        if output.name not in answers or not output.is_linked:
            continue
        number = tree.nodes.new("ShaderNodeValue")
        number.outputs[0].default_value = answers[output.name]
        for end in [link.to_socket for link in output.links if not link.is_muted]:
            tree.links.new(number.outputs[0], end)
