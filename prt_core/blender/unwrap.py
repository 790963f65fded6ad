"""UV maps for an atlas, by Blender's own unwrapping and packing, on a mesh of all objects together.

The mesh is made for that and goes again: no object of the user's is touched. It holds what renders,
modifiers and instances realised, in world space, so that charts are as large as their surface is.
"""

from contextlib import ExitStack

import bpy
import numpy as np

from prt_core.blender.casters import mark_temporary, remove_blocks
from prt_core.blender.operator_context import context_of
from prt_core.errors import PRTError, expect

# Faces of one chart lie within this angle of its mean, in radians: Blender's own default.
_ANGLE = np.radians(66)
_MAP = "prt"
# Beyond the square's edges, by rounding; and how far charts reach at least that are packed well.
_ROUNDED, _FULL = 1e-3, 0.5


def lightmap_uvs(meshes, settings):
    """UV maps of objects in one atlas, charts apart.

    Parameters
    ----------
    meshes : sequence of Mesh
    settings : ImageSettings
        Of which size the atlas is, the texels between charts, and whether the objects' own charts
        are packed: those of objects without a UV map are made.

    Returns
    -------
    dict of str -> (n_corners, 2) float64

    Raises
    ------
    PRTError
        Blender cannot unwrap them here.
    """
    width, height = settings.atlas
    # Blender packs a square, in which texels of an image that is none are longer than wide.
    stretch = max(width, height) / np.array([width, height])
    kept = [settings.atlas_uv == "packed" and mesh.corner_uv is not None for mesh in meshes]
    made = np.repeat(np.logical_not(kept), [len(mesh.face_sizes) for mesh in meshes])
    with ExitStack() as undo:
        item = undo.enter_context(_temporary(_joined(meshes, kept)))
        scene = undo.enter_context(_temporary(bpy.data.scenes.new("prt unwrap")))
        scene.collection.objects.link(item)
        scene.tool_settings.use_uv_select_sync = True
        scene.tool_settings.mesh_select_mode = (False, False, True)
        layer = scene.view_layers[0]
        layer.objects.active = item
        item.select_set(True, view_layer=layer)
        select = item.data.polygons.foreach_set
        try:
            with context_of(
                scene,
                active_object=item,
                object=item,
                edit_object=item,
                selected_objects=[item],
                selected_editable_objects=[item],
            ):
                if made.any():
                    select("select", made)
                    bpy.ops.object.mode_set(mode="EDIT")
                    bpy.ops.uv.smart_project(
                        angle_limit=_ANGLE, island_margin=0, correct_aspect=False
                    )
                    bpy.ops.object.mode_set(mode="OBJECT")
                select("select", np.ones(len(made), bool))
                bpy.ops.object.mode_set(mode="EDIT")
                bpy.ops.uv.average_islands_scale()
                bpy.ops.object.mode_set(mode="OBJECT")
                _stretch(item.data, stretch)
                bpy.ops.object.mode_set(mode="EDIT")
                _pack(item.data, settings.atlas_margin / max(width, height), width == height)
                bpy.ops.object.mode_set(mode="OBJECT")
        except RuntimeError as error:
            reason = " ".join(str(error).split())
            raise PRTError(f"atlas: Blender cannot unwrap the objects ({reason})") from error
        uv = _uv(item.data)
    low, high = uv.min(axis=0), uv.max(axis=0)
    # Blender lets charts stick out, or shrinks them to nothing, where their margins take all.
    fits = np.isfinite(uv).all() and low.min() > -_ROUNDED and high.max() < 1 + _ROUNDED
    expect(
        fits and (high - low).max() > _FULL,
        f"atlas: {settings.atlas_margin} texels between all charts do not fit into "
        f"{width} x {height}; take a larger atlas or a smaller margin",
    )
    ends = np.cumsum([len(mesh.corner_vertex) for mesh in meshes])
    return {mesh.name: part for mesh, part in zip(meshes, np.split(uv, ends[:-1]), strict=True)}


def _pack(mesh, margin, square):
    """Put all charts into the square from 0 to 1, so far apart; turned where texels are square.

    By their boxes: by their shapes it takes minutes for a few hundred charts, and fills no more.
    """
    bpy.ops.uv.pack_islands(
        rotate=square,
        scale=True,
        merge_overlap=False,
        margin_method="FRACTION",
        margin=margin,
        shape_method="AABB",
    )


def _joined(meshes, kept):
    """A mesh object of all corners, in a frame in which their largest side is 1.

    `kept` (n_meshes,) bool: whose own UV maps it has.
    """
    first, corners, positions = 0, [], []
    for mesh in meshes:
        corners.append(mesh.corner_vertex + first)
        positions.append(mesh.vertices)
        first += len(mesh.vertices)
    corners, positions = np.concatenate(corners), np.concatenate(positions)
    low, high = positions.min(axis=0), positions.max(axis=0)
    positions = (positions - (low + high) / 2) / max((high - low).max(), 1e-30)
    sizes = np.concatenate([mesh.face_sizes for mesh in meshes])
    data = bpy.data.meshes.new("prt unwrap")
    data.vertices.add(len(positions))
    data.vertices.foreach_set("co", positions.astype(np.float32).ravel())
    data.loops.add(len(corners))
    data.loops.foreach_set("vertex_index", corners.astype(np.int32))
    data.polygons.add(len(sizes))
    start = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int32)
    data.polygons.foreach_set("loop_start", start)
    data.update(calc_edges=True)
    # What is unwrapped anew begins without a map, so that what it had before changes nothing.
    uv = [
        m.corner_uv if k else np.zeros((len(m.corner_vertex), 2))
        for m, k in zip(meshes, kept, strict=True)
    ]
    layer = data.uv_layers.new(name=_MAP, do_init=False)
    layer.data.foreach_set("uv", np.concatenate(uv).astype(np.float32).ravel())
    item = bpy.data.objects.new("prt unwrap", data)
    mark_temporary(data)
    return item


def _stretch(mesh, factor):
    values = (_uv(mesh) * factor).astype(np.float32)
    mesh.uv_layers[_MAP].data.foreach_set("uv", values.ravel())


def _uv(mesh):
    """(n_corners, 2) float64."""
    values = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers[_MAP].data.foreach_get("uv", values)
    return values.reshape(-1, 2).astype(np.float64)


class _temporary:
    """A data-block that is removed again, an object with its mesh."""

    def __init__(self, block):
        self._blocks = [block, block.data] if isinstance(block, bpy.types.Object) else [block]

    def __enter__(self):
        for block in self._blocks:
            mark_temporary(block)
        return self._blocks[0]

    def __exit__(self, *_):
        remove_blocks(self._blocks)
