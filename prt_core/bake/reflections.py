"""The reflection stage of a bake: what glossy points see where something is in the way."""

import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from prt_core.bake import visibility
from prt_core.bake.visibility import add_seconds, blocks
from prt_core.errors import expect
from prt_core.rays import cast_on_all_cores
from prt_core.relight.glossy_points import metal_among
from prt_core.runtime.cores import n_cores
from prt_core.runtime.progress import Progress
from prt_core.sphere import Blocks
from prt_core.store import damage_as_error
from prt_core.transport import Reflections, Sharing, reflection_hits
from prt_core.transport.incoming_field import sides_of
from prt_core.transport.sharing import DARK

# Blocks of points worked on together for each core.
_TOGETHER = 4
# What a block notes: rays, short rays, rays that met nothing.
_N_FIGURES = 3


@dataclass(frozen=True)
class ReflectionResult:
    """What the rays of the reflection stage came to.

    Attributes
    ----------
    points, rays, short_rays, lost : int
        Glossy points; rays from them, and from what they met; and those that met nothing where
        visibility says that something is.
    """

    points: int = 0
    rays: int = 0
    short_rays: int = 0
    lost: int = 0


def block_sides(materials, cube_map):
    """How many blocks along an edge the field of each point needs.

    Rough diffuse surfaces have one as well: what they send depends on the view.

    Parameters
    ----------
    materials : Materials
    cube_map : CubeMap

    Returns
    -------
    (n,) int
        0 for points that look the same from everywhere.
    """
    facets = (materials.glossy.max(axis=1) > 0) | (materials.metal.max(axis=1) > 0)
    facets |= (materials.dielectric[:, 0] > 0) & (materials.ior[:, 0] != 1)
    coat = materials.coat[:, 0] > 0
    # A coat is as narrow as it is; what lies below it may be all that is seen of it all the same.
    narrow = np.where(facets, materials.roughness[:, 0], 1.0)
    narrow = np.minimum(narrow, np.where(coat, materials.coat_roughness[:, 0], 1.0))
    rough = (materials.diffuse_roughness[:, 0] > 0) & (materials.albedo.max(axis=1) > 0)
    return np.where(facets | coat | rough, sides_of(narrow, cube_map.resolution), 0)


def reflection_steps(store, scene, cube_map, caster, settings, seconds):
    """What glossy points of a scene see, into a store; yields `Progress`.

    Parameters
    ----------
    store : BakeStore
        Its visibility is whole.
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    seconds : dict of str -> float
        By stage; added to.

    Returns
    -------
    ReflectionResult
    """
    sides = block_sides(scene.points.materials, cube_map) if settings.gloss else np.zeros(0, int)
    if not sides.any():
        if store.attributes.get("reflections"):
            store.update(reflections=[])
        return ReflectionResult()
    start, sharing = time.perf_counter(), Sharing(scene, caster)
    result = np.array([0, sharing.n_rays, 0], np.int64)
    kinds = np.unique(sides[sides > 0]).tolist()
    bits, metal = store.array("visibility"), np.zeros(len(scene.points), bool)
    glossy = np.flatnonzero(sides)
    metal[glossy] = metal_among(scene.points, glossy)
    for side in kinds:
        points = np.flatnonzero(sides == side).astype(np.int32)
        store.keep(_name(side, "points"), points)
        divided = Blocks(cube_map, side)
        parts = blocks(len(points))
        shape, chunk = (len(points), len(divided)), (visibility.BLOCK, len(divided))
        met = store.create(_name(side, "met"), shape, "int32", chunk)
        share = store.create(_name(side, "share"), shape, "uint8", chunk)
        table = len(parts), _N_FIGURES
        figures = store.create(_name(side, "figures"), table, "int64", (1, _N_FIGURES))
        todo = [
            index
            for index, part in enumerate(parts)
            if not (met.holds(part) and share.holds(part) and figures.holds(index))
        ]

        def one(caster, index, parts=parts, points=points, divided=divided, side=side,
                met=met, share=share, figures=figures):  # fmt: skip
            rows = points[parts[index]]
            key = (side << 32) + parts[index].start
            work = scene, caster, sharing, divided, rows, _rows(bits, rows), settings.seed, key
            seen = reflection_hits(*work, metal)
            figures[index] = [seen.n_rays, seen.n_short, seen.n_lost]
            share[parts[index]], met[parts[index]] = seen.share, seen.met

        group = max(caster.threads, n_cores()) * _TOGETHER
        yield Progress("reflections", 0, len(points))
        for first in range(0, len(todo), group):
            batch = todo[first : first + group]
            cast_on_all_cores(caster, one, batch)
            yield Progress("reflections", parts[batch[-1]].stop, len(points))
        with damage_as_error(store.path, f"'{_name(side, 'figures')}'"):
            result += figures[...].sum(axis=0)
    add_seconds(seconds, "reflections", time.perf_counter() - start)
    store.update(reflections=kinds, seconds=seconds)
    return ReflectionResult(int((sides > 0).sum()), *result.tolist())


def read_reflections(store, scene, cube_map):
    """The `Reflections` of a finished bake, a tuple of one for each size of blocks.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    cube_map : CubeMap

    Raises
    ------
    PRTError
        They are missing, damaged or out of range.
    """
    result = []
    for points, divided, read in reflection_tables(store, scene, cube_map):
        met, share = read()
        tables = ((met[part], share[part]) for part in blocks(len(points)))
        result.append(Reflections.of_tables(points, divided, tables))
    return tuple(result)


def reflection_tables(store, scene, cube_map):
    """What `read_reflections` is made of, for each size of blocks.

    Yields
    ------
    points : (n,) int32
        That have such blocks, ascending.
    divided : Blocks
    read : callable() -> (n, n_blocks) int32, (n, n_blocks) uint8
        What they have met, and shares, as `Seen` has them.
    """
    n_points = len(scene.points)
    with damage_as_error(store.path, "'reflections'"):
        sides = list(store.attributes.get("reflections", []))
        expect(
            all(type(side) is int and side > 0 for side in sides),
            "the blocks of its reflections are damaged",
        )
    for side in sides:
        divided = Blocks(cube_map, side)
        points = store.read(_name(side, "points"), (None,), "int32")
        good = len(points) and points[0] >= 0 and points[-1] < n_points
        _expect(store, "points", good and (np.diff(points) > 0).all())
        yield points, divided, partial(_read, store, side, (len(points), len(divided)), n_points)


def _read(store, side, shape, n_points):
    met = store.read(_name(side, "met"), shape, "int32")
    share = store.read(_name(side, "share"), shape, "uint8")
    _expect(store, "met", met.min() >= DARK and met.max() < n_points)
    return met, share


def _expect(store, name, good):
    expect(good, f"{store.path}: '{name}' of its reflections is out of range; the bake is damaged")


def _name(side, what):
    return f"reflections_{side}_{what}"


def _rows(bits, rows):
    """Rows of a stored array, ascending: read as one range, in which they lie close together."""
    first, last = int(rows[0]), int(rows[-1]) + 1
    return bits[first:last][rows - first]
