"""What a bake takes over from an earlier one of the same scene: only what has changed is baked.

A point that was there before keeps what it knows of every direction whose ray passes by all places
that have changed; of the others it keeps what a change cannot have touched: what was dark can only
have become lit where the old place of something was in the way, what was lit dark where the new
place is. All else is asked again by agreement, and the certificate is made anew of everything, with
draws of its own. Bounce rays are kept by the same rule (see `transport.kept_rays`); what points
receive of emitters, reflections and details are made again whole.

A bake of a selection leaves the points of other objects as they were. What it left is noted with
the bake, and asked by the next one that is not of a selection.
"""

from dataclasses import fields, replace

import numpy as np

from prt_core.bake.earlier import Earlier, objects_called
from prt_core.bake.gather import SHIFTS, read_shifts
from prt_core.bake.gather_blocks import ROUNDS_OF
from prt_core.bake.visibility import blocks
from prt_core.sampling import Known
from prt_core.scene import compare
from prt_core.scene.boxes import Boxes
from prt_core.store import damage_as_error
from prt_core.transport.gather import gather_shift
from prt_core.transport.kept_rays import KeptRays
from prt_core.transport.visibility import horizon_bits

# Turns of the certificate of one bake at most: the next one's draws are others.
_TURNS = 16
# Points worked on together.
_TOGETHER = 1 << 14
# Less of the points than this is not worth comparing.
_LEAST = 0.05


class Reuse:
    """What a bake takes over from an `Earlier` one.

    Parameters
    ----------
    earlier : Earlier
    scene : Scene
        As it is baked, with its backs and details.
    only : sequence of str, optional
        Objects whose points are asked again; default: all that have to be.

    Attributes
    ----------
    compared : Compared
    turn : int
        Of the certificate's draws, the first.
    """

    def __init__(self, earlier, scene, only=None):
        self.earlier, self.scene = earlier, scene
        self.compared = compare(earlier.scene, scene)
        self.turn = _TURNS * (earlier.generation + 1)
        old_of = self.compared.old_of
        self.still = np.zeros(len(scene.points), bool)
        if only is not None:
            chosen = objects_called(scene, only)
            self.still = (old_of >= 0) & ~chosen[scene.points.object_index]
        self._pending = _pending_boxes(earlier, scene)
        self._bits = earlier.store.array("visibility")
        sampled = earlier.store.attributes["report"].get("method") != "exhaustive"
        self._traced = earlier.store.array("traced") if sampled else None

    @property
    def changed(self):
        """`Boxes` around all that has changed, where it was and where it is."""
        return self.compared.before.joined(self.compared.after).joined(self._pending)

    @property
    def dark_is_unsure(self):
        """Whether bounce rays that ended in the dark may end elsewhere now: something has changed,
        or backs have got points."""
        return len(self.changed) > 0 or bool((self.compared.old_of < 0).any())

    def known(self, cube_map, points=None):
        """The `Known` of some points, (n,) int; default: all."""
        if points is None:
            points = np.arange(len(self.scene.points))
        n_bytes = -(-cube_map.n_directions // 8)
        known = Known(*np.zeros((4, len(points), n_bytes), np.uint8))
        for first in range(0, len(points), _TOGETHER):
            part = slice(first, first + _TOGETHER)
            self._tell(
                cube_map, points[part], *(getattr(known, f.name)[part] for f in fields(Known))
            )
        return known

    def _tell(self, cube_map, points, bits, known, traced, above):
        """Fill in what is known of some points, see `Known`; all zero before."""
        old = self.compared.old_of[points]
        above[:] = horizon_bits(self.scene, cube_map, points)
        mine = np.flatnonzero(old >= 0)
        if not len(mine):
            return
        before, horizon = _rows(self._bits, old[mine]), above[mine]
        origins = self.scene.ray_origins[points[mine]]
        unknown = self.compared.before.texels(origins, cube_map, horizon & ~before)
        unknown |= self.compared.after.texels(origins, cube_map, before)
        if len(self._pending):
            unknown |= self._pending.texels(origins, cube_map, horizon)
        unknown[self.still[points[mine]]] = 0
        rays = horizon if self._traced is None else _rows(self._traced, old[mine])
        bits[mine], known[mine], traced[mine] = before, ~unknown, rays & ~unknown

    def kept_rays(self, store, seed):
        """The `KeptRays` of the bounces; None where the earlier bake has cast none.

        Their shifts are put into the store: directions follow from them.
        """
        if not self.earlier.store.attributes.get("rounds"):
            return None
        old_of, before = self.compared.old_of, self.earlier.store
        n_old = len(self.earlier.scene.points)
        shifts, old = _shifts(len(old_of), seed), read_shifts(before, n_old)
        old = _shifts(n_old, self.earlier.settings.seed) if old is None else old
        mine = old_of >= 0
        shifts[mine] = old[old_of[mine]]
        store.keep(SHIFTS, shifts)
        unsure = _unsure_points(self.scene, old_of, self.changed)
        parts = before.array("gather"), old_of, n_old, shifts, unsure, self.changed
        # Bakes from before there was a choice have all rounds of all points.
        chosen = ROUNDS_OF in before.attributes["arrays"]
        rounds = before.read(ROUNDS_OF, (n_old,), "int16") if chosen else None
        return KeptRays(*parts, self.dark_is_unsure, self.still, rounds)

    def of_all(self, bounced):
        """What rays of the bounces came to, as shares of all that the bake has, kept ones too.

        Those that end in the dark are cast again wherever something has changed: of the new rays
        alone they would be far too many.

        Parameters
        ----------
        bounced : Bounced
        """
        report, whole = self.earlier.store.attributes["report"], self._gathered(bounced.rays)
        new = bounced.rays / max(whole, 1)
        kept = 0.0 if self.dark_is_unsure else 1 - new
        hidden, dark = (report.get(name) or 0.0 for name in ("hidden_hits", "dark_backs"))
        return replace(
            bounced,
            hidden=bounced.hidden * new + hidden * kept,
            dark_backs=bounced.dark_backs * new + dark * kept,
        )

    def _gathered(self, n_rays):
        """Rays that the bounces of the bake stand on, where so many of them were cast for it."""
        report = self.earlier.store.attributes["report"]
        before = (report.get("reused") or {}).get("gather_rays") or report.get("rays_gather", 0)
        return max(before, n_rays)

    def pending(self):
        """Boxes, in the world, of what the points that were left alone do not know of."""
        scene = self.scene
        boxes = self.changed if self.still.any() else Boxes.none()
        boxes = boxes.moved(scene.size, scene.centre)
        return {name: getattr(boxes, name).tolist() for name in ("low", "high", "radius")}

    def told(self, report):
        """What the report of the bake says of it.

        Parameters
        ----------
        report : dict
            With its `rays` and `points`.
        """
        new = int((self.compared.old_of < 0).sum())
        whole = self.earlier.whole_rays
        share = report["rays"] / max(whole, 1)
        left = "; what a selection left" if len(self._pending) else ""
        line = (
            f"{self.compared}{left}: {new:,} of {report['points']:,} points asked anew, the others "
            f"where they see it; {share:.0%} of the rays of a whole bake"
        )
        if self.still.any():
            line += "; of objects not selected nothing was asked"
        return {
            "of": self.earlier.store.path.name,
            "digest": self.earlier.digest,
            "generation": self.earlier.generation + 1,
            "whole_rays": whole,
            "gather_rays": self._gathered(report["rays_gather"]),
            "points": new,
            "rays_share": share,
            "left_alone": int(self.still.sum()),
            "pending": self.pending(),
            "line": line,
        }


def _shifts(n_points, seed):
    """(n_points, 2, 2) float32: those that follow from the blocks of the points."""
    shifts = np.empty((n_points, 2, 2), np.float32)
    for block in blocks(n_points):
        for half in (0, 1):
            shifts[block, half] = gather_shift(block, block.stop - block.start, seed, half)
    return shifts


def _pending_boxes(earlier, scene):
    """What points of the earlier bake were not asked about, in the frame of the scene."""
    reused = earlier.store.attributes.get("reused") or {}
    with damage_as_error(earlier.store.path):
        pending = reused.get("pending") or {"low": [], "high": []}
        low, high = (np.reshape(np.array(pending[k], float), (-1, 3)) for k in ("low", "high"))
        radius = pending.get("radius")
        boxes = Boxes(low, high, None if radius is None else np.array(radius, float))
        return boxes.moved(1 / scene.size, -scene.centre / scene.size)


def _unsure_points(scene, old_of, changed):
    """(n_points,) bool: points to which hits of now may be handed otherwise than before.

    Those nearer to a change than a cell of theirs is wide, and those of triangles that have got
    other points.
    """
    points = scene.points.positions
    corners = scene.vertices[scene.triangles]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    reach = np.zeros(len(points))
    owner = np.repeat(np.arange(len(scene.triangles)), scene.lattice_sizes)
    cell = (edge / scene.triangle_level)[owner]
    sided = scene.lattice_back >= 0
    np.maximum.at(reach, scene.lattice, cell)
    np.maximum.at(reach, scene.lattice_back[sided], cell[sided])
    details = scene.details
    # Places further away may be handed to these than to corners.
    reach[details.point] = 2 * edge[details.triangle]
    unsure = changed.overlap(points - reach[:, None], points + reach[:, None])
    new = old_of < 0
    other = np.zeros(len(scene.triangles), bool)
    other[owner[new[scene.lattice]]] = True
    other[owner[sided][new[scene.lattice_back[sided]]]] = True
    other[details.triangle[new[details.point]]] = True
    # Details serve the triangles beside their own as well.
    beside = np.zeros(len(points), bool)
    beside[scene.lattice[other[owner]]] = True
    other[owner[beside[scene.lattice]]] = True
    unsure[scene.lattice[other[owner]]] = True
    mine = sided & other[owner]
    unsure[scene.lattice_back[mine]] = True
    unsure[details.point[other[details.triangle]]] = True
    return unsure


def _rows(array, rows):
    """Rows of a stored array, in any order: each of its chunks is read once."""
    result = np.empty((len(rows), array.shape[1]), array.dtype)
    size = array.chunks[0]
    chunk = rows // size
    for number in np.unique(chunk):
        mine = np.flatnonzero(chunk == number)
        first = int(number) * size
        result[mine] = array[first : min(first + size, len(array))][rows[mine] - first]
    return result


def reuse_of(earlier, scene, only=None):
    """The `Reuse` of an earlier bake; in words why there is none; None where none was asked for."""
    if not isinstance(earlier, Earlier):
        return earlier
    reuse = Reuse(earlier, scene, only)
    if (reuse.compared.old_of >= 0).mean() >= _LEAST:
        return reuse
    return "hardly a point is where it was"


def note_reuse(store, report, reuse):
    """Say in the report, and note in the store, what was taken over, or why nothing was."""
    if reuse is None:
        return
    if isinstance(reuse, Reuse):
        report["reused"] = reuse.told(report)
        store.update(reused=report["reused"])
        if reuse.still.any():
            report["messages"].insert(
                0,
                "only a selection was baked: light and shadow of what has changed are not on the "
                "other objects yet; bake what moved brings them",
            )
    else:
        report["reused"] = {"of": None, "line": f"nothing, all was baked: {reuse}"}
        report["messages"].insert(0, f"nothing was taken from the earlier bake: {reuse}")
