"""How near a page's colours come to exact ones, under its own lights turned."""

import numpy as np

from prt_core.compress import ClusterEvaluator
from prt_core.evaluate import colour_error
from prt_core.light import TurningLight
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress

# Degrees about z.
_TURNS = 15.0, 135.0, 255.0


def error_steps(transport, model, images, with_bits):
    """Relative errors of radiance; a generator of `Progress`.

    Parameters
    ----------
    transport : Transport
    model : ClusterCompressor
        With the values that the page has.
    images : dict of str -> EnvironmentMap
    with_bits : bool
        Whether the brightest texels are exact.

    Returns
    -------
    dict
        error (mean), worst, worst_light, lights (how many).
    """
    evaluator = ClusterEvaluator(model, transport if with_bits else None)
    errors = {}

    def one(name, image, turning, turn):
        truth = transport.radiance(image.to_cube_map(transport.cube_map, turn))
        received = evaluator.product(turning.at(turn))
        if np.any(truth):
            near = transport.exit_radiance(received).toward()
            errors[f"{name} at {turn:g}°"] = colour_error(near, truth)["l2"]

    done = 0
    for name, image in images.items():
        turning = yield from in_thread("measure", TurningLight, image, transport.cube_map)
        for turn in _TURNS:
            yield from in_thread("measure", one, name, image, turning, turn)
            done += 1
            yield Progress("measure", done, len(images) * len(_TURNS))
    if not errors:
        return {"error": 0.0, "worst": 0.0, "worst_light": None, "lights": 0}
    worst = max(errors, key=errors.get)
    return {
        "error": float(np.mean(list(errors.values()))),
        "worst": float(errors[worst]),
        "worst_light": worst,
        "lights": len(errors),
    }
