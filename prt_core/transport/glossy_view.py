"""What microfacet lobes reflect of the field of incoming light towards a view.

For each point that faces the viewer the lobe is evaluated at the directions of a cut (see
`transport.lobe_cuts`) and multiplied with the field; within the blocks around the mirror direction
the light of the sky has its finer detail, as far as the block is open; and the brightest texels
come in by their own visibility bits. The lobe's Fresnel term is a sum of powers, so that all
lobes of one roughness are evaluated together.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_used
from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.transport.lobe_cuts import cells, lobe_cut, parts_along
from prt_core.transport.lobe_values import lobe_values

# Points worked on at once: what belongs to them stays in the cache.
_PART = 1024
# Classes of roughness: each ends at this times the alpha at which it begins.
_CLASS = 1.6


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
        self._cells = cells(self._side)

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
        cell = self._cells.texel_along(*mirror.T)
        widest = alpha[seen] if alpha.ndim == 1 else alpha[seen].max(axis=1)
        kind = np.floor(np.log(widest) / np.log(_CLASS)).astype(np.int64)
        key = (kind - kind.min()) * self._cells.n_directions + cell
        order = np.argsort(key, kind="stable")
        bounds = np.flatnonzero(np.diff(key[order], prepend=-1, append=-1))
        n_powers = powers_used(powers) if lobe is None else 1
        details, jobs = {}, []
        bright = self.field.bright_directions.T.astype(np.float32)
        for first, last in zip(bounds[:-1], bounds[1:], strict=True):
            group = seen[order[first:last]]
            among = widest[order[first:last]]
            parts = self._parts(float(among.min()), details)
            # In steps of 5 %, so that cuts are found again.
            largest = 1.05 ** np.ceil(np.log(float(among.max())) / np.log(1.05))
            cut = lobe_cut(self._side, int(cell[order[first]]), largest, parts)
            cut = cut.above(normals[group])
            jobs += [(cut, parts, group[f : f + _PART]) for f in range(0, len(group), _PART)]

        def one(job):
            cut, parts, some = job
            detail = details[parts]
            frame = None if axes is None else axes[some]
            directions = np.concatenate([cut.directions, bright], axis=1)
            ways = directions, normals[some], outgoing[some]
            if lobe is None:
                values = lobe_values(*ways, alpha[some], frame, n_powers)
            else:
                values = [lobe(*ways)]
            terms = self._terms(cut, detail, rows[some], values)
            result[some] = np.einsum("pkc,pkc->pc", terms, powers[some, :n_powers])

        on_all_cores(one, jobs)
        return result

    def _parts(self, alpha, details):
        """Parts along a block's edge, whose detail of the light is added where it is missing."""
        parts = parts_along(self._side, alpha, self.field.light_map.resolution)
        if parts not in details:
            details[parts] = self.field.detail(parts)
        return parts

    def _terms(self, cut, detail, rows, lobe):
        """(p, n_powers, 3): what each power of the Fresnel term brings."""
        field, n_cut = self.field, cut.directions.shape[1]
        n_blocks, n_core, n_far = len(cut.core), cut.n_core, len(cut.far)
        n_near = n_blocks + len(cut.ring)
        blocks = np.empty((len(rows), n_near + n_far, len(lobe)), np.float32)
        apart = np.empty((len(lobe), len(rows), 3), np.float32)
        seen = field.bright_seen(rows).astype(np.float32)
        shared = None
        if cut.n_parts > 1:
            shared = field.open[rows[:, None], cut.core] * np.float32(1 / 255)
            detail = detail[:, cut.core].reshape(n_core, 3)
        for power, weights in enumerate(lobe):
            apart[power] = (weights[:, n_cut:] * seen) @ field.bright_light
            weights = weights[:, :n_cut]
            weights *= cut.solid_angles
            total = weights[:, :n_blocks]
            if shared is not None:
                parts = [
                    weights[:, first : first + n_blocks] for first in range(0, n_core, n_blocks)
                ]
                total = sum(parts[1:], parts[0])
                for part in parts:
                    part *= shared
                apart[power] += weights[:, :n_core] @ detail
            blocks[:, :n_blocks, power] = total
            blocks[:, n_blocks:, power] = weights[:, n_core:]
        near = field.values[rows].take(np.concatenate([cut.core, cut.ring]), axis=2)
        terms = np.matmul(wholes(near), blocks[:, :n_near])
        if n_far:
            far = field.coarse[rows].take(cut.far, axis=2)
            terms += np.matmul(wholes(far), blocks[:, n_near:])
        terms = terms.swapaxes(1, 2) + apart.swapaxes(0, 1)
        return np.maximum(terms, 0, out=terms)
