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
    """
    scene = scene or bpy.context.scene
    rendered_layer(scene)[0].update()
    items = [item for item in scene.objects if item.type == "CAMERA"]
    names, _ = display_names(items)
    cameras = {names[item.session_uid]: _camera_of(item, scene, []) for item in items}
    return {name: camera for name, camera in cameras.items() if camera is not None}


def _camera_of(item, scene, messages):
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
        np.array(item.matrix_world, np.float64),
        half,
        lens=lens,
        sensor_fit=data.sensor_fit.lower(),
        shift=(data.shift_x, data.shift_y),
        pixel_aspect=(render.pixel_aspect_x, render.pixel_aspect_y),
        clip=(data.clip_start, data.clip_end),
        frame=(render.resolution_x, render.resolution_y),
        **settings,
    )
