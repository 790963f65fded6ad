"""Which rays meet an object: Blender's ray visibility and Indirect Only, as Cycles takes them."""

import bpy

from prt_core.scene import RAYS


def set_ray_visibility(mesh, source, owner):
    """Let a mesh say which kinds of rays meet it.

    Parameters
    ----------
    mesh : Mesh
    source : bpy.types.Object
        The object whose geometry it is.
    owner : bpy.types.Object
        Its instancer, or itself: an instance is seen by what sees both.
    """
    for flag, kind in RAYS.items():
        setattr(mesh, flag, all(getattr(item, f"visible_{kind}") for item in (source, owner)))
    if owner.indirect_only_get(view_layer=bpy.context.view_layer):
        mesh.camera_rays = False
