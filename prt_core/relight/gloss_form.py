"""Gloss from a compressed form: transfer matrices in place of the field of incoming light."""

import hashlib
from functools import lru_cache

import numpy as np

from prt_core.basis import rotations_of_harmonics, texel_harmonics
from prt_core.compress.gloss_transfer import GlossTransfer
from prt_core.errors import PRTError, expect_kind, system_errors
from prt_core.reflectance.fresnel_powers import N_POWERS, powers_used
from prt_core.reflectance.harmonic import HarmonicReflectance
from prt_core.relight.point_lobes import PointLobes
from prt_core.runtime.main_thread import maybe_in_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import FACES, tangent_frames
from prt_core.store import (
    AGAIN,
    GLOSS_FORM,
    BakeStore,
    compressed_attributes,
    damage_as_error,
    read_compressed,
)
from prt_core.transport.bright_texels import bits_of
from prt_core.transport.lobe_values import lobe_values

# Points worked on at once; lobes are told apart by steps of their roughness.
_PART, _STEP = 2048, 1 / 32


class GlossForm:
    """What glossy points of a bake reflect, by a `GlossTransfer`.

    Parameters
    ----------
    bake : Bake
        With gloss.
    model : GlossTransfer
        Of it.
    """

    def __init__(self, bake, model):
        self.model = expect_kind("model", model, GlossTransfer)
        self._transport, points = bake.transport, bake.scene.points
        self.points = np.concatenate([part.points for part in bake.reflections])
        self._world = bake.scene.to_world(points.positions[self.points])
        self._normals = points.normals[self.points]
        self._lobes = PointLobes(points.materials[self.points], self._normals)
        self._frames = tangent_frames(self._normals)
        self._turns = [
            block.astype(np.float32) for block in rotations_of_harmonics(self._frames, model.order)
        ]
        resolution = bake.cube_map.resolution
        self._integrals = texel_harmonics(resolution, model.order, FACES)
        self._arrived = None

    def light(self, texels):
        """Take in a light, (n_directions, 3) float32 radiance of the sky. Returns self."""
        cube_map, count = self._transport.cube_map, self.model.n_bright
        angles = cube_map.solid_angles
        bright = np.argsort(-texels.max(axis=1) * angles, kind="stable")[:count]
        rest = texels.astype(np.float64)
        others = np.delete(rest, bright, axis=0)
        rest[bright] = np.minimum(others.mean(axis=0), rest[bright])
        more = (texels - rest)[bright] * angles[bright, None]
        self._bright = np.ascontiguousarray(cube_map.directions[bright].T, np.float32)
        self._brought = more.astype(np.float32)
        self._seen = bits_of(self._transport.bits[self.points], bright).astype(np.float32)
        arrived = self.model.arriving(self._integrals.T @ rest, self._integrals.T @ texels)
        self._arrived = np.empty_like(arrived)

        def one(first):
            part = slice(first, first + _PART)
            for degree, block in enumerate(self._turns):
                of = slice(degree**2, (degree + 1) ** 2)
                self._arrived[part, of] = np.matmul(block[part], arrived[part, of])

        on_all_cores(one, range(0, len(arrived), _PART))
        return self

    # Views are quick as they are.
    maps_views = True

    def map_views_steps(self, pace=None):
        """As `Gloss.map_views_steps`: there is nothing to do."""
        yield from ()

    def toward_steps(self, view, lamps=(), pace=None, every=1, mapped=False):
        """See `Gloss.toward_steps`; there are no lamps, and all points are quick enough."""
        return (yield from maybe_in_thread(pace, "gloss", self._toward, view))

    def _toward(self, view):
        n_points = self._transport.n_points
        reflected = np.zeros((n_points, 3), np.float32)
        diffuse = np.ones((n_points, 3), np.float32)
        if view.direction is not None and view.direction.ndim == 2:
            outgoing = view.direction[self.points]
        else:
            outgoing = view.outgoing(self._world)
        outgoing = np.asarray(outgoing, np.float32)
        cosine = np.einsum("nx,nx->n", outgoing, self._normals)
        facing = np.flatnonzero(cosine > 0)

        def one(first):
            rows = facing[first : first + _PART]
            groups, left = self._lobes.at(rows, cosine[rows])
            total = np.zeros((len(rows), 3), np.float32)
            local = np.einsum("nij,nj->ni", self._frames[rows], outgoing[rows])
            for alpha, powers in groups:
                width = np.sqrt(alpha.prod(axis=1))
                kind = np.rint(np.sqrt(width) / _STEP).astype(int)
                for step in np.unique(kind):
                    some = np.flatnonzero((kind == step) & powers.any(axis=(1, 2)))
                    if len(some):
                        table = _harmonics_of(step, self.model.order)
                        total[some] += self._lobe(
                            table, rows[some], local[some], outgoing[rows[some]], width[some],
                            powers[some],
                        )  # fmt: skip
            where = self.points[rows]
            reflected[where], diffuse[where] = np.maximum(total, 0), left

        on_all_cores(one, range(0, len(facing), _PART))
        return reflected, diffuse

    def _lobe(self, table, rows, local, outgoing, alpha, powers):
        vectors = table.vectors(local).astype(np.float32)
        sums = np.matmul(vectors, self._arrived[rows])
        n_powers = powers_used(powers)
        lobes = lobe_values(self._bright, self._normals[rows], outgoing, alpha, None, n_powers)
        for power, lobe in enumerate(lobes):
            sums[:, power] += (lobe * self._seen[rows]) @ self._brought
        return np.einsum("npc,npc->nc", sums, powers)


@lru_cache(maxsize=64)
def _harmonics_of(step, order):
    """`HarmonicReflectance` of a white lobe of a roughness, times each power of Fresnel terms."""
    alpha = np.float32([max(step * _STEP, 0.05) ** 2])
    up = np.float32([[0, 0, 1]])

    def evaluate(incoming, outgoing):
        ways = np.ascontiguousarray(incoming.T, np.float32)
        lobes = lobe_values(ways, up, outgoing.astype(np.float32), alpha, None, N_POWERS)
        values = np.stack([lobe[0] for lobe in lobes], axis=1)
        return values / np.maximum(incoming[:, 2:], 1e-6)

    return HarmonicReflectance(evaluate, order)


def gloss_fingerprint(bake):
    """A digest of all that a form of a bake's gloss depends on."""
    digest = hashlib.blake2b(digest_size=16)
    digest.update(bake.transport.fingerprint().encode())
    for part in bake.reflections:
        for array in (part.points, part.start, part.block, part.met, part.share):
            digest.update(np.ascontiguousarray(array))
    return digest.hexdigest()


def load_gloss_form(bake):
    """The stored form of a bake's gloss, or why there is none to use.

    Returns
    -------
    GlossForm or None, str
    """
    if bake.path is None or not bake.reflections:
        return None, "there is no compressed gloss"
    with system_errors(bake.path):
        store = BakeStore(bake.path)
        attributes = compressed_attributes(store, GLOSS_FORM)
        if attributes is None:
            return None, "there is no compressed gloss; make it with 'prt compress'"
        if attributes.get("fingerprint") != gloss_fingerprint(bake):
            return None, f"the compressed gloss is of another state of the bake; {AGAIN}"
        state = read_compressed(store, attributes)
        with damage_as_error(bake.path, "its compressed gloss", AGAIN):
            n_points = sum(len(part) for part in bake.reflections)
            return GlossForm(bake, GlossTransfer.from_state(state, n_points)), ""


class GlossFormInUse:
    """The form of gloss that one bake is relit from, read when it is first needed.

    Parameters
    ----------
    bake : Bake
    """

    def __init__(self, bake):
        self._bake, self._form, self._of, self.why = bake, None, None, ""

    def close(self):
        """Let go of it."""
        self._form = self._of = None

    def read(self):
        """The `GlossForm`, or None: then `why` says why not."""
        # Materials may be replaced after the bake: then the form is of another one.
        if self._of is not self._bake.transport.materials:
            try:
                self._form, self.why = load_gloss_form(self._bake)
            except PRTError as error:
                self._form, self.why = None, str(error)
            self._of = self._bake.transport.materials
        return self._form
