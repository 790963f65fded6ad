"""A light taken apart, so that each part of it can be kept by itself."""

from dataclasses import replace

from prt_core.errors import expect_kind
from prt_core.relight.lamps import chosen_lamps, world_suns
from prt_core.relight.lighting import Lighting

_DARK = "none"


def lights_apart(bake, lighting):
    """The parts of a light, whose colours add up to its own: environment, each lamp, emission.

    Parameters
    ----------
    bake : Bake
    lighting : Lighting

    Returns
    -------
    list of (str, Lighting)
        With the name of each: "environment", those of the lamps, "emission".
    """
    expect_kind("lighting", lighting, Lighting)
    parts = []
    if lighting.environment is not None:
        parts.append(("environment", replace(lighting, lamps=False, emission=_DARK)))
    lamps = chosen_lamps(bake, lighting)
    alone = {"environment": None, "rotation": None, "sharp_sun": False}
    for lamp in lamps[: len(lamps) - len(world_suns(bake, lighting))]:
        part = replace(lighting, lamps=(lamp,), emission=_DARK, **alone)
        parts.append((getattr(lamp, "name", "sun"), part))
    factors = [factor for *_, factor in lighting.emission]
    if bake.emission is not None and (not factors or any(factors)):
        parts.append(("emission", replace(lighting, lamps=(), **alone)))
    return parts
