"""Ambient occlusion, sky visibility and bent normals: what a bake knows beside light."""

import numpy as np

from prt_core.bake import Bake, load
from prt_core.bake.occlusion import baked_occlusion_steps
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.progress import run
from prt_core.transport import Occlusion


def occlusion(
    bake,
    kind="ambient",
    *,
    distance=None,
    falloff="constant",
    weight="cosine",
    caster="auto",
    report=None,
):
    """How open the surroundings of each corner of a baked scene are.

    Parameters
    ----------
    bake : Bake, str or Path
        From `load`, or its folder.
    kind : {"ambient", "sky", "bent-normal"}
        Ambient occlusion; the share of the sky that is seen; or the mean open direction.
    distance : float, optional
        In Blender units: what is farther away is not in the way. Rays are cast for it, for a bake
        knows no distances. Default: everything is in the way, however far.
    falloff : {"constant", "linear", "smooth", "sharp"}
        How blockers count less towards that distance.
    weight : {"cosine", "even"}
        Of directions (see `Occlusion`).
    caster : str
        Who casts these rays.
    report : callable(Progress), optional

    Returns
    -------
    dict of str -> (n_corners,) or (n_corners, 3) float32
        Shares, 1 where nothing is in the way, or unit vectors in world space; in Blender's loop
        order, for each object that receives. 0 for corners of faces without area.

    Raises
    ------
    PRTError
        The bake cannot be read, or there is no such kind, falloff or weight.
    """
    asked = Occlusion(kind, distance, falloff, weight)
    bake = bake if isinstance(bake, Bake) else load(expect_store_path("bake", bake))
    values = run(baked_occlusion_steps(bake, asked, caster), report)
    if values.ndim == 2:
        return bake.colours(values)
    grey = bake.colours(np.repeat(values[:, None], 3, axis=1))
    return {name: colours[:, 0] for name, colours in grey.items()}
