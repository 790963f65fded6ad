"""Blocks of several sizes, cuts through them, and means of lobes over light that spreads."""

import numpy as np
import pytest

from prt_core.sphere import Blocks, CubeMap, tangents
from prt_core.transport.field_nodes import FieldNodes
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.incoming_field import IncomingField
from prt_core.transport.lobe_cuts import cells, lobe_cut
from prt_core.transport.lobe_values import lobe_values
from tests.core.transport.test_glossy_view import Case, white


def test_larger_blocks_have_the_means_of_smaller_ones():
    nodes, fine = FieldNodes(12), CubeMap(12)
    assert nodes.sides == (12, 6, 3) and len(nodes) == 6 * (144 + 36 + 9)
    values = np.random.default_rng(0).random((2, 3, 864)).astype(np.float32)
    means = nodes.means(values)
    np.testing.assert_array_equal(means[..., :864], values)
    for index, side in enumerate(nodes.sides):
        blocks = Blocks(fine, side)
        wanted = blocks.sums((values * fine.solid_angles)[1, 2]) / blocks.solid_angles
        begin, end = nodes.first[index : index + 2]
        np.testing.assert_allclose(means[1, 2, begin:end], wanted, rtol=1e-4)


def test_nodes_are_where_their_light_is():
    nodes, cube_map = FieldNodes(8), CubeMap(32)
    even, spread = nodes.placed(cube_map, np.ones(cube_map.n_directions))
    middles = CubeMap(8).directions
    assert (np.einsum("nx,nx->n", even[:384], middles) > np.cos(0.01)).all()
    # Light that is even in a square has a twelfth of its area as variance along an axis.
    np.testing.assert_allclose(spread[:384], nodes.solid_angles[:384] / 12, rtol=0.35)
    light = np.zeros(cube_map.n_directions)
    light[1234] = 1
    placed, spread = nodes.placed(cube_map, light)
    for side, begin in zip(nodes.sides, nodes.first, strict=False):
        owner = begin + Blocks(cube_map, side).of_texel[1234]
        np.testing.assert_allclose(placed[owner], cube_map.directions[1234], atol=1e-4)
        assert spread[owner] < 1e-4


@pytest.mark.parametrize("parts", [1, 2])
@pytest.mark.parametrize("width", [0.1, 0.5])
def test_a_cut_has_every_direction_once_and_small_blocks_near_its_middle(width, parts):
    tree = FieldNodes(16)
    cut = lobe_cut(16, 8, 77, width, parts)
    counts = np.zeros(CubeMap(16).n_directions)
    counts[cut.core] += 1
    for index, side in enumerate(tree.sides):
        begin, end = tree.first[index : index + 2]
        mine = cut.nodes[(cut.nodes >= begin) & (cut.nodes < end)] - begin
        counts += np.isin(Blocks(CubeMap(16), side).of_texel, mine)
    np.testing.assert_array_equal(counts, 1)
    assert len(cut.core) == 0 if parts == 1 or width > 0.3 else len(cut.core) > 0
    centre = CubeMap(8).directions[77]
    away = np.arccos(np.clip(CubeMap(2).directions @ centre, -1, 1))
    large = np.isin(tree.first[3] + np.arange(24), cut.nodes)
    assert large.any() and away[large].min() > 0.9


def test_few_points_share_larger_cells():
    assert [cells(8, n) for n in (1, 5000, 60000)] == [3, 4, 6]
    assert cells(16, 60000) == 8 and cells(1, 60000) == 1


@pytest.mark.parametrize("alpha", [(0.25, 0.25), (0.3, 0.2)])
def test_values_are_means_over_light_that_spreads(alpha):
    rng = np.random.default_rng(2)
    normal = np.float32([[0, 0, 1]])
    view = np.float32([[0.5, 0.1, 0.0]])
    view[0, 2] = np.sqrt(1 - view[0] @ view[0])
    axes = np.stack(tangents(normal), axis=1).astype(np.float32)
    middles = rng.normal(size=(40, 3)) * 0.35 + [-0.5, -0.1, 0.86]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    first, second = tangents(middles)
    size, steps = 0.16, np.linspace(-0.5, 0.5, 9)[:, None]
    around = [middles + size * (x * first + y * second) for x in steps for y in steps]
    around = np.array([way / np.linalg.norm(way, axis=1, keepdims=True) for way in around])
    alpha = np.float32([alpha])

    def values(ways, spread=None):
        ways = np.ascontiguousarray(ways.reshape(-1, 3).T, np.float32)
        return lobe_values(ways, normal, view, alpha, axes, 1, spread)[0]

    wanted = values(around).reshape(len(around), -1).mean(axis=0)
    spread = np.full(40, size**2 * (steps**2).mean(), np.float32)
    without, within = values(middles)[0], values(middles, spread)[0]
    there = wanted > 0.05 * wanted.max()
    errors = [np.linalg.norm((each - wanted)[there]) for each in (without, within)]
    assert errors[1] < 0.45 * errors[0]
    if alpha[0, 0] == alpha[0, 1]:
        ways = np.ascontiguousarray(middles.T, np.float32)
        even = lobe_values(ways, normal, view, alpha[:, 0], None, 1, spread)[0][0]
        np.testing.assert_allclose(even, within, rtol=1e-3)


def test_what_is_sent_otherwise_is_taken_in_as_a_change():
    case = Case()
    reflections = case.reflections
    entries = np.arange(len(reflections.met))[reflections.met >= 0][::3]
    who, which = np.unique(reflections.met[entries], return_inverse=True)
    change = np.random.default_rng(1).uniform(-0.1, 0.5, (len(who), 3)).astype(np.float32)
    case.field.update(case.light, case.sent)
    before = GlossyView(case.field, case.normals)
    n = len(case.normals)
    outgoing = np.tile(np.float32([0.36, -0.48, 0.8]), (n, 1))
    work = np.arange(n), outgoing, np.full(n, 0.4, np.float32), white(n)
    dim = before.reflected(*work)
    case.field.resend(entries, which, change)
    case.field.settle()
    changed = case.field.values.copy()
    # The same, entry by entry, into a field of its own.
    other = IncomingField(reflections, case.bits)
    other.update(case.light, case.sent)
    row = np.repeat(np.arange(n), np.diff(reflections.start))[entries]
    wanted = (other.values.astype(np.uint32) << 16).view(np.float32)
    n_blocks = len(case.blocks)
    smallest = wanted[:, :, :n_blocks].copy()
    share = reflections.share[entries, None] / np.float32(255)
    smallest[row, :, reflections.block[entries]] += change[which] * share
    wanted = other.nodes.means(smallest)
    ours = (changed.astype(np.uint32) << 16).view(np.float32)
    np.testing.assert_allclose(ours, wanted, rtol=0.01, atol=1e-4)
    assert np.abs(GlossyView(case.field, case.normals).reflected(*work) - dim).max() > 0.01


def test_bright_texels_that_lie_together_are_one_for_wide_lobes():
    case = Case()
    light = np.full_like(case.light, 0.1)
    sun = case.cube_map.texel_of(np.array([[0.2, 0.3, 0.9]]))[0]
    light[[sun, sun + 1]] = 1e4
    case.field.update(light, 0 * case.sent)
    field = case.field
    assert len(field.bright) == 2 and field.merged is field.apart
    seen = (field.apart.values.astype(np.uint32) << 16).view(np.float32)
    sums = seen.sum(axis=2)[:, 0]
    share = (1e4 - 0.1) * case.cube_map.solid_angles[[sun, sun + 1]]
    bits = np.unpackbits(case.bits, axis=1, bitorder="little")[:, [sun, sun + 1]]
    np.testing.assert_allclose(sums, bits @ share, rtol=0.01, atol=1e-3)


def test_texels_as_bright_as_the_rest_of_their_block_bring_nothing():
    case = Case()
    light = np.full_like(case.light, 0.1)
    light[case.blocks.texels[200:220].ravel()] = 50
    case.field.update(light, 0 * case.sent)
    field = case.field
    assert len(field.bright) == 48
    np.testing.assert_allclose(np.linalg.norm(field.apart.directions, axis=1), 1, rtol=1e-5)
    assert not field.apart.values[:, :, field.apart.spread > 0.1].any()
    assert np.isfinite(field.directions).all() and np.isfinite(field.apart.spread).all()
