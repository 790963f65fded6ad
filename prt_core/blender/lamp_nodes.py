"""What the nodes of a lamp emit, as Cycles renders them: by direction or place, and by distance.

A lamp of power 1 with these nodes is rendered in a scene of its own: a point or spot lamp inside a
white ball, seen from its middle; the surface of an area lamp from in front; a sun on a plate. What
is seen is divided by what a lamp without nodes shows there.
"""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Matrix

from prt_core.blender.identity import by_uid
from prt_core.blender.node_trees import (
    all_nodes,
    as_diffuse_rays_see,
    counts_bounces,
    tree_signature,
)
from prt_core.blender.small_render import layer_numbers, small_render
from prt_core.blender.spot_coordinates import with_spot_coordinates
from prt_core.errors import expect

# Pixels of a pattern: two degrees of direction; places along each side of an area lamp.
_BY_DIRECTION, _BY_PLACE = (180, 90), (64, 64)
# What changes by less than this share of the greatest value is the same everywhere.
_SAME = 2e-3
# Edges of a pattern: a step between pixels of this share of the greatest value, and which share of
# the pixels may have one before it is said.
_STEP, _STEPS = 0.3, 0.01
# A lamp's ball is seen from so many of its radii, by so many samples; the median may differ by
# this share from what its middle shows.
_FAR, _OF_BALL, _OTHER = 20, 64, 0.03
# Distances at which a falloff is seen, relative to that of the pattern.
_DISTANCES = 10.0 ** np.arange(-2, 3.01, 0.25)
# Nodes whose values do not depend on where the lamp is or how it is turned.
_ANYWHERE = {
    "OUTPUT_LIGHT", "EMISSION", "BLACKBODY", "VALUE", "RGB", "MATH", "VECT_MATH", "MIX", "MIX_RGB",
    "VALTORGB", "CURVE_RGB", "HUE_SAT", "GAMMA", "BRIGHTCONTRAST", "INVERT", "WAVELENGTH", "CLAMP",
    "MAP_RANGE", "LIGHT_FALLOFF", "TEX_IES", "LIGHT_PATH", "GROUP", "GROUP_INPUT", "GROUP_OUTPUT",
    "REROUTE", "FRAME", "COMBINE_COLOR", "SEPARATE_COLOR", "COMBXYZ", "SEPXYZ", "ADD_SHADER",
}  # fmt: skip
_MOST_KEPT = 64
_KEPT = {}


@dataclass(frozen=True)
class Emission:
    """What nodes make of a lamp's light.

    Attributes
    ----------
    factor : (3,) float64
        On its power.
    pattern, texture : (n_rows, n_columns, 3) float64, or None
    falloff : (n, 2) float64, or None
        As those of a `Lamp`.
    """

    factor: np.ndarray
    pattern: np.ndarray | None = None
    texture: np.ndarray | None = None
    falloff: np.ndarray | None = None


class LampNodes:
    """The nodes of a lamp, as they are evaluated now.

    Parameters
    ----------
    scene : bpy.types.Scene
    data : bpy.types.Light
        Evaluated; nothing of it is kept.
    matrix : (4, 4) float64
        Where the lamp is.
    item : LampObject
    """

    def __init__(self, scene, data, matrix, item):
        self._plain, self._matrix, self._item = _numbers(data.node_tree), matrix, item
        self._light = data.original.session_uid
        self._key = None if self._plain is not None else _key(scene, data, matrix, item)

    def emission(self, scene):
        """(`Emission`, list of what it cannot follow).

        Parameters
        ----------
        scene : bpy.types.Scene
            Whose frame counts.

        Raises
        ------
        PRTError
            Cycles cannot render.
        """
        if self._plain is not None:
            return Emission(self._plain), []
        if self._key not in _KEPT:
            light = by_uid(bpy.data.lights, self._light)
            expect(light is not None, "the lamp was removed while it was read")
            while len(_KEPT) >= _MOST_KEPT:
                _KEPT.pop(next(iter(_KEPT)))
            with small_render(scene) as render:
                matrix = Matrix(self._matrix.tolist())
                _KEPT[self._key] = _rendered(render, light, matrix, self._item)
        return _KEPT[self._key]


def _numbers(tree):
    """(3,) factor of a tree that is one Emission with numbers; None where it is more."""
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        return np.zeros(3)
    node = output.inputs["Surface"].links[0].from_node
    if node.bl_idname != "ShaderNodeEmission" or node.mute or any(s.is_linked for s in node.inputs):
        return None
    strength = node.inputs["Strength"].default_value
    return np.array(node.inputs["Color"].default_value[:3], np.float64) * strength


def _key(scene, data, matrix, item):
    shape = [data.type, scene.cycles.shading_system]
    if data.type == "AREA":
        shape += [data.shape, data.size, data.size_y]
    elif data.type != "SUN":
        shape += [data.shadow_soft_size, data.type == "SPOT" and data.spot_size]
    kinds = {node.type for node in all_nodes(data.node_tree)}
    if not kinds <= _ANYWHERE:
        shape.append(matrix.tobytes())
    if kinds & {"OBJECT_INFO", "ATTRIBUTE"}:
        shape += [item, *layer_numbers(scene).items()]
    return tree_signature(data.node_tree, scene.frame_current), *shape


def _rendered(render, light, matrix, item):
    """(Emission, list of what it cannot follow)."""
    kind, notes = light.type, []
    if counts_bounces(light.node_tree):
        notes.append("that its nodes count bounces")
    data = _unit_lamp(render, light)
    notes += item.answer(data.node_tree, render.keep)
    if kind == "SPOT":
        with_spot_coordinates(data.node_tree, light, np.abs(matrix.to_scale()))
    look = {"SUN": _Sun, "AREA": _Area}.get(kind, _Point)(render, data, matrix, item)
    seen, small = look.pattern(1.0), look.pattern(1.0, small=True)
    falloff = None
    if np.abs(look.pattern(4.0, small=True) - small).max() > _SAME * np.abs(small).max():
        falloff, separable = _falloff(look, small)
        if not separable:
            notes.append("that its nodes change with distance otherwise in each direction")
    factor, table = _summary(seen)
    if kind != "AREA" and _has_edges(seen):
        notes.append("how sharp the edges are that its nodes show")
    anywhere = {node.type for node in all_nodes(light.node_tree)} <= _ANYWHERE
    if kind in {"POINT", "SPOT"} and not anywhere and look.differs_from_place_to_place():
        notes.append("that its nodes change from place to place on it")
    if kind != "AREA":
        return Emission(factor, table, None, falloff), notes
    if look.is_alike_from_aside():
        return Emission(factor, None, table, falloff), notes
    look.remove()
    data = _unit_lamp(render, light, "POINT")
    item.answer(data.node_tree, render.keep)
    seen = _Point(render, data, matrix, item).pattern(1.0)
    if table is not None:
        notes.append("that its nodes change with direction otherwise in each place")
    return Emission(np.ones(3), seen, None, falloff), notes


def _unit_lamp(render, light, kind=None):
    """A copy of a lamp's data that shines with power 1, white, all round and without shadow."""
    data = render.keep(light.copy())
    kind = kind or data.type
    # A spot's cone is not of its nodes.
    data.type = "POINT" if kind == "SPOT" else kind
    data = bpy.data.lights[data.name]
    data.energy, data.color, data.use_shadow = 1, (1, 1, 1), False
    for name, value in (("use_temperature", False), ("exposure", 0), ("normalize", True)):
        if hasattr(data, name):
            setattr(data, name, value)
    return data


def _has_edges(seen):
    steps = [np.abs(np.diff(seen, axis=axis)).max(axis=-1).ravel() for axis in (0, 1)]
    return np.mean(np.concatenate(steps) > _STEP * np.abs(seen).max()) > _STEPS


def _summary(seen):
    """(factor, table): where a table is the same everywhere its mean, and None."""
    factor, most = seen.mean(axis=(0, 1)), np.abs(seen).max()
    if np.abs(seen - factor).max() <= _SAME * most:
        return factor, None
    # Rows or columns that are all alike are kept once.
    for axis in (0, 1):
        first = seen.take([0], axis=axis)
        if np.abs(seen - first).max() <= _SAME * most:
            seen = first
    return np.ones(3), seen


def _falloff(look, pattern):
    """((n, 2) distances and factors, whether they are the same everywhere)."""
    rows, separable = [], True
    for distance in _DISTANCES:
        seen = look.pattern(distance, small=True)
        factor = float((seen * pattern).sum() / max((pattern * pattern).sum(), 1e-30))
        off = np.abs(seen - factor * pattern).max()
        separable = separable and off <= 0.02 * np.abs(seen).max()
        rows.append((distance, max(factor, 0.0)))
    return np.array(rows), separable


class _Point:
    """A point or spot lamp, by direction."""

    def __init__(self, render, data, matrix, item):
        self._data, self._radius = data, data.shadow_soft_size
        data.shadow_soft_size = 0
        item.dress(render.add(data, matrix))
        self._render, self._axes = render, matrix.normalized()
        self._ball = render.add(_white(render, *_ball()))
        turned = self._axes @ Euler((np.pi / 2, 0, -np.pi / 2)).to_matrix().to_4x4()
        render.add_camera(
            turned, type="PANO", panorama_type="EQUIRECTANGULAR", clip_start=1e-6, clip_end=1e6
        )

    def differs_from_place_to_place(self):
        """Whether its ball shows another pattern from far away than its middle."""
        if not self._radius:
            return False
        away = max(1.0, _FAR * self._radius)
        of_middle = self.pattern(away, small=True, samples=_OF_BALL)
        self._data.shadow_soft_size = self._radius
        of_ball = self.pattern(away, small=True, samples=_OF_BALL)
        self._data.shadow_soft_size = 0
        return np.median(np.abs(of_ball - of_middle)) > _OTHER * np.median(np.abs(of_middle))

    def pattern(self, distance, small=False, samples=1):
        self._ball.matrix_world = self._axes @ Matrix.Diagonal((*[distance] * 3, 1))
        size, samples = ((24, 12), samples) if small else (_BY_DIRECTION, 4)
        seen = self._render.pixels(*size, samples).astype(np.float64)
        # Power 1 is 1 / 4 pi in each direction.
        return seen * 4 * np.pi**2 * distance**2


class _Area:
    """An area lamp, by the place on it."""

    def __init__(self, render, data, matrix, item):
        square = data.shape in {"SQUARE", "DISK"}
        size = data.size, data.size if square else data.size_y
        data.shape, data.spread = "RECTANGLE", np.pi
        data.size, data.size_y = size
        as_diffuse_rays_see(data.node_tree, render.keep)
        self._lamp = render.add(data, matrix)
        item.dress(self._lamp)
        self._lamp.visible_camera = True
        self._render, self._axes = render, matrix.normalized()
        self._size = np.array(size) * np.abs(matrix.to_scale())[:2]
        wide, high = np.maximum(self._size / self._size.min(), 1e-6)
        render.scene.render.pixel_aspect_x, render.scene.render.pixel_aspect_y = wide, high
        self._camera = render.add_camera(
            None, type="ORTHO", ortho_scale=self._size.max(), clip_start=1e-6, clip_end=1e6
        )

    def pattern(self, distance, small=False, tilt=0.0):
        # In front, which is where its -z points, and so with x the other way round.
        place = Euler((0, np.pi + tilt, 0)).to_matrix().to_4x4() @ Matrix.Translation(
            (0, 0, distance)
        )
        self._camera.matrix_world = self._axes @ place
        size, samples = ((8, 8), 4) if small else (_BY_PLACE, 16)
        seen = self._render.pixels(*size, samples)[:, ::-1].astype(np.float64)
        # Power 1 is a radiance of 1 / pi on each area.
        return seen * np.pi * self._size.prod()

    def is_alike_from_aside(self):
        """Whether its radiance does not depend on the direction."""
        away = 10 * self._size.max()
        front = self.pattern(away, small=True).mean(axis=(0, 1))
        for tilt in (-np.pi / 4, np.pi / 4):
            # It is narrower from there; what lies beside it is dark.
            aside = self.pattern(away, small=True, tilt=tilt).mean(axis=(0, 1)) / np.cos(tilt)
            if not np.allclose(aside, front, rtol=0.1, atol=0.02 * np.abs(front).max()):
                return False
        return True

    def remove(self):
        """Take it out of the scene."""
        self._render.scene.collection.objects.unlink(self._lamp)


class _Sun:
    """A sun, which shines alike from everywhere."""

    def __init__(self, render, data, matrix, item):
        data.angle = 0
        axes = matrix.normalized()
        item.dress(render.add(data, axes))
        corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
        render.add(_white(render, corners, [(0, 1, 2, 3)]), axes)
        render.add_camera(axes @ Matrix.Translation((0, 0, 1)), type="ORTHO", ortho_scale=1)
        self._seen = render.pixels(4, 4, 1).astype(np.float64) * np.pi

    def pattern(self, distance, small=False):
        return self._seen


def _white(render, vertices, faces):
    """A white mesh whose faces are smooth."""
    mesh = render.keep(bpy.data.meshes.new("prt render"))
    mesh.from_pydata(vertices.tolist(), [], faces)
    mesh.shade_smooth()
    material = render.keep(bpy.data.materials.new("prt render"))
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in _WHITE)
    shader.inputs["Color"].default_value = 1, 1, 1, 1
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    return mesh


_WHITE = "BsdfDiffuse", "OutputMaterial"


def _ball(n_around=128, n_down=64):
    """Vertices and faces of a ball of radius 1, fine enough to be round."""
    down = (np.arange(1, n_down) / n_down * np.pi)[:, None]
    around = np.arange(n_around) / n_around * 2 * np.pi
    rings = [np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)]
    rings[2] = np.broadcast_to(rings[2], rings[0].shape)
    vertices = np.concatenate([np.stack(rings, axis=-1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    north, south = len(vertices) - 2, len(vertices) - 1
    faces = []
    for i in range(n_around):
        j = (i + 1) % n_around
        faces += [(north, i, j), (south, south - 1 - n_around + j, south - 1 - n_around + i)]
        for ring in range(n_down - 2):
            first = ring * n_around
            faces.append((first + i, first + n_around + i, first + n_around + j, first + j))
    return vertices, faces
