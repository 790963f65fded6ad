"""Blender's world and sun lamps as light on the directions of a cube map."""

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes
from prt_core.blender.images import has_known_colours, pixels_of
from prt_core.blender.lamps import ALL_BOUNCES, read_lamps
from prt_core.blender.node_trees import all_nodes, counts_bounces, linked_to, tree_signature
from prt_core.blender.passes.graphs import asks_camera
from prt_core.blender.render_scene import rendered_layer, rendered_world
from prt_core.blender.small_render import layer_numbers
from prt_core.blender.world_image import world_image
from prt_core.errors import PRTError, expect
from prt_core.light.baked_world import BakedWorld, image_of_world
from prt_core.light.environment import EnvironmentMap
from prt_core.light.sun import sun_light
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import run
from prt_core.sphere import rotation_matrix

_BLACK = EnvironmentMap(np.zeros((1, 1, 3), np.float32), "world")
_MOST_MAPS = 4
_MAPS = {}


def read_world(cube_map, scene=None, suns=True):
    """Radiance of the world, with its suns and the sun lamps added.

    Parameters
    ----------
    cube_map : CubeMap
    scene : bpy.types.Scene, optional
    suns : bool
        Whether the suns of its skies and sun lamps are added.

    Returns
    -------
    (n_directions, 3) float32

    Raises
    ------
    PRTError
        An image of it cannot be read, or Cycles cannot render it.
    """
    scene = scene or bpy.context.scene
    world = read_environment(scene)
    lamps = [] if world is None else list(world.suns)
    lamps += [lamp for lamp in read_lamps(scene) if lamp.is_on_texels]
    return run(world_on_texels_steps(cube_map, world, lamps if suns else []))


def world_on_texels_steps(cube_map, world, suns):
    """(n_directions, 3) float32 radiance of a `WorldLight` or None, with suns; a generator."""
    return (yield from in_thread("light", _on_texels, cube_map, world, suns))


def baked_world_steps(cube_map, world, suns):
    """The `BakedWorld` of a `WorldLight`, or of a black sky, and suns; a generator."""
    return (yield from in_thread("light", _baked, cube_map, world, suns))


def _baked(cube_map, world, suns):
    sky = _BLACK if world is None else image_of_world(world.map, world.rotation, world.strength)
    return BakedWorld(_on_texels(cube_map, world, suns), sky)


def _on_texels(cube_map, world, suns):
    light = np.zeros((cube_map.n_directions, 3), np.float32)
    if world is not None:
        light += world.map.to_cube_map(cube_map, world.rotation, world.strength)
    for lamp in suns:
        light += sun_light(cube_map, lamp.towards, lamp.power, lamp.angle)
    return light


@dataclass(frozen=True)
class WorldLight:
    """The background of a world: an environment, how it is turned, its factor, and its suns.

    Attributes
    ----------
    map : EnvironmentMap
    rotation : (3, 3) float64
    strength : float
    suns : tuple of Lamp
        Of its skies; they are not in the map, and turned and strong as they are.
    """

    map: EnvironmentMap
    rotation: np.ndarray
    strength: float
    suns: tuple = ()

    def turned_suns(self, rotation, strength):
        """The suns, turned by a further rotation matrix and times a factor, as a list of `Lamp`."""
        return [
            replace(sun, axes=rotation @ sun.axes, power=sun.power * strength) for sun in self.suns
        ]


def read_environment(scene=None, messages=None):
    """The world's background as `WorldLight`, None where diffuse surfaces get no light of it.

    An image that is only turned is read as it is, and so is one colour; anything else is what
    Cycles renders of it.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
    messages : list of str, optional
        Told what is left out.

    Raises
    ------
    PRTError
        As `read_world`.
    """
    scene = scene or bpy.context.scene
    world = rendered_world(scene)
    if world is None or not world.cycles_visibility.diffuse or not rendered_layer(scene)[0].use_sky:
        return None
    what = f"world '{world.name}'"
    most = world.original.cycles.max_bounces
    if most < ALL_BOUNCES and messages is not None:
        messages.append(f"{what}: its limit of {most} bounces is ignored")
    if not has_nodes(world):
        return _even(world.color, 1.0, what)
    tree = world.node_tree
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return None
    if output.inputs["Volume"].is_linked and messages is not None:
        messages.append(f"{what}: its volume is ignored")
    if not output.inputs["Surface"].is_linked:
        return None
    if messages is not None and any(asks_camera(node) for node in all_nodes(tree)):
        messages.append(f"{what}: Window and Camera coordinates in it are not those of the camera")
    if messages is not None and counts_bounces(tree):
        messages.append(f"{what}: its nodes count bounces; light is as after the first of them")
    _expect_images(tree, what)
    plain = _plain(tree, output, what)
    if plain is not None:
        return plain
    frame = scene.frame_current, scene.frame_subframe
    asked = [scene.cycles.shading_system]
    if any(node.type == "ATTRIBUTE" for node in all_nodes(tree)):
        asked += layer_numbers(scene).items()
    key = "rendered", world.original.session_uid, tree_signature(tree, frame), *asked
    try:
        image = _kept(key, lambda: world_image(scene, world.original, what))
    except PRTError as error:
        raise PRTError(f"{what}: {error}") from error
    if image.takes and messages is not None:
        messages.append(f"{what}: light below zero takes none away; it is none")
    return WorldLight(image.map, np.eye(3), 1.0, tuple(image.suns))


def _plain(tree, output, what):
    """`WorldLight` of one Background of a colour or of an image that is only turned, else None."""
    node = linked_to(output.inputs["Surface"]).node
    if node.type != "BACKGROUND" or node.mute or node.inputs["Strength"].is_linked:
        return None
    strength = float(node.inputs["Strength"].default_value)
    if strength < 0:
        return None
    colour = linked_to(node.inputs["Color"])
    if colour is None:
        return _even(node.inputs["Color"].default_value, strength, what)
    texture = colour.node
    if texture.type != "TEX_ENVIRONMENT" or texture.mute or colour.name != "Color":
        return None
    image = texture.image
    # Bytes are interpolated as they are encoded, and multiplied with their alpha.
    if image.source not in {"FILE", "GENERATED"} or not image.is_float:
        return None
    if not has_known_colours(image):
        return None
    if texture.projection != "EQUIRECTANGULAR":
        return None
    turn = _turn(texture)
    if turn is None:
        return None
    return WorldLight(_map_of(image, what), turn, strength)


def _expect_images(tree, what):
    for node in all_nodes(tree):
        if node.bl_idname not in {"ShaderNodeTexEnvironment", "ShaderNodeTexImage"}:
            continue
        if node.mute or not any(output.is_linked for output in node.outputs):
            continue
        image = node.image
        expect(image is not None, f"{what}: the texture '{node.name}' has no image; choose one")
        expect(
            image.size[0] > 0 or _has_file(image),
            f"{what}: image '{image.name}' has no pixels; its file '{image.filepath}' is missing "
            "or unreadable",
        )


def _has_file(image):
    """Whether a film or sequence is there, of which Blender knows no size before it is shown."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    return image.source in {"MOVIE", "SEQUENCE"} and Path(path).is_file()


def _even(colour, strength, what):
    pixels = np.maximum(np.float32(colour[:3]), 0).reshape(1, 1, 3)
    return WorldLight(
        _kept(("even", pixels.tobytes()), lambda: EnvironmentMap(pixels, what)), np.eye(3), strength
    )


def _map_of(image, what):
    """The image as a map, kept while it is the same: reading pixels takes long."""

    def make():
        return EnvironmentMap(np.maximum(pixels_of(image)[..., :3], 0), what)

    if image.is_dirty or image.source not in {"FILE", "GENERATED"} or image.packed_file:
        return make()
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    stamp = path.stat().st_mtime_ns if path.is_file() else 0
    space = image.colorspace_settings.name
    return _kept((image.session_uid, str(path), stamp, tuple(image.size), space), make)


def _kept(key, make):
    if key not in _MAPS:
        while len(_MAPS) >= _MOST_MAPS:
            _MAPS.pop(next(iter(_MAPS)))
        _MAPS[key] = make()
    return _MAPS[key]


def _turn(texture):
    """The rotation of the light by a texture's vector input; None where that is something else."""
    source = linked_to(texture.inputs["Vector"])
    if source is None:
        return np.eye(3)
    matrix = np.eye(3)
    if source.node.type == "MAPPING" and not source.node.mute:
        mapping = source.node
        if any(s.is_linked for s in mapping.inputs if s.name != "Vector"):
            return None
        angles = np.degrees(mapping.inputs["Rotation"].default_value[:])
        scale = np.array(mapping.inputs["Scale"].default_value[:])
        location = mapping.inputs.get("Location")
        moved = mapping.vector_type in {"POINT", "TEXTURE"} and any(location.default_value[:])
        if moved or not np.allclose(scale, scale[0]) or scale[0] <= 0:
            return None
        matrix = rotation_matrix(angles)
        # The mapping turns the direction that is looked up; the light turns the other way.
        if mapping.vector_type != "TEXTURE":
            matrix = matrix.T
        source = linked_to(mapping.inputs["Vector"])
    if source is None or (source.node.type == "TEX_COORD" and source.name == "Generated"):
        return matrix
    return None
