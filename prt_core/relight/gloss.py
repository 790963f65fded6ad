"""Gloss in one bake: what its glossy points reflect towards a view, under one light after another.

Once a light the field of incoming light is filled in (see `transport.incoming_field`); a view is
lobes over it. Lobes that are narrower than texels mirror what stands in their direction.
"""

import hashlib

import numpy as np

from prt_core.errors import expect
from prt_core.reflectance.mean_gloss import more_by_gloss
from prt_core.relight.coarse_view import CoarseView
from prt_core.relight.glossy_pixels import GlossyPixels, PixelLight
from prt_core.relight.glossy_points import METAL, GlossyPoints, SeenMetal
from prt_core.relight.highlights import POWER
from prt_core.relight.point_lobes import PointLobes
from prt_core.runtime.main_thread import maybe_in_thread
from prt_core.runtime.progress import Progress
from prt_core.scene import ended_at

# Said where a bake with gloss is shown to nobody.
NO_VIEW = "gloss is shown as an even colour, for no view was given (--view camera, or x,y,z)"
# Sweeps over what reflects what reflects, at most.
_SWEEPS = 3
# Points whose lobes are evaluated in one step: then a view that is not wanted any more can end.
_AT_ONCE = 1 << 16
# Pieces of maps of views that are made in one step, for the same reason.
_PIECES = 48


class Gloss:
    """What the glossy points of a bake reflect.

    Parameters
    ----------
    bake : Bake
        Baked with gloss.
    caster : str
        For the rays of mirrors; made when first needed.

    Attributes
    ----------
    lobes : PointLobes
        Of its glossy points, one part of the reflections after the other.
    more : (n_points, 3) float32
        Of what points receive, what they send to others besides what they show without a view.

    Raises
    ------
    PRTError
        The bake has none.
    """

    def __init__(self, bake, caster="auto"):
        expect(
            bake.reflections,
            "view: this bake knows of no gloss, and looks the same from everywhere; bake with "
            "--gloss, and with materials that have some",
        )
        self._points = bake.scene.points
        self._world = bake.scene.to_world(self._points.positions)
        glossy = np.concatenate([reflections.points for reflections in bake.reflections])
        self.lobes = PointLobes(self._points.materials[glossy], self._points.normals[glossy])
        self.more = more_by_gloss(bake.transport.materials)
        self._parts, first = [], 0
        for reflections in bake.reflections:
            self._parts.append(GlossyPoints(bake, reflections, self.lobes, first))
            first += len(reflections.points)
        # Reflections see what lets light pass by rays that end at it, as pictures do.
        ended = ended_at(self._points.materials)[:, None]
        self._ended = None if (ended == 1).all() else ended
        self._metal = self._light = self._sky = self._maps = None
        self._glimpses, self._again, self._coarse = [], None, {}
        self._pixels = GlossyPixels(
            bake.scene, self._parts, self.lobes, lambda: bake.make_caster(caster, "diffuse")
        )

    def close(self):
        """Let go of the rays' caster."""
        self._pixels.close()

    @property
    def narrowest(self):
        """Alpha below which a lobe is taken for a mirror."""
        return min(part.narrowest for part in self._parts)

    @property
    def nbytes(self):
        """Of the fields, of maps of views, and of what is kept for metal that metal sees."""
        kept = sum(one.nbytes for one in self._glimpses)
        kept += 0 if self._metal is None else self._metal.nbytes
        for matrices in self._again or ():
            # The three have their indices in common.
            kept += sum(matrix.data.nbytes for matrix in matrices)
            kept += matrices[0].indices.nbytes + matrices[0].indptr.nbytes
        return sum(part.nbytes for part in self._parts) + kept

    @property
    def mirror_rays(self):
        """How many rays the mirrors of the last picture cast."""
        return self._pixels.n_rays

    def light(self, texels, sent, even, sky=None, detailed=None, tolerance=0.01, lamps=()):
        """Take in a light: as many sweeps as it takes until reflections of reflections settle.

        Parameters
        ----------
        texels : (n_directions, 3) float32, or None
            Radiance of what is far away.
        sent : (n_points, 3) float32
            Radiance that points send out to all sides, with what stands in for gloss (`more`, too).
        even : (n_points, 3) float32
            The same without those.
        sky : callable((m, 3) directions) -> (m, 3), optional
            The same light in full detail, for mirrors; default: texels.
        detailed : (n_texels, 3) float32, optional
            The same light on a finer cube map (see `IncomingField.update`).
        tolerance : float
            Change of what is reflected at which sweeps end, in parts of it.
        lamps
            See `toward_steps`: metal that is seen in metal reflects them.
        """
        self._sky = sky or texel_sky(self._parts[0].field.reflections.blocks.cube_map, texels)
        key = _digest(texels, sent, even)
        if key == self._light:
            return
        self._light = self._maps = None
        if self._ended is not None:
            sent, even = sent / self._ended, even / self._ended
        seen = self._seen_metal()
        for part in self._parts:
            part.light(texels, sent, sky, detailed, settled=seen is None)
        if seen is not None:
            change = self._change_of_seen(seen, sent - even, tolerance, lamps)
            for part, (entries, which) in zip(self._parts, seen.entries, strict=True):
                part.resend(entries, which, change)
                part.settle()
        self._light = key

    def _change_of_seen(self, seen, standing, tolerance, lamps):
        """(k, 3) radiance of what is seen beyond what stood in for it, (n_points, 3)."""
        before = np.zeros((len(seen), 3), np.float32)
        for part, mine in zip(self._parts, seen.parts, strict=True):
            before[mine] = standing[part.points[seen.row[mine]]]
        stood, once = before, self._of_seen(seen, lamps)
        reflected = once
        for _ in range(_SWEEPS - 1):
            if np.abs(reflected - before).sum() <= tolerance * np.abs(reflected).sum():
                break
            before = reflected
            reflected = np.maximum(once + self._seen_again(seen, before - stood), 0)
        return reflected - stood

    def _seen_metal(self):
        """Where reflections see what reflects as much as metals do, and from where; or None."""
        if self._metal is None:
            reflections = [part.field.reflections for part in self._parts]
            strong = [part.strength() > METAL for part in self._parts]
            seen = self._metal = SeenMetal(reflections, strong, len(self._world))
            self._glimpses = [
                part.glimpses(seen.row[mine], seen.outgoing.of(mine))
                for part, mine in zip(self._parts, seen.parts, strict=True)
            ]
        return self._metal if len(self._metal) else None

    def _of_seen(self, seen, lamps):
        """(k, 3) radiance that what is seen reflects towards where it is seen from."""
        result = np.zeros((len(seen), 3), np.float32)
        for index, mine in enumerate(seen.parts):
            shown = self._glimpses[index].reflected()
            for lit in lamps:
                work = lit.lamp, lit.received, self._world, seen.row[mine], seen.outgoing.of(mine)
                shown += self._parts[index].glimpsed_highlights(*work)
            result[mine] = shown / self._ended_at(seen, index)
        return result

    def _seen_again(self, seen, change):
        """(k, 3): what is seen in what is seen, where that sends more by `change` (k, 3)."""
        if self._again is None:
            self._again = [
                glimpses.returned(*entries, len(seen))
                for glimpses, entries in zip(self._glimpses, seen.entries, strict=True)
            ]
        result = np.zeros((len(seen), 3), np.float32)
        for index, (mine, matrices) in enumerate(zip(seen.parts, self._again, strict=True)):
            for channel, matrix in enumerate(matrices):
                result[mine, channel] = matrix @ change[:, channel]
            result[mine] /= self._ended_at(seen, index)
        return result

    def _ended_at(self, seen, index):
        """Of rays at what is seen of a part the share that ends there: (k, 1), or 1."""
        if self._ended is None:
            return np.float32(1)
        return self._ended[self._parts[index].points[seen.row[seen.parts[index]]]]

    @property
    def maps_views(self):
        """Whether wide lobes are looked up where a view may be (see `map_views_steps`)."""
        return self._maps is not None and not any(one.left for one in self._maps)

    def map_views_steps(self, pace=None):
        """Make maps of all views for what has wide lobes, as a generator of `Progress`.

        They are of the light that is known, and serve `toward_steps`. One that is dropped goes on
        where it was when it is asked for again.

        Parameters
        ----------
        pace : float, optional
            Seconds a step may take; then the arithmetic runs beside the caller, in a thread.
        """
        if self._maps is None:
            self._maps = yield from maybe_in_thread(pace, "views", self._planned_maps)
        maps = self._maps
        total = sum(one.planned for one in maps)
        # Another light, which may come between two steps, has maps of its own.
        while maps is self._maps and not self.maps_views:
            one = next(one for one in maps if one.left)
            yield from maybe_in_thread(pace, "views", one.make, _PIECES)
            yield Progress("views", total - sum(each.left for each in maps), total)

    def _planned_maps(self):
        return [part.view_map() for part in self._parts]

    def toward_steps(self, view, lamps=(), pace=None, every=1, mapped=False):
        """Radiance that lobes send towards a view, as a generator of `Progress`.

        Parameters
        ----------
        view : View
        lamps : sequence of LitLamp
        pace : float, optional
            Seconds a step may take; then the arithmetic runs beside the caller, in a thread.
        every : int
            Lobes are evaluated at one of so many points, which those between follow.
        mapped : bool
            Look up what has a map (see `map_views_steps`) instead: all of these points.

        Returns
        -------
        reflected : (n_points, 3) float32
        diffuse : (n_points, 3) float32
            What the lobes leave of diffuse light, in parts of what the view from straight above
            does.
        """
        outgoing = view.outgoing(self._world).astype(np.float32)
        values = np.zeros((len(self._world), 6), np.float32)
        values[:, 3:] = 1
        (facing, looked_up), coarse = np.zeros((2, len(self._world)), bool), None
        # While a view moves a lamp is one direction.
        power = None if every > 1 else POWER
        for part in self._parts:
            rows = part.facing(outgoing.take(part.points, axis=0))
            facing[part.points[rows]] = True
            if mapped and part.mapped.any():
                there = part.mapped[rows]
                some, rows = rows[there], rows[~there]
                looked_up[part.points[some]] = True
                work = self._toward, part.looked_up, part, some, outgoing, lamps, None
                values[part.points[some]] = yield from maybe_in_thread(pace, "gloss", *work)
            if every > 1 and len(rows):
                if coarse is None:
                    coarse = yield from maybe_in_thread(pace, "gloss", self._coarser, every)
                rows = rows[coarse.chosen[part.points[rows]]]
            for first in range(0, len(rows), _AT_ONCE):
                some = rows[first : first + _AT_ONCE]
                work = self._toward, part.toward, part, some, outgoing, lamps, power
                values[part.points[some]] = yield from maybe_in_thread(pace, "gloss", *work)
        if coarse is not None:
            coarse.follow(values, facing, looked_up)
        return values[:, :3], values[:, 3:]

    def _toward(self, lobes, part, rows, outgoing, lamps, power):
        """(k, 6): what some points of a part reflect, and what is left of diffuse light."""
        outgoing = outgoing.take(part.points.take(rows), axis=0)
        reflected, diffuse = lobes(rows, outgoing)
        for lit in lamps:
            reflected += part.highlights(lit, self._world, rows, outgoing, power)
        return np.concatenate([reflected, diffuse], axis=1)

    def _coarser(self, every):
        if every not in self._coarse:
            glossy = np.concatenate([part.points for part in self._parts])
            self._coarse[every] = CoarseView(self._points, glossy, every)
        return self._coarse[every]

    def radiance_of_pixels(self, rays, even, own, lamps=()):
        """What the samples of a picture show under the light, each with its own normal and view.

        Parameters
        ----------
        rays : CameraRays
        even : (n_points, 3) float32
            What points send out to all sides, without what they send of themselves.
        own : (n_points, 3) float32, or None
            That.
        lamps
            See `toward`.

        Returns
        -------
        (n_lit, 3) float32
            Of `rays.lit`.
        """
        return self._pixels.radiance(rays, PixelLight(even, own, self._sky, tuple(lamps)))


def texel_sky(cube_map, texels):
    """The light of texels, as a function of (m, 3) directions to (m, 3) radiance.

    Parameters
    ----------
    cube_map : CubeMap
    texels : (n_directions, 3) float32, or None
        None: black.
    """
    if texels is None:
        return lambda directions: np.zeros(directions.shape, np.float32)
    return lambda directions: texels[cube_map.texel_along(*directions.T)]


def _digest(*arrays):
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(b"" if array is None else np.ascontiguousarray(array))
    return digest.digest()
