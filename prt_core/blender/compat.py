"""What differs between Blender versions, in one place."""

import bpy


def has_nodes(data):
    """Whether a material, world or lamp is described by nodes; since 5.0 all with a tree are."""
    if data.node_tree is None:
        return False
    return bpy.app.version >= (5, 0, 0) or data.use_nodes
