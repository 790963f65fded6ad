"""What differs between Blender versions and between windows and none, in one place."""

import bpy

# Of properties that hold a path: since 4.5 one that may begin with // has to say so, else Blender
# draws it in red.
_RELATIVE = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if _RELATIVE else set()


def has_nodes(data):
    """Whether a material, world or lamp is described by nodes; since 5.0 all with a tree are."""
    if data.node_tree is None:
        return False
    return bpy.app.version >= (5, 0, 0) or data.use_nodes


def view_layer_of(scene):
    """The view layer that is looked at, or the scene's first."""
    if scene == bpy.context.scene and bpy.context.view_layer is not None:
        return bpy.context.view_layer
    return scene.view_layers[0]


def composites(scene):
    """Whether the compositor has nodes that may change a picture of a scene."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group  # Blender 5.0 and later
    else:
        tree = scene.node_tree if scene.use_nodes else None
    passive = {"R_LAYERS", "COMPOSITE", "VIEWER", "GROUP_OUTPUT", "REROUTE", "FRAME"}
    return tree is not None and any(
        node.type not in passive and not node.mute for node in tree.nodes
    )


def depsgraph_of(layer):
    """The dependency graph of a view layer, up to date.

    `bpy.context.evaluated_depsgraph_get` in a context of its own (`temp_override`) lets go of
    Python's lock and then looks into Python's dictionary of that context: with Python 3.11 Blender
    takes the lock of any other thread for its own, and crashes when that thread lets go.
    """
    layer.update()
    return layer.depsgraph


def fcurve_of(block, path):
    """The animation curve of a data-block's property; None where it has none."""
    found = (curves.find(path) for curves in curves_of(block))
    return next((curve for curve in found if curve is not None), None)


def animations_of(block):
    """Collections of a data-block's animation curves and drivers, which have `remove`."""
    drivers = [] if block.animation_data is None else [block.animation_data.drivers]
    return curves_of(block) + drivers


def curves_of(block):
    """Collections of a data-block's animation curves, without its drivers."""
    data = block.animation_data
    if data is None or data.action is None:
        return []
    action = data.action
    if hasattr(action, "fcurves"):
        return [action.fcurves]
    # Since 5.0 an action's curves are kept in layers, for each slot apart.
    if data.action_slot is None:
        return []
    strips = [strip for layer in action.layers for strip in layer.strips]
    bags = [strip.channelbag(data.action_slot) for strip in strips]
    return [bag.fcurves for bag in bags if bag]


def custom_camera_missing():
    """What this Blender lacks for cameras that are shaders, and what to do; None where nothing."""
    if bpy.app.version < (4, 5, 0):
        version = ".".join(map(str, bpy.app.version[:2]))
        return f"needs Blender 4.5 or later for its camera, this is {version}; take a newer one"
    import _cycles

    if not _cycles.with_osl:
        return "this build of Blender has no OSL; take one from blender.org"
    return None
