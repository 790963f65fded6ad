"""What a page needs to show gloss: who sees what in reflections, and how surfaces reflect.

For each light the page fills a field of incoming light in, as `transport.incoming_field` does, from
its visibility bits and from what its points send. What is in the way of a block of directions is a
*patch*, a run of points along the page's curve: few numbers, which deflate well. Blocks lie in the
order of their tree, each before the quarters of the next.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from prt_core.errors import expect
from prt_core.export.web.gloss_lobes import pack_lobes
from prt_core.export.web.pack import shared_exponent
from prt_core.sphere import Blocks
from prt_core.transport.incoming_field import FINER, divisor
from prt_core.transport.lobe_cuts import parts_along

# Blocks along an edge of a face, at most; and parts of a block that have a bit.
_SIDE, _CELLS = 8, (4, 2, 1)
# A page's patches, which 14 bits number, and those of metal, which take longer; the least cosine
# between the normals of a patch.
_MOST_PATCHES, _MOST_METAL = 16383, 1024
_ALIKE = 0.7
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

    def order(self):
        """(n_blocks,) int: which block of `blocks` each one in the order of the tree is."""
        index = np.arange(len(self.blocks))
        face, rest = np.divmod(index >> 2 * (self.levels - 1), self.top**2)
        row, column = np.divmod(rest, self.top)
        for level in range(self.levels - 2, -1, -1):
            quarter = index >> 2 * level & 3
            row, column = 2 * row + (quarter >> 1), 2 * column + (quarter & 1)
        return (face * self.blocks.side + row) * self.blocks.side + column

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
        Of the bake, in the page's order.

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
    start, metal = _patches(bake.scene, points, lobes.strong)
    patch = np.repeat(np.arange(len(start) - 1), np.diff(start))
    pack.add("patch", start.astype(np.uint32), differences=True)
    pack.add("metal", metal.astype(np.uint16), differences=True)
    number_of = np.full(len(start), -1)
    number_of[metal + 1] = np.arange(len(metal))
    rows, n_wide, row_of = _rows(bake, tree, points, number)
    pack.add("gloss_row", row_of.astype(np.uint32), differences=True)
    pack.add("gloss_point", rows.astype(np.uint32), differences=True)
    # Two more, which negative numbers count from the end, of what returns no light.
    patch_of = np.append(patch[_in_page(bake.scene, points)] + 1, [0, 0])
    met, hidden, gathered = _in_the_way(bake, tree, points[rows], patch_of)
    order = tree.order()
    # Block by block: neighbours along the curve are alike in each.
    met = met[:, order]
    pack.add("met", met.T)
    # From where metal is seen: blocks of directions in which others have it.
    seen = number_of[met]
    row, block = np.nonzero(seen >= 0)
    glimpses = np.unique(seen[row, block] * len(order) + block)
    pack.add("glimpse", glimpses.astype(np.uint32), differences=True)
    pack.add("hidden", hidden[:, order].T)
    pack.add("gloss_met", gathered[order].astype(np.float32))
    pack.add("gloss_open", _mean_visibility(bake, points[rows]))
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


def _patches(scene, points, strong):
    """Runs of points along the page's curve, of one object each and alike in normal.

    Returns
    -------
    start : (n_patches + 1,) int
        Where each begins, and the end.
    metal : (m,) int
        Those of metal.
    """
    run = metal_run = 1
    normals, group = scene.points.normals[points], scene.points.object_index[points]
    kind = 2 * group + strong
    while True:
        start, first, count = [0], 0, 0
        for i in range(1, len(points)):
            count += 1
            same = kind[i] == kind[first] and normals[i] @ normals[first] > _ALIKE
            if not same or count >= (metal_run if strong[first] else run):
                first, count = i, 0
                start.append(i)
        metal = np.flatnonzero(strong[start])
        if len(metal) > _MOST_METAL and metal_run < len(points):
            metal_run *= 2
        elif len(start) > _MOST_PATCHES and run < len(points):
            run, metal_run = 2 * run, 2 * metal_run
        else:
            return np.array([*start, len(points)]), metal[:_MOST_METAL]


def _in_page(scene, points):
    """(n_points,) int: of every point of the bake the page's point that stands for it."""
    number = np.full(len(scene.points), -1)
    number[points] = np.arange(len(points))
    others = np.flatnonzero(number < 0)
    if len(others):
        # What cameras do not see is the colour of what is nearest, where it is mirrored.
        everything = np.concatenate([scene.points.positions, 0.1 * scene.points.normals], axis=1)
        number[others] = cKDTree(everything[points]).query(everything[others])[1]
    return number


def _in_the_way(bake, tree, rows, patch_of):
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
    n_blocks, n_points = len(tree.blocks), len(patch_of) - 2
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
        owner = part.blocks.of_texel[tree.blocks.texels]
        around = [np.unique(each) for each in owner]
        most = max(map(len, around))
        around = np.stack([np.pad(each, (0, most - len(each)), "edge") for each in around])
        area = np.zeros((n_blocks, len(part.blocks)))
        np.add.at(area, (tree.blocks.of_texel, part.blocks.of_texel), angles)
        area = area[np.arange(n_blocks)[:, None], around]
        area[:, 1:][np.diff(around, axis=1) == 0] = 0
        area /= tree.blocks.solid_angles[:, None]
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
            seen = tree.blocks.pattern_sums(tree.blocks.patterns(bits), angles)
            rest = 1 - seen / tree.blocks.solid_angles
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
