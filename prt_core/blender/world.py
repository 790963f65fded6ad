"""Blender's world and sun lamps as light on the directions of a cube map."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes
from prt_core.blender.images import pixels_of
from prt_core.blender.lamps import read_lamps
from prt_core.blender.materials import linked_to
from prt_core.errors import PRTError, expect
from prt_core.light.environment import EnvironmentMap
from prt_core.light.sun import sun_light
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import run
from prt_core.sphere import rotation_matrix

_MOST_MAPS = 4
_MAPS = {}


def read_world(cube_map, scene=None, suns=True):
    """Radiance of the world, with the sun lamps added.

    Understood: a Background of one colour or of an equirectangular Environment Texture, whose
    vector may come from Texture Coordinate (Generated) and one Mapping that turns.

    Parameters
    ----------
    cube_map : CubeMap
    scene : bpy.types.Scene, optional
    suns : bool
        Whether sun lamps are added.

    Returns
    -------
    (n_directions, 3) float32

    Raises
    ------
    PRTError
        The world has a node that is not understood; nothing is guessed.
    """
    return run(read_world_steps(cube_map, scene, suns))


def read_world_steps(cube_map, scene=None, suns=True):
    """`read_world` as a generator of `Progress`: Blender is read in the first step only."""
    scene = scene or bpy.context.scene
    found = read_environment(scene)
    lamps = [lamp for lamp in read_lamps(scene) if suns and lamp.kind == "sun"]
    return (yield from in_thread("light", _on_texels, cube_map, found, lamps))


def _on_texels(cube_map, found, suns):
    light = np.zeros((cube_map.n_directions, 3), np.float32)
    if found is not None:
        light += found.map.to_cube_map(cube_map, found.rotation, found.strength)
    for lamp in suns:
        light += sun_light(cube_map, lamp.towards, lamp.power, lamp.angle)
    return light


@dataclass(frozen=True)
class WorldLight:
    """The background of a world: an environment, how it is turned, and its factor.

    Attributes
    ----------
    map : EnvironmentMap
    rotation : (3, 3) float64
    strength : float
    """

    map: EnvironmentMap
    rotation: np.ndarray
    strength: float


def read_environment(scene=None):
    """The world's background as `WorldLight`, None where it is black or there is no world.

    Raises
    ------
    PRTError
        As `read_world`.
    """
    world = (scene or bpy.context.scene).world
    if world is None:
        return None
    what = f"world '{world.name}'"
    tree = world.node_tree
    if not has_nodes(world):
        return _even(world.color, 1.0, what)
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    shader = linked_to(output.inputs["Surface"]) if output else None
    if shader is None:
        return None
    if output.inputs["Volume"].is_linked:
        raise PRTError(f"{what}: a volume is not understood; unlink it")
    node = shader.node
    expect(
        node.type == "BACKGROUND",
        f"{what}: node '{node.name}' is not understood; link one Background to the output",
    )
    expect(
        not node.inputs["Strength"].is_linked,
        f"{what}: a texture on the background's strength is not understood; set a number",
    )
    strength = float(node.inputs["Strength"].default_value)
    colour = linked_to(node.inputs["Color"])
    if colour is None:
        return _even(node.inputs["Color"].default_value, strength, what)
    texture = colour.node
    expect(
        texture.type == "TEX_ENVIRONMENT",
        f"{what}: node '{texture.name}' is not understood; use an Environment Texture",
    )
    expect(texture.image is not None, f"{what}: the environment texture has no image")
    expect(
        texture.projection == "EQUIRECTANGULAR",
        f"{what}: projection '{texture.projection}' is not understood; use Equirectangular",
    )
    return WorldLight(_map_of(texture.image, what), _turn(texture, what), strength)


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


def _turn(texture, what):
    """The rotation matrix that the texture's vector input applies to the light."""
    source = linked_to(texture.inputs["Vector"])
    if source is None:
        return np.eye(3)
    matrix = np.eye(3)
    if source.node.type == "MAPPING":
        mapping = source.node
        linked = [s.name for s in mapping.inputs if s.is_linked and s.name != "Vector"]
        expect(not linked, f"{what}: a link into the mapping's {linked} is not understood")
        angles = np.degrees(mapping.inputs["Rotation"].default_value[:])
        scale = np.array(mapping.inputs["Scale"].default_value[:])
        location = mapping.inputs.get("Location")
        moved = mapping.vector_type in {"POINT", "TEXTURE"} and any(location.default_value[:])
        expect(
            mapping.vector_type in {"POINT", "TEXTURE", "VECTOR", "NORMAL"}
            and np.allclose(scale, scale[0])
            and scale[0] > 0
            and not moved,
            f"{what}: a mapping that moves or stretches the sky is not understood; only turn it",
        )
        matrix = rotation_matrix(angles)
        # The mapping turns the direction that is looked up; the light turns the other way.
        if mapping.vector_type != "TEXTURE":
            matrix = matrix.T
        source = linked_to(mapping.inputs["Vector"])
    expect(
        source is None or (source.node.type == "TEX_COORD" and source.name == "Generated"),
        f"{what}: texture coordinates other than Generated are not understood",
    )
    return matrix
