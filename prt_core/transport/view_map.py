"""Views looked up: what wide lobes reflect of a known light, as a smooth map of all views.

What a wide lobe reflects changes slowly with the direction in which the view is mirrored, so each
point has a small map of these directions, on the disc into which the half space above it is laid
with equal areas. Entries are in parts of what lobes reflect of light from all sides, which is known
exactly and changes fast where views graze. They are coefficients of quadratic B-splines: smooth
between its nodes, a view is nine look-ups a point. The brightest texels, which show the very shape
of lobes, are evaluated for the view.

A map is lobes times the field of incoming light, as a view is (see `transport.glossy_view`), but
lobes are made for many points at once: for those with lobes of one class and about one normal. As
places in the map are mirror directions in the world, what such normals differ by moves no
reflection; lobes are those of slightly other tilts.
"""

from functools import lru_cache

import numpy as np

from prt_core.reflectance.energy import ggx_power_albedos
from prt_core.reflectance.fresnel_powers import N_POWERS, powers_used
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import Blocks, CubeMap, tangent_frames
from prt_core.transport.bright_lobes import BrightLobes
from prt_core.transport.field_nodes import field_nodes
from prt_core.transport.lobe_cuts import pieces
from prt_core.transport.lobe_values import lobe_values

# Nodes along an edge of a map, and cells of normals along an edge of a cube's face.
N_NODES, _CELLS = 14, 16
# Nodes at and beyond the horizon are of views that graze so much.
_LEAST_COSINE = 0.04
# Cosines of views whose lobes are evaluated at four places of each block.
_GRAZING = 0.45
# Points whose maps are made at once, and whose maps are looked up at once.
_MADE, _LOOKED_UP = 2048, 2048
# Cosines at which reflected shares are known, closer where views graze.
_SHARES = 33
# Sliders of roughness at which they are.
_SLIDERS = np.linspace(0.3, 1, 23)
# Steps by which lobes are told apart: of the logarithm of alpha, and of what is reflected straight
# back; of few kinds each is a class of its own.
_STEPS, _FEW = ((0.05, 0.15), (0.1, 0.3), (0.2, 1.0)), 32
# Points a group of one class and cell should have, in the mean: a group takes time of its own.
_LEAST = 8


class ViewMap:
    """What points reflect towards all views, under the light that is in their field.

    Parameters
    ----------
    field : IncomingField
    normals : (n, 3) float32
        Of the points of the field.
    kinds : (n,) int
        Points of one kind have the same lobes; negative: a point without a map.
    lobes_of : callable(kind (k,) int, cosine (k,) float) -> list of (alpha, powers)
        Of lobes that have one roughness, towards views along a cosine with the normal: (k,), and
        (k, N_POWERS, 3) of their Fresnel terms (see `fresnel_powers`).
    least : int
        Points a group that shares lobes should have in the mean.
    lobe : callable(directions, normals, outgoing) -> (v, m) float32, optional
        Another lobe times the cosine than that of microfacets, as `GlossyView.reflected` takes it.

    Attributes
    ----------
    has : (n,) bool
        Which points have a map; none until all are made (see `make`), and none where their lobes
        are too different for maps to pay.
    left, planned : int
        Pieces of work that are to be done, and that were at first.
    """

    def __init__(self, field, normals, kinds, lobes_of, least=_LEAST, lobe=None):
        self._normals = np.ascontiguousarray(normals, np.float32)
        self._kinds, self.has = np.asarray(kinds, np.int32), np.zeros(len(normals), bool)
        self._rows = rows = np.flatnonzero(self._kinds >= 0)
        self._jobs, self.left, self.planned = [], 0, 0
        n_kinds = int(self._kinds.max(initial=-1)) + 1
        if not len(rows):
            return
        cells = CubeMap(_CELLS).texel_along(*self._normals[rows].T)
        classes, groups = _classes(self._kinds[rows], cells, n_kinds, lobes_of, least)
        if groups is None:
            return
        self._shares = np.ones((n_kinds, _SHARES, 3), np.float32)
        if lobe is None:
            self._shares = _shares_of_kinds(n_kinds, lobes_of)
        self._group = np.zeros(len(normals), np.int32)
        self._group[rows] = groups
        self._frames = np.zeros((int(groups.max()) + 1, 3, 3), np.float32)
        self._nodes = np.zeros((len(normals), 3, N_NODES * N_NODES), np.uint8)
        self._scale = np.zeros((len(normals), 3), np.float32)
        self._light, self._views = _Light(field, lobe), _node_views()
        self._bright = BrightLobes(field.apart, self._kinds, lobes_of, lobe)
        self._lobes_of = lobes_of
        self._plan(groups, classes)

    def make(self, pieces=None):
        """Make so many pieces of the maps, or all that are left.

        Parameters
        ----------
        pieces : int, optional
        """
        done = self.planned - self.left
        jobs = self._jobs[done : None if pieces is None else done + pieces]
        on_all_cores(self._fill_in, jobs)
        self.left -= len(jobs)
        if self.planned and not self.left:
            self.has[self._rows] = True

    @property
    def nbytes(self):
        """Of the maps."""
        if not self.planned:
            return 0
        own = self._nodes, self._scale, self._shares, self._group, self._kinds, self._frames
        return sum(array.nbytes for array in own) + self._bright.nbytes

    def reflected(self, rows, outgoing):
        """Radiance that points send towards a viewer.

        Parameters
        ----------
        rows : (k,) int
            Points that have a map and face the viewer.
        outgoing : (k, 3) float32
            Unit vectors towards the viewer, in the world.

        Returns
        -------
        (k, 3) float32
        """
        result = np.empty((len(rows), 3), np.float32)
        flat, size = self._nodes.reshape(-1), N_NODES * N_NODES
        steps = np.arange(-1, 2, dtype=np.int32)
        around = (steps[:, None] * np.int32(N_NODES) + steps).reshape(9, 1)

        def one(first):
            some = slice(first, first + _LOOKED_UP)
            row, out = rows[some], outgoing[some]
            normal = self._normals.take(row, axis=0)
            cosine = np.einsum("kx,kx->k", out, normal)
            mirror = 2 * cosine[:, None] * normal - out
            frame = self._frames.take(self._group.take(row), axis=0)
            place = _on_disc(*np.einsum("kax,kx->ak", frame, mirror))
            node = np.rint(place).astype(np.int32)
            (down, right) = (_spline(part) for part in place - node)
            weights = (down[:, None] * right).reshape(9, -1)
            start = row.astype(np.int64) * (3 * size) + node[0] * N_NODES + node[1]
            index = start + around
            share = self._share_at(row, cosine) * self._scale.take(row, axis=0)
            for channel in range(3):
                values = flat.take(index + channel * size).astype(np.float32)
                values *= values
                values *= weights
                np.multiply(values.sum(axis=0), share[:, channel], out=result[some, channel])
            result[some] += self._bright.reflected(row, normal, out, cosine)

        on_all_cores(one, range(0, len(rows), _LOOKED_UP))
        return result

    def _share_at(self, rows, cosine):
        """(k, 3): what points reflect of light from all sides towards views along a cosine."""
        place = np.sqrt(np.clip(cosine, 0, 1)) * np.float32(_SHARES - 1)
        low = np.minimum(place.astype(np.int32), _SHARES - 2)
        index = self._kinds.take(rows) * np.int32(_SHARES) + low
        table = self._shares.reshape(-1, 3)
        below = table.take(index, axis=0)
        return below + (table.take(index + 1, axis=0) - below) * (place - low)[:, None]

    def _plan(self, groups, classes):
        """Which points are worked on together, about which normal, and with which lobes."""
        order, lobes = np.argsort(groups, kind="stable"), {}
        bounds = np.flatnonzero(np.diff(groups[order], prepend=-1, append=-1))
        for first, last in zip(bounds[:-1], bounds[1:], strict=True):
            kind, group = int(classes[order[first]]), groups[order[first]]
            if kind not in lobes:
                lobes[kind] = self._lobes_at(kind, self._views[:, 2])
            mine = self._rows[order[first:last]]
            mean = self._normals[mine].mean(axis=0, dtype=np.float64)
            self._frames[group] = tangent_frames(mean[None] / np.linalg.norm(mean))[0]
            starts = range(0, len(mine), _MADE)
            self._jobs += [(mine[f : f + _MADE], group, lobes[kind]) for f in starts]
        self.planned = self.left = len(self._jobs)

    def _fill_in(self, job):
        """Make the maps of some points of a group."""
        (mine, group, lobes), light, n = job, self._light, N_NODES
        frame = self._frames[group]
        there = np.flatnonzero(frame[2] @ light.directions > 0)
        weights, filter_ = light.weights(there, frame, self._views @ frame, lobes), _prefilter(n)
        for channel, weight in enumerate(weights):
            weight = filter_ @ weight.reshape(n, -1)
            weights[channel] = np.matmul(filter_, weight.reshape(n, n, -1)).reshape(n * n, -1)
        arriving = light.arriving(mine, there)
        if len(weights) == 1:
            nodes = arriving.reshape(-1, len(there)) @ weights[0].T
            nodes = nodes.reshape(len(mine), 3, -1)
        else:
            nodes = [arriving[:, k] @ weight.T for k, weight in enumerate(weights)]
            nodes = np.stack(nodes, axis=1)
        # Roots, in 255ths of the largest: as near where little is reflected.
        np.maximum(nodes, 0, out=nodes)
        most = np.maximum(nodes.max(axis=2), 1e-30)
        nodes *= (255.0**2 / most)[:, :, None]
        np.sqrt(nodes, out=nodes)
        self._nodes[mine] = np.rint(nodes, out=nodes)
        self._scale[mine] = most / np.float32(255.0**2)

    def _lobes_at(self, kind, cosine):
        """Lobes of a kind towards all nodes, in parts of what they reflect of even light."""
        groups = self._lobes_of(np.full(len(cosine), kind), cosine)
        place = np.sqrt(cosine) * (_SHARES - 1)
        share = np.stack(
            [np.interp(place, np.arange(_SHARES), s) for s in self._shares[kind].T], axis=1
        )
        share = np.maximum(share, 1e-12)[:, None]
        return [
            (alpha.astype(np.float32), (powers / share).astype(np.float32))
            for alpha, powers in groups
            if powers.any()
        ]


class _Light:
    """What arrives at points from the smallest blocks of a field."""

    def __init__(self, field, lobe=None):
        self._field, self._lobe, n = field, lobe, field.nodes.first[1]
        self.directions, self._angles = field.directions[:n].T, field.nodes.solid_angles[:n]
        self._whole = field.directions[:n, None], field.spread[:n, None], np.ones((n, 1))
        self._parts = self._whole
        side, cube_map = field.nodes.sides[0], field.light_map
        if cube_map.resolution % (2 * side) == 0:
            order = pieces(side, 2).T
            directions, spread = field_nodes(2 * side).placed(cube_map, field.mean_light)
            light = field.mean_light * cube_map.solid_angles
            share = Blocks(cube_map, 2 * side).sums(light + 1e-9 * light.mean() + 1e-30)[order]
            share /= share.sum(axis=1, keepdims=True)
            self._parts = directions[order], spread[order], share

    def weights(self, there, frame, views, lobes):
        """Of some blocks `there` (m,) for views (v, 3): (v, m) a channel, or of all at once."""
        grey = all((powers == powers[..., :1]).all() for _, powers in lobes)
        total = [np.zeros((len(views), len(there)), np.float32) for _ in range(1 if grey else 3)]
        grazes = views @ frame[2] < _GRAZING
        for some, (directions, spread, share) in ((~grazes, self._whole), (grazes, self._parts)):
            angles = (share[there] * self._angles[there, None]).ravel().astype(np.float32)
            ways = np.ascontiguousarray(directions[there].reshape(-1, 3).T)
            normals = np.broadcast_to(frame[2], (np.count_nonzero(some), 3))
            for alpha, powers in lobes:
                powers = powers[some]
                if self._lobe is None:
                    values = lobe_values(
                        ways, normals, views[some], alpha[some], None, powers_used(powers),
                        spread[there].ravel(),
                    )  # fmt: skip
                else:
                    values = [self._lobe(ways, normals, views[some])]
                for power, value in enumerate(values):
                    if powers[:, power].any():
                        value *= angles
                        value = value.reshape(len(value), len(there), -1).sum(axis=2)
                        for channel, weight in enumerate(total):
                            weight[some] += value * powers[:, power, channel, None]
        return total

    def arriving(self, rows, there):
        """(k, 3, m) float32 radiance from some blocks."""
        return wholes(self._field.values.take(rows, axis=0).take(there, axis=2))


def _on_disc(x, y, z):
    """Places (2, k) in a map of local directions, of components (k,); the disc fills it."""
    scale = np.float32((N_NODES - 1) / 2) / np.sqrt(1 + np.maximum(z, 0))
    place = np.stack([x, y]) * scale + np.float32((N_NODES - 1) / 2)
    # About each node but the outermost there are nine.
    return np.clip(place, 0.51, N_NODES - 1.51, out=place)


def _node_views():
    """(N_NODES^2, 3) float32: views that nodes stand for, in a local frame, above the horizon."""
    line = np.linspace(-1, 1, N_NODES)
    x, y = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
    squared = x * x + y * y
    cosine = np.maximum(1 - squared, _LEAST_COSINE)
    length = np.sqrt(1 - cosine * cosine) / np.maximum(np.sqrt(squared), 1e-9)
    return np.stack([-x * length, -y * length, cosine], axis=1).astype(np.float32)


def _spline(part):
    """(3, k): quadratic B-splines of the nodes before, at and after, `part` (k,) from the node."""
    return np.stack([0.5 * (0.5 - part) ** 2, 0.75 - part * part, 0.5 * (0.5 + part) ** 2])


@lru_cache(maxsize=1)
def _prefilter(n):
    """(n, n) float32: values at nodes to coefficients that pass through them, straight beyond."""
    values = 0.75 * np.eye(n) + 0.125 * (np.eye(n, k=1) + np.eye(n, k=-1))
    values[0, :2] += [0.25, -0.125]
    values[-1, -2:] += [-0.125, 0.25]
    return np.linalg.inv(values).astype(np.float32)


def _classes(kinds, cells, n_kinds, lobes_of, least):
    """Which points share lobes: (k,) kinds that stand for their own, and (k,) groups, or None."""
    every = np.arange(n_kinds)
    lobes = None
    for width, step in _STEPS:
        stands_for = every
        if n_kinds > _FEW:
            lobes = lobes or lobes_of(every, np.ones(n_kinds))
            steps = [
                np.column_stack([np.log(alpha) / width, powers[:, 0] / step])
                for alpha, powers in lobes
            ]
            steps = np.rint(np.concatenate(steps, axis=1)).astype(np.int64)
            _, first, which = np.unique(steps, axis=0, return_index=True, return_inverse=True)
            stands_for = first[which.ravel()]
        classes = stands_for[kinds]
        keys = classes * np.int64(6 * _CELLS * _CELLS) + cells
        found, groups = np.unique(keys, return_inverse=True)
        if len(found) * least <= len(kinds):
            return classes, groups
        if n_kinds <= _FEW:
            break
    return None, None


def _shares_of_kinds(n_kinds, lobes_of):
    """(n_kinds, _SHARES, 3) float32: what lobes reflect of even light, by the view's cosine."""
    shares = np.zeros((n_kinds, _SHARES, 3), np.float32)
    cosine = np.maximum(np.linspace(0, 1, _SHARES) ** 2, 1e-4).astype(np.float32)
    for first in range(0, n_kinds, 1024):
        kinds = np.arange(first, min(first + 1024, n_kinds))
        for alpha, powers in lobes_of(np.repeat(kinds, _SHARES), np.tile(cosine, len(kinds))):
            shape = len(kinds), _SHARES
            slider = np.sqrt(alpha).reshape(shape)
            place = (slider - _SLIDERS[0]) / (_SLIDERS[1] - _SLIDERS[0])
            place = np.clip(place, 0, len(_SLIDERS) - 1)
            low = np.minimum(place.astype(np.int32), len(_SLIDERS) - 2)
            part = (place - low)[..., None].astype(np.float32)
            table, column = white_shares(), np.arange(_SHARES)
            white = table[low, column] * (1 - part) + table[low + 1, column] * part
            own = powers.reshape(*shape, N_POWERS, 3)
            shares[kinds] += np.einsum("ksp,kspc->ksc", white, own)
    return shares


@lru_cache(maxsize=1)
def white_shares():
    """What white lobes times powers of the Fresnel term reflect of light from all sides.

    Returns
    -------
    (n_sliders, _SHARES, N_POWERS) float32
        By roughness and the cosine of the view.
    """
    cosines = np.maximum(np.linspace(0, 1, _SHARES) ** 2, 1e-4)
    shares = on_all_cores(lambda slider: ggx_power_albedos(slider, cosines), _SLIDERS)
    return np.stack(shares).astype(np.float32)
