"""Samples of the lobes, and the dense sum itself, against the dense sum."""

from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.transport.bright_texels import BrightApart, BrightTexels
from prt_core.transport.dense_gloss import dense_reflection
from prt_core.transport.lobe_samples import LobeSamples


def lobe_sample_steps(task, powers=(4, 6), n_bright=(16,)):
    """Measure samples of lobes for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
    powers : sequence of int
        2 to these many samples of a lobe: rows of each.
    n_bright : sequence of int
        Numbers of brightest texels that are taken out of the light: rows of each.

    Returns
    -------
    list of dict
        See `measured_steps`.
    """
    rows, transport = [], task.transport
    for name, reflectance in task.reflectances.items():
        for power in powers:
            parts = transport.bits, task.normals, transport.cube_map, reflectance
            form = LobeSamples(*parts, power)
            for count in n_bright:
                this = form
                if count:
                    this = BrightApart(form, BrightTexels(*parts[:3], reflectance.eval, count))
                label = f"lobe samples, {2**power}, {count} texels apart"
                rows.append((yield from measured_steps(task, name, label, this, 0.0)))
    return rows


class _Dense:
    """The dense sum as a form of some points."""

    def __init__(self, task, reflectance):
        self._transport, self._reflectance = task.transport, reflectance
        self._bits = task.transport.bits[task.sample]
        self._normals, self._light = task.normals[task.sample], None

    def set_light(self, light):
        self._light = light

    def toward(self, outgoing):
        parts = self._normals, self._transport.cube_map, self._light, self._reflectance.eval
        return dense_reflection(self._bits, *parts, outgoing)

    @property
    def nbytes(self):
        # Of all points: it is what everything else is beside.
        return self._transport.bits.nbytes + self._transport.normals.nbytes


def dense_steps(task):
    """Measure the dense sum for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask

    Returns
    -------
    list of dict
        See `measured_steps`; timed at the points of the sample.
    """
    rows = []
    for name, reflectance in task.reflectances.items():
        form = _Dense(task, reflectance)
        rows.append((yield from measured_steps(task, name, "dense sum", form, 0.0, True)))
    return rows
