"""What forms of view-dependent transport are measured on, and how: seconds, bytes, errors."""

import time
from dataclasses import dataclass, field

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_whole
from prt_core.evaluate.metrics import colour_error
from prt_core.runtime.progress import Progress
from prt_core.transport import Transport
from prt_core.transport.dense_gloss import dense_reflection
from prt_core.transport.transfer import negative_share


@dataclass
class GlossTask:
    """Points of one reflectance, some lights and a view.

    Attributes
    ----------
    transport : Transport
    outgoing : (n_points, 3) float
        Unit vectors to the viewer.
    reflectances : dict of str -> Reflectance
        Of one material each.
    lights : dict of str -> (n_directions, 3) float
    n_sample : int
        Points at which errors are measured, evenly among those that face the viewer.
    """

    transport: Transport
    outgoing: np.ndarray
    reflectances: dict
    lights: dict
    n_sample: int = 1500
    _truth: dict = field(default_factory=dict, repr=False)

    def __post_init__(self):
        expect_kind("transport", self.transport, Transport)
        shape = self.transport.n_points, 3
        self.outgoing = expect_array("outgoing", self.outgoing, shape, np.float64)
        expect(self.reflectances and self.lights, "reflectances, lights: give at least one each")
        expect_whole("n_sample", self.n_sample, 1)
        self.normals = self.transport.normals.astype(np.float64)
        facing = np.flatnonzero(np.einsum("ni,ni->n", self.normals, self.outgoing) > 0)
        expect(len(facing), "outgoing: no point faces the viewer")
        places = np.linspace(0, len(facing) - 1, min(self.n_sample, len(facing)))
        self.n_facing, self.sample = len(facing), facing[places.astype(int)]

    def truth(self, name, light):
        """The dense sum at the sample, (n_sample, 3), of a reflectance and a light, by names."""
        key = name, light
        if key not in self._truth:
            self._truth[key] = dense_reflection(
                self.transport.bits[self.sample],
                self.normals[self.sample],
                self.transport.cube_map,
                self.lights[light],
                self.reflectances[name].eval,
                self.outgoing[self.sample],
            )
        return self._truth[key]


def measured_steps(task, name, label, form, seconds, sample_only=False):
    """Measure one form of one reflectance; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    name : str
        Of the reflectance.
    label : str
        Of the form.
    form : object
        With `set_light(light)`, `toward(outgoing)` and `nbytes`.
    seconds : float
        What it took to prepare.
    sample_only : bool
        Whether the form has the points of the sample alone.

    Returns
    -------
    dict
        form, reflectance, points, facing, bytes, seconds, light_ms, view_ms (of the processor, all
        cores; medians over the lights), l2_mean, l2_worst, worst_light, negative (largest share of
        points).
    """
    outgoing = task.outgoing[task.sample] if sample_only else task.outgoing
    errors, light_ms, view_ms, negative = {}, [], [], []
    for index, (light, radiance) in enumerate(task.lights.items()):
        wanted = task.truth(name, light)
        begun = time.process_time()
        form.set_light(radiance)
        lit = time.process_time()
        result = form.toward(outgoing)
        done = time.process_time()
        light_ms.append(1e3 * (lit - begun))
        view_ms.append(1e3 * (done - lit))
        result = result if sample_only else result[task.sample]
        errors[light] = colour_error(result, wanted)["l2"]
        negative.append(negative_share(result))
        yield Progress(label, index + 1, len(task.lights))
    worst = max(errors, key=errors.get)
    return {
        "form": label,
        "reflectance": name,
        "points": len(outgoing),
        "facing": len(task.sample) if sample_only else task.n_facing,
        "bytes": int(form.nbytes),
        "seconds": seconds,
        "light_ms": float(np.median(light_ms)),
        "view_ms": float(np.median(view_ms)),
        "l2_mean": float(np.mean(list(errors.values()))),
        "l2_worst": errors[worst],
        "worst_light": worst,
        "negative": max(negative),
    }
