"""Arrays of an evaluated mesh, copied while Blender has it, and the `Mesh` in world space."""

from dataclasses import dataclass

import numpy as np

from prt_core.reflectance import Materials
from prt_core.scene import Mesh


def one_colour(colour, count):
    """`Materials` of so many corners of one albedo, which takes no room."""
    return Materials(albedo=np.broadcast_to(np.asarray(colour, np.float64), (count, 3)))


@dataclass
class RawMesh:
    """What one evaluated mesh holds, in its own space; all its instances share it.

    Attributes
    ----------
    vertices : (n_vertices, 3) float64
    corner_vertex : (n_corners,) int64
    corner_normal : (n_corners, 3) float64
    triangles : (n_triangles, 3) int64
        By their corners.
    face_sizes : (n_faces,) int32
    corner_slot : (n_corners,) int64
        Number of the material.
    corner_uv : (n_corners, 2) float64 or None
        Of the UV map that renders take; 0 at faces that are NaN or infinite there.
    n_bad_uv : int
        How many corners were.
    flat : bool
    materials, paint
        See `Mesh`.
    material_names : tuple of str
        By slot.
    surface : RawSurface or None
        What its materials may read from it.
    """

    vertices: np.ndarray
    corner_vertex: np.ndarray
    corner_normal: np.ndarray
    triangles: np.ndarray
    face_sizes: np.ndarray
    corner_slot: np.ndarray
    corner_uv: np.ndarray | None = None
    n_bad_uv: int = 0
    flat: bool = False
    materials: object = None
    paint: object = None
    material_names: tuple = ()
    surface: object = None

    @classmethod
    def of(cls, data, slots_of):
        """That of an evaluated `bpy.types.Mesh`; `slots_of` the mesh whose material numbers hold.

        A face with the number of no slot has the last one, as in renders.
        """
        n_corners = len(data.loops)
        vertices = np.empty(len(data.vertices) * 3, np.float32)
        data.vertices.foreach_get("co", vertices)
        corner_vertex = np.empty(n_corners, np.int32)
        data.loops.foreach_get("vertex_index", corner_vertex)
        normals = np.empty(n_corners * 3, np.float32)
        data.corner_normals.foreach_get("vector", normals)
        data.calc_loop_triangles()
        triangles = np.empty(len(data.loop_triangles) * 3, np.int32)
        data.loop_triangles.foreach_get("loops", triangles)
        sizes = np.empty(len(data.polygons), np.int32)
        data.polygons.foreach_get("loop_total", sizes)
        slots = np.empty(len(data.polygons), np.int32)
        slots_of.polygons.foreach_get("material_index", slots)
        layer = next((layer for layer in data.uv_layers if layer.active_render), None)
        uv, bad = None, np.zeros(n_corners, bool)
        if layer is not None:
            uv = np.empty(n_corners * 2, np.float32)
            layer.data.foreach_get("uv", uv)
            uv = uv.reshape(-1, 2).astype(np.float64)
            bad = ~np.isfinite(uv).all(axis=1)
        if bad.any():
            face = np.repeat(np.arange(len(sizes)), sizes)
            uv[np.isin(face, face[bad])] = 0
        return cls(
            vertices.reshape(-1, 3).astype(np.float64),
            corner_vertex.astype(np.int64),
            normals.reshape(-1, 3).astype(np.float64),
            triangles.reshape(-1, 3).astype(np.int64),
            sizes,
            np.repeat(slots, sizes).astype(np.int64),
            uv,
            int(bad.sum()),
            # Where faces differ in that, or have normals of their own, Cycles takes the corners'.
            data.normals_domain == "FACE",
        )

    def without_slots(self, slots):
        """The same without the triangles of some material numbers."""
        kept = ~np.isin(self.corner_slot[self.triangles[:, 0]], list(slots))
        return RawMesh(**{**self.__dict__, "triangles": self.triangles[kept]})

    def is_own_of(self, evaluated):
        """Whether an evaluated object's own mesh has these corners, and nobody shares it."""
        original = evaluated.original
        if original.type != "MESH" or original.data.users > 1 or original.data.library:
            return False
        if len(original.data.loops) != len(self.corner_vertex):
            return False
        own = np.empty(len(original.data.loops), np.int32)
        original.data.loops.foreach_get("vertex_index", own)
        return len(original.data.vertices) == len(self.vertices) and bool(
            (own == self.corner_vertex).all()
        )

    def placed(self, name, matrix, messages):
        """The `Mesh` of that name.

        Parameters
        ----------
        name : str
        matrix : (4, 4) float64
            From its own space to the world's.
        messages : list of str
            Told which faces were ignored.
        """
        linear = matrix[:3, :3]
        world = self.vertices @ linear.T + matrix[:3, 3]
        triangles = self.triangles
        bad = ~np.isfinite(world).all(axis=1)
        if bad.any():
            messages.append(f"{name}: {int(bad.sum())} vertices are NaN or infinite; faces ignored")
            triangles = triangles[~bad[self.corner_vertex[triangles]].any(axis=1)]
            world[bad] = 0
        if self.n_bad_uv:
            messages.append(
                f"{name}: {self.n_bad_uv} corners of its UV map are NaN or infinite; their faces "
                "have no place in it, unwrap them"
            )
        determinant = np.linalg.det(linear)
        if determinant == 0:
            messages.append(
                f"{name}: scaled to nothing in one direction; what is flat of it casts shadows and "
                "is black, as in Cycles"
            )
            turned = np.zeros_like(self.corner_normal)
        else:
            turned = self.corner_normal @ np.linalg.inv(linear)
            lengths = np.sqrt(np.einsum("ij,ij->i", turned, turned))[:, None]
            turned /= np.maximum(lengths, 1e-30)
            if not np.isfinite(turned).all():
                turned = np.where(np.isfinite(turned).all(axis=1)[:, None], turned, 0.0)
        if determinant < 0:
            # A mirror turns the winding round, not the side that is the front.
            triangles = triangles[:, ::-1]
        return Mesh(
            name=name,
            vertices=world,
            corner_vertex=self.corner_vertex,
            corner_normal=turned,
            triangle_corners=triangles,
            materials=self.materials,
            corner_material=self.corner_slot,
            face_sizes=self.face_sizes,
            flat=self.flat,
            corner_uv=self.corner_uv,
            paint=self.paint,
            material_names=self.material_names,
            matrix=matrix if np.isfinite(matrix).all() else None,
        )
