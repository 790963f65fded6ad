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
from prt_core.transport.view_map import ViewMap

LABEL, MAPPED = "field of incoming light (default)", "field of incoming light, mapped (default)"


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
        result = self._reflected(outgoing)
        if self._lobe is None and self._reflectance.multiple:
            up = np.zeros((len(outgoing), 3))
            up[:, 2] = np.maximum(np.einsum("ni,ni->n", outgoing, self._normals), 1e-6)
            result *= self._reflectance.gain(up)
        return result

    def _reflected(self, outgoing):
        work = self._every, outgoing, self._alpha, self._powers
        return self._view.reflected(*work, lobe=self._lobe)

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


class MappedFieldOfSky(FieldOfSky):
    """The same with maps of views, which belong to the light: as where a view moves."""

    def set_light(self, light):
        """Take a light, (n_directions, 3), and make maps of all views."""
        super().set_light(light)
        kinds = np.zeros(len(self._every), np.int32)
        # Also where points are so few that a relighter would make none.
        self._map = ViewMap(
            self.field, self._normals, kinds, self._lobes_of, least=0, lobe=self._lobe
        )
        self._map.make()

    def _lobes_of(self, kind, _):
        return [(self._alpha[kind], self._powers[kind])]

    def _reflected(self, outgoing):
        result = np.zeros((len(outgoing), 3), np.float32)
        facing = np.einsum("ni,ni->n", self._normals, outgoing) > 0
        rows = np.flatnonzero(facing)
        result[rows] = self._map.reflected(rows, outgoing[rows].astype(np.float32))
        return result

    @property
    def nbytes(self):
        """Of the field and the maps."""
        return super().nbytes + self._map.nbytes


def incoming_steps(task):
    """Measure the field for each reflectance of a task; a generator of `Progress`.

    Wide lobes have another row with maps of views, which a view that moves uses.

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
            wide = sides_of(reflectance.roughness, 16) == sides_of(1, 16)
            for label, kind in ((LABEL, FieldOfSky), (MAPPED, MappedFieldOfSky)):
                if kind is FieldOfSky or wide.all():
                    begun = time.process_time()
                    form = kind(task.transport, reflectance)
                    seconds = time.process_time() - begun
                    rows.append((yield from measured_steps(task, name, label, form, seconds)))
    return rows
