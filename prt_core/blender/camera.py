"""Blender's camera as a `Camera`."""

import bpy
import numpy as np

from prt_core.blender.identity import display_names
from prt_core.blender.render_scene import rendered_layer
from prt_core.scene import Camera

_PANORAMAS = {
    "EQUIRECTANGULAR": "equirectangular",
    "FISHEYE_EQUIDISTANT": "equidistant",
    "FISHEYE_EQUISOLID": "equisolid",
}


def read_camera(scene=None, messages=None):
    """The `Camera` of a scene; None where it has none, or one whose lens is not followed.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
    messages : list of str, optional
        Told what is not followed.
    """
    scene = scene or bpy.context.scene
    # A script may have moved it a moment ago.
    rendered_layer(scene)[0].update()
    return _camera_of(scene.camera, scene, [] if messages is None else messages)


def read_cameras(scene=None):
    """All cameras of a scene whose lens is followed, shown or hidden: dict of str -> `Camera`.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        Blender does not evaluate what is hidden in it: of hidden cameras those are left out that
        constraints, or a parent's bones or vertices, hold.
    """
    scene = scene or bpy.context.scene
    layer = rendered_layer(scene)[0]
    layer.update()
    evaluated = {item.original.session_uid for item in layer.depsgraph.objects}
    items = [item for item in scene.objects if item.type == "CAMERA"]
    names, _ = display_names(items)
    cameras = {}
    for item in items:
        matrix = item.matrix_world if item.session_uid in evaluated else _matrix_of(item)
        camera = None if matrix is None else _camera_of(item, scene, [], matrix)
        if camera is not None:
            cameras[names[item.session_uid]] = camera
    return cameras


def _matrix_of(item):
    """Object to world, from what an object and its parents say; None where that is not all."""
    if any(not each.mute for each in item.constraints):
        return None
    if item.parent is None:
        return item.matrix_basis
    above = _matrix_of(item.parent) if item.parent_type == "OBJECT" else None
    return None if above is None else above @ item.matrix_parent_inverse @ item.matrix_basis


def _camera_of(item, scene, messages, matrix=None):
    if item is None or item.type != "CAMERA":
        return None
    data, render = item.data, scene.render
    what = f"camera '{item.name}'"
    lens = {"PERSP": "perspective", "ORTHO": "orthographic"}.get(data.type)
    settings = {}
    if data.type == "PANO":
        lens = _PANORAMAS.get(data.panorama_type)
        settings["fisheye"] = (
            data.fisheye_fov,
            data.fisheye_lens,
            data.sensor_width,
            data.sensor_height,
        )
        settings["panorama"] = (
            data.longitude_min,
            data.longitude_max,
            data.latitude_min,
            data.latitude_max,
        )
    if lens is None:
        kind = data.panorama_type if data.type == "PANO" else data.type
        messages.append(
            f"{what}: a lens of type {kind} is not followed; take a perspective, orthographic, "
            "equirectangular or fisheye one"
        )
        return None
    if data.dof.use_dof and lens == "perspective":
        messages.append(f"{what}: its depth of field is ignored")
    half = data.ortho_scale / 2 if lens == "orthographic" else np.tan(data.angle / 2)
    return Camera(
        np.array(item.matrix_world if matrix is None else matrix, np.float64),
        half,
        lens=lens,
        sensor_fit=data.sensor_fit.lower(),
        shift=(data.shift_x, data.shift_y),
        pixel_aspect=(render.pixel_aspect_x, render.pixel_aspect_y),
        clip=(data.clip_start, data.clip_end),
        frame=(render.resolution_x, render.resolution_y),
        **settings,
    )
