"""Bake points: where light is received, and all that is known of each."""

from dataclasses import dataclass, fields

import numpy as np

from prt_core.reflectance import QUANTITIES, Materials

# The materials that a point has, and how the names of their arrays begin.
MATERIALS = {"materials": "", "mean_materials": "mean_"}


@dataclass
class BakePoints:
    """Points of a bake, in the scene's frame (see `Scene`).

    Attributes
    ----------
    positions : (n_points, 3) float64
    normals, geometric_normals : (n_points, 3) float32
        Unit vectors; the geometric one belongs to the faces around the point.
    ray_offset : (n_points, 3) float32
        From the position to where its rays start: off the surface, and on flat parts a little
        towards their middle, for points on the rim of a wall must not look along the wall that
        touches it there.
    areas : (n_points,) float32
        Share of the surface, in squared frame units.
    materials : Materials
        Of the place itself: what it shows.
    mean_materials : Materials
        Of the area that the point stands for: what it bounces.
    object_index : (n_points,) int32
    visible : (n_points,) bool
        Whether a corner of a receiving object shows the point; the others only bounce.
    emitter : (n_points,) int32
        Which of the scene's emitters the point belongs to, -1 where to none.
    """

    positions: np.ndarray
    normals: np.ndarray
    geometric_normals: np.ndarray
    ray_offset: np.ndarray
    areas: np.ndarray
    materials: Materials
    mean_materials: Materials
    object_index: np.ndarray
    visible: np.ndarray
    emitter: np.ndarray

    def __len__(self):
        return len(self.positions)

    @property
    def albedo(self):
        """(n_points, 3) float32: what is shown."""
        return self.materials.albedo

    @property
    def mean_albedo(self):
        """(n_points, 3) float32: what is bounced."""
        return self.mean_materials.albedo

    def nondefault(self):
        """Names of the quantities of materials that are not their default everywhere."""
        nondefault = {*self.materials.nondefault(), *self.mean_materials.nondefault()}
        return [name for name in QUANTITIES if name in nondefault]

    def arrays(self):
        """Name -> array of everything stored; what is its default everywhere is left out."""
        arrays = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in MATERIALS:
                prefix = MATERIALS[field.name]
                arrays |= {prefix + name: getattr(value, name) for name in self.nondefault()}
            elif field.name != "emitter" or (value >= 0).any():
                arrays[field.name] = value
        return arrays


def joined(points, more):
    """`BakePoints` one after the other."""
    parts = points, more
    whole = {
        f.name: joined_arrays([getattr(part, f.name) for part in parts]) for f in fields(BakePoints)
    }
    if all(part.materials is part.mean_materials for part in parts):
        whole["mean_materials"] = whole["materials"]
    return BakePoints(**whole)


def some_points(points, chosen):
    """`BakePoints` of some of them, by a mask or their numbers."""
    some = {f.name: getattr(points, f.name)[chosen] for f in fields(BakePoints)}
    if points.materials is points.mean_materials:
        some["mean_materials"] = some["materials"]
    return BakePoints(**some)


def joined_arrays(parts):
    """Arrays, or `Materials`, one after the other."""
    whole = Materials.joined if isinstance(parts[0], Materials) else np.concatenate
    return whole(parts)
