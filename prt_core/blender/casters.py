"""Blender's own BVH as ray casters: Geometry Nodes (all cores) and mathutils.bvhtree.

The rays are the vertices of a mesh in a temporary scene; a node group casts them and stores one
integer for each, the triangle that was hit plus one. The user's scene is never touched.
"""

import weakref

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from prt_core.blender.compat import depsgraph_of
from prt_core.rays.caster import (
    MISS,
    Hits,
    as_limits,
    as_rays,
    barycentric_of,
    register_caster,
)
from prt_core.runtime.cores import n_cores

# Rays are as long as they like in the scene's frame, whose size is 1.
_FAR = 100.0
# Blender's threads take ten thousand rays of a mesh at once. Fewer are spread over several meshes,
# which are evaluated side by side, so many rays each at least.
_GRAIN, _FEWEST = 10_000, 500
_TEMPORARY = "prt_temporary"
_OPEN = weakref.WeakSet()
_HIT, _DIRECTION, _LENGTH, _TRIANGLE = "prt_hit", "prt_direction", "prt_length", "prt_triangle"


class BlenderCaster:
    """Batches of rays through the Raycast node of Geometry Nodes; main thread only."""

    name = "blender"
    batch = 1 << 21
    threads = 1

    def __init__(self, vertices, triangles):
        self._vertices = np.ascontiguousarray(vertices, np.float32)
        self._triangles = np.ascontiguousarray(triangles, np.int32)
        self._made = []
        _OPEN.add(self)
        try:
            self._build()
        except BaseException:
            self.close()
            raise

    def _keep(self, block):
        mark_temporary(block)
        self._made.append(block)
        return block

    def _build(self):
        self._scene = self._keep(bpy.data.scenes.new("prt rays"))
        target = self._keep(bpy.data.meshes.new("prt target"))
        _fill(target, self._vertices, self._triangles)
        number = target.attributes.new(_TRIANGLE, "INT", "FACE")
        number.data.foreach_set("value", np.arange(1, len(self._triangles) + 1, dtype=np.int32))
        self._target = self._keep(bpy.data.objects.new("prt target", target))
        self._rays = {}
        for limited in (False, True):
            group = self._keep(_raycast_group(self._target, limited))
            self._rays[limited] = [self._ray_object(group) for _ in range(n_cores())]
        self._scene.collection.objects.link(self._target)

    def _ray_object(self, group):
        mesh = self._keep(bpy.data.meshes.new("prt rays"))
        rays = self._keep(bpy.data.objects.new("prt rays", mesh))
        rays.modifiers.new("prt rays", "NODES").node_group = group
        # Linked once: a change of links would evaluate the target again, and build its BVH.
        self._scene.collection.objects.link(rays)
        return rays

    def _cast(self, origins, directions, distances):
        if not self._made:
            self._build()
        objects = self._rays[distances is not None]
        n_rays = len(origins)
        n_parts = min(len(objects), n_rays // _FEWEST) if n_rays < _GRAIN * len(objects) else 1
        size = -(-n_rays // max(1, n_parts))
        parts = [slice(first, first + size) for first in range(0, n_rays, size)]
        for rays, part in zip(objects, parts, strict=False):
            mesh = rays.data
            if len(mesh.vertices) != len(origins[part]):
                mesh.clear_geometry()
                mesh.vertices.add(len(origins[part]))
            _set(mesh, "position", "FLOAT_VECTOR", "vector", origins[part])
            _set(mesh, _DIRECTION, "FLOAT_VECTOR", "vector", directions[part])
            if distances is not None:
                _set(mesh, _LENGTH, "FLOAT", "value", distances[part])
            mesh.update_tag()
            rays.update_tag()
        triangle = np.empty(n_rays, np.int32)
        depsgraph = depsgraph_of(self._scene.view_layers[0])
        for rays, part in zip(objects, parts, strict=False):
            attribute = rays.evaluated_get(depsgraph).data.attributes[_HIT]
            attribute.data.foreach_get("value", triangle[part])
        triangle -= 1
        return triangle

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        if not len(origins):
            return np.zeros(0, bool)
        distances = as_limits(distances, len(origins))
        if distances is not None:
            distances = np.ascontiguousarray(np.minimum(distances, _FAR), np.float32)
        return self._cast(origins, directions, distances) != MISS

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        triangle = np.zeros(0, np.int32)
        if len(origins):
            triangle = self._cast(origins, directions, None)
        barycentric, distance = barycentric_of(
            self._vertices, self._triangles, origins, directions, triangle
        )
        return Hits(triangle, barycentric, distance)

    def close(self):
        """Remove every data-block that was made; another cast makes them again."""
        remove_blocks(self._made)
        self._made = []


class BVHTreeCaster:
    """`mathutils.bvhtree`: one ray a call, one core; for where nodes cannot run."""

    name = "bvhtree"
    batch = 1 << 16
    threads = 1

    def __init__(self, vertices, triangles):
        self._vertices = np.ascontiguousarray(vertices, np.float32)
        self._triangles = np.ascontiguousarray(triangles, np.int32)
        # epsilon must stay 0: above it the tree casts swept spheres.
        self._tree = BVHTree.FromPolygons(
            self._vertices.tolist(), self._triangles.tolist(), all_triangles=True, epsilon=0.0
        )

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        cast = self._tree.ray_cast
        if distances is None:
            rays = zip(origins.tolist(), directions.tolist(), strict=True)
            blocked = (cast(o, d)[2] is not None for o, d in rays)
        else:
            rays = zip(
                origins.tolist(), directions.tolist(), np.asarray(distances).tolist(), strict=True
            )
            blocked = (cast(o, d, t)[2] is not None for o, d, t in rays)
        return np.fromiter(blocked, bool, len(origins))

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        cast = self._tree.ray_cast
        rays = zip(origins.tolist(), directions.tolist(), strict=True)
        numbers = (cast(o, d)[2] for o, d in rays)
        triangle = np.fromiter((MISS if i is None else i for i in numbers), np.int32, len(origins))
        barycentric, distance = barycentric_of(
            self._vertices, self._triangles, origins, directions, triangle
        )
        return Hits(triangle, barycentric, distance)

    def close(self):
        """See `RayCaster`."""
        self._tree = None


def mark_temporary(block):
    """Note that a data-block is not the user's and does not last."""
    block[_TEMPORARY] = True


def is_temporary(block):
    """Whether a data-block is a caster's or of a small render, not the user's."""
    return bool(block.get(_TEMPORARY))


def release_all():
    """Take every caster's data-blocks out of the file, before it is saved or undone."""
    for caster in list(_OPEN):
        caster.close()


def remove_left_over():
    """Remove casters' data-blocks that an undo step or a crash's file has brought back."""
    kinds = bpy.data.scenes, bpy.data.objects, bpy.data.meshes, bpy.data.cameras
    remove_blocks([b for kind in (*kinds, bpy.data.node_groups) for b in kind if is_temporary(b)])


def remove_blocks(blocks):
    """Remove data-blocks; `bpy.data.scenes.remove` crashes where there is no window (4.3)."""
    bpy.data.batch_remove(blocks)


def register():
    """Make both known by name."""
    register_caster("blender", BlenderCaster)
    register_caster("bvhtree", BVHTreeCaster)


def _fill(mesh, vertices, triangles):
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.update()


def _set(mesh, name, kind, field, values):
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
    attribute.data.foreach_set(field, values.ravel())


def _raycast_group(target, limited):
    """Object Info -> Raycast -> Store Named Attribute; nothing but the one integer is stored."""
    group = bpy.data.node_groups.new("prt rays", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links

    def named(name, kind):
        node = nodes.new("GeometryNodeInputNamedAttribute")
        node.data_type = kind
        node.inputs["Name"].default_value = name
        return next(s for s in node.outputs if s.name == "Attribute" and s.enabled)

    def enabled(sockets, name):
        return next(s for s in sockets if s.name == name and s.enabled)

    info = nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = target
    cast = nodes.new("GeometryNodeRaycast")
    cast.data_type = "INT"
    if hasattr(cast, "mapping"):
        cast.mapping = "NEAREST"
    else:
        cast.inputs["Interpolation"].default_value = "Nearest"
    links.new(info.outputs["Geometry"], cast.inputs["Target Geometry"])
    links.new(named(_TRIANGLE, "INT"), enabled(cast.inputs, "Attribute"))
    links.new(named(_DIRECTION, "FLOAT_VECTOR"), cast.inputs["Ray Direction"])
    if limited:
        links.new(named(_LENGTH, "FLOAT"), cast.inputs["Ray Length"])
    else:
        cast.inputs["Ray Length"].default_value = _FAR
    store = nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "INT", "POINT"
    store.inputs["Name"].default_value = _HIT
    links.new(enabled(cast.outputs, "Attribute"), enabled(store.inputs, "Value"))
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    links.new(start.outputs[0], store.inputs["Geometry"])
    links.new(store.outputs["Geometry"], end.inputs[0])
    return group
