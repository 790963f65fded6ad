"""Atlases: one image of the surfaces of several objects, by UV maps, as lightmaps are.

Triangles lie flat in the image, in units of texels, and each a little higher than the one before:
rays from above and from below meet the same triangle wherever it is the only one, so that overlaps
are found. A texel whose middle meets a triangle shows that place. Around charts lies a ring of
texels that a bilinear lookup at their border reads. Where the surface goes on in another chart they
show it there, as far behind the edge as they are; else the nearest place on the border. All others
take the light of the nearest texel that shows something, which is what keeps mip maps clean.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import cKDTree

from prt_core.errors import (
    expect,
    expect_all,
    expect_array,
    expect_kind,
    expect_named,
    expect_offers,
    expect_pair,
)
from prt_core.scene.images.behind_edges import behind_edges
from prt_core.scene.images.point_images import PointImage, extended, intersect, surface_points
from prt_core.scene.images.seams import Seams, common_edges, uv_edges
from prt_core.scene.mesh import Mesh

# Bilinear lookups on a border reach so far, in texels.
_RING = 1.5
# Samples along a border are so far apart, and their places so far inside of it at most.
_STEP, _INSIDE = 0.5, 0.1
# A triangle smaller than this, in texels, is none in the image.
_LEAST_AREA = 1e-9
# Shares of an object's texels, and of its surface, below which nothing is said.
_SAID = 0.001


@dataclass(frozen=True)
class Atlas:
    """By which UV maps an image shows objects.

    Attributes
    ----------
    corner_uv : dict of str -> (n_corners, 2) float32
        Of each object in it, in Blender's loop order.
    made : dict
        How these came about: `uv` as `ImageSettings.atlas_uv`, `margin`, and the `objects` that
        were asked for, None for all.
    seams : Seams
        Where charts meet on the surface.
    """

    corner_uv: dict
    made: dict
    seams: Seams

    @property
    def own(self):
        """Whether these are the UV maps that the objects have anyway."""
        return self.made["uv"] == "own"


def with_atlas(scene, meshes, corner_uv, size, make_caster, made=None):
    """The scene with a bake point at each texel of an atlas that shows something.

    Parameters
    ----------
    scene : Scene
    meshes : sequence of Mesh
        What it was made of.
    corner_uv : dict of str -> (n_corners, 2) float
        UV maps of the objects that are in the atlas, by their names; v up.
    size : (int, int)
        Width and height in texels.
    make_caster : callable((n, 3) float32, (m, 3) int32) -> RayCaster
    made : dict, optional
        How the maps came about (see `Atlas`); default: they are the objects' own.

    Returns
    -------
    Scene
        With an `image` that has an `atlas`; what is to be said of UV maps is among its messages.

    Raises
    ------
    PRTError
        Nothing lies between 0 and 1.
    """
    expect_offers("scene", scene, ("hit_points", "objects"), "a Scene")
    width, height = expect_pair("atlas: size", size, 1, 8192)
    corner_uv = _expect_maps(scene, meshes, corner_uv)
    made = {"uv": "own", "margin": 0, "objects": None} if made is None else made
    expect_kind("made", made, dict)
    flat = _Flat(scene, meshes, corner_uv, width, height)
    caster = make_caster(
        flat.vertices(), np.arange(3 * len(flat.source), dtype=np.int32).reshape(-1, 3)
    )
    try:
        texel, place, inside = flat.texels(caster)
    finally:
        caster.close()
    sides = common_edges(scene, flat.source, flat.places, flat.points)
    ring, ring_place, ring_inside = flat.ring(texel, sides)
    texel = np.concatenate([texel, ring])
    expect(len(texel), "atlas: the UV maps cover nothing between 0 and 1; unwrap the objects anew")
    place = np.concatenate([place, ring_place])
    inside = np.concatenate([inside, ring_inside])
    points, lit = surface_points(scene, flat.source[place], inside, np.zeros(len(place), bool))
    shown = np.full(width * height, -1)
    shown[texel[lit]] = len(scene.points) + np.arange(lit.sum())
    shown = shown.reshape(height, width)
    nearest = distance_transform_edt(shown < 0, return_distances=False, return_indices=True)
    from_texel = np.ravel_multi_index(tuple(nearest), shown.shape).ravel()
    seams = Seams.of_edges(sides, flat.places, width, height, from_texel)
    pixel = np.arange(width * height, dtype=np.int32)
    point = shown.ravel()[from_texel].astype(np.int32)
    maps = {name: np.asarray(uv, np.float32) for name, uv in corner_uv.items()}
    image = PointImage(height, width, 1, pixel, point, atlas=Atlas(maps, made, seams))
    flat.say(scene, texel, place)
    return extended(scene, points, image)


def _expect_maps(scene, meshes, corner_uv):
    """UV maps by the names of objects, each for all corners."""
    expect_named("corner_uv", corner_uv, object, "UV maps")
    meshes = expect_all("meshes", meshes, Mesh, "meshes")
    sizes = {mesh.name: len(mesh.corner_vertex) for mesh in meshes}
    there = {item.name for item in scene.objects} & set(sizes)
    unknown = sorted(set(corner_uv) - there)
    expect(corner_uv and not unknown, f"corner_uv: expected names of objects, got {unknown}")
    return {
        name: expect_array(f"{name}: corner_uv", uv, (sizes[name], 2), np.float64)
        for name, uv in corner_uv.items()
    }


class _Flat:
    """The triangles of some objects as they lie in an image.

    Attributes
    ----------
    source : (n,) int64
        Triangles of the scene.
    name : (n,) int64
        Place of their objects among the names.
    places : (n, 3, 2) float64
        Columns and rows of their corners in the image.
    corners : (n, 3, 3) float32
        Where these are in the scene.
    """

    def __init__(self, scene, meshes, corner_uv, width, height):
        self.names, self.width, self.height = list(corner_uv), width, height
        order = {item.name: index for index, item in enumerate(scene.objects)}
        by_name = {mesh.name: mesh for mesh in meshes}
        sources, names, uvs, points = [], [], [], []
        for number, name in enumerate(self.names):
            corners = by_name[name].solid_triangles()
            sources.append(np.flatnonzero(scene.triangle_object == order[name]))
            names.append(np.full(len(corners), number))
            uvs.append(np.asarray(corner_uv[name], np.float64)[corners])
            points.append(scene.objects[order[name]].corner_point[corners])
        self._all = np.concatenate(sources)
        self._all_names = np.concatenate(names)
        self._all_points = np.concatenate(points)
        uv = np.concatenate(uvs)
        # Columns and rows of texels, whose middles are whole numbers and a half.
        self._all_places = np.stack([uv[..., 0] * width, (1 - uv[..., 1]) * height], axis=-1)
        a, b, c = np.moveaxis(self._all_places, 1, 0)
        doubled = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        self._solid = np.isfinite(doubled) & (doubled > 2 * _LEAST_AREA)
        self.source, self.name = self._all[self._solid], self._all_names[self._solid]
        self.places = self._all_places[self._solid]
        self.points = self._all_points[self._solid]
        corners = scene.vertices[scene.triangles[self._all]]
        self.corners = corners[self._solid]
        a, b, c = np.moveaxis(corners, 1, 0)
        self._areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        self._overlaps = {}
        expect(
            len(self.source), "atlas: no face has an area in its UV map; unwrap the objects anew"
        )

    def vertices(self):
        """(3 n, 3) float32: flat triangles, each a little higher than the one before."""
        height = np.repeat(np.linspace(0, 1, len(self.source)), 3)
        return np.column_stack([self.places.reshape(-1, 2), height]).astype(np.float32)

    def texels(self, caster):
        """Texels whose middle meets a triangle, which, and where in it; notes overlaps."""
        row, column = np.divmod(np.arange(self.width * self.height), self.width)
        found = []
        for start, way in ((2, -1), (-1, 1)):
            middles = np.column_stack([column + 0.5, row + 0.5, np.full(len(row), start)])
            ways = np.tile(np.float32([0, 0, way]), (len(row), 1))
            found.append(intersect(caster, middles.astype(np.float32), ways)[:2])
        (top, inside), (below, inside_below) = found
        hit = np.flatnonzero(top >= 0)
        differ = hit[top[hit] != below[hit]]
        # Neighbours meet in their common edge.
        apart = (_depth(inside[differ]) > 1e-3) & (_depth(inside_below[differ]) > 1e-3)
        pairs = np.sort(self.name[[top[differ[apart]], below[differ[apart]]]], axis=0)
        kinds, counts = np.unique(pairs, axis=1, return_counts=True)
        for (one, two), n_texels in zip(kinds.T, counts, strict=True):
            self._overlaps[int(one), int(two)] = int(n_texels)
        return hit, top[hit], inside[hit]

    def ring(self, taken, sides):
        """Texels around charts that are not `taken`, and what they show: which triangle, where.

        `sides` are edges at which the surface goes on in another chart (see `common_edges`).
        """
        edges = uv_edges(self.places, self.points)
        border = edges.border
        start = self.places[border // 3, border % 3]
        stop = self.places[border // 3, (border + 1) % 3]
        count = np.ceil(np.linalg.norm(stop - start, axis=1) / _STEP).astype(np.int64) + 1
        # Tiles far outside of the image are not walked along.
        reaches = (np.minimum(start, stop) < [self.width + 2, self.height + 2]).all(axis=1)
        reaches &= (np.maximum(start, stop) > -2).all(axis=1)
        count[~reaches] = 0
        which = np.repeat(np.arange(len(border)), count)
        along = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(
            count[which] - 1, 1
        )
        samples = start[which] + along[:, None] * (stop - start)[which]
        near = np.zeros((self.height, self.width), bool)
        column, row = np.floor(samples).astype(np.int64).T
        column, row = np.clip(column, 0, self.width - 1), np.clip(row, 0, self.height - 1)
        near[row, column] = True
        near = binary_dilation(near, np.ones((5, 5), bool)).ravel()
        near[taken] = False
        free = np.flatnonzero(near)
        if not len(free):
            return free, free, np.empty((0, 2), np.float32)
        row, column = np.divmod(free, self.width)
        middles = np.column_stack([column, row]) + 0.5
        distance, nearest = cKDTree(samples).query(middles, distance_upper_bound=_RING)
        reached = np.isfinite(distance)
        sample = nearest[reached]
        triangle, corner = border[which[sample]] // 3, border[which[sample]] % 3
        weights = np.zeros((len(sample), 3))
        rows = np.arange(len(sample))
        weights[rows, corner] = 1 - along[sample]
        weights[rows, (corner + 1) % 3] += along[sample]
        # A little inside, where rays start above the triangle and not beside it.
        reach = np.linalg.norm(self.places[triangle].mean(axis=1) - samples[sample], axis=1)
        share = np.minimum(0.25, _INSIDE / np.maximum(reach, 1e-12))[:, None]
        weights = weights * (1 - share) + share / 3
        far, beyond, shares = behind_edges(
            middles[reached], border[which[sample]], sides, self.places, self.corners
        )
        triangle[far], weights[far] = beyond, shares
        return free[reached], triangle, weights[:, 1:].astype(np.float32)

    def say(self, scene, texel, place):
        """Add what is to be known of the UV maps to the messages of the scene, by name."""
        count = np.bincount(self.name[place], minlength=len(self.names))
        middle = self._all_places.mean(axis=1)
        outside = ((middle < 0) | (middle > [self.width, self.height])).any(axis=1) & self._solid
        beyond, flat = self._share(outside), self._share(~self._solid)
        says, triangles = scene.messages.append, np.bincount(self.name, minlength=len(self.names))
        for number, name in enumerate(self.names):
            if 0 < count[number] < triangles[number]:
                says(
                    f"{name}: has {triangles[number]:,} triangles and {count[number]:,} texels in "
                    "the atlas, which are coarser than its vertices; make the atlas larger"
                )
            if count[number] == 0:
                says(
                    f"{name}: has no texel of its own in the atlas, for it is too small there or "
                    "lies outside; make the atlas larger, or look at its UV map"
                )
            if beyond[number] > _SAID:
                says(
                    f"{name}: {beyond[number]:.0%} of its surface lies outside of 0 to 1 in its UV "
                    "map (other UDIM tiles), and is not in the atlas"
                )
            if flat[number] > _SAID:
                says(
                    f"{name}: {flat[number]:.0%} of its surface has no area in its UV map, and is "
                    "not in the atlas; unwrap it"
                )
        for (one, two), n_texels in self._overlaps.items():
            if n_texels > _SAID * count[one]:
                who = f"{self.names[one]}: its UV map overlaps itself"
                if one != two:
                    who = f"{self.names[one]} and {self.names[two]}: their UV maps overlap"
                says(
                    f"{who} in {n_texels:,} texels, which show one of the places; pack the charts, "
                    "or unwrap anew"
                )

    def _share(self, triangles):
        """(n_names,) which share of each object's surface some of the triangles are."""
        part = np.bincount(self._all_names[triangles], self._areas[triangles], len(self.names))
        return part / np.bincount(self._all_names, self._areas, len(self.names))


def _depth(inside):
    """(m,) how far from the nearest edge places are, as their least barycentric weight."""
    return np.minimum(inside.min(axis=1), 1 - inside.sum(axis=1))
