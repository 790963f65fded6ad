"""Bake points on the back sides of triangles."""

from dataclasses import replace

import numpy as np

from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.scene.points import joined, some_points


def with_backs(scene, triangles):
    """The scene with points on the backs of chosen triangles; the same object where all have them.

    Parameters
    ----------
    scene : Scene
    triangles : (n_triangles,) bool

    Returns
    -------
    Scene
        Its new points come last, and none is visible: what is shown are fronts.
    """
    if not triangles.any():
        return scene
    sided = np.repeat(triangles, scene.lattice_sizes)
    wanted = sided & (scene.lattice_back < 0)
    if not wanted.any():
        return scene
    known = np.full(len(scene.points), -1, np.int32)
    has = scene.lattice_back >= 0
    known[scene.lattice[has]] = scene.lattice_back[has]
    front = np.unique(scene.lattice[wanted])
    front = front[known[front] < 0]
    known[front] = len(scene.points) + np.arange(len(front))
    lattice_back = np.where(sided, known[scene.lattice], scene.lattice_back)
    result = replace(
        scene,
        points=joined(scene.points, _with_their_own(scene, backs_of(scene.points, front), front)),
        lattice_back=lattice_back.astype(np.int32),
    )
    result.frames = scene.frames
    return result


def _with_their_own(scene, backs, front):
    """`BakePoints` behind some front points, with what the back is where that is known."""
    surfaces = scene.surfaces
    if surfaces is None or surfaces.back is surfaces:
        return backs
    lattice = scene.triangle_level.astype(np.int64), scene.lattice_start, scene.lattice
    own = surfaces.back.of_points(*lattice, front)
    every = scene.points.materials.stored().gathered(
        len(scene.points), lambda _, values: values.astype(np.float64)
    )
    every.put(front, own)
    mean = with_mean_gloss(surfaces.back.mean(*lattice, every)[front]).of_what_is_met()
    return replace(backs, materials=own.stored(), mean_materials=mean.stored())


def backs_of(points, chosen):
    """`BakePoints` on the other side of chosen points; none is visible."""
    back = some_points(points, chosen)
    normal, offset = back.geometric_normals, back.ray_offset
    across = np.einsum("nx,nx->n", normal.astype(np.float64), offset)[:, None]
    return replace(
        back,
        normals=-back.normals,
        geometric_normals=-normal,
        ray_offset=(offset - 2 * normal * across).astype(np.float32),
        visible=np.zeros(len(back), bool),
    )


def opposites(scene):
    """(n_points,) int32: the point on the other side of the same place, -1 where there is none."""
    points = scene.points
    result = np.full(len(points), -1, np.int32)
    has = scene.lattice_back >= 0
    result[scene.lattice[has]] = scene.lattice_back[has]
    result[scene.lattice_back[has]] = scene.lattice[has]
    # Pixels that have one lie where it does, and it follows theirs (see `with_camera_image`).
    left = np.setdiff1d(np.flatnonzero(result < 0), scene.lattice)
    key = np.column_stack([points.positions[left], points.geometric_normals[left]])
    other = np.column_stack([points.positions[left], -points.geometric_normals[left]]) + 0.0
    _, which = np.unique(np.concatenate([key + 0.0, other]), axis=0, return_inverse=True)
    which = which.reshape(-1)
    holder = np.full(which.max(initial=-1) + 1, -1)
    holder[which[: len(left)]] = left
    partner = holder[which[len(left) :]]
    # Of several pixels at one place the last stands for all: both ways, or for none.
    paired = np.flatnonzero(partner >= 0)
    result[left[paired]] = partner[paired]
    mutual = result[result] == np.arange(len(result))
    return np.where(mutual & (result >= 0), result, -1).astype(np.int32)
