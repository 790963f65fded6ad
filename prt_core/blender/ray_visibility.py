"""Which rays meet an object: Blender's ray visibility and Indirect Only, as Cycles takes them."""

from prt_core.scene import RAYS


def ray_visibility(source, owner, view_layer):
    """Which kinds of rays meet an object, as flags of its `Mesh`: a dict of bool.

    Parameters
    ----------
    source : bpy.types.Object
        The object whose geometry it is.
    owner : bpy.types.Object
        Its instancer, or itself: an instance is seen by what sees both.
    view_layer : bpy.types.ViewLayer
        Of the same evaluation.
    """
    flags = {
        flag: all(getattr(item, f"visible_{kind}") for item in (source, owner))
        for flag, kind in RAYS.items()
    }
    # What is evaluated is in no view layer.
    if owner.original.indirect_only_get(view_layer=view_layer):
        flags["camera_rays"] = False
    return flags
