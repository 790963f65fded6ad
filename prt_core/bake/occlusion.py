"""Ambient occlusion, sky visibility and bent normals of a bake, by its bits and its scene."""

from prt_core.bake.bake import Bake
from prt_core.errors import expect_kind
from prt_core.transport import Occlusion, occlusion_steps


def baked_occlusion_steps(bake, asked, caster="auto", pace=None):
    """How open the surroundings of a bake's points are; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
    asked : Occlusion
    caster : str
        Who casts rays, where there is a distance: only then are any.
    pace : float, optional
        Seconds a step may take.

    Returns
    -------
    (n_points,) or (n_points, 3) float32
        See `occlusion_steps`.
    """
    expect_kind("bake", bake, Bake, "what `load` returns")
    expect_kind("asked", asked, Occlusion)
    expect_kind("caster", caster, str, "the name of one")
    if asked.distance is None:
        return (yield from _steps(bake, asked, None, pace))
    rays = bake.make_caster(caster)
    try:
        return (yield from _steps(bake, asked, rays, pace))
    finally:
        rays.close()


def _steps(bake, asked, rays, pace):
    return occlusion_steps(bake.scene, bake.cube_map, bake.transport.bits, asked, rays, pace)
