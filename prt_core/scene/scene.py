"""`Scene`: triangles in a frame of their own, bake points, and what each hit means.

The frame: positions are kept relative to the scene's centre and divided by its size, in float64.
Rays are cast in float32, about one zero or several (see `rays.frames`).
"""

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_mask,
    expect_vectors,
    expect_whole,
)
from prt_core.rays import precision_frames
from prt_core.runtime.array_parts import held_once, parts_of
from prt_core.scene.backs import opposites, with_backs
from prt_core.scene.details import Details, no_details
from prt_core.scene.emitters import find_emitters
from prt_core.scene.images.point_images import PointImage
from prt_core.scene.lattice import lattice_of_hits, lattice_size, refinement_levels
from prt_core.scene.mesh import RAYS, Mesh
from prt_core.scene.opacity import Opacity, dimming, opacities_of
from prt_core.scene.open_sky import open_points
from prt_core.scene.own_faces import OwnFaces
from prt_core.scene.paint import Surfaces, surfaces_of
from prt_core.scene.points import BakePoints
from prt_core.scene.points_of_meshes import make_points
from prt_core.scene.ray_casters import caster_of
from prt_core.scene.ray_offset import ray_lifts
from prt_core.scene.scene_object import objects_of_meshes
from prt_core.scene.stack import parts_of_triangles, stack_meshes

# Albedo up to this is taken as 1 that was rounded.
_WHITE = 1.001


@dataclass
class Scene:
    """Triangles and bake points of a scene, in the scene's own frame.

    Attributes
    ----------
    centre : (3,) float64
    size : float
        World position = centre + size * frame position.
    vertices : (n_vertices, 3) float64
    triangles : (n_triangles, 3) int32
        What rays hit.
    points : BakePoints
    objects : list of SceneObject
    triangle_object : (n_triangles,) int32
    triangle_level : (n_triangles,) int32
        Segments an edge is cut into for bouncing; 1 where the corners suffice.
    lattice_start : (n_triangles,) int64
    lattice : (n,) int32
        Point indices of each triangle's lattice (see `refine`).
    lattice_back : (n,) int32
        Points of the back side, -1 where the back returns no light.
    messages : list of str
        What is to be said of the meshes.
    image : PointImage or None
        Pixels that some of the points belong to.
    details : Details
        Points inside of triangles.
    surfaces : Surfaces or None
        What was between the corners of the meshes it was made from; not kept on disk.
    opacity : Opacity or None
        Where triangles let light pass; None where all are opaque.
    shadow_opacity : Opacity or None
        The same for shadow rays; `opacity` itself where they meet what others do.
    emitters : tuple of str
        Names of the materials that emit light, of one each.
    triangle_emitter : (n_triangles,) int32
        Which of them each triangle belongs to; -1, the default: to none.
    """

    centre: np.ndarray
    size: float
    vertices: np.ndarray
    triangles: np.ndarray
    points: BakePoints
    objects: list
    triangle_object: np.ndarray
    triangle_level: np.ndarray
    lattice_start: np.ndarray
    lattice: np.ndarray
    lattice_back: np.ndarray
    messages: list = field(default_factory=list)
    image: PointImage | None = None
    details: Details = field(default_factory=no_details)
    surfaces: Surfaces | None = field(default=None, repr=False, compare=False)
    opacity: Opacity | None = field(default=None, repr=False)
    shadow_opacity: Opacity | None = field(default=None, repr=False)
    emitters: tuple = ()
    triangle_emitter: np.ndarray | None = None

    def __post_init__(self):
        if self.triangle_emitter is None:
            self.triangle_emitter = np.broadcast_to(np.int32(-1), len(self.triangles))

    @classmethod
    def from_meshes(cls, meshes, max_hidden=None):
        """Build the scene: points per distinct corner normal, hidden points in large triangles.

        Parameters
        ----------
        meshes : sequence of Mesh
        max_hidden : int, optional
            Most hidden points to add in large triangles; default: half of the others, at least
            2,000.

        Returns
        -------
        Scene

        Raises
        ------
        PRTError
            When there is no triangle with an area, or two meshes share a name.
        """
        meshes = expect_all("meshes", meshes, Mesh, "meshes")
        if max_hidden is not None:
            expect_whole("max_hidden", max_hidden, 0)
        for name, count in Counter(mesh.name for mesh in meshes).items():
            expect(count == 1, f"meshes: the name '{name}' is used twice; rename one")
        messages = []
        stack = stack_meshes(meshes, messages)
        if not len(stack.triangles):
            raise PRTError(
                "scene: no triangle with an area to bake; add a mesh object that is visible in "
                "renders, or name other objects"
            )
        centre, size = stack.move_to_frame()
        levels = refinement_levels(stack, max_hidden)
        frames = precision_frames(stack.vertices, stack.triangles, stack.triangle_object)
        for number in np.unique(stack.triangle_object[frames.coarse]):
            messages.append(
                f"{meshes[int(number)].name}: lies so far from the rest for its size that its "
                "shadows are coarse; bake what lies apart in files of its own"
            )
        differ = [m.name for m in meshes if m.shadow_rays != m.diffuse_rays]
        if differ:
            names = ", ".join(differ[:4]) + (" …" if len(differ) > 4 else "")
            messages.append(
                f"{len(differ)} objects are seen by only one of shadow and diffuse rays ({names}); "
                "light from the world goes by their diffuse ray visibility, lamps and sharp suns "
                "by the shadow one"
            )
        surfaces = surfaces_of(meshes, stack)
        messages += [
            f"{mesh.name}: albedo above 1 is shown as it is, but bounces as 1"
            for mesh in meshes
            if mesh.materials.albedo.max(initial=0) > _WHITE
        ]
        built = make_points(meshes, stack, levels, frames, surfaces)
        emitters, triangle_emitter, built.points.emitter = find_emitters(
            meshes, stack, levels, built, surfaces
        )
        scene = cls(
            centre=centre,
            size=size,
            vertices=stack.vertices,
            triangles=stack.triangles,
            points=built.points,
            objects=objects_of_meshes(meshes, stack, built.corner_point),
            triangle_object=stack.triangle_object,
            triangle_level=held_once(levels),
            lattice_start=built.lattice_start,
            lattice=built.lattice,
            lattice_back=np.broadcast_to(np.int32(-1), built.lattice.shape),
            messages=messages,
            surfaces=surfaces,
            **opacities_of(surfaces),
            emitters=emitters,
            triangle_emitter=triangle_emitter,
        )
        messages.extend(dimming(scene))
        # Known already; of a scene that was read they are found when they are asked for.
        scene.frames = frames
        # What is translucent, or glass, shows the light of its back.
        through = scene.points.materials.through.any(axis=1)
        through |= scene.points.mean_materials.through.any(axis=1)
        if through.any():
            through = np.logical_or.reduceat(through[scene.lattice], scene.lattice_start)
        else:
            through = np.zeros(len(scene.triangles), bool)
        return with_backs(scene, through | stack.two_sided[scene.triangle_object])

    @cached_property
    def frames(self):
        """The `Frames` in which the triangles are cast."""
        return precision_frames(self.vertices, self.triangles, self.triangle_object)

    def make_caster(self, name="auto", rays="diffuse", resolution=32, objects=None):
        """A ray caster over the triangles that rays of a kind meet.

        Parameters
        ----------
        name : str
            Of the back-end (see `rays.make_caster`).
        rays : {"diffuse", "shadow", "camera"}
            Those that gather light, from the sky and from surfaces; those towards lamps; those of
            pictures.
        resolution : int
            Of the cube map whose directions are traced, where surfaces let some light pass.
        objects : (n_objects,) bool, optional
            Whose triangles alone may be met; default: all.

        Returns
        -------
        RayCaster
        """
        if objects is not None:
            objects = expect_mask("objects", objects, len(self.objects))
        return caster_of(self, name, rays, resolution, objects)

    def objects_named(self, names):
        """(n_objects,) bool: which objects people know by one of these names.

        Parameters
        ----------
        names : sequence of str
            See `SceneObject.known_as`.
        """
        names = set(names)
        return np.array([item.known_as in names for item in self.objects], bool)

    @property
    def lattice_sizes(self):
        """(n_triangles,) int64: how many points each triangle's lattice has."""
        return lattice_size(self.triangle_level.astype(np.int64))

    @cached_property
    def ray_origins(self):
        """(n_points, 3): where the rays of each point start, in the scene's frame.

        float32; where several frames serve the triangles float64.
        """
        origins = self.points.positions + self.points.ray_offset
        return origins.astype(np.float32) if len(self.frames) == 1 else origins

    @cached_property
    def opposite(self):
        """(n_points,) int32: the point on the other side of the same place, -1 where none is."""
        return opposites(self)

    @cached_property
    def own_faces(self):
        """The `OwnFaces` of the points of bent surfaces."""
        return OwnFaces(self)

    @cached_property
    def open_points(self):
        """(n_points,) bool: points from which nothing can be in the way (see `open_sky`)."""
        return open_points(self)

    @cached_property
    def triangle_normals(self):
        """(n_triangles, 3) float32: unit normals of the front sides."""
        normals = np.empty((len(self.triangles), 3), np.float32)
        for part in parts_of_triangles(len(normals)):
            a, b, c = np.moveaxis(self.vertices[self.triangles[part]], 1, 0)
            normal = np.cross(b - a, c - a)
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            normals[part] = normal / np.maximum(length, 1e-300)
        return normals

    @cached_property
    def triangle_lifts(self):
        """(n_triangles,) float64: how far above each triangle rays must start."""
        lifts = np.empty(len(self.triangles))
        for part in parts_of_triangles(len(lifts)):
            corners = self.frames.local(self.vertices, self.triangles, part)
            lifts[part] = ray_lifts(corners, self.triangle_normals[part])[0]
        return lifts

    def hit_points(self, triangle, barycentric, back):
        """The bake points around hits and their weights.

        Parameters
        ----------
        triangle : (m,) int
        barycentric : (m, 2) float
            Weights of the triangle's second and third corner.
        back : (m,) bool
            Whether the back side was hit.

        Returns
        -------
        points : (m, 3) int32
            -1 where the side that was hit returns no light.
        weights : (m, 3) float32
            Sum to 1.
        """
        cell, weights = lattice_of_hits(self.triangle_level[triangle], barycentric)
        cell += self.lattice_start.take(triangle)[:, None]
        points = self.lattice.take(cell)
        behind = np.flatnonzero(back)
        points[behind] = self.lattice_back.take(cell[behind])
        return points.astype(np.int32, copy=False), weights

    def materials_at(self, triangle, barycentric, back, shown=False):
        """`Materials` of m places (see `hit_points`), in float64.

        `shown` : bool
            Whether fronts are as they are shown, not as diffuse rays meet them.
        """
        if self.surfaces is None:
            return self.points.materials.between(*self.hit_points(triangle, barycentric, back))
        return self.surfaces.seen(triangle, barycentric, back, shown)

    def emission_at(self, triangle, barycentric, back):
        """(m, 3) float64: radiance that places of emitters send out.

        Parameters
        ----------
        triangle : (m,) int
        barycentric : (m, 2) float
            Weights of the second and third corner.
        back : (m,) bool
            Whether by their back.
        """
        if self.surfaces is None:
            # A back without points of its own is as the front.
            around, weights = self.hit_points(triangle, barycentric, back)
            bare = around[:, 0] < 0
            around[bare] = self.hit_points(triangle[bare], barycentric[bare], ~back[bare])[0]
            emission = self.points.mean_materials.emission[around].astype(np.float64)
            return np.einsum("mk,mkc->mc", weights, emission)
        return self.surfaces.emission_at(triangle, barycentric, back)

    def to_world(self, positions):
        """Frame positions (n, 3) to world positions, float64."""
        return self.centre + self.size * expect_vectors("positions", positions)

    def to_frame(self, positions):
        """World positions (n, 3) to frame positions, float64."""
        return (expect_vectors("positions", positions) - self.centre) / self.size

    def fingerprint(self):
        """Hexadecimal digest of everything a bake depends on; equal scenes give equal digests."""
        digest = hashlib.sha256()
        for array in (
            self.centre,
            np.float64(self.size),
            self.vertices,
            self.triangles,
            self.points.positions,
            self.points.normals,
            self.points.geometric_normals,
            self.points.ray_offset,
            *self.points.materials.digested(),
            *self.points.mean_materials.digested(),
            self.points.visible,
            self.lattice,
            self.lattice_back,
        ):
            for part in parts_of(array):
                digest.update(part)
        if self.image is not None:
            digest.update(np.int64([self.image.height, self.image.width, self.image.samples]))
            digest.update(self.image.pixel)
            digest.update(self.image.point)
        for item in self.objects:
            digest.update(item.name.encode())
            digest.update(item.corner_point.tobytes())
            met_by = [getattr(item, name) for name in RAYS]
            if not all(met_by):
                digest.update(bytes(met_by))
        if self.opacity is not None:
            digest.update(self.opacity.digest())
        if self.shadow_opacity is not self.opacity:
            own = self.shadow_opacity
            digest.update(b"shadow" + (own.digest() if own is not None else b""))
        if self.emitters:
            digest.update("\0".join(self.emitters).encode())
            digest.update(self.triangle_emitter)
            digest.update(self.points.emitter)
        return digest.hexdigest()
