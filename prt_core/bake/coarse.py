"""A scene from the rows of few of its points: how they are spread, what they gather, how far off.

Of the known points some are taken for unknown, and what their neighbours would have told of them
is compared with what they know. Bounces are compared from two halves of their rays.
"""

import numpy as np

from prt_core.runtime.seeds import Stage, generator
from prt_core.transport import (
    PartialTransport,
    Sharing,
    SpreadGather,
    emitted_light,
    gather_operator,
    gather_parts,
    ray_ends,
    surface_lights,
)
from prt_core.transport.sent import Sent, mean_of_channels, sent_of
from prt_core.transport.visibility import vector_light

# Rounds of gather rays of each point; even, for two halves of them are compared.
_ROUNDS = 2
# Turns of rays towards emitters, and the error at which one is enough.
_EMISSION_TURNS, _EMISSION_ERROR = 2, 0.1
# Points worked on together, and of which the error is estimated.
_BLOCK, _SAMPLE = 256, 2048


class Coarse:
    """What is made once of a scene, for rows of any of its points.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
        On which light is given.
    settings : BakeSettings
    caster : RayCaster
        May be replaced.
    spread : Spread
    """

    def __init__(self, scene, cube_map, settings, caster, spread):
        self.scene, self._cube_map, self._settings = scene, cube_map, settings
        self.caster, self._spread = caster, spread
        # Of their own, whatever else is drawn from the seed of the bake.
        self._seed = int(generator(settings.seed, Stage.PICTURES, 1).integers(1 << 31))
        self._lights = self._sharing = None
        points = scene.points
        self._through = scene.opposite if points.materials.through.any() else None
        self._sends = mean_of_channels(sent_of(points.mean_materials, scene.opposite))
        self._probes = probe_skies(cube_map)

    def shares(self, points):
        """S: who takes what from the known `points` (see `Spread.shares`)."""
        return self._spread.shares(points)

    def transport(self, bits, spread, gather, row_map=None):
        """`PartialTransport` of the scene."""
        points = self.scene.points
        means = None if points.mean_materials.equals(points.materials) else points.mean_materials
        return PartialTransport(
            self._cube_map, bits, gather, points.normals, points.materials, self._settings.series,
            self._settings.bounces, means, self._through, spread, row_map,
        )  # fmt: skip

    def gathered(self, points, spread, received):
        """K of all points by rays of some, and the squared error of their first bounce.

        Parameters
        ----------
        points : (n_known,) int
        spread : (n_points, n_known) CSR float32
        received : (n_points, 3) float32
            Direct light of all points under the probe skies, the first of which is even.

        Returns
        -------
        SpreadGather, or None
            None where nothing is to bounce.
        error : (3,) float64
            Relative to what the points receive.
        """
        if self._settings.bounces == 0:
            return None, np.zeros(3)
        scene = self.scene
        self._sharing = self._sharing or Sharing(scene)
        parts = [points[first : first + _BLOCK] for first in range(0, len(points), _BLOCK)]
        jobs = [(part, turn) for part in parts for turn in range(_ROUNDS)]
        hits = gather_parts(
            scene, self.caster, jobs, self._seed, scene.open_points, None, self._sharing
        )
        hits = np.concatenate(
            [
                np.hstack([g.hits for g in hits[i : i + _ROUNDS]])
                for i in range(0, len(hits), _ROUNDS)
            ]
        )
        blocked = np.clip(1 - received[points, 0], 0, 1)
        ends, n_points = ray_ends(hits), len(scene.points)
        whole = gather_operator(ends, n_points, blocked)
        sent = self._sends(received) if isinstance(self._sends, Sent) else self._sends * received
        half = ends.shape[1] // 2
        one, two = (
            gather_operator(part, n_points, blocked) @ sent
            for part in (ends[:, :half], ends[:, half:])
        )
        bounced = (one + two) / 2
        size = _squares(received[points] + bounced)
        error = _squares(one - two) / 4 / np.maximum(size, 1e-300)
        more = received[points[:_SAMPLE]]
        return SpreadGather(spread, whole), error + self._spread_error(points, bounced, more)

    def probed(self, transport):
        """(n_points, 3) float32: direct light of all points under the probe skies."""
        return transport.received(self._probes)

    def left_out_error(self, points, transport):
        """(3,) float64: squared relative error of points that take direct light from others.

        Parameters
        ----------
        points : (n_known,) int
            Whose rows the transport has.
        transport : PartialTransport
        """
        sample = np.arange(min(len(points), _SAMPLE))
        shares = self._spread.left_out(points, points[sample])
        used = np.union1d(shares.indices, sample)
        light = transport.on_rows(self._probes)
        vectors = vector_light(transport.bits[used], transport.directions_of_rows, light)
        flat, normals = vectors.reshape(len(used), -1), self.scene.points.normals[points[sample]]
        own = flat[np.searchsorted(used, sample)]
        told, known = (
            np.maximum(np.einsum("pa,pac->pc", normals, v.reshape(len(sample), 3, -1)), 0)
            for v in (shares[:, used] @ flat, own)
        )
        return _squares(told - known) / np.maximum(_squares(known), 1e-300)

    def emitted(self, points, spread):
        """What is received of each emitter, by rays of the known points.

        Returns
        -------
        received : (n_emitters, n_points, 4) float32, or None
            None where nothing emits light.
        error : float
            Squared and relative, of what all of them together bring to points that take it.
        """
        scene = self.scene
        if not scene.emitters:
            return None, 0.0
        if self._lights is None:
            self._lights = surface_lights(scene)
            for light in self._lights:
                light.look_around(self.caster, self._seed)
        parts = [
            emitted_light(
                scene,
                self.caster,
                self._lights,
                points[first : first + _BLOCK],
                self._seed,
                _EMISSION_ERROR,
                _EMISSION_TURNS,
            ).received
            for first in range(0, len(points), _BLOCK)
        ]
        received = np.concatenate(parts, axis=1)
        error = self._spread_error(points, received.sum(axis=0)[:, 3:], 0)[0]
        return np.stack([spread @ light for light in received]), float(error)

    def _spread_error(self, points, values, more):
        """(k,) float64: squared error of `values` (n_known, k) where they are taken by others,
        relative to these and `more` besides."""
        sample = slice(0, _SAMPLE)
        told = self._spread.left_out(points, points[sample]) @ values
        size = _squares(values[sample] + more)
        unknown = 1 - len(points) / len(self.scene.points)
        return unknown * _squares(told - values[sample]) / np.maximum(size, 1e-300)


def _squares(values):
    """(k,) float64: sums of the squares of columns."""
    return np.einsum("nk,nk->k", values, values, dtype=np.float64)


def probe_skies(cube_map):
    """(n_directions, 3) float32: an even sky, a low and a high lamp-like sky, one a channel."""
    towards = np.array([[0.8, 0.3, 0.52], [-0.5, -0.7, 0.51]])
    light = np.ones((cube_map.n_directions, 3), np.float32)
    light[:, 1:] = np.exp(12 * (cube_map.directions @ towards.T - 1))
    return light
