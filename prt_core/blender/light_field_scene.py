"""A scene whose light field is captured: its triangles and points, and the camera that shoots."""

from prt_core.blender.camera import read_camera
from prt_core.blender.depsgraph import read_meshes_steps
from prt_core.blender.identity import find_object, scene_of
from prt_core.blender.light_field_camera import LightFieldCamera, expect_custom_camera
from prt_core.blender.light_groups import lights_of
from prt_core.reflectance import Materials
from prt_core.scene.paint import LOOKS, Look, look_of
from prt_core.scene.sheets import is_sheet


def light_field_meshes_steps(uid, objects=None, two_sided=(), lamps=False, pace=None):
    """The meshes of a scene for a light field; a generator of `Progress`.

    Parameters
    ----------
    uid : int
        `session_uid` of the scene.
    objects : sequence of str, optional
        Names of those whose field is wanted; default: all.
    two_sided : sequence of str
        Objects with points on their backs, besides those that are sheets.
    lamps : bool
        Whether materials are evaluated, so that it is known which objects emit light.
    pace : float, optional
        Seconds a step may take.

    Returns
    -------
    list of Mesh

    Raises
    ------
    PRTError
        This Blender has no cameras that are shaders, or a name belongs to nothing with faces.
    """
    expect_custom_camera()
    # What is said of materials and of what bakes leave out does not hold for a render by Cycles.
    unsaid = []
    meshes = yield from read_meshes_steps(
        uid, objects, two_sided, unsaid, pace=pace, materials=lamps
    )
    for mesh in meshes:
        _keep_emission(mesh)
        mesh.two_sided = mesh.two_sided or (mesh.receives and is_sheet(mesh))
    return meshes


def _keep_emission(mesh):
    """Leave nothing of a mesh's materials but what they emit: the render has all the rest.

    Else glass would have points within, and what bakes say of what lets light pass would be said.
    """
    for name in ("shown", *LOOKS):
        look = look_of(mesh, name) if name == "shown" else getattr(mesh, name)
        if look is None:
            continue
        materials = Materials(albedo=look.materials.albedo, emission=look.materials.emission)
        paint = None if look.paint is None else look.paint.only({"emission"})
        if name == "shown":
            mesh.materials, mesh.paint = materials, paint
        else:
            setattr(mesh, name, Look(materials, paint))


def light_field_camera(uid, built, lamps=False, messages=None):
    """The `LightFieldCamera` of a scene, and the `Camera` that the scene has, or None.

    Parameters
    ----------
    uid : int
    built : Scene
        Of the meshes.
    lamps : bool
        Whether there is a field of each light.
    messages : list of str, optional
    """
    scene, messages = scene_of(uid), [] if messages is None else messages
    lights = lights_of(scene, _emitting(built), messages) if lamps else ()
    places = sorted(
        {_place(item) for item in built.objects if item.receives},
    )
    return LightFieldCamera(scene, places, lights), read_camera(scene, messages)


def _place(item):
    """Name and library of what renders as an object of the scene."""
    return (item.source or item.owner), ("" if item.source else item.library)


def _emitting(built):
    """The objects of Blender whose materials emit light, each once."""
    emits = sorted(set(built.triangle_object[built.triangle_emitter >= 0].tolist()))
    found = {find_object(*_place(built.objects[index])) for index in emits}
    return sorted(found - {None}, key=lambda item: item.name_full)
