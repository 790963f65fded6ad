"""Blender's world and sun lamps as light on the directions of a cube map."""

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes
from prt_core.blender.images import pixels_of
from prt_core.blender.lamps import read_lamps
from prt_core.blender.materials import _source
from prt_core.errors import PRTError, expect
from prt_core.light.environment import EnvironmentMap
from prt_core.light.rotation import rotation_matrix
from prt_core.light.sun import sun_light


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
    scene = scene or bpy.context.scene
    light = np.zeros((cube_map.n_directions, 3), np.float32)
    if scene.world is not None:
        light += _background(scene.world, cube_map)
    if suns:
        for lamp in read_lamps(scene):
            if lamp.kind == "sun":
                light += sun_light(cube_map, lamp.towards, lamp.power, lamp.angle)
    return light


def _background(world, cube_map):
    what = f"world '{world.name}'"
    tree = world.node_tree
    if not has_nodes(world):
        return np.broadcast_to(np.float32(world.color[:]), (cube_map.n_directions, 3))
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    shader = _source(output.inputs["Surface"]) if output else None
    if shader is None:
        return 0.0
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
    colour = _source(node.inputs["Color"])
    if colour is None:
        value = np.float32(node.inputs["Color"].default_value[:3]) * np.float32(strength)
        return np.broadcast_to(value, (cube_map.n_directions, 3))
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
    pixels = np.maximum(pixels_of(texture.image)[..., :3], 0)
    environment = EnvironmentMap(pixels, what)
    return environment.to_cube_map(cube_map, _turn(texture, what), strength)


def _turn(texture, what):
    """The rotation matrix that the texture's vector input applies to the light."""
    source = _source(texture.inputs["Vector"])
    if source is None:
        return None
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
        source = _source(mapping.inputs["Vector"])
    expect(
        source is None or (source.node.type == "TEX_COORD" and source.name == "Generated"),
        f"{what}: texture coordinates other than Generated are not understood",
    )
    return matrix
