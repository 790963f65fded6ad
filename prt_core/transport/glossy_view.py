"""What microfacet lobes reflect of the field of incoming light towards a view.

For each point that faces the viewer the lobe is evaluated at the blocks of a cut (see
`transport.lobe_cuts`), as a mean over where their light comes from, and multiplied with the field;
close to the mirror direction of narrow lobes the light of the sky has its finer detail, as far as
the block is open; and the brightest texels come in by their own visibility bits. The lobe's Fresnel
term is a sum of powers, so that all lobes of one roughness are evaluated together.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_used
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap
from prt_core.transport.lobe_cuts import cells, lobe_cut, parts_along
from prt_core.transport.lobe_values import lobe_values

# Points worked on at once: what belongs to them stays in the cache.
_PART = 512
# Classes of roughness: each ends at this times the alpha at which it begins.
_CLASS = 1.6
_STEP = 0.1
# Lobes are as wide as twice their alpha, in radians, and not wider than this.
_WIDEST = 0.5
# Cosines between view and normal below which lobes count as narrower, and by how much.
_GRAZING, _NARROWER = (0.2, 0.45), (0.35, 0.7, 1.0)


class GlossyView:
    """Lobes over the field of incoming light of a bake.

    Parameters
    ----------
    field : IncomingField
    normals : (n, 3) float32
        Of the points of the field.
    """

    def __init__(self, field, normals):
        self.field = field
        self.normals = np.ascontiguousarray(normals, np.float32)
        self._side = field.reflections.blocks.side

    def reflected(self, rows, outgoing, alpha, powers, axes=None, normals=None, lobe=None):
        """Radiance that lobes send towards a viewer.

        Parameters
        ----------
        rows : (k,) int
            Points of the field, in any order and number; what faces away from the viewer sends
            nothing.
        outgoing : (k, 3) float32
            Unit vectors towards the viewer, in the world.
        alpha : (k,) or (k, 2) float
            Of the lobes; two of them along and across a tangent.
        powers : (k, N_POWERS, 3) float32
            Fresnel term of the lobes (see `fresnel_powers`).
        axes : (k, 2, 3) float32, optional
            Tangents, where there are two alphas.
        normals : (k, 3) float32, optional
            Of places beside the points, whose fields they take; default: those of the points.
        lobe : callable(directions, normals, outgoing) -> (p, m) float32, optional
            Another lobe times the cosine than that of microfacets, about as wide as `alpha` says:
            of (3, m) directions, (p, 3) normals and (p, 3) ways to the viewer, all float32. Of the
            powers the first alone counts.

        Returns
        -------
        (k, 3) float32
        """
        outgoing = np.asarray(outgoing, np.float32)
        alpha = np.asarray(alpha, np.float32)
        normals = self.normals[rows] if normals is None else np.asarray(normals, np.float32)
        facing = np.einsum("nx,nx->n", normals, outgoing)
        result = np.zeros((len(rows), 3), np.float32)
        seen = np.flatnonzero((facing > 0) & powers.any(axis=(1, 2)))
        if not len(seen):
            return result
        mirror = 2 * facing[seen, None] * normals[seen] - outgoing[seen]
        around = CubeMap(cells(self._side, len(seen)))
        cell = around.texel_along(*mirror.T)
        least = alpha[seen]
        if alpha.ndim == 2:
            # Stretched lobes turn, and so need more.
            least, most = least.min(axis=1), least.max(axis=1)
            least = least * (least / most) ** np.float32(0.25)
        slant = np.digitize(facing[seen], _GRAZING)
        width = np.minimum(2 * least, _WIDEST) * np.float32(_NARROWER)[slant]
        width = np.log(width)
        kind = np.floor(width / np.log(_CLASS)).astype(np.int64)
        key = (kind - kind.min()) * around.n_directions + cell
        order = np.argsort(key, kind="stable")
        bounds = np.flatnonzero(np.diff(key[order], prepend=-1, append=-1))
        n_powers = powers_used(powers) if lobe is None else 1
        # Side by side, so that each group is a slice.
        chosen, width, cell = seen[order], width[order], cell[order]
        rows, normals, outgoing, alpha = (
            array.take(chosen, axis=0) for array in (np.asarray(rows), normals, outgoing, alpha)
        )
        powers = powers[:, :n_powers].take(chosen, axis=0)
        axes = None if axes is None else axes.take(chosen, axis=0)
        ordered, jobs = np.empty((len(chosen), 3), np.float32), []
        for first, last in zip(bounds[:-1], bounds[1:], strict=True):
            # In steps, so that cuts are found again.
            least = float(np.exp(_STEP * np.floor(width[first:last].min() / _STEP)))
            which = around.resolution, int(cell[first])
            places = self._places(which, least, normals[first:last])
            jobs += [(places, slice(f, min(f + _PART, last))) for f in range(first, last, _PART)]

        def one(job):
            places, some = job
            frame = None if axes is None else axes[some]
            ways = places.directions, normals[some], outgoing[some]
            if lobe is None:
                values = lobe_values(*ways, alpha[some], frame, n_powers, places.spread)
            else:
                values = [lobe(*ways)]
            terms = self._terms(places, rows[some], values)
            np.einsum("pkc,pkc->pc", terms, powers[some], out=ordered[some])

        on_all_cores(one, jobs)
        result[chosen] = ordered
        return result

    def _places(self, cell, width, normals):
        """The `Places` of lobes about mirror directions in a cell, above any of the horizons.

        `cell` is how many there are along an edge, and which of them.
        """
        parts = parts_along(self._side, width, self.field.light_map.resolution)
        mean = normals.mean(axis=0)
        mean /= max(float(np.sqrt(mean @ mean)), 1e-6)
        # As far below the horizon of the mean normal others may still be above theirs.
        lowest = -np.sqrt(max(1 - float((normals @ mean).min()) ** 2, 0)) - 1e-6
        return self.field.places(lobe_cut(self._side, *cell, width, parts)).above(mean, lowest)

    def _terms(self, places, rows, lobe):
        """(p, n_powers, 3): what each power of the Fresnel term brings."""
        field, n_blocks = self.field, len(places.core)
        n_core, n_nodes = n_blocks * places.n_parts, len(places.nodes)
        n_bright = len(field.apart.spread)
        weights = np.empty((len(rows), n_blocks + n_nodes + n_bright, len(lobe)), np.float32)
        if n_core:
            shared = field.open[rows[:, None], places.core] * np.float32(1 / 255)
            detail = np.empty((len(lobe), len(rows), 3), np.float32)
        for power, values in enumerate(lobe):
            values *= places.solid_angles
            weights[:, n_blocks:, power] = values[:, n_core:]
            if n_core:
                parts = values[:, :n_core].reshape(-1, places.n_parts, n_blocks)
                parts.sum(axis=1, out=weights[:, :n_blocks, power])
                parts *= shared[:, None]
                detail[power] = values[:, :n_core] @ places.detail
        columns = np.concatenate([places.core, places.nodes])
        columns = (np.arange(3)[:, None] * len(field.nodes) + columns).ravel()
        near = field.values.reshape(len(field.values), -1).take(rows, axis=0).take(columns, axis=1)
        light = np.empty((len(rows), 3, weights.shape[1]), np.float32)
        light[..., : n_blocks + n_nodes] = wholes(near).reshape(len(rows), 3, -1)
        light[..., n_blocks + n_nodes :] = wholes(field.apart.values.take(rows, axis=0))
        brought = np.matmul(light, weights).swapaxes(1, 2)
        if n_core:
            brought += detail.swapaxes(0, 1)
        return np.maximum(brought, 0, out=brought)
