"""How open the surroundings of points are: ambient occlusion, the visible sky, bent normals.

All three are sums over the directions that a point sees, weighted by exact integrals over the
texels of the cube map, so that they need nothing but the bits of a bake. Bits know no distances:
where only what is near is to count, a ray is cast in each direction whose bit says that something
is in the way, and in no other.

Ambient occlusion is Zhukov, Iones & Kronin 1998, with the falloffs of Blender's proportional
editing; bent normals are Landis 2002.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_caster,
    expect_kind,
    expect_number,
    expect_one_of,
)
from prt_core.runtime.progress import Pace, Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import expect_bits, horizon_bits, unpack

KINDS = ("ambient", "sky", "bent-normal")
WEIGHTS = ("cosine", "even")
# How much light comes past a blocker at a share t of the distance.
FALLOFFS = {
    "constant": lambda t: np.zeros_like(t),
    "linear": lambda t: t,
    "smooth": lambda t: t * t * (3 - 2 * t),
    "sharp": lambda t: 1 - (1 - t) ** 2,
}
# Points whose bits are spread at once, and those of a step.
_BLOCK, _STEP = 128, 4096


@dataclass(frozen=True)
class Occlusion:
    """What of the surroundings is asked for.

    Parameters
    ----------
    kind : {"ambient", "sky", "bent-normal"}
        Ambient occlusion as Cycles has it: the open share of the hemisphere above the surface, 1
        where nothing is in the way. Sky: the share of the sky, the half of all directions above the
        world's horizon, of which open ground sees 1. Bent normal: the mean open direction, a unit
        vector in world space.
    distance : float, optional
        In Blender units: what is farther away is not in the way. Default: everything is.
    falloff : {"constant", "linear", "smooth", "sharp"}
        How blockers count less, the nearer they are to that distance: by shares 1 (as Cycles'),
        1 - t, 1 - 3 t^2 + 2 t^3, (1 - t)^2 at a share t of it.
    weight : {"cosine", "even"}
        Of directions: as an even light falls on the surface, or all alike.

    Raises
    ------
    PRTError
        There is no such thing, or a falloff without a distance.
    """

    kind: str = "ambient"
    distance: float | None = None
    falloff: str = "constant"
    weight: str = "cosine"

    def __post_init__(self):
        expect_one_of("kind", self.kind, KINDS)
        expect_one_of("falloff", self.falloff, tuple(FALLOFFS))
        expect_one_of("weight", self.weight, WEIGHTS)
        if self.distance is not None:
            expect_number("distance", self.distance, above=0)
        expect(
            self.distance is not None or self.falloff == "constant",
            f"falloff: '{self.falloff}' needs a distance to fall off within; give one",
        )


def occlusion_steps(scene, cube_map, bits, asked, caster=None, pace=None):
    """How open the surroundings of all points are; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    asked : Occlusion
    caster : RayCaster, optional
        Over what diffuse rays meet; needed where there is a distance.
    pace : float, optional
        Seconds a step may take.

    Returns
    -------
    (n_points,) float32
        Shares, 0 to 1; or (n_points, 3) float32, unit vectors: the normal itself where nothing is
        open.
    """
    expect_kind("scene", scene, Scene)
    expect_kind("cube_map", cube_map, CubeMap)
    bits = expect_bits("bits", bits, cube_map.n_directions)
    n_points = len(scene.points)
    expect(len(bits) == n_points, f"bits: expected {n_points} rows, got {len(bits)}")
    expect_kind("asked", asked, Occlusion)
    if asked.distance is not None:
        expect_caster(caster)
    sums = _Sums(scene, cube_map, bits, asked, caster)
    result = np.empty((n_points, 3) if asked.kind == "bent-normal" else n_points, np.float32)
    alone = asked.distance is not None and caster.threads == 1

    def one(part):
        result[part] = sums(part)

    paces = Pace(pace, _BLOCK)
    for first in range(0, n_points, _STEP):
        for step in paces.parts(first, min(first + _STEP, n_points)):
            starts = range(step.start, step.stop, _BLOCK)
            parts = [slice(start, min(start + _BLOCK, step.stop)) for start in starts]
            if alone:
                for part in parts:
                    one(part)
            else:
                on_all_cores(one, parts)
            paces.worked()
            yield Progress("occlusion", step.stop, n_points)
    return result


class _Sums:
    """Weighted sums over the open directions of parts of the points."""

    def __init__(self, scene, cube_map, bits, asked, caster):
        self._scene, self._cube_map, self._bits = scene, cube_map, bits
        self._asked, self._caster = asked, caster
        self._samples = cube_map.samples.astype(np.float32)
        columns = _columns(cube_map, asked)
        if asked.kind == "sky":
            # Open ground sees no texel of the middle row of an odd cube map: nobody does.
            columns = columns * (cube_map.directions[:, 2:] > 1e-9)
        self._columns = columns.astype(np.float32)
        self._vectors = np.ascontiguousarray(cube_map.vectors.T, np.float32)
        self._up = np.float32([[0, 0, 1]])

    def __call__(self, part):
        """What is asked for of the points of a slice."""
        normals = self._scene.points.normals[part]
        sums = self._open(part) @ self._columns
        if self._asked.kind == "bent-normal":
            return self._directions(sums, normals)
        values = self._weighed(sums, normals)
        # Of as many texels: those on the horizon count whole or not at all above and below.
        if self._asked.kind == "sky":
            whole = self._weighed(self._columns.sum(axis=0, keepdims=True), self._up)
        else:
            above = (normals @ self._vectors > 0).astype(np.float32)
            whole = self._weighed(above @ self._columns, normals)
        return np.clip(values / whole, 0, 1)

    def _weighed(self, sums, normals):
        if self._asked.weight == "cosine":
            return np.einsum("px,px->p", sums, normals)
        return sums[:, 0]

    def _directions(self, sums, normals):
        if self._asked.weight == "cosine":
            sums = np.einsum("pxy,py->px", sums.reshape(-1, 3, 3), normals)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        return np.where(length > 1e-6, sums / np.maximum(length, 1e-6), normals)

    def _open(self, part):
        """(n, n_directions) float32: how much of each texel is open to each point."""
        n_directions = self._cube_map.n_directions
        seen = unpack(self._bits[part], n_directions)
        if self._asked.distance is None:
            return seen
        above = unpack(horizon_bits(self._scene, self._cube_map, part), n_directions, np.uint8)
        point, direction = np.nonzero((above > 0) & (seen == 0))
        origins = self._scene.ray_origins[part]
        # In the scene's frame, whose unit is its size: beyond a few of these nothing is met.
        limit = min(self._asked.distance / self._scene.size, 1e6)
        for first in range(0, len(point), self._caster.batch):
            rays = slice(first, first + self._caster.batch)
            starts, ways = origins[point[rays]], self._samples[direction[rays]]
            seen[point[rays], direction[rays]] = self._passed(starts, ways, limit)
        return seen

    def _passed(self, starts, ways, limit):
        """(m,) share of light that comes past what rays meet."""
        if self._asked.falloff == "constant":
            return ~self._caster.occluded(starts, ways, np.full(len(ways), limit, np.float32))
        distance = self._caster.intersect(starts, ways).distance
        return FALLOFFS[self._asked.falloff](np.minimum(distance / np.float32(limit), 1))


def _columns(cube_map, asked):
    """(n_directions, n) float64: what each open texel adds to the sums."""
    if asked.kind == "bent-normal" and asked.weight == "cosine":
        ways = cube_map.directions
        products = (ways[:, :, None] * ways[:, None]).reshape(-1, 9)
        return products * cube_map.solid_angles[:, None]
    if asked.kind == "bent-normal" or asked.weight == "cosine":
        return cube_map.vectors
    return cube_map.solid_angles[:, None]


def as_colours(values):
    """Shares or unit vectors as colours: (n, 3) float32 from 0 to 1.

    Shares are grey; a vector is 0.5 + 0.5 of its components, as in normal maps.

    Parameters
    ----------
    values : (n,) or (n, 3) float32
    """
    if values.ndim == 1:
        return np.repeat(values[:, None], 3, axis=1)
    return (np.float32(0.5) + np.float32(0.5) * values).astype(np.float32)
