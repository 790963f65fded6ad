"""Lights that are kept by name, as buttons of a page: day, night, dusk.

Each sets the page's own controls: image, turn and strength, and the sliders of lamps and emitters.
A button shows its light alone, whatever weight that has in a blend.
"""

from pathlib import Path

import numpy as np

from prt_core.errors import expect, shown
from prt_core.relight.emission import OTHERS
from prt_core.relight.light_file import lights_by_name, read_lights


def read_sets(sets, bake):
    """Lights by name, or those of .json files in the order of the files (see `read_lights`).

    Parameters
    ----------
    sets : dict of str -> dict, or sequence of str or Path
    bake : Bake

    Returns
    -------
    list of WeightedLight

    Raises
    ------
    PRTError
        A file or a light in it is not as it should be, two have one name, or a light is one that
        pages cannot show.
    """
    expect(
        isinstance(sets, list | tuple | dict) and len(sets),
        f"sets: expected lights by name, or a list of .json files of them, got {shown(sets)}",
    )
    if isinstance(sets, dict):
        lights = lights_by_name(sets, bake, "sets")
    else:
        lights = [light for path in sets for light in read_lights(path, bake)]
    names = [light.name for light in lights]
    twice = [name for name in names if names.count(name) > 1]
    expect(not twice, f"sets: two are called '{twice and twice[0]}'; give each its own name")
    for light in lights:
        where = f"sets: light '{light.name}'"
        lighting = light.lighting
        expect(
            abs(lighting.matrix[2, 2] - 1) < 1e-6,
            f"{where} is turned about other axes than z, and pages turn about z alone",
        )
        expect(
            not lighting.is_world or bake.world is not None,
            f"{where} is the world's, and the baked scene had no light of its world",
        )
        coloured = [name for name, colour, _ in lighting.emission if colour is not None]
        expect(
            not coloured,
            f"{where} gives '{coloured and coloured[0]}' another colour, which a page cannot; "
            "leave the colour out",
        )
    return lights


def image_paths(lights, own=()):
    """Paths of the images of `read_sets`, after `own` ones; each file once.

    Returns
    -------
    dict of Path -> path
        As they were given, by what they are in full.
    """
    paths = [light.lighting.environment for light in lights if light.lighting.is_image]
    files = {}
    for path in (*own, *paths):
        files.setdefault(Path(path).resolve(), path)
    return files


def page_sets(lights, bake, sources, paths=()):
    """What a page is told of lights.

    Parameters
    ----------
    lights : list of WeightedLight
        Of `read_sets`.
    bake : Bake
    sources : list of Source
        Of the page.
    paths : sequence of Path
        Of the page's images, in full.

    Returns
    -------
    list of dict
        name; light: which image, "world" or None; turn in degrees; strength in stops; strengths
        of the sources.
    """
    images, sets = list(paths), []
    for light in lights:
        lighting = light.lighting
        power = lighting.strength
        shines = None
        if power > 0 and lighting.environment is not None:
            image = lighting.environment
            shines = "world" if lighting.is_world else images.index(Path(image).resolve())
        turn = np.degrees(np.arctan2(lighting.matrix[1, 0], lighting.matrix[0, 0]))
        sets.append({
            "name": light.name,
            "light": shines,
            "turn": round(float(turn), 3),
            "strength": float(np.log2(power)) if power > 0 else 0.0,
            "strengths": [float(_factor(each, lighting, bake)) for each in sources],
        })  # fmt: skip
    return sets


def _factor(source, lighting, bake):
    """How strong a lamp or an emitter of a page shines; of several that share a slider the most."""
    if source.kind == "emitter":
        factors = {name: factor for name, _, factor in lighting.emission}
        names = [bake.emission.names[index] for index in source.emitters]
        return max(factors.get(name, factors.get(OTHERS, 1.0)) for name in names)
    if lighting.lamps is True or lighting.lamps is False or source.kind == "world":
        return lighting.lamp_factor * float(lighting.lamps is True)
    mine = {lamp.name: lamp for lamp in lighting.lamps}
    baked = [lamp for lamp in bake.lamps if lamp.name == source.name] or bake.lamps
    shares = [
        np.abs(mine[lamp.name].power).max() / max(np.abs(lamp.power).max(), 1e-30)
        for lamp in baked
        if lamp.name in mine
    ]
    return lighting.lamp_factor * max(shares, default=0.0)
