"""The light that surfaces receive, without their own colours: what materials multiply."""

from copy import copy
from dataclasses import replace

import numpy as np

from prt_core.errors import expect_offers
from prt_core.reflectance import Materials


def as_received(bake):
    """A bake whose colours are the light that its points receive: irradiance / pi.

    Light is bounced as it was. What points emit themselves is left out, and what shines through
    them.

    Parameters
    ----------
    bake : Bake

    Returns
    -------
    Bake
        Of the same arrays. It has no compressed form: light alone is relit exactly.
    """
    expect_offers("bake", bake, ("scene", "transport"), "what `load` returns")
    white = Materials(albedo=np.ones((bake.transport.n_points, 3), np.float32))
    transport = copy(bake.transport)
    transport.mean_materials = bake.transport.bounced_materials
    transport.materials = white
    points = replace(bake.scene.points, materials=white)
    scene = replace(bake.scene, points=points)
    return replace(bake, scene=scene, transport=transport, reflections=())
