"""Transfer matrices of the glossy points of a bake: light in harmonics, light that arrives in them.

As `transport.transfer` has them, but in the world, for all points that have gloss, and with what
reflections see: what stands in the way in a block sends what it would under each harmonic of the
light. Columns are the light's harmonics twice: of the light that comes straight, whose brightest
texels are taken out, and of all of it, which lights the rest of the scene.
"""

import numpy as np

from prt_core.basis import harmonic_products, texel_harmonics
from prt_core.basis.spherical_harmonics import harmonics
from prt_core.compress.clusters.clustered_pca import ClusteredPCA
from prt_core.compress.rows import Rows
from prt_core.compress.state import value_of
from prt_core.errors import expect, expect_kind, expect_whole
from prt_core.runtime.named_settings import expect_settings, named_settings, read_setting
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.sphere import FACES
from prt_core.transport.seen_lobes import entries_of
from prt_core.transport.transfer import sent_harmonics
from prt_core.transport.transport import Transport
from prt_core.transport.visibility import unpack

_BLOCK = 256


class TransferRows(Rows):
    """The matrices as rows: columns are harmonics of the light, outputs those of what arrives.

    Parameters
    ----------
    transport : Transport
    reflections : sequence of Reflections
        Their points are the rows, one part after the other.
    order : int
        Degrees 0 to order - 1.
    """

    def __init__(self, transport, reflections, order=5):
        self._transport = expect_kind("transport", transport, Transport)
        self._reflections, self.order = reflections, expect_whole("order", order, 1, 8)
        n = order**2
        self.n_points = sum(len(part) for part in reflections)
        self.n_directions, self.n_outputs = 2 * n, 3 * n
        self.reads = np.repeat(np.arange(3), n)
        self._ends = np.cumsum([0, *(len(part) for part in reflections)])
        self._blocks = None

    def prepare_steps(self):
        """Work out all rows; a generator of `Progress`."""
        if self._blocks is None:
            resolution = self._transport.cube_map.resolution
            integrals = texel_harmonics(resolution, 2 * self.order - 1, FACES)
            products = harmonic_products(self.order).reshape(self.order**4, -1).T
            self._tables = integrals.astype(np.float32), products.astype(np.float32)
            yield Progress("transfer", 0, self.n_points)
            self._sent = sent_harmonics(self._transport, self.order)
            blocks, done = [], 0
            for part in in_parallel(self._made, self.blocks(_BLOCK)):
                blocks.append(part)
                done += len(part)
                yield Progress("transfer", done, self.n_points)
            self._blocks = np.concatenate(blocks)
        return self

    def block(self, points):
        """See `Rows.block`."""
        return self._blocks[points]

    def _made(self, points):
        n = self.order**2
        result = np.zeros((len(points), 2 * n, 3, n), np.float32)
        integrals, products = self._tables
        owner = np.searchsorted(self._ends, points, side="right") - 1
        for index in np.unique(owner):
            part, mine = self._reflections[index], np.flatnonzero(owner == index)
            rows = points[mine] - self._ends[index]
            bits = self._transport.bits[part.points[rows]]
            seen = unpack(bits, self._transport.n_directions) @ integrals
            straight = (seen @ products).reshape(-1, n, n)
            result[mine, :n] = straight.swapaxes(1, 2)[:, :, None]
            result[mine, n:] = self._from_scene(part, rows)
        return result.reshape(len(points), 2 * n, 3 * n)

    def _from_scene(self, part, rows):
        """(k, n_light, 3, n_local): what arrives from what is in the way."""
        n, blocks = self.order**2, part.blocks
        which, entry = entries_of(part.start, rows)
        kept = part.met[entry] >= 0
        which, entry = which[kept], entry[kept]
        block = part.block[entry]
        weight = part.share[entry] * (blocks.solid_angles[block] / 255)
        arriving = (harmonics(blocks.directions, self.order)[block] * weight[:, None]).astype(
            np.float32
        )
        result = np.zeros((len(rows), n, 3, n), np.float32)
        starts = np.flatnonzero(np.diff(which, prepend=-1))
        for first, last in zip(starts, [*starts[1:], len(which)], strict=True):
            sent = self._sent[part.met[entry[first:last]]]
            product = arriving[first:last].T @ sent.reshape(last - first, -1)
            result[which[first]] = product.reshape(n, 3, n).transpose(2, 1, 0)
        return result


class GlossTransfer:
    """Clustered transfer matrices of a bake's glossy points.

    Parameters
    ----------
    order : int
        Degrees of the harmonics, of light and of what arrives.
    n_components : int
        Of each cluster.
    n_bright : int
        Texels that are taken out of a light and summed by themselves.
    points : int
        Of a cluster, in the mean.
    seed : int

    Attributes
    ----------
    compressor_ : ClusteredPCA
    """

    name = "transfer"

    def __init__(self, order=5, n_components=16, n_bright=16, points=350, seed=0):
        self.order = expect_whole("method: 'transfer': order", order, 1, 8)
        self.n_components = expect_whole("method: 'transfer': n_components", n_components, 1, 1024)
        self.n_bright = expect_whole("method: 'transfer': n_bright", n_bright, 0, 1024)
        self.points = expect_whole("method: 'transfer': points", points, 1)
        self.seed = expect_whole("method: 'transfer': seed", seed, 0)

    @classmethod
    def from_text(cls, text, seed=0):
        """Of NAME:key=value,… as it is asked for."""
        name, settings = named_settings(text)
        known = "order", "n_components", "n_bright", "points"
        expect_settings(name, settings, known)
        return cls(**{key: read_setting(value) for key, value in settings.items()}, seed=seed)

    def settings(self):
        """Parameters by name."""
        names = "order", "n_components", "n_bright", "points", "seed"
        return {name: getattr(self, name) for name in names}

    def fit_steps(self, transport, reflections):
        """Make and compress the matrices; a generator of `Progress`.

        Parameters
        ----------
        transport : Transport
        reflections : sequence of Reflections

        Returns
        -------
        GlossTransfer
            Itself.
        """
        rows = TransferRows(transport, reflections, self.order)
        yield from rows.prepare_steps()
        n_clusters = max(1, round(rows.n_points / self.points))
        self.compressor_ = ClusteredPCA(n_clusters, self.n_components, seed=self.seed)
        yield from self.compressor_.fit_steps(rows)
        return self

    def arriving(self, straight, everything):
        """Harmonics of the light that arrives at each point, in the world.

        Parameters
        ----------
        straight, everything : (order^2, 3) float
            Harmonics of the light without its bright texels, and of all of it.

        Returns
        -------
        (n_points, order^2, 3) float32
        """
        arrived = self.compressor_.product(np.concatenate([straight, everything]))
        return arrived.reshape(len(arrived), 3, -1).swapaxes(1, 2)

    @property
    def nbytes(self):
        """Of what a light reads."""
        return self.compressor_.nbytes

    def state(self):
        """Arrays and values for a store."""
        return {"settings": self.settings(), **self.compressor_.state()}

    @classmethod
    def from_state(cls, state, n_points):
        """The form of a `state`; `PRTError` where it is not of so many points."""
        model = value_of(state, "settings", lambda settings: cls(**settings))
        model.compressor_ = ClusteredPCA.from_state(state)
        made = model.compressor_
        shape = made.n_points_, made.n_directions_, made.n_outputs_
        wanted = n_points, 2 * model.order**2, 3 * model.order**2
        expect(shape == wanted, f"compressed gloss: is of {shape}, expected {wanted}")
        return model
