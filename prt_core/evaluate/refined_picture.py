"""A picture of where meshes were refined: triangles, coloured by the round that made them."""

import numpy as np

from prt_core.errors import expect, expect_caster, expect_offers
from prt_core.evaluate.view import expect_view
from prt_core.scene import auto_camera, expect_camera, hits_in_view, view_rays

# sRGB of what was there, and of the first and the last round; how dark lines between triangles are.
_BEFORE, _FIRST, _LAST, _LINE = (205, 205, 205), (250, 210, 120), (190, 30, 60), 0.45
_SKY = 40


def refined_picture(scene, caster, camera=None, width=960, height=540):
    """Where the objects of a scene were refined.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
        Over what camera rays meet.
    camera : Camera, optional
        Default: see `auto_camera`.
    width, height : int
        Pixels.

    Returns
    -------
    (height, width, 3) uint8
        Grey where triangles are as they were, from yellow to red by the round of the latest of
        their vertices, with lines between them.

    Raises
    ------
    PRTError
        None of the objects was refined.
    """
    expect_offers("scene", scene, ("objects", "hit_points"), "a Scene")
    rounds = _rounds(scene)
    expect(rounds.any(), "refined: no edge of this bake's meshes was split; bake with --refine")
    camera = auto_camera(scene) if camera is None else expect_camera(camera)
    expect_view(width, height, 1)
    expect_caster(caster)
    rays = view_rays(camera, width, height, 1)
    triangle = hits_in_view(scene, caster, rays)[0].reshape(height, width)
    latest = rounds[scene.triangles].max(axis=1)
    share = ((latest - 1) / max(rounds.max() - 1, 1))[:, None]
    colours = np.where(
        latest[:, None] > 0, np.array(_FIRST) * (1 - share) + np.array(_LAST) * share, _BEFORE
    )
    ways = rays.directions.reshape(height, width, 3)
    facing = np.abs((scene.triangle_normals[triangle] * ways).sum(axis=2))
    image = colours[triangle] * (0.55 + 0.45 * facing[..., None])
    image[triangle < 0] = _SKY
    image[_between(triangle)] *= _LINE
    return np.rint(image).astype(np.uint8)


def _rounds(scene):
    """(n_vertices,) int: in which round each vertex was made, 0 for those that were there."""
    return np.concatenate(
        [
            np.zeros(item.n_vertices, np.int32)
            if item.refined is None
            else item.refined.vertex_round
            for item in scene.objects
        ]
    )


def _between(triangle):
    """(height, width) bool: pixels whose neighbour to the right or below shows another triangle."""
    line = np.zeros(triangle.shape, bool)
    line[:, :-1] |= triangle[:, :-1] != triangle[:, 1:]
    line[:-1] |= triangle[:-1] != triangle[1:]
    return line
