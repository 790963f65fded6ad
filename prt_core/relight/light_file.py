"""Lights by name in a .json file: what the add-on keeps as sets, for the command line and others.

    {"day": {"environment": "noon.exr", "rotation": 30, "weight": 1},
     "night": {"environment": "moon.hdr", "lamps": {"Desk": 0.5}, "emission": {"Neon": 2}}}

Each has fields of `Lighting` by their names, and a weight (1). `lamps` is true, or the factors of
some of the baked scene's lamps by their names, of which `*` means all others. Paths are seen from
the folder of the file.
"""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from prt_core.errors import PRTError, expect, expect_path, shown, system_errors
from prt_core.relight.blend import WeightedLight
from prt_core.relight.lighting import Lighting
from prt_core.runtime.files import written


def read_lights(path, bake):
    """The lights of a file, for a bake.

    Parameters
    ----------
    path : str or Path
        `NAME.json`.
    bake : Bake
        Whose lamps are meant.

    Returns
    -------
    list of WeightedLight

    Raises
    ------
    PRTError
        The file, or a light in it, is not as it should be.
    """
    path = expect_path("lights", path)
    with system_errors(path):
        # Some editors begin a file with a mark of its encoding.
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    twice = []

    def by_name(pairs):
        names = [name for name, _ in pairs]
        twice.extend(name for name in names if names.count(name) > 1)
        return dict(pairs)

    try:
        lights = json.loads(text, object_pairs_hook=by_name)
    except ValueError as error:
        raise PRTError(f"{path}: is no .json file ({error})") from error
    expect(not twice, f"{path}: '{twice and twice[0]}' is there twice; rename one of them")
    return lights_by_name(lights, bake, path, path.parent)


def lights_by_name(lights, bake, where="lights", folder=None):
    """What a file of lights holds, as `read_lights` returns it.

    Parameters
    ----------
    lights : dict of str -> dict
    bake : Bake
    where : str or Path, optional
        What messages begin with.
    folder : Path, optional
        From which paths of images are seen; default: the current one.
    """
    good = isinstance(lights, dict) and lights and all(isinstance(v, dict) for v in lights.values())
    expect(good, f'{where}: expected lights by name, as {{"day": {{"environment": "noon.exr"}}}}')
    where = getattr(where, "name", where)
    return [
        _light(f"{where}: light '{name}'", folder or Path(), name, values, bake)
        for name, values in lights.items()
    ]


def write_lights(path, lights):
    """Write lights by name (see `read_lights`), whole or not at all.

    Parameters
    ----------
    path : str or Path
        `NAME.json`.
    lights : dict of str -> dict
        Paths in them are written as seen from the folder of the file, where they can be.
    """
    path = expect_path("lights", path)
    expect(path.suffix.lower() == ".json", f"{path}: expected a name that ends in .json")
    good = isinstance(lights, dict) and all(isinstance(v, dict) for v in lights.values())
    expect(good, f"{path}: expected lights by name, got {shown(lights)}")
    near = {}
    for name, values in lights.items():
        near[name] = dict(values)
        image = values.get("environment")
        if image not in (None, "world"):
            image, folder = Path(image).resolve(), path.resolve().parent
            inside = image.is_relative_to(folder)
            near[name]["environment"] = (image.relative_to(folder) if inside else image).as_posix()
    try:
        text = json.dumps(near, indent=1, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise PRTError(f"{path}: a light holds what .json cannot ({error})") from error
    with written(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def _light(where, folder, name, values, bake):
    known, values = [field.name for field in fields(Lighting)], dict(values)
    weight = values.pop("weight", 1.0)
    unknown = sorted(set(values) - set(known))
    expect(not unknown, f"{where}: has no {', '.join(unknown)}; there are {', '.join(known)}, "
           "weight")  # fmt: skip
    image = values.get("environment")
    if isinstance(image, str) and image != "world":
        values["environment"] = folder / image
    if isinstance(values.get("lamps"), dict):
        # The light of the world holds some of its suns already, on its texels.
        lamps = [lamp for lamp in bake.lamps if not (image == "world" and lamp.is_on_texels)]
        values["lamps"] = _dimmed(where, values["lamps"], lamps)
    try:
        return WeightedLight(name, Lighting(**values), weight)
    except PRTError as error:
        raise PRTError(f"{where}: {error}") from error


def _dimmed(where, factors, lamps):
    """The lamps of a bake, each times its factor; without one they are as baked."""
    lamps = [lamp for lamp in lamps if not lamp.of_world]
    names = {lamp.name for lamp in lamps}
    unknown = sorted(set(factors) - names - {"*"})
    expect(not unknown, f"{where}: the baked scene has no lamp '{unknown and unknown[0]}'; there "
           f"are {', '.join(sorted(names)) or 'none'}")  # fmt: skip
    dimmed = []
    for lamp in lamps:
        factor = factors.get(lamp.name, factors.get("*", 1.0))
        good = isinstance(factor, int | float) and not isinstance(factor, bool) and factor >= 0
        expect(good, f"{where}: expected a factor of lamp '{lamp.name}', got {shown(factor)}")
        if factor > 0:
            dimmed.append(replace(lamp, power=np.asarray(lamp.power) * factor))
    return dimmed
