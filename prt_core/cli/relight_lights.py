"""`prt relight --lights`: a bake under several lights by name, blended or each alone."""

import argparse
import math
import time
from dataclasses import replace

import numpy as np

import prt_core
from prt_core.cli.arguments import bpy_for_rays, expect_used, is_place, view_transform_asked
from prt_core.cli.each_light import expect_readable
from prt_core.cli.relight_view import asked_view
from prt_core.errors import expect
from prt_core.evaluate.sequence import PictureWriter, light_paths, write_npz
from prt_core.relight.blend import LightBlend
from prt_core.relight.light_file import read_lights
from prt_core.runtime.files import expect_output
from prt_core.scene import Camera

# What the file says of each light, or what is of one light only, by what it is where not given.
_NOT_WITH = {
    "light": None, "rotate": None, "strength": 1.0, "sharp_sun": False, "lamps": False,
    "lamp_samples": None, "emission": None, "bounces": "baked", "turn": None,
    "progressive": False, "image": None, "blend": None, "apart": False,
}  # fmt: skip
_OUTPUTS = {"output": ".npz", "png": ".png"}


def add_lights(relight):
    """Add the flags of several lights to `relight`."""
    relight.add_argument(
        "--lights", metavar="JSON", help="lights by name, as the add-on writes them, for --output "
        "and --png",
    )  # fmt: skip
    relight.add_argument(
        "--weights", nargs="+", type=_weight, metavar="NAME=W",
        help="how much of each of --lights (the file's own weights)",
    )  # fmt: skip
    relight.add_argument(
        "--each", action="store_true", help="each of --lights alone, into files with its name"
    )


def _weight(text):
    name, sign, value = text.rpartition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not (sign and name and math.isfinite(number) and number >= 0):
        raise argparse.ArgumentTypeError(f"expected NAME=W with W of at least 0, got '{text}'")
    return name, number


def relight_lights(options):
    """Colours and pictures under the lights of a file; returns 0."""
    outputs = _expect_request(options)
    bpy_for_rays(options.caster)
    baked = prt_core.load(options.bake)
    lights = _lights(options, baked)
    chosen = {light.name: [replace(light, weight=1.0)] for light in lights}
    if options.each:
        # Of the first it is said at once.
        expect_readable(light.lighting.environment for light in lights[1:])
    else:
        chosen = {"": lights}
    by_kind = {kind: light_paths(path, list(chosen)) for kind, path in outputs.items()}
    paths = {name: {kind: named[name] for kind, named in by_kind.items()} for name in chosen}
    camera, view = asked_view(options, baked)
    size = options.size or (camera or baked.camera or Camera(np.eye(4), 1)).size()
    blend = LightBlend(baked, options.caster, options.form)
    shown_by = view_transform_asked(options, baked)
    pictures = None
    if options.png:
        pictures = PictureWriter(baked, size, options.caster, camera, shown_by)
    try:
        for name, shining in chosen.items():
            start = time.perf_counter()
            _write(baked, blend, shining, view, paths[name], pictures)
            spent, written = time.perf_counter() - start, ", ".join(map(str, paths[name].values()))
            mixed = " + ".join(f"{each.weight:g} {each.name}" for each in shining if each.weight)
            print(f"{written}: {mixed or 'no light'} in {spent:.2f} s")
    finally:
        blend.close()
    return 0


def _write(baked, blend, lights, view, paths, pictures):
    radiance = None
    if "output" in paths or view is None:
        radiance = blend.radiance(lights, view=view)
    if "output" in paths:
        write_npz(paths["output"], baked.colours(radiance))
    if "png" not in paths:
        return
    if view is None:
        pictures.write(paths["png"], radiance, background=blend.sky(lights))
    else:
        pictures.write_picture(paths["png"], blend.picture(pictures.rays(), lights))


def _expect_request(options):
    """The outputs that are asked for by their kinds; what --lights has no use for is refused."""
    refuse_one_light(options)
    expect(
        not (options.each and options.weights),
        "--weights: each light is shown alone with --each; leave out one of the two",
    )
    expect(
        options.view is None or not options.png or not is_place(options.view),
        "--view: a picture is seen from the camera; give --view camera with --png, or the name of "
        "another",
    )
    outputs = {kind: getattr(options, kind) for kind in _OUTPUTS if getattr(options, kind)}
    expect(outputs, "relight: nothing to write; give --output NPZ or --png PNG with --lights")
    expect_used(options, {"view_transform": (("png",), "--png")})
    return {
        kind: expect_output(f"--{kind}", path, _OUTPUTS[kind]) for kind, path in outputs.items()
    }


def refuse_one_light(options):
    """Refuse flags that are of one light beside --lights."""
    for name, default in _NOT_WITH.items():
        flag = name.replace("_", "-")
        expect(
            getattr(options, name, default) == default,
            f"--{flag}: is for one light; leave it out with --lights, whose file says what each is",
        )


def exposed_lights(options, baked):
    """The lights of the file --lights, with the exposure of the command line."""
    return [
        replace(light, lighting=replace(
            light.lighting, exposure=light.lighting.exposure + options.exposure))
        for light in read_lights(options.lights, baked)
    ]  # fmt: skip


def _lights(options, baked):
    """The lights of the file, with the weights and the exposure of the command line."""
    lights = exposed_lights(options, baked)
    if not options.weights:
        return lights
    weights, names = dict(options.weights), [light.name for light in lights]
    unknown = [name for name in weights if name not in names]
    expect(
        not unknown,
        f"--weights: {options.lights} has no light '{unknown and unknown[0]}'; there are "
        f"{', '.join(names)}",
    )
    asked = [name for name, _ in options.weights]
    twice = [name for name in weights if asked.count(name) > 1]
    expect(not twice, f"--weights: '{twice and twice[0]}' is there twice; leave one out")
    return [replace(light, weight=weights.get(light.name, 0.0)) for light in lights]
