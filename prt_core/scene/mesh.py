"""One object's mesh, checked: what a scene is made of."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_array,
    expect_flag,
    expect_kind,
    expect_numbers,
)
from prt_core.reflectance import Materials, expect_materials
from prt_core.scene.paint import LOOKS, Look, Paint
from prt_core.scene.refined import Refined

# The kinds of rays, and which field of a mesh says whether they meet it.
RAYS = {"shadow_rays": "shadow", "diffuse_rays": "diffuse", "camera_rays": "camera"}


@dataclass
class Mesh:
    """One object's evaluated mesh, in world space: what a scene is made of.

    Parameters
    ----------
    name : str
        Unique; the key of the object's colours.
    vertices : (n_vertices, 3) float64
        World positions in Blender units.
    corner_vertex : (n_corners,) int
        The vertex of each face corner, in Blender's loop order.
    corner_normal : (n_corners, 3) float
        Unit shading normals in world space.
    triangle_corners : (n_triangles, 3) int
        Corner indices of each triangle, counter-clockwise seen from its front.
    materials : Materials or (n_corners, 3) float
        Of the corners; an array is the diffuse albedo, and all else has its default. Albedo above 1
        is shown, but bounces as 1.
    corner_material : (n_corners,) int, optional
        Corners of different materials never share a point.
    receives : bool
        Whether its colours are wanted; other objects cast shadows and bounce only.
    two_sided : bool
        Whether its back sides receive and bounce as well (cloth, leaves).
    face_sizes : (n_faces,) int, optional
        Corners of each face, in order; default: triangles.
    own_mesh : bool
        Whether colours can go to the object's own mesh (see `blender.colours`).
    owner : str, optional
        The object a person knows it by: that of the instances, or itself.
    library : str
        Of the owner, where it is linked; names of objects are unique in their library only.
    source : str
        Name of the object that the owner shows here, where it is an instance of another.
    corner_uv : (n_corners, 2) float, optional
        For geometry images.
    paint : Paint, optional
        The materials between the corners; default: as they say, in between.
    material_names : tuple of str
        Names of the materials by their number in `corner_material`; what has none is called as the
        mesh. Surfaces that emit light are told apart by them: those of one name are one light.
    shadow_rays, diffuse_rays, camera_rays : bool
        Whether rays towards lamps, rays that gather light (from the sky, and from surfaces), and
        those of pictures meet it.
    flat : bool
        Whether its triangles are shaded by their own normals, not by those of their corners: those
        of a bent quad are those of the quad.
    matrix : (4, 4) float, optional
        From the object's own space to the world's, where the vertices are already; for programs
        that want objects in places. Default: none but the world's.
    bounced, back, shadow : Look, optional
        What diffuse rays meet of the front, and of the back, and what is in the way of shadow rays,
        where that is something else than the materials above, which are shown; default: the same,
        and that of the front.
    refined : Refined, optional
        Where its corners were in the mesh that it was refined from.
    """

    name: str
    vertices: np.ndarray
    corner_vertex: np.ndarray
    corner_normal: np.ndarray
    triangle_corners: np.ndarray
    materials: Materials
    corner_material: np.ndarray | None = None
    receives: bool = True
    two_sided: bool = False
    face_sizes: np.ndarray | None = None
    own_mesh: bool = False
    owner: str | None = None
    library: str = ""
    source: str = ""
    corner_uv: np.ndarray | None = None
    paint: Paint | None = None
    material_names: tuple = ()
    shadow_rays: bool = True
    diffuse_rays: bool = True
    camera_rays: bool = True
    flat: bool = False
    matrix: np.ndarray | None = None
    bounced: Look | None = None
    back: Look | None = None
    shadow: Look | None = None
    refined: Refined | None = None

    def __post_init__(self):
        expect(isinstance(self.name, str) and self.name, "mesh: name expected a text")
        self.owner = expect_kind(f"{self.name}: owner", self.owner or self.name, str, "text")
        expect_kind(f"{self.name}: library", self.library, str, "text")
        expect_kind(f"{self.name}: source", self.source, str, "text")
        for flag in ("receives", "two_sided", "own_mesh", "flat", *RAYS):
            setattr(self, flag, expect_flag(f"{self.name}: {flag}", getattr(self, flag)))
        self.vertices = expect_array(f"{self.name}: vertices", self.vertices, (None, 3), np.float64)
        self.corner_vertex = expect_array(
            f"{self.name}: corner_vertex", self.corner_vertex, (None,), np.int64
        )
        n_corners = len(self.corner_vertex)
        self.corner_normal = expect_array(
            f"{self.name}: corner_normal", self.corner_normal, (n_corners, 3), np.float64
        )
        self.materials = expect_materials(self.name, self.materials, n_corners, np.float64)
        triangles = expect_numbers(f"{self.name}: triangle_corners", self.triangle_corners)
        triangles = triangles if triangles.size else triangles.reshape(0, 3)
        self.triangle_corners = expect_array(
            f"{self.name}: triangle_corners", triangles, (None, 3), np.int64
        )
        if self.corner_material is None:
            self.corner_material = np.zeros(n_corners, np.int64)
        self.corner_material = expect_array(
            f"{self.name}: corner_material", self.corner_material, (n_corners,), np.int64
        )
        self.material_names = tuple(
            expect_all(f"{self.name}: material_names", self.material_names, str, "texts")
        )
        for kind in LOOKS:
            if getattr(self, kind) is not None:
                name = f"{self.name}: {kind}"
                look = expect_kind(name, getattr(self, kind), Look)
                materials = expect_materials(name, look.materials, n_corners, np.float64)
                setattr(self, kind, Look(materials, look.paint))
        if self.corner_uv is not None:
            self.corner_uv = expect_array(
                f"{self.name}: corner_uv", self.corner_uv, (n_corners, 2), np.float64
            )
        if self.matrix is not None:
            self.matrix = expect_array(f"{self.name}: matrix", self.matrix, (4, 4), np.float64)
        if self.face_sizes is None:
            # Unknown faces: triangles where the corners allow it, else one face of them all.
            triangles = n_corners % 3 == 0
            self.face_sizes = np.full(n_corners // 3, 3) if triangles else [n_corners]
        self.face_sizes = expect_array(
            f"{self.name}: face_sizes", self.face_sizes, (None,), np.int32, 0
        )
        expect(
            int(self.face_sizes.sum()) == n_corners,
            f"{self.name}: face_sizes expected to sum to the {n_corners} corners, "
            f"got {int(self.face_sizes.sum())}",
        )
        for name, index, limit in (
            ("corner_vertex", self.corner_vertex, len(self.vertices)),
            ("triangle_corners", self.triangle_corners, n_corners),
        ):
            if index.size:
                expect(
                    index.min() >= 0 and index.max() < limit,
                    f"{self.name}: {name} expected indices in 0..{limit - 1}, "
                    f"got {index.min()}..{index.max()}",
                )

    def material_name(self, number):
        """The name of the material of this number, or that of the mesh where it has none."""
        names = self.material_names
        # Numbers beyond the last slot are of the last one, as in Blender.
        return (names and number >= 0 and names[min(number, len(names) - 1)]) or self.name

    def solid_triangles(self):
        """(n, 3) int64: the triangles that have an area, by their corners."""
        return self.triangle_corners[self.is_solid()]

    def is_solid(self):
        """(n_triangles,) bool: which triangles have an area."""
        corners = self.triangle_corners
        a, b, c = np.moveaxis(self.vertices[self.corner_vertex[corners]], 1, 0)
        doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        edge = np.maximum(
            np.linalg.norm(b - a, axis=1),
            np.maximum(np.linalg.norm(c - a, axis=1), np.linalg.norm(c - b, axis=1)),
        )
        return (doubled > 1e-12 * edge**2) & (doubled > 0)
