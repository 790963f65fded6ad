"""Glossy points whose fields have blocks of one size: their lobes, and which of them are seen."""

import numpy as np

from prt_core.relight.highlights import POWER, highlights
from prt_core.relight.point_lobes import PointLobes
from prt_core.runtime.threads import on_all_cores
from prt_core.transport.glimpse import LEAST, Glimpses, lifted
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.incoming_field import IncomingField
from prt_core.transport.mirror import Mirror
from prt_core.transport.rough_diffuse import rough_share
from prt_core.transport.view_map import ViewMap

# Lobes of a smaller alpha are mirrors: in parts of half the width of a texel.
_TEXELS = 0.6
# What reflects so much of the light that comes straight is metal to others that see it.
METAL = 0.15
# Sights of metal in metal whose highlights are worked out at once.
_SIGHTS = 1 << 13
# Blocks along an edge with which no lobe is narrow, and the least alpha of lobes that have maps.
_WIDE, _LEAST_MAPPED = 8, 0.16


class GlossyPoints:
    """What glossy points of a bake reflect.

    Parameters
    ----------
    bake : Bake
    reflections : Reflections
    lobes : PointLobes
        Of the glossy points of the bake.
    first : int
        Its row of the first of these.

    Attributes
    ----------
    points : (n,) int32
        The bake points.
    field : IncomingField
    narrowest : float
        Alpha below which a lobe is taken for a mirror.
    """

    def __init__(self, bake, reflections, lobes, first=0):
        points, which = bake.scene.points, reflections.points
        self.points = which
        self.field = IncomingField(reflections, bake.transport.bits)
        self._lobes, self._first = lobes, first
        self._normals = points.normals[which]
        self._view = GlossyView(self.field, self._normals)
        self._mirror = Mirror(self.field, bake.transport.bits)
        self._frames = lobes.frames[first : first + len(which)]
        self.narrowest = narrowest_of(bake.cube_map)
        # Wide lobes need no detail of the light.
        self._is_wide = reflections.blocks.side <= _WIDE
        self._map = None

    def light(self, texels, sent, sky=None, detailed=None, settled=True):
        """Take in a light, as `IncomingField.update` and `Mirror.update` do."""
        self._map = None
        self.field.update(texels, sent, None if self._is_wide else detailed, settled)
        self._mirror.update(texels, sent, sky)

    def resend(self, entries, which, change):
        """Take in what entries of the reflections send, as `IncomingField.resend` does."""
        self.field.resend(entries, which, change)
        self._mirror.resend(entries, which, change)

    def settle(self):
        """End a number of `resend`, as `IncomingField.settle` does."""
        self.field.settle()

    def strength(self):
        """(n,) float32: how much is reflected straight back, at most of the channels."""
        return self._lobes.strength()[self._first : self._first + len(self.points)]

    def facing(self, outgoing):
        """Rows of the points that face the viewer, of directions (n, 3)."""
        return np.flatnonzero(np.einsum("nx,nx->n", outgoing, self._normals) > 0)

    def view_map(self):
        """The `ViewMap` of the light, of wide lobes; planned when first asked for."""
        if self._map is None:
            least = self._lobes.kinds()[2][self._first : self._first + len(self.points)]
            kinds, lobes_at = self._lobes_by_kind((least > _LEAST_MAPPED - 1e-4) & self._is_wide)

            def lobes_of(kind, cosine):
                return [(alpha[:, 0], powers) for alpha, powers in lobes_at(kind, cosine)]

            self._map = ViewMap(self.field, self._normals, kinds, lobes_of)
        return self._map

    @property
    def mapped(self):
        """(n,) bool: points whose views are looked up; none before the map is made."""
        return np.zeros(len(self.points), bool) if self._map is None else self._map.has

    @property
    def nbytes(self):
        """Of the field, and of maps of views."""
        return self.field.nbytes + (0 if self._map is None else self._map.nbytes)

    def looked_up(self, rows, outgoing):
        """As `toward`, of points that are `mapped`."""
        normals = self._normals.take(rows, axis=0)
        cosine = np.einsum("kx,kx->k", outgoing, normals)
        diffuse = self._lobes.diffuse(self._first + rows, cosine)
        diffuse = diffuse * self.rough_share(rows, normals, outgoing)
        return self._map.reflected(rows, outgoing), diffuse

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
        normals = self._normals[rows]
        cosine = np.einsum("kx,kx->k", outgoing, normals)
        groups, diffuse = self._lobes.at(self._first + rows, cosine)
        result = np.zeros((len(rows), 3), np.float32)
        for alpha, powers in groups:
            result += self.reflected(rows, normals, outgoing, alpha, powers, self._frames[rows])
        return result, diffuse * self.rough_share(rows, normals, outgoing)

    def rough_share(self, rows, normals, outgoing):
        """What rough diffuse lobes send towards a view, in parts of what leaves evenly.

        Of the points by `rows` (k,), or places beside them of other normals: (k, 3) float32, or 1
        where no lobe is rough.
        """
        rough = self._lobes.rough[self._first + rows]
        some = np.flatnonzero(rough)
        if not len(some):
            return np.float32(1)
        result = np.ones((len(rows), 3), np.float32)
        result[some] = rough_share(
            self.field, rows[some], normals[some], outgoing[some], rough[some],
            self._lobes.facets[self._first + rows[some]],
        )  # fmt: skip
        return result

    def glimpses(self, rows, outgoing):
        """`Glimpses` of points by `rows` (k,) from where `outgoing`, `Ways`, lead."""
        kinds, lobes_of = self._lobes_by_kind(np.ones(len(self.points), bool))
        return Glimpses(self.field, self._normals, rows, outgoing, kinds, lobes_of)

    def _lobes_by_kind(self, some):
        """Kinds (n,) of some of the points, -1 of others, and a function of kinds and cosines."""
        kinds, first, _ = self._lobes.kinds()
        own = np.full(len(self.points), -1, np.int32)
        mine = kinds[self._first : self._first + len(self.points)]
        used, own[some] = np.unique(mine[some], return_inverse=True)
        first = first[used]
        return own, lambda kind, cosine: self._lobes.at(first[kind], cosine)[0]

    def reflected(self, rows, normals, outgoing, alpha, powers, frames):
        """What lobes reflect of the fields of points.

        Parameters
        ----------
        rows : (k,) int
            Whose fields; one may come more than once.
        normals, outgoing : (k, 3) float32
            Of the places that reflect: those of the points, or of places beside them.
        alpha : (k, 2) float32
        powers : (k, N_POWERS, 3) float32
        frames : (k, 3, 3) float32
            Tangents, where the alphas differ.

        Returns
        -------
        (k, 3) float32
        """
        result = np.zeros((len(rows), 3), np.float32)
        narrow = alpha.max(axis=1) < self.narrowest
        even = ~narrow & (alpha[:, 0] == alpha[:, 1])
        brushed = ~narrow & ~even
        if narrow.any():
            work = rows[narrow], normals[narrow], outgoing[narrow], powers[narrow]
            result[narrow] = self._mirror.reflected(*work)
        if even.any():
            work = rows[even], outgoing[even], alpha[even, 0], powers[even]
            result[even] = self._view.reflected(*work, normals=normals[even])
        if brushed.any():
            widths = np.maximum(alpha[brushed], self.narrowest)
            work = rows[brushed], outgoing[brushed], widths, powers[brushed]
            axes = frames[brushed, :2]
            result[brushed] = self._view.reflected(*work, axes, normals[brushed])
        return result

    def highlights(self, lit_lamp, world, rows, outgoing, power=POWER):
        """What lobes reflect of a lamp, as wide as the lamp looks.

        Parameters
        ----------
        lit_lamp : LitLamp
            With what all bake points receive of it.
        world : (n_points, 3) float
            Their places.
        rows : (k,) int
            Of the points, which face the viewer.
        outgoing : (k, 3) float32
            Towards the viewer.
        power : int, optional
            See `highlights`.

        Returns
        -------
        (k, 3) float32
        """
        result = np.zeros((len(rows), 3), np.float32)
        received = lit_lamp.received[self.points[rows]]
        lit = np.flatnonzero(received.any(axis=1))
        if len(lit):
            # Parts of a lamp take more samples than all of it.
            power = power if power is None or lit_lamp.seen is None else power + 1
            some, outgoing = rows[lit], outgoing[lit]
            own = self.points[some]
            cells = lit_lamp.seen_at(own[:, None], np.ones((len(own), 1), np.float32))
            work = self._lobes_toward(some, outgoing), self._frames[some], lit_lamp.lamp
            result[lit] = highlights(*work, received[lit], world[own], outgoing, power, cells)
        return result

    def _lobes_toward(self, rows, outgoing):
        """Lobes of points by `rows` (k,) towards views (k, 3), as `PointLobes.at` gives them."""
        cosine = np.einsum("kx,kx->k", outgoing, self._normals[rows])
        return self._lobes.at(self._first + rows, cosine)[0]

    def glimpsed_highlights(self, lamp, received, world, rows, outgoing):
        """About what lobes reflect of a lamp, of points that are seen in others.

        As `highlights` has it, of a lamp that is one direction and lobes that are not narrow; rows
        may come more than once, and face away by their smooth normals.
        """
        result = np.zeros((len(rows), 3), np.float32)

        def one(first):
            own = slice(first, first + _SIGHTS)
            here = received.take(self.points.take(rows[own]), axis=0)
            lit = np.flatnonzero(here.any(axis=1))
            if len(lit):
                some = rows[own][lit]
                view = lifted(outgoing[own][lit], self._normals[some])
                groups = [
                    (np.maximum(alpha, LEAST), powers)
                    for alpha, powers in self._lobes_toward(some, view)
                ]
                work = groups, self._frames[some], lamp, here[lit], world[self.points[some]], view
                result[own][lit] = highlights(*work, power=None)

        on_all_cores(one, range(0, len(rows), _SIGHTS))
        return result


def metal_among(points, rows):
    """(k,) bool: which of the bake points by `rows` (k,) are metal to others that see them.

    Parameters
    ----------
    points : BakePoints
    rows : (k,) int
    """
    return PointLobes(points.materials[rows], points.normals[rows]).strength() > METAL


def narrowest_of(cube_map):
    """Alpha (float32) below which lobes are mirrors, for the texels of a `CubeMap`."""
    return np.float32(_TEXELS * np.pi / 4 / cube_map.resolution)


class SeenMetal:
    """Where reflections see points that reflect as much as metals do, and from where.

    What several points see along one direction is there once, in the order of what is seen.

    Parameters
    ----------
    reflections : list of Reflections
    strong : list of (n,) bool
        Which of the points of each reflect as much as metals do.
    n_points : int

    Attributes
    ----------
    parts : list of slice
        What is seen of each of the reflections' points.
    row : (k,) int32
        Which of these points it is.
    outgoing : Ways
        From there to who sees it, (k, 3).
    entries : list of (int array, int32 array)
        Of each part the entries of its reflections that see one, and which these are.
    """

    def __init__(self, reflections, strong, n_points):
        owner = np.full(n_points + 2, -1, np.int32)
        row = np.zeros(n_points + 2, np.int64)
        for index, (part, mine) in enumerate(zip(reflections, strong, strict=True)):
            owner[part.points[mine]], row[part.points[mine]] = index, np.flatnonzero(mine)
        directions = [part.blocks.directions for part in reflections]
        first = np.cumsum([0, *map(len, directions)])
        keys, chosen = [], []
        for index, part in enumerate(reflections):
            # Negative numbers, of what returns no light, count from the end: of no part.
            entries = np.flatnonzero(owner[part.met] >= 0)
            if len(part.met) <= np.iinfo(np.int32).max:
                entries = entries.astype(np.int32)
            met = part.met[entries]
            seen = owner[met] * np.int64(n_points) + row[met]
            keys.append(seen * first[-1] + first[index] + part.block[entries])
            chosen.append(entries)
        keys, which = np.unique(np.concatenate(keys), return_inverse=True)
        which = which.astype(np.int32)
        ends = np.cumsum([len(entries) for entries in chosen])[:-1]
        self.entries = list(zip(chosen, np.split(which, ends), strict=True))
        seen, direction = np.divmod(keys, first[-1])
        part, row = np.divmod(seen, n_points)
        self.row = row.astype(np.int32)
        ends = np.searchsorted(part, np.arange(len(reflections) + 1))
        self.parts = [slice(*map(int, each)) for each in zip(ends[:-1], ends[1:], strict=True)]
        self.outgoing = Ways(-np.concatenate(directions).astype(np.float32), direction)
        self._n_points, self._n_blocks = n_points, int(first[-1])

    def __len__(self):
        return len(self.row)

    @property
    def keys(self):
        """(k,) int64, ascending: ((part n_points + row) n_blocks + block) of what is seen, where
        blocks of each of the reflections follow those of the one before."""
        keys = np.empty(len(self), np.int64)
        for index, part in enumerate(self.parts):
            seen = self.row[part] + np.int64(index * self._n_points)
            keys[part] = seen * self._n_blocks + self.outgoing.which[part]
        return keys

    @property
    def nbytes(self):
        """Of what is there for as long as it is."""
        entries = sum(one.nbytes + which.nbytes for one, which in self.entries)
        return self.row.nbytes + self.outgoing.nbytes + entries


class Ways:
    """Directions that are looked up in a table where they are asked for.

    Parameters
    ----------
    table : (n, 3) float32
    which : (k,) int

    Attributes
    ----------
    which : (k,) uint16 or int32
    """

    def __init__(self, table, which):
        self._table = table
        self.which = which.astype(np.uint16 if len(table) <= 1 << 16 else np.int32, copy=False)

    def __len__(self):
        return len(self.which)

    def __getitem__(self, part):
        """(m, 3) float32: those of a slice."""
        return self._table.take(self.which[part], axis=0)

    def of(self, part):
        """`Ways` of a slice, with the same table."""
        return Ways(self._table, self.which[part])

    @property
    def nbytes(self):
        """Of the arrays."""
        return self._table.nbytes + self.which.nbytes
