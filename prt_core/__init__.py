"""Precomputed radiance transfer: bake how light travels in a scene once, relight it at once.

Vocabulary: a *bake* stores visibility bits V (n_points x n_directions), the gather operator K
(n_points x n_points, sparse) and the bake points with their albedo. Transport rows, columns and
blocks are derived from it: B = albedo (E + K B), E = 1/pi sum_d L_d V cos omega.

Axes: Blender's world axes, z up; directions point from the surface to the light. Lengths are
Blender units, radiance is linear Rec.709.
"""

__version__ = "0.1.0"
