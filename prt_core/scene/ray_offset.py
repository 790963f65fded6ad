"""How far above its surface a ray must start: as far as float32 may misplace that surface.

A ray that starts on a triangle must not meet it. What can go wrong is rounding alone: that of the
triangle's corners in its frame (see `rays.frames`), of the ray's start, and of the test itself.
Across the surface it grows with the coordinates along the normal, for the rest with all of them
(Blender's test, which shears the triangle along the ray, has some of that along the normal too).
Measured with Embree's and Blender's tests on planes of any place, size and tilt, half of these
factors leave no ray that meets its own plane. So a contact is resolved down to a tenth of a
millimetre in a scene of a kilometre, and what lies nearer than that to a large plane far away does
not matter to what stands elsewhere.

A start above a corner may lie below another face of a sharp crease. So it also goes along its own
face, by so much more that only faces which are less than three degrees apart would be in its way.
"""

import numpy as np

_STEP = 2.0**-24
_ALONG, _OVERALL, _SIDEWAYS = 8 * _STEP, 4 * _STEP, 256 * _STEP
# The longest offset of a scene, in its frame: there no coordinate is larger than 1.
MOST_OFFSET = 3**0.5 * _ALONG + _OVERALL + _SIDEWAYS


def ray_lifts(corners, normals):
    """Start of rays above triangles, and how far inside of their rim.

    Parameters
    ----------
    corners : (n, 3, 3) float64
        In the frame they are cast in.
    normals : (n, 3) float
        Unit vectors.

    Returns
    -------
    lift, sideways : (n,) float64
        Along the normal, and along the triangle.
    """
    largest = np.abs(corners).max(axis=1)
    overall = largest.max(axis=1)
    lift = _ALONG * (np.abs(normals) * largest).sum(axis=1) + _OVERALL * overall
    # A triangle around the zero of its frame still has a start that is not itself.
    return np.maximum(lift, 1e-30), np.maximum(_SIDEWAYS * overall, 1e-30)
