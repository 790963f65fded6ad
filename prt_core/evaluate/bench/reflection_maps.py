"""Reflection maps, with and without a factor for shadows, against the dense sum."""

import time

import numpy as np

from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.light.prefilter import PhongMap, SplitSum
from prt_core.reflectance import Microfacet, Phong
from prt_core.transport.dense_gloss import lobe_visibility


class _OfMap:
    """A map as a form of some points."""

    def __init__(self, reflectance, cube_map, normals, visibility=None):
        self._normals, self._visibility, self._more = normals, visibility, ()
        self._scale = np.float32(1)
        if isinstance(reflectance, Phong):
            self._map = PhongMap(cube_map, float(reflectance.exponent))
            self._scale = reflectance.reflectance.astype(np.float32)
        else:
            roughness = float(reflectance.roughness)
            self._map = SplitSum(cube_map, (roughness,))
            straight = reflectance.fresnel(np.ones(1))[0]
            self._more = roughness, straight

    def set_light(self, light):
        self._map.set_light(light)

    def toward(self, outgoing):
        radiance = self._map.toward(self._normals, outgoing, *self._more, self._visibility)
        return radiance * self._scale

    @property
    def nbytes(self):
        return self._map.nbytes


def reflection_map_steps(task):
    """Measure reflection maps for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
        Its reflectances that are `Phong` or `Microfacet`; others have no map and no row.

    Returns
    -------
    list of dict
        See `measured_steps`. The factor is exact and as dear as the dense sum: these rows are of
        the sample's points.
    """
    rows, transport = [], task.transport
    for name, reflectance in task.reflectances.items():
        if not isinstance(reflectance, Phong | Microfacet):
            continue
        form = _OfMap(reflectance, transport.cube_map, task.normals)
        rows.append((yield from measured_steps(task, name, "reflection map", form, 0.0)))
        begun = time.process_time()
        parts = transport.bits[task.sample], task.normals[task.sample], transport.cube_map
        share = lobe_visibility(*parts, reflectance.eval, task.outgoing[task.sample])
        form = _OfMap(reflectance, transport.cube_map, parts[1], share)
        seconds = time.process_time() - begun
        label = "reflection map, factor for shadows"
        rows.append((yield from measured_steps(task, name, label, form, seconds, True)))
    return rows
