"""The lobes of glossy points, and those of places between them, towards a view."""

import numpy as np

from prt_core.reflectance import Materials, local_frames, principled_lobes
from prt_core.reflectance.fresnel_powers import N_POWERS, fresnel_powers
from prt_core.reflectance.view_factors import ViewFactors

# Lobes below a coat have one roughness; a coat has its own.
_GROUPS = ("metal", "dielectric", "glossy"), ("coat",)


class PointLobes:
    """Lobes of glossy points.

    Row -1 is of what has no gloss.

    Parameters
    ----------
    materials : Materials
        Of n points.
    normals : (n, 3) float32

    Attributes
    ----------
    normals : (n, 3) float32
    frames : (n, 3, 3) float32
        Tangents and normals (see `local_frames`).
    rough : (n + 1,) float32
        Roughness of their diffuse lobes.
    facets : (n + 1, 3) float32
        Colour of the facets of these.
    groups : list of LobeGroup
        Lobes of one roughness, those that any point has.
    """

    def __init__(self, materials, normals):
        matte = Materials(albedo=np.zeros((1, 3)))
        lobes = principled_lobes(Materials.joined([materials, matte]))
        self._differ = bool(materials.differing())
        self.normals = normals
        self.frames = lobes.frames(np.concatenate([normals, [[0, 0, 1]]]))[:-1].astype(np.float32)
        self._factors = ViewFactors(Materials.joined([materials, matte]))
        self.rough = np.zeros(lobes.n_points, np.float32)
        self.facets = np.zeros((lobes.n_points, 3), np.float32)
        for lobe in lobes.lobes:
            if lobe.name == "diffuse":
                self.rough[lobe.rows] = lobe.reflectance.diffuse_roughness[..., 0]
                self.facets[lobe.rows] = lobe.reflectance.colour[:, 0]
        self.groups = [LobeGroup(lobes, names) for names in _GROUPS]
        self.groups = [group for group in self.groups if group.lobes]

    def strength(self):
        """(n,) float32: how much is reflected straight back, at most of the channels."""
        result = np.zeros(len(self.normals), np.float32)
        for group in self.groups:
            for powers in group.lobes.values():
                result += powers[:-1, 0].max(axis=1)
        return result

    def at(self, rows, cosine):
        """The lobes of points towards a view.

        Parameters
        ----------
        rows : (k,) int
        cosine : (k,) float
            Between view and normal.

        Returns
        -------
        groups : list of (alpha, powers)
            Of lobes that have one roughness: (k, 2), and (k, N_POWERS, 3) of their Fresnel terms
            (see `fresnel_powers`).
        diffuse : (k, 3) float32
            What is left of diffuse light, in parts of that of the view from straight above.
        """
        factors = self._factors.at(rows, cosine)
        groups = []
        for group in self.groups:
            powers = sum(
                values[rows] * factors[name][:, None] for name, values in group.lobes.items()
            )
            groups.append((group.alpha[rows], powers))
        return groups, factors["diffuse"]

    def diffuse(self, rows, cosine):
        """(k, 3) float32: what is left of diffuse light alone, as `at` has it."""
        return self._factors.at(rows, cosine, ("diffuse",))["diffuse"]

    def kinds(self):
        """Points that have the same lobes, but for the axes of these.

        Returns
        -------
        kinds : (n,) int32
            Equal for equal lobes.
        first : (n_kinds,) int64
            A point of each kind.
        least : (n,) float32
            The smallest alpha of any lobe of each point; 0 where one is stretched.
        """
        n = len(self.normals)
        names = [name for group in self.groups for name in group.lobes]
        columns, least = [self._factors.labels(names)[:n]], np.ones(n, np.float32)
        for group in self.groups:
            alpha, powers = group.alpha[:n], [each[:n] for each in group.lobes.values()]
            width = np.where(alpha[:, 0] == alpha[:, 1], alpha[:, 0], np.float32(0))
            there = np.any([each.any(axis=(1, 2)) for each in powers], axis=0)
            least = np.where(there, np.minimum(least, width), least)
            columns += [alpha, *(each.reshape(n, -1) for each in powers)]
        # Equal rows, and as good as only those, have equal products with a random vector.
        columns = np.concatenate(columns, axis=1).astype(np.float64)
        way = np.random.default_rng(0).uniform(1, 2, columns.shape[1])
        _, first, kinds = np.unique(columns @ way, return_index=True, return_inverse=True)
        return kinds.ravel().astype(np.int32), first, least

    def between(self, rows, weights, cosine):
        """The lobes of places between points, as `at` has those of points.

        Fresnel terms are means; so is the roughness, of the points that have such a lobe.

        Parameters
        ----------
        rows : (k, m) int
        weights : (k, m) float32
            Sum to 1.
        cosine : (k,) float
            Between view and normal of the places.
        """
        if not self._differ and (rows >= 0).all():
            return self.at(rows[:, 0], cosine)
        groups, diffuse = None, 0
        for column, weight in zip(rows.T, weights.T, strict=True):
            here, share = self.at(column, cosine)
            diffuse = diffuse + share * weight[:, None]
            if groups is None:
                groups = [[0, 0, np.float32(1e-30)] for _ in here]
            for group, (alpha, powers) in zip(groups, here, strict=True):
                own = weight * powers.any(axis=(1, 2)) + np.float32(1e-12) * (column >= 0)
                group[0] = group[0] + np.sqrt(alpha) * own[:, None]
                group[1] = group[1] + powers * weight[:, None, None]
                group[2] = group[2] + own
        return [((a / own[:, None]) ** 2, powers) for a, powers, own in groups], diffuse

    def frames_between(self, rows, weights, normals):
        """(k, 3, 3) float32: frames of places between points `rows` (k, m), about their normals."""
        tangents = np.einsum("km,kmx->kx", weights * (rows >= 0), self.frames[rows, 0])
        return local_frames(normals, tangents).astype(np.float32)


class LobeGroup:
    """Lobes that have the same roughness at each point.

    Parameters
    ----------
    principled : PrincipledLobes
        Of n points, and of what has no gloss.
    names : sequence of str
        Of lobes.

    Attributes
    ----------
    lobes : dict of str -> (n + 1, N_POWERS, 3) float32
        Their Fresnel terms, by name.
    alpha : (n + 1, 2) float32
    """

    def __init__(self, principled, names):
        n = principled.n_points
        self.lobes, self.alpha = {}, np.ones((n, 2), np.float32)
        for lobe in principled.lobes:
            if lobe.name in names:
                powers = np.zeros((n, N_POWERS, 3), np.float32)
                powers[lobe.rows] = fresnel_powers(lobe.reflectance.fresnel) * lobe.weight
                self.lobes[lobe.name] = powers
                alphas = lobe.reflectance.alpha_x, lobe.reflectance.alpha_y
                self.alpha[lobe.rows] = np.concatenate(alphas, axis=1)
