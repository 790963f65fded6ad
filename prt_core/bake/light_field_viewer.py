"""A light field as somebody moves around it, or dims its lamps: the quickest way that fits.

Where tables of all lights fit into memory they are decoded once; then a move of the view is one
look-up of all lights, and a lamp's slider only adds up what was looked up. Else the mixture of the
lights is decoded, and again when the view moves after the lamps have changed; or radiance is made
from the coefficients of the compressed form.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.lightfield.light_tables import LightTables
from prt_core.lightfield.viewer import Viewer
from prt_core.runtime.main_thread import in_thread
from prt_core.transport import View

MOST_BYTES = 1 << 30
_TABLES = {np.float32: "each light", np.float16: "each light in 16 bits"}


class CapturedField:
    """A `LightField` as it was captured, decoded as a `SurfaceLightField` is.

    Parameters
    ----------
    field : LightField
    """

    def __init__(self, field):
        self._radiance = field.radiance
        self.n_lights_, self.n_points_ = field.radiance.shape[:2]
        self.layout_, self.frames_ = HRDFLayout(*field.angles), field.frames

    def expect_weights(self, weights):
        """(n_lights, 3) float32 of `weights` (n_lights,) or (n_lights, 3), or of None."""
        if weights is None:
            return np.ones((self.n_lights_, 3), np.float32)
        weights = np.asarray(weights)
        weights = weights[:, None] if weights.ndim == 1 else weights
        wanted = self.n_lights_, 3 if weights.shape[-1:] == (3,) else 1
        weights = expect_array("weights", weights, wanted, np.float32)
        return np.broadcast_to(weights, (self.n_lights_, 3))

    def decode(self, points, weights=None):
        """Radiance of neighbouring points, of all lights together.

        Parameters
        ----------
        points : slice, or (n,) int
            One after the other.
        weights : (n_lights,) or (n_lights, 3) float, optional

        Returns
        -------
        (n, rows, columns, 3) float32
        """
        if not isinstance(points, slice):
            points = slice(int(points[0]), int(points[-1]) + 1)
        mixed = np.zeros((points.stop - points.start, *self.layout_.shape, 3), np.float32)
        for light, weight in enumerate(self.expect_weights(weights)):
            if weight.any():
                mixed += self._radiance[light, points] * weight
        return mixed


class FieldViewer:
    """Views of a light field.

    Parameters
    ----------
    field : LightField
    compressed : SurfaceLightField, optional
        Its compressed form, which is shown in its place.
    most_bytes : int
        Of memory for tables.

    Attributes
    ----------
    kind : {"each light", "each light in 16 bits", "mixture", "coefficients"}
        What views are made from.

    Raises
    ------
    PRTError
        There is no compressed form, and one light alone takes more memory.
    """

    def __init__(self, field, compressed=None, most_bytes=MOST_BYTES):
        model = CapturedField(field) if compressed is None else compressed
        self._model, self._most_bytes = model, most_bytes
        self._is_compressed = compressed is not None
        self._positions = field.scene.to_world(field.scene.points.positions[field.point])
        self._view = self._ways = self._each = self._weights = self._viewer = self._tables = None
        table = 12 * model.n_points_ * model.layout_.n_cells
        dtype = LightTables.dtype_within(model, most_bytes)
        if dtype is not None:
            self._tables = LightTables(model, dtype, field.radiance.chunks[1])
            self.kind = _TABLES[dtype]
        elif table <= most_bytes:
            self.kind = "mixture"
        else:
            self.kind = "coefficients"
            expect(
                self._is_compressed,
                f"{field.store.path}: takes {table / 1e9:.1f} GB of memory to look at; compress it "
                "with 'prt lightfield compress', or bake it with fewer angles",
            )

    def steps(self, view, weights=None):
        """Radiance of the field's points towards a view; a generator of `Progress`.

        Parameters
        ----------
        view : View
        weights : (n_lights,) or (n_lights, 3) float, optional
            Factors of the lights; default: 1.

        Returns
        -------
        (n_points, 3) float32
        """
        weights = self._model.expect_weights(weights)
        moved = self._look(view)
        if self._tables is not None:
            if moved:
                self._each = self._tables.each_toward(self._ways)
            return _mixed(self._each, weights)
        if self._viewer is not None and np.array_equal(weights, self._weights):
            return self._viewer.toward(self._ways)
        if self._is_compressed and self._viewer is not None and not moved:
            # While the view stays its lights are looked up once.
            if self._each is None:
                each = yield from in_thread("lights", self._model.each_toward, self._ways)
                self._each = np.ascontiguousarray(each.transpose(1, 0, 2))
            return _mixed(self._each, weights)
        self._viewer = yield from in_thread(
            "lights", Viewer, self._model, weights, self._most_bytes
        )
        self._weights = np.array(weights)
        return self._viewer.toward(self._ways)

    def _look(self, view):
        """Note from where is looked; whether that is another place than before."""
        expect_kind("view", view, View)
        key = [None if v is None else v.tobytes() for v in (view.position, view.direction)]
        moved = key != self._view
        if moved:
            self._ways = np.ascontiguousarray(view.outgoing(self._positions), np.float32)
            self._each, self._view = None, key
        return moved


def _mixed(each, weights):
    """(n_points, 3) float32 of (n_points, n_lights, 3) and factors (n_lights, 3)."""
    factors = np.einsum("lc,cd->lcd", weights, np.eye(3, dtype=np.float32))
    return each.reshape(len(each), -1) @ factors.reshape(-1, 3)
