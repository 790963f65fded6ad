"""Glossy points whose fields have blocks of one size: their lobes, and which of them are seen."""

import numpy as np

from prt_core.reflectance import principled_lobes
from prt_core.reflectance.fresnel_powers import N_POWERS, fresnel_powers
from prt_core.reflectance.view_factors import ViewFactors
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.incoming_field import IncomingField
from prt_core.transport.mirror import Mirror

# Lobes of a smaller alpha are mirrors: in parts of half the width of a texel.
_TEXELS = 0.6
# What reflects so much of the light that comes straight is metal to others that see it.
_METAL = 0.15
# Blocks along an edge with which no lobe is narrow.
_WIDE = 8


class GlossyPoints:
    """What glossy points of a bake reflect.

    Parameters
    ----------
    bake : Bake
    reflections : Reflections

    Attributes
    ----------
    points : (n,) int32
        The bake points.
    field : IncomingField
    """

    def __init__(self, bake, reflections):
        points, which = bake.scene.points, reflections.points
        self.points = which
        self.field = IncomingField(reflections, bake.transport.bits)
        self._normals = points.normals[which]
        self._view = GlossyView(self.field, self._normals)
        self._mirror = Mirror(self.field, bake.transport.bits)
        self._materials = points.materials[which]
        lobes = principled_lobes(self._materials)
        self._frames = lobes.frames(self._normals).astype(np.float32)
        self._factors = ViewFactors(self._materials)
        self._narrowest = np.float32(_TEXELS * np.pi / 4 / bake.cube_map.resolution)
        # Wide lobes need no detail of the light.
        self._is_wide = reflections.blocks.side <= _WIDE
        # Those below a coat have one roughness; a coat has its own.
        self._groups = [
            group
            for group in (
                _Group(lobes, ("metal", "dielectric", "glossy")),
                _Group(lobes, ("coat",)),
            )
            if group.lobes
        ]

    def light(self, texels, sent, sky=None, by_entry=None, detailed=None):
        """Take in a light, as `IncomingField.update` and `Mirror.update` do."""
        self.field.update(texels, sent, by_entry, None if self._is_wide else detailed)
        self._mirror.update(texels, sent, sky, by_entry)

    def strength(self):
        """(n,) float32: how much is reflected straight back, at most of the channels."""
        result = np.zeros(len(self.points), np.float32)
        for group in self._groups:
            for powers in group.lobes.values():
                result += powers[:, 0].max(axis=1)
        return result

    def facing(self, outgoing):
        """Rows of the points that face the viewer, of directions (n, 3)."""
        return np.flatnonzero(np.einsum("nx,nx->n", outgoing, self._normals) > 0)

    def toward(self, rows, outgoing):
        """What points reflect.

        Parameters
        ----------
        rows : (k,) int
            Of the points; one may come more than once.
        outgoing : (k, 3) float32
            Towards the viewer, in the world.

        Returns
        -------
        reflected : (k, 3) float32
        diffuse : (k, 3) float32
            What is left of diffuse light, in parts of that of the view from straight above.
        """
        result, factors = np.zeros((len(rows), 3), np.float32), self._seen(rows, outgoing)
        for group in self._groups:
            powers = group.seen(rows, factors)
            result += self._reflected(rows, outgoing, group.alpha[rows], powers)
        return result, factors["diffuse"]

    def glimpse(self, rows, outgoing):
        """(k, 3) float32: about what points by `rows` (k,) reflect along `outgoing` (k, 3)."""
        result, factors = np.zeros((len(rows), 3), np.float32), self._seen(rows, outgoing)
        for group in self._groups:
            powers = group.seen(rows, factors)
            result += self._view.glimpse(rows, outgoing, group.alpha[rows], powers)
        return result

    def _seen(self, rows, outgoing):
        cosine = np.einsum("kx,kx->k", outgoing, self._normals[rows])
        return self._factors.at(rows, cosine)

    def _reflected(self, rows, outgoing, alpha, powers):
        result = np.zeros((len(rows), 3), np.float32)
        narrow = alpha.max(axis=1) < self._narrowest
        even = ~narrow & (alpha[:, 0] == alpha[:, 1])
        brushed = ~narrow & ~even
        if narrow.any():
            normals = self._normals[rows[narrow]]
            work = rows[narrow], normals, outgoing[narrow], powers[narrow]
            result[narrow] = self._mirror.reflected(*work)
        if even.any():
            work = rows[even], outgoing[even], alpha[even, 0], powers[even]
            result[even] = self._view.reflected(*work)
        if brushed.any():
            widths = np.maximum(alpha[brushed], self._narrowest)
            work = rows[brushed], outgoing[brushed], widths, powers[brushed]
            result[brushed] = self._view.reflected(*work, self._frames[rows[brushed], :2])
        return result

    def highlights(self, lamp, received, world, rows, outgoing):
        """What lobes reflect of a lamp, as wide as the lamp looks.

        Parameters
        ----------
        lamp : Lamp or BrightPixels
        received : (n_points, 3) float32
            What all bake points receive of it: irradiance / pi.
        world : (n_points, 3) float
            Their places.
        rows : (k,) int
            Of the points, which face the viewer.
        outgoing : (k, 3) float32
            Towards the viewer.

        Returns
        -------
        (k, 3) float32
        """
        result = np.zeros((len(rows), 3), np.float32)
        received = received[self.points[rows]]
        lit = np.flatnonzero(received.any(axis=1))
        if not len(lit):
            return result
        rows = rows[lit]
        direction, angle = lamp.seen_from(world[self.points[rows]])
        # A facet that turns by an angle turns what it mirrors by two: half of it, in the mean.
        spread = angle / 2 / np.sqrt(2)
        materials = self._materials[rows]
        widened = {
            name: np.minimum(np.sqrt(np.hypot(getattr(materials, name)[:, 0] ** 2, spread)), 1)
            for name in ("roughness", "coat_roughness")
        }
        widened = {name: values[:, None] for name, values in widened.items()}
        lobes = principled_lobes(materials.replaced(**widened))
        frames = self._frames[rows].astype(np.float64)
        incoming, view = (
            np.einsum("nx,nkx->nk", ways, frames)[:, None] for ways in (direction, outgoing[lit])
        )
        result[lit] = np.pi * received[lit] * lobes.eval(incoming, view)[:, 0]
        return result


class _Group:
    """Lobes that have the same roughness at each point.

    Attributes
    ----------
    lobes : dict of str -> (n, N_POWERS, 3) float32
        Their Fresnel terms.
    alpha : (n, 2) float32
    """

    def __init__(self, lobes, names):
        n = lobes.n_points
        self.lobes, self.alpha = {}, np.ones((n, 2), np.float32)
        for lobe in lobes.lobes:
            if lobe.name in names:
                powers = np.zeros((n, N_POWERS, 3), np.float32)
                powers[lobe.rows] = fresnel_powers(lobe.reflectance.fresnel) * lobe.weight
                self.lobes[lobe.name] = powers
                alphas = lobe.reflectance.alpha_x, lobe.reflectance.alpha_y
                self.alpha[lobe.rows] = np.concatenate(alphas, axis=1)

    def seen(self, rows, factors):
        """(k, N_POWERS, 3) float32 of points by `rows`, times the `factors` of their lobes."""
        return sum(values[rows] * factors[name][:, None] for name, values in self.lobes.items())


class SeenMetal:
    """Where reflections see points that reflect as much as metals do, and from where.

    Parameters
    ----------
    parts : list of GlossyPoints
    n_points : int

    Attributes
    ----------
    part, row : (k,) int
        Whose points they are, and which.
    outgoing : (k, 3) float32
        From there to who sees it.
    entries : list of (int array, slice)
        Of each part the entries of its reflections that see one, and which these are.
    """

    def __init__(self, parts, n_points):
        owner = np.full(n_points + 2, -1, np.int32)
        row = np.zeros(n_points + 2, np.int64)
        for index, part in enumerate(parts):
            strong = np.flatnonzero(part.strength() > _METAL)
            owner[part.points[strong]], row[part.points[strong]] = index, strong
        met, ways, self.entries, first = [], [], [], 0
        for part in parts:
            reflections = part.field.reflections
            # Negative numbers, of what returns no light, count from the end: of no part.
            entries = np.flatnonzero(owner[reflections.met] >= 0)
            met.append(reflections.met[entries])
            directions = reflections.blocks.directions[reflections.block[entries]]
            ways.append(-directions.astype(np.float32))
            self.entries.append((entries, slice(first, first + len(entries))))
            first += len(entries)
        met = np.concatenate(met)
        self.part, self.row, self.outgoing = owner[met], row[met], np.concatenate(ways)

    def __len__(self):
        return len(self.row)
