"""What a page needs to show gloss: who sees what in reflections, and how surfaces reflect.

For each light the page fills a field of incoming light in, as `transport.incoming_field` does, from
its visibility bits and from what its points send. What is in the way of a block of directions, or
of a quarter of one where lobes are narrow, is a *patch*: a point, or a run of points along the
page's curve where there are more than have a number. Blocks lie in the order of their tree, each
before the quarters of the next.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from prt_core.errors import expect
from prt_core.export.web.gloss_lobes import pack_lobes
from prt_core.export.web.pack import shared_exponent
from prt_core.relight.glossy_points import SeenMetal, metal_among
from prt_core.sphere import Blocks
from prt_core.transport.incoming_field import FINER, divisor
from prt_core.transport.lobe_cuts import parts_along

# Blocks along an edge of a face, at most; and parts of a block that have a bit.
_SIDE, _CELLS = 8, (4, 2, 1)
# A page's patches, which 14 bits number, and the least cosine between the normals of one.
_MOST_PATCHES, _ALIKE = 16383, 0.7
# Texels of the field, at most.
_MOST_FIELD = 1 << 25
_PART = 1024


@dataclass(frozen=True)
class Tree:
    """Blocks of a cube map and their larger ones.

    Attributes
    ----------
    blocks : Blocks
        The smallest that have something in the way.
    top : int
        Of the largest along an edge of a face.
    levels : int
        Sizes of blocks.
    cells : int
        Parts along an edge of a block that have a bit each.
    """

    blocks: Blocks
    top: int
    levels: int
    cells: int

    @classmethod
    def of(cls, cube_map):
        """The tree of a `CubeMap`."""
        side = divisor(cube_map.resolution, _SIDE)
        step = cube_map.resolution // side
        top, levels = side, 1
        while top % 2 == 0 and top > 2:
            top, levels = top // 2, levels + 1
        cells = next(n for n in _CELLS if step % n == 0)
        return cls(Blocks(cube_map, side), top, levels, cells)

    def order(self, more=0):
        """(n_blocks,) int: which block of `blocks` each one in the order of the tree is.

        With `more` of those that are so many times halved.
        """
        deep, side = self.levels - 1 + more, self.blocks.side << more
        index = np.arange(6 * side**2)
        face, rest = np.divmod(index >> 2 * deep, self.top**2)
        row, column = np.divmod(rest, self.top)
        for level in range(deep - 1, -1, -1):
            quarter = index >> 2 * level & 3
            row, column = 2 * row + (quarter >> 1), 2 * column + (quarter & 1)
        return (face * side + row) * side + column

    def n_nodes(self, more=0):
        """Blocks of all sizes, and of so many smaller ones."""
        return sum(6 * self.top**2 * 4**level for level in range(self.levels + more))


def pack_gloss(pack, bake, points):
    """Put what gloss needs into a `Pack`.

    Parameters
    ----------
    pack : Pack
    bake : Bake
        Baked with gloss.
    points : (n,) int
        Of the bake, in the page's order; all `mirrored_points` are among them.

    Returns
    -------
    tuple of str
        What the page does not show as it is.
    dict
        What the page is told of it.
    """
    tree = Tree.of(bake.cube_map)
    number = np.full(len(bake.scene.points), -1)
    number[points] = np.arange(len(points))
    lobes, facts = pack_lobes(pack, bake, points)
    start = _patches(bake.scene, points)
    patch = np.repeat(np.arange(len(start) - 1), np.diff(start))
    metal, place = _metal(bake, points[start[:-1]], lobes.strong[start[:-1]])
    pack.add("patch", start.astype(np.uint32), differences=True)
    pack.add("metal", metal.astype(np.uint16))
    rows, n_wide, row_of = _rows(bake, tree, points, number)
    pack.add("gloss_row", row_of.astype(np.uint32), differences=True)
    pack.add("gloss_point", rows.astype(np.uint32), differences=True)
    # Two more, which negative numbers count from the end, of what returns no light.
    patch_of = np.zeros(len(bake.scene.points) + 2, np.int64)
    patch_of[points] = patch + 1
    # Wide lobes have what is in the way by blocks, narrow ones by their quarters.
    number_of, seen = np.full(len(start), -1), []
    number_of[metal + 1] = np.arange(len(metal))
    for more, name, some in ((0, "wide", rows[:n_wide]), (1, "narrow", rows[n_wide:])):
        if len(some):
            blocks = Blocks(bake.cube_map, tree.blocks.side << more)
            met, hidden, gathered = _in_the_way(bake, blocks, points[some], patch_of)
            order = tree.order(more)
            # Block by block: neighbours along the curve are alike in each.
            pack.add(f"{name}_met", met[:, order].T)
            pack.add(f"{name}_hidden", hidden[:, order].T)
            pack.add(f"{name}_gathered", gathered[order].astype(np.float32))
            pack.add(f"{name}_open", _mean_visibility(bake, points[some]))
            patch, block = number_of[met], np.broadcast_to(np.arange(len(blocks)), met.shape)
            there = np.zeros((len(metal), len(blocks)), bool)
            there[patch[patch >= 0], block[patch >= 0]] = True
            seen.append((more, there))
    pack.add("dice", _numbers(bake, tree, seen, place).astype(np.uint32), differences=True)
    # Blocks are cut into parts where lobes are narrower than these.
    fine = FINER * bake.cube_map.resolution if n_wide < len(rows) else bake.cube_map.resolution
    parts = parts_along(2 * tree.blocks.side, facts["narrowest"], fine)
    return lobes.notes, facts | {
        "top": tree.top,
        "levels": tree.levels,
        "cells": tree.cells,
        "wide": n_wide,
        "rows": len(rows),
        "patches": len(start) - 1,
        "metal": len(metal),
        "fine": fine,
        "parts": parts if n_wide < len(rows) else 0,
    }


def mirrored_points(bake):
    """(m,) int: points that glossy ones see, which a page needs whether cameras see them or not."""
    met = [part.met[part.met >= 0] for part in bake.reflections]
    return np.unique(np.concatenate([np.zeros(0, np.int32), *met]))


def pack_highlight(pack, index, source, scene, points):
    """Put what arrives of a lamp straight into a `Pack`, for its highlights.

    Parameters
    ----------
    pack : Pack
    index : int
        Of the source.
    source : Source
        Of a single lamp.
    scene : Scene
    points : (n,) int

    Returns
    -------
    dict
        lamp: eight numbers, its place (of a sun its direction) and how wide it is, its axis, and
        what it is: -1 a sun, 0 round, 1 flat; lamp_factor, by which what arrives was multiplied.
    """
    lamp, zero = source.lamp, [0.0, 0.0, 0.0]
    codes, factor = shared_exponent(np.maximum(source.direct[points] * source.sign, 0))
    pack.add(f"direct{index}", codes)
    if lamp.kind == "sun":
        numbers = [*lamp.towards, lamp.angle / 2, *zero, -1]
    else:
        place = scene.to_frame(lamp.position[None])[0]
        numbers = [*place, lamp.radius / scene.size, *zero, 0]
        if lamp.kind == "area":
            area = lamp.size[0] * lamp.size[1] / (4 / np.pi if lamp.ellipse else 1)
            numbers = [*place, area / scene.size**2, *lamp.axes[:, 2], 1]
    return {"lamp": [float(each) for each in numbers], "lamp_factor": factor * source.sign}


def _rows(bake, tree, points, number):
    """Glossy points that have a field: numbers in the page's order, those of wide lobes first.

    Returns
    -------
    rows : (n_rows,) int
    n_wide : int
    row_of : (n,) int
        Of every point of the page the row whose field it takes, from 1 on; 0: it has no gloss.
    """
    parts = [(number[part.points], part.blocks.side) for part in bake.reflections]
    narrow = np.zeros(len(points), np.int8) - 1
    for who, side in parts:
        narrow[who[who >= 0]] = side > tree.blocks.side and tree.cells > 1
    row_of = np.zeros(len(points), np.int64)
    kinds = [np.flatnonzero(narrow == kind) for kind in (0, 1)]
    sizes = tree.n_nodes(), tree.n_nodes(1)
    every = 1
    while sum(-(-len(who) // every) * size for who, size in zip(kinds, sizes, strict=True)) > (
        _MOST_FIELD
    ):
        every *= 2
    rows = np.concatenate([who[::every] for who in kinds])
    n_wide = len(kinds[0][::every])
    for who, first in zip(kinds, (0, n_wide), strict=True):
        if len(who):
            row_of[who] = 1 + first + _nearest(bake.scene.points, points[who], every)
    expect(len(rows), "bake: cameras see nothing of what is glossy in its scene")
    return rows, n_wide, row_of


def _nearest(points, which, every):
    """Of some points each one's nearest of every so many of them, alike in place and normal."""
    if every == 1:
        return np.arange(len(which))
    positions = points.positions[which]
    step = np.ptp(positions, axis=0).max() / np.sqrt(len(which))
    apart = 1e3 * points.object_index[which, None]
    key = np.concatenate([positions / step / every, points.normals[which], apart], axis=1)
    return cKDTree(key[::every]).query(key)[1]


def _patches(scene, points):
    """(n_patches + 1,) int: where runs of points along the page's curve begin, and the end.

    Those of a run are of one object and alike in normal.
    """
    run, normals, group = 1, scene.points.normals[points], scene.points.object_index[points]
    start = np.arange(len(points) + 1)
    while len(start) > _MOST_PATCHES + 1 and run < len(points):
        start, first, run = [0], 0, 2 * run
        for i in range(1, len(points)):
            same = group[i] == group[first] and normals[i] @ normals[first] > _ALIKE
            if not same or i - first >= run:
                first = i
                start.append(i)
        start = np.array([*start, len(points)])
    return start


def _metal(bake, starts, strong):
    """Patches of metal in the order of `SeenMetal`, and where in it each of their points is.

    Parameters
    ----------
    bake : Bake
    starts : (n_patches,) int
        Of the bake, a point of each patch.
    strong : (n_patches,) bool
        Those that are metal.

    Returns
    -------
    metal : (m,) int
    place : (m,) int
        Part of the reflections times the number of the bake's points, and row.
    """
    where, metal, place = np.full(len(bake.scene.points), -1), [np.zeros(0, int)], []
    where[starts[strong]] = np.flatnonzero(strong)
    for index, part in enumerate(bake.reflections):
        rows = np.flatnonzero(where[part.points] >= 0)
        metal.append(where[part.points[rows]])
        place.append(index * len(where) + rows)
    return np.concatenate(metal), np.concatenate(place)


def _numbers(bake, tree, seen, place):
    """Of what metal sends to who sees it the number that a `Relighter` has for it.

    Both throw the dice by it, so that what few facets miss is the same (see `transport.glimpse`).

    Parameters
    ----------
    bake : Bake
    tree : Tree
    seen : list of (int, (m, n_blocks) bool)
        In which blocks of the tree, or so many times halved ones, patches of metal are seen.
    place : (m,) int
        Of these patches, see `_metal`.

    Returns
    -------
    (k,) int
        Patch by patch, of blocks and then of quarters.
    """
    points = bake.scene.points
    glossy = np.concatenate([part.points for part in bake.reflections])
    strong = metal_among(points, glossy)
    strong = np.split(strong, np.cumsum([len(part) for part in bake.reflections])[:-1])
    keys = SeenMetal(bake.reflections, strong, len(points)).keys
    sides = [part.blocks.side for part in bake.reflections]
    total = sum(6 * side**2 for side in sides)
    # Each part of the reflections numbers its own.
    begin = np.searchsorted(keys, np.arange(len(sides)) * len(points) * total)
    numbers = []
    for more, there in seen:
        side = tree.blocks.side << more
        first = sum(6 * each**2 for each in sides[: sides.index(side)]) if side in sides else 0
        patch, block = np.nonzero(there)
        own = np.searchsorted(keys, place[patch] * total + first + block)
        numbers.append((patch, own - begin[place[patch] // len(points)]))
    patch, number = (np.concatenate(each) for each in zip(*numbers, strict=True))
    return number[np.argsort(patch, kind="stable")]


def _in_the_way(bake, blocks, rows, patch_of):
    """What stands in the way of blocks, and how much of what is not open it hides.

    Returns
    -------
    met : (n_rows, n_blocks) uint16
        A patch, from 1 on; 0 where nothing is that returns light.
    hidden : (n_rows, n_blocks) uint8
        In thirds: the rest lies below the horizon.
    gathered : (n_blocks,) float
        Light that all rows see there in the mean, under an even sky of 1.
    """
    n_blocks, n_points = len(blocks), len(patch_of) - 2
    met = np.zeros((len(rows), n_blocks), np.uint16)
    hidden = np.zeros((len(rows), n_blocks), np.uint8)
    even = bake.transport.radiance(np.ones((bake.cube_map.n_directions, 3), np.float32))
    even = np.append(even.mean(axis=1), [0, 0])
    gathered = np.zeros(n_blocks)
    place = np.full(n_points, -1)
    place[rows] = np.arange(len(rows))
    angles = bake.cube_map.solid_angles
    for part in bake.reflections:
        # Blocks of this part that share texels with each block of the tree.
        owner = part.blocks.of_texel[blocks.texels]
        around = [np.unique(each) for each in owner]
        most = max(map(len, around))
        around = np.stack([np.pad(each, (0, most - len(each)), "edge") for each in around])
        area = np.zeros((n_blocks, len(part.blocks)))
        np.add.at(area, (blocks.of_texel, part.blocks.of_texel), angles)
        area = area[np.arange(n_blocks)[:, None], around]
        area[:, 1:][np.diff(around, axis=1) == 0] = 0
        area /= blocks.solid_angles[:, None]
        for first in range(0, len(part), _PART):
            some = slice(first, min(first + _PART, len(part)))
            where = place[part.points[some]]
            if not (where >= 0).any():
                continue
            table = np.full((some.stop - first) * len(part.blocks), -1, np.int32)
            share = np.zeros(len(table), np.float32)
            at, entries = part.places(some)
            table[at], share[at] = part.met[entries], part.share[entries] / np.float32(255)
            table, share = (x.reshape(-1, len(part.blocks))[:, around] for x in (table, share))
            share = share * area
            chosen = share.argmax(axis=2)[..., None]
            table = np.take_along_axis(table, chosen, axis=2)[..., 0]
            share = share.sum(axis=2)
            bits = bake.transport.bits[part.points[some]]
            rest = 1 - blocks.pattern_shares(blocks.patterns(bits))
            ratio = np.clip(share / np.maximum(rest, 1e-6), 0, 1)
            mine = where >= 0
            patch = np.where(share > 0, patch_of[table], 0)
            met[where[mine]], hidden[where[mine]] = patch[mine], np.rint(3 * ratio)[mine]
            gathered += (share * even[table])[mine].sum(axis=0)
    return met, hidden, gathered / max(len(rows), 1)


def _mean_visibility(bake, rows):
    """(n_directions,) uint8: how many of some points see each texel, in 255ths."""
    seen = np.zeros(bake.cube_map.n_directions)
    for first in range(0, len(rows), _PART):
        bits = bake.transport.bits[rows[first : first + _PART]]
        seen += np.unpackbits(bits, axis=1, count=len(seen), bitorder="little").sum(axis=0)
    return np.rint(255 * seen / len(rows)).astype(np.uint8)
