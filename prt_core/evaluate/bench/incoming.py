"""The field of incoming light, which relighting uses, against the dense sum."""

import time

import numpy as np

from prt_core.errors import PRTError
from prt_core.evaluate.bench.gloss_task import measured_steps
from prt_core.reflectance import Microfacet, Phong
from prt_core.reflectance.fresnel_powers import N_POWERS, fresnel_powers
from prt_core.sphere import Blocks
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.incoming_field import IncomingField, sides_of
from prt_core.transport.reflections import Reflections

LABEL = "field of incoming light (default)"


class FieldOfSky:
    """The sky alone, past what is in the way, in a field of incoming light.

    Parameters
    ----------
    transport : Transport
    reflectance : Microfacet or Phong
        Of one material, isotropic.
    """

    def __init__(self, transport, reflectance):
        if not isinstance(reflectance, Microfacet | Phong):
            raise PRTError(
                f"reflectance: the field takes Microfacet or Phong, got {reflectance!r:.60}"
            )
        cube_map, n = transport.cube_map, transport.n_points
        self._reflectance, self._normals = reflectance, transport.normals
        slider = float(np.max(reflectance.roughness))
        blocks = Blocks(cube_map, int(sides_of(slider, cube_map.resolution)))
        # What is in the way sends nothing: no entries.
        empty = (np.zeros(0, kind) for kind in (np.uint16, np.int32, np.uint8))
        start = np.zeros(n + 1, np.int64)
        reflections = Reflections(np.arange(n, dtype=np.int32), blocks, start, *empty)
        self.field = IncomingField(reflections, transport.bits)
        self._view = GlossyView(self.field, transport.normals)
        self._bits = transport.bits.nbytes
        self._sent = np.zeros((n, 3), np.float32)
        self._every = np.arange(n)
        self._alpha = np.full(n, slider**2, np.float32)
        self._powers = np.zeros((n, N_POWERS, 3), np.float32)
        self._lobe = None
        if isinstance(reflectance, Phong):
            self._lobe = self._phong
            self._powers[:, 0] = reflectance.reflectance
        else:
            self._powers[:] = fresnel_powers(reflectance.fresnel)

    def set_light(self, light):
        """Take a light, (n_directions, 3)."""
        self.field.update(np.asarray(light, np.float32), self._sent)

    def toward(self, outgoing):
        """(n_points, 3) float32, of `outgoing` (n_points, 3)."""
        result = self._view.reflected(
            self._every, outgoing, self._alpha, self._powers, lobe=self._lobe
        )
        if self._lobe is None and self._reflectance.multiple:
            up = np.zeros((len(outgoing), 3))
            up[:, 2] = np.maximum(np.einsum("ni,ni->n", outgoing, self._normals), 1e-6)
            result *= self._reflectance.gain(up)
        return result

    def _phong(self, directions, normals, outgoing):
        """Phong's lobe times the cosine: (p, m) float32."""
        n = np.float32(self._reflectance.exponent)
        cosine = normals @ directions
        facing = np.einsum("px,px->p", normals, outgoing)[:, None]
        toward = (2 * facing * normals - outgoing) @ directions
        value = np.maximum(toward, 0) ** n
        return value * np.maximum(cosine, 0) * np.float32((n + 2) / (2 * np.pi))

    @property
    def nbytes(self):
        """Of the field, what it reads of the bits, and the normals."""
        return self.field.nbytes + self.field.open.nbytes + self._bits + self._normals.nbytes


def incoming_steps(task):
    """Measure the field for each reflectance of a task; a generator of `Progress`.

    Parameters
    ----------
    task : GlossTask
        Its reflectances that are `Phong` or `Microfacet`; others have no row.

    Returns
    -------
    list of dict
        See `measured_steps`.
    """
    rows = []
    for name, reflectance in task.reflectances.items():
        if isinstance(reflectance, Phong | Microfacet):
            begun = time.perf_counter()
            form = FieldOfSky(task.transport, reflectance)
            seconds = time.perf_counter() - begun
            rows.append((yield from measured_steps(task, name, LABEL, form, seconds)))
    return rows
