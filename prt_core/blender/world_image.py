"""Any world as an image: what its nodes give, as Cycles renders it for diffuse rays.

The disc of a sky's sun is smaller than a pixel. It is left out of the image and is a sun of its
own, as bright and large as a finer picture of its place shows it.
"""

from dataclasses import dataclass

import numpy as np
from mathutils import Euler, Matrix

from prt_core.blender.node_trees import all_nodes, as_diffuse_rays_see
from prt_core.blender.small_render import small_render
from prt_core.light.environment import BRIGHTEST, EnvironmentMap
from prt_core.light.local import Lamp
from prt_core.sphere import tangents

# Width of an image without images in it, and the greatest.
_WIDTH, _WIDEST = 512, 4096
_SAMPLES = 4
# The fine picture: pixels a side, and its width in discs.
_FINE, _DISCS = 64, 2.5
# The smallest disc in radians: what is smaller casts shadows as sharp.
_SMALLEST = float(np.radians(0.2))
# A disc is so many times brighter than the brightest of the sky around it.
_BRIGHTER = 1.5
# Less than this share of the brightest below zero are traces of a filter.
_TRACES = 0.01


@dataclass(frozen=True)
class WorldImage:
    """An `EnvironmentMap`, the suns of its skies as a list of `Lamp`, and whether it took light."""

    map: EnvironmentMap
    suns: list
    takes: bool


def world_image(scene, world, name):
    """The `WorldImage` of a world with nodes.

    Parameters
    ----------
    scene : bpy.types.Scene
        Whose frame it is.
    world : bpy.types.World
    name : str
        For messages.

    Raises
    ------
    PRTError
        Cycles cannot render.
    """
    with small_render(scene) as render:
        copy = render.keep(world.copy())
        as_diffuse_rays_see(copy.node_tree, render.keep)
        render.scene.world = copy
        # Nothing is lit by it.
        copy.cycles.sampling_method = "NONE"
        turned = Euler((np.pi / 2, 0, -np.pi / 2)).to_matrix().to_4x4()
        render.add_camera(turned, type="PANO", panorama_type="EQUIRECTANGULAR")
        discs = [node for node in all_nodes(copy.node_tree) if _has_disc(node)]
        for node in discs:
            # A sky with a disc is never turned; without one it would be.
            for link in [link for socket in node.inputs for link in socket.links]:
                node.id_data.links.remove(link)
            node.sun_disc = False
        width = _width(copy.node_tree)
        samples = _SAMPLES if width <= 2 * _WIDTH else 1
        pixels = np.nan_to_num(render.pixels(width, width // 2, samples), nan=0.0)
        takes = bool(pixels.min() < -_TRACES * max(float(pixels.max()), 1e-6))
        pixels = np.clip(pixels, 0, BRIGHTEST)
        suns = [sun for node in discs for sun in _suns_of(render, node, f"sun of {name}")]
        return WorldImage(EnvironmentMap(pixels, name), suns, takes)


def _has_disc(node):
    # Other skies have the property, and no disc.
    kinds = {"NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"}
    return node.bl_idname == "ShaderNodeTexSky" and node.sky_type in kinds and node.sun_disc


def _width(tree):
    images = [node.image for node in all_nodes(tree) if getattr(node, "image", None)]
    widest = max((image.size[0] for image in images), default=0)
    return int(np.clip(2 * ((widest + 1) // 2), _WIDTH, _WIDEST))


def _suns_of(render, node, name):
    """The sun of a sky texture in a list; an empty one where nothing is seen of its disc."""
    elevation, turn = node.sun_elevation, node.sun_rotation
    level = np.cos(elevation)
    axes = _facing(np.array([np.sin(turn) * level, np.cos(turn) * level, np.sin(elevation)]))
    node.sun_size = size = max(node.sun_size, _SMALLEST)
    side = 2 * np.tan(min(_DISCS * size / 2, 1.2))
    looking = Matrix(axes.tolist()).to_4x4() @ Euler((0, np.pi, 0)).to_matrix().to_4x4()
    render.add_camera(looking, type="PERSP", angle=2 * np.arctan(side / 2))
    node.sun_disc = True
    light = np.clip(np.nan_to_num(render.pixels(_FINE, _FINE, 4 * _SAMPLES)), 0, BRIGHTEST)
    light = light.astype(np.float64)
    node.sun_disc = False
    step = side / _FINE
    across = (np.arange(_FINE) + 0.5) * step - side / 2
    x, y = np.meshgrid(-across, -across)
    length = np.sqrt(1 + x * x + y * y)
    ways = np.stack([x, y, np.ones_like(x)], axis=-1) / length[..., None] @ axes.T
    around = light[np.hypot(x, y) > 0.4 * side]
    disc = light.sum(axis=-1) > _BRIGHTER * around.sum(axis=-1).max()
    power = (light - around.mean(axis=0)) * (disc * step**2 / length**3)[..., None]
    weight = power.sum(axis=-1)
    if not disc.any():
        return []
    middle = np.einsum("ij,ijk->k", weight, ways)
    middle /= np.linalg.norm(middle)
    # An even disc of half angle a lies a^2 / 2 from its middle in the mean square.
    square = (weight * 2 * (1 - ways @ middle)).sum() / weight.sum()
    angle = 2 * np.sqrt(2 * square)
    # What W / m^2 it gives to a surface that faces it.
    power = (power * (ways @ middle)[..., None]).sum(axis=(0, 1))
    return [Lamp("sun", power, axes=_facing(middle), angle=angle, of_world=True, name=name)]


def _facing(direction):
    """(3, 3): axes whose z is a direction, as columns."""
    x, y = tangents(direction[None])
    return np.stack([x[0], y[0], direction], axis=1)
