"""What microfacet lobes reflect of the field of incoming light towards a view.

For each point that faces the viewer the lobe is evaluated at the directions of a cut (see
`transport.lobe_cuts`) and multiplied with the field; within the blocks around the mirror direction
the light of the sky has its finer detail, as far as the block is open; and the brightest texels
come in by their own visibility bits. The lobe's Fresnel term is a sum of powers, so that all
lobes of one roughness are evaluated together.
"""

import numpy as np

from prt_core.runtime.halves import wholes
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import sobol_points, square_to_ggx_normals, tangent_frames
from prt_core.transport.lobe_cuts import cells, lobe_cut, parts_along

# Facets that a glimpse takes of each lobe, and points of one at once.
_FACETS, _MANY = 4, 1 << 13
# Points worked on at once: what belongs to them stays in the cache.
_PART = 1024
# Least alpha of what is met: one point stands for all that is met in a block, and its lobe for
# theirs.
_LEAST = np.float32(0.1)
# Least cosine of a view of a glimpse: smooth normals may face away from who sees the surface.
_GRAZING = 0.05
# Shifts of a sequence that are spread evenly, one after the other.
_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
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
        n_powers = _n_powers(powers) if lobe is None else 1
        details, jobs = {}, []
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
            ways = self._directions(cut), normals[some], outgoing[some]
            if lobe is None:
                values = _evaluated(*ways, alpha[some], frame, n_powers)
            else:
                values = [lobe(*ways)]
            terms = self._terms(cut, detail, rows[some], values)
            result[some] = np.einsum("pkc,pkc->pc", terms, powers[some, :n_powers])

        on_all_cores(one, jobs)
        return result

    def glimpse(self, rows, outgoing, alpha, powers):
        """About what lobes send: quick, and right in the mean over many points and directions.

        A few facets of each lobe mirror the blocks that they face; bright texels are exact.

        Parameters
        ----------
        rows, outgoing, alpha, powers
            As `reflected` takes them.

        Returns
        -------
        (k, 3) float32
        """
        field, result = self.field, np.zeros((len(rows), 3), np.float32)
        blocks = field.reflections.blocks
        bright = np.ascontiguousarray(field.bright_directions.T, np.float32)
        n_powers = _n_powers(powers)
        places = sobol_points(int(np.log2(_FACETS))).astype(np.float32)

        def one(first):
            part = slice(first, first + _MANY)
            some = rows[part]
            ways = _lifted(outgoing[part], self.normals[some])
            width = alpha[part] if alpha.ndim == 1 else np.sqrt(alpha[part].prod(axis=1))
            width = np.maximum(width, _LEAST)
            frames = tangent_frames(self.normals[some]).astype(np.float32)
            view = np.einsum("kx,kax->ka", ways, frames)
            # Each point has a shift of its own, so that errors go away in the mean.
            shift = np.arange(first, first + len(some))[:, None] * _GOLDEN % 1
            uv = (places + shift[:, None].astype(np.float32)) % np.float32(1)
            lobe = width[:, None]
            facets = square_to_ggx_normals(uv, view[:, None], lobe, lobe)
            cosine = np.einsum("ka,kfa->kf", view, facets)
            incoming = 2 * cosine[..., None] * facets - view[:, None]
            own, other = (
                np.sqrt(1 + lobe**2 * np.maximum(1 / np.maximum(z, 1e-3) ** 2 - 1, 0))
                for z in (view[:, None, 2], incoming[..., 2])
            )
            weight = np.where(incoming[..., 2] > 0, (1 + own) / (own + other), 0) / _FACETS
            world = np.matmul(incoming, frames)
            block = blocks.along(*np.moveaxis(world, -1, 0))
            light = wholes(field.values[some[:, None], :, block])
            rest = np.clip(1 - cosine, 0, 1)
            each = np.ones_like(rest), rest**5, rest**3, cosine * rest**6
            each = np.stack(each[:n_powers], axis=2) * weight[..., None]
            factor = np.matmul(each, powers[part, :n_powers])
            result[part] = (light * np.maximum(factor, 0)).sum(axis=1)
            if bright.size:
                seen = field.bright_seen(some)
                lobes = _evaluated(bright, self.normals[some], ways, width, None, n_powers)
                terms = np.stack([(lobe * seen) @ field.bright_light for lobe in lobes], axis=1)
                result[part] += np.einsum("kpc,kpc->kc", terms, powers[part, :n_powers])

        on_all_cores(one, range(0, len(rows), _MANY))
        return result

    def _parts(self, alpha, details):
        """Parts along a block's edge, whose detail of the light is added where it is missing."""
        parts = parts_along(self._side, alpha, self.field.light_map.resolution)
        if parts not in details:
            details[parts] = self.field.detail(parts)
        return parts

    def _directions(self, cut):
        """(3, m + n_bright) float32: those of the cut, and of the bright texels."""
        bright = self.field.bright_directions
        return np.concatenate([cut.directions, bright.T.astype(np.float32)], axis=1)

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


def _n_powers(powers):
    """How many powers of the Fresnel term any lobe has, the first ones."""
    return 1 + int(np.flatnonzero(powers.any(axis=(0, 2))).max(initial=0))


def _lifted(directions, normals):
    """Directions (k, 3) lifted to `_GRAZING` above the surface where they are below that."""
    cosine = np.einsum("kx,kx->k", directions, normals)[:, None]
    lifted = directions + np.maximum(_GRAZING - cosine, 0) * normals
    return (lifted / np.linalg.norm(lifted, axis=1, keepdims=True)).astype(np.float32)


def _evaluated(directions, normals, outgoing, alpha, axes, n_powers):
    """Lobes times the cosine, times powers of Schlick's kind: (p, m) each.

    Those of `fresnel_powers`, of the cosine between light and facet.

    Parameters
    ----------
    directions : (3, m) float32
    normals, outgoing : (p, 3) float32
    alpha : (p,) or (p, 2) float32
    axes : (p, 2, 3) float32, or None
    n_powers : int
    """
    cosine = normals @ directions
    np.maximum(cosine, 0, out=cosine)
    height = np.einsum("px,px->p", normals, outgoing)[:, None]
    # Squared length of the sum of both directions: 4 times the squared cosine with the facet.
    squared = outgoing @ directions
    squared += 1
    squared *= 2
    np.maximum(squared, 1e-6, out=squared)
    along = cosine + height
    along *= along
    if axes is None:
        square = (alpha * alpha)[:, None]
        stretched = cosine * cosine
        stretched *= 1 - square
        stretched += square
        masked_own = np.sqrt(square + (1 - square) * height * height)
        along *= square - 1
        along += squared
        scale = square
    else:
        along, stretched, masked_own, scale = _stretched(
            directions, outgoing, alpha, axes, along, cosine, height
        )
    # Below the horizon, where nothing counts, it can be 0.
    np.maximum(along, 1e-12, out=along)
    np.sqrt(stretched, out=stretched)
    stretched *= height
    masked = cosine * masked_own
    masked += stretched
    # Below the horizon, where nothing counts, it can be 0.
    np.maximum(along, 1e-12, out=along)
    value = np.divide(squared, along, out=along)
    value *= value
    value /= masked
    value *= cosine
    value *= scale / (2 * np.pi)
    lobes = [value]
    if n_powers > 1:
        facet = np.sqrt(squared, out=squared)
        facet *= 0.5
        rest = 1 - facet
        np.maximum(rest, 0, out=rest)
        fifth = rest * rest
        fifth *= fifth
        fifth *= rest
        fifth *= value
        lobes.append(fifth)
        if n_powers > 2:
            third = rest * rest
            third *= rest
            third *= value
            lobes.append(third)
        if n_powers > 3:
            rest *= facet
            rest *= fifth
            lobes.append(rest)
    return lobes


def _stretched(directions, outgoing, alpha, axes, along, cosine, height):
    """What an anisotropic lobe has in place of an isotropic one's terms."""
    alpha_x, alpha_y = (a[:, None] for a in alpha.T)
    product = alpha_x * alpha_y
    stretched, own = cosine * cosine, height * height
    along *= product
    for axis, width, other in zip(axes.swapaxes(0, 1), (alpha_x, alpha_y), (alpha_y, alpha_x),
                                  strict=True):  # fmt: skip
        there, here = axis @ directions, np.einsum("px,px->p", axis, outgoing)[:, None]
        half = there + here
        half *= half
        half *= other / width
        along += half
        there *= width
        there *= there
        stretched += there
        own = own + (width * here) ** 2
    return along, stretched, np.sqrt(own), product
