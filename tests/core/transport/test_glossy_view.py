"""The field of incoming light and lobes over it, against sums over all texels."""

import numpy as np
import pytest

from prt_core.reflectance import Constant, Microfacet, OrenNayar, local_frames
from prt_core.scene import Scene
from prt_core.sphere import Blocks, CubeMap, tangents
from prt_core.transport import Reflections, Sharing, bright_lobes, reflection_hits, visibility_bits
from prt_core.transport import glimpse as module
from prt_core.transport.glimpse import Glimpses
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.incoming_field import FINER, IncomingField, bright_texels
from prt_core.transport.lobe_values import lobe_values
from prt_core.transport.mirror import Mirror
from prt_core.transport.rough_diffuse import rough_share
from prt_core.transport.visibility import unpack
from tests.meshes import caster_of, plane, sphere, wall

RESOLUTION, SIDE = 16, 8
WAYS = np.array([[0.3, -0.5, 0.8], [0.9, 0.1, 0.35], [0.0, 0.0, 1.0]])


class Case:
    """A floor beside a wall and a ball, what is seen, and a sky."""

    def __init__(self, seed=0):
        meshes = [plane(5, name="floor"), wall(0.9, 2.0, 1.0, n=5), sphere(6, 0.3, (0, 0, 0.6))]
        self.scene = Scene.from_meshes(meshes, max_hidden=0)
        self.cube_map, caster = CubeMap(RESOLUTION), caster_of(self.scene)
        n = len(self.scene.points)
        points = np.arange(n)
        self.bits = visibility_bits(self.scene, self.cube_map, caster, points)
        self.blocks = Blocks(self.cube_map, SIDE)
        seen = reflection_hits(
            self.scene, caster, Sharing(self.scene), self.blocks, points, self.bits, 0
        )
        self.reflections = Reflections.of_tables(points, self.blocks, [(seen.met, seen.share)])
        self.field = IncomingField(self.reflections, self.bits)
        rng = np.random.default_rng(seed)
        way = self.cube_map.directions
        self.light = np.exp(3 * (way @ [0.6, -0.3, 0.74] - 0.5))[:, None] * [1.0, 0.8, 0.5]
        self.light = self.light.astype(np.float32)
        self.sent = rng.uniform(0.2, 0.4, (n, 3)).astype(np.float32)
        self.normals = self.scene.points.normals

    def dense(self, alpha, outgoing):
        """Sums over all texels, of the sky alone."""
        frames = local_frames(self.normals)
        lobe = Microfacet(alpha, alpha, Constant(1.0), multiple=False)
        incoming = np.einsum("mx,nkx->nmk", self.cube_map.directions, frames)
        view = np.einsum("nx,nkx->nk", outgoing, frames)[:, None]
        weights = lobe.eval(incoming, view)[..., 0] * np.maximum(incoming[..., 2], 0)
        weights = weights * self.cube_map.solid_angles * unpack(self.bits, 6 * RESOLUTION**2)
        return weights @ self.light


@pytest.fixture(scope="module")
def case():
    return Case()


def white(n, powers=1):
    result = np.zeros((n, 4, 3), np.float32)
    result[:, :powers] = 1
    return result


def relative(ours, wanted):
    return np.sqrt(((ours - wanted) ** 2).sum() / (wanted**2).sum())


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("alpha", "bound"), [(0.16, 0.03), (0.3, 0.02), (0.6, 0.02)])
def test_lobes_over_the_field_are_near_the_dense_sum(case, way, alpha, bound):
    n = len(case.scene.points)
    case.field.update(case.light, 0 * case.sent)
    outgoing = np.tile(way / np.linalg.norm(way), (n, 1)).astype(np.float32)
    view = GlossyView(case.field, case.normals)
    ours = view.reflected(np.arange(n), outgoing, np.full(n, alpha), white(n))
    seen = (outgoing * case.normals).sum(axis=1) > 0
    assert not ours[~seen].any()
    assert relative(ours[seen], case.dense(alpha, outgoing)[seen]) < bound


@pytest.mark.parametrize("cosine", [0.1, 0.2, 0.35])
def test_a_slanted_lobe_keeps_its_light_where_the_light_has_coarse_texels(cosine):
    scene, n = Scene.from_meshes([plane(2)]), 16
    cube_map, points = CubeMap(n), np.arange(len(scene.points))
    bits = visibility_bits(scene, cube_map, caster_of(scene), points)
    blocks, nothing = Blocks(cube_map, n), np.zeros((len(points), 6 * n * n))
    tables = [(nothing.astype(np.int32) - 1, nothing.astype(np.uint8))]
    field = IncomingField(Reflections.of_tables(points, blocks, tables), bits)
    field.update(np.ones((6 * n * n, 3), np.float32), np.zeros((len(points), 3), np.float32))
    way, alpha = np.float32([[0, np.sqrt(1 - cosine**2), cosine]]), np.float32([0.09])
    ours = GlossyView(field, scene.points.normals).reflected(points[:1], way, alpha, white(1))
    fine, up = CubeMap(256), np.float32([[0, 0, 1]])
    (lobe,) = lobe_values(fine.directions.T.astype(np.float32), up, way, alpha, None, 1)
    # Of coarse texels alone two thirds would be lost.
    np.testing.assert_allclose(ours, (lobe[0] * fine.solid_angles).sum(), rtol=0.12)


def test_a_round_lobe_with_axes_is_the_round_lobe(case):
    n = len(case.scene.points)
    case.field.update(case.light, case.sent)
    outgoing = np.tile([0.36, -0.48, 0.8], (n, 1)).astype(np.float32)
    view = GlossyView(case.field, case.normals)
    powers = np.random.default_rng(1).random((n, 4, 3)).astype(np.float32)
    rows, axes = np.arange(n), np.stack(tangents(case.normals), axis=1).astype(np.float32)
    one = view.reflected(rows, outgoing, np.full(n, 0.25), powers)
    two = view.reflected(rows, outgoing, np.full((n, 2), 0.25), powers, axes)
    np.testing.assert_allclose(one, two, rtol=2e-4, atol=1e-5)


def test_a_stretched_lobe_is_that_of_the_reflectance(case):
    n, alpha = len(case.scene.points), (0.5, 0.15)
    case.field.update(case.light, 0 * case.sent)
    outgoing = np.tile([0.36, -0.48, 0.8], (n, 1)).astype(np.float32)
    frames = local_frames(case.normals, np.tile([0.3, 0.9, 0.2], (n, 1)))
    view = GlossyView(case.field, case.normals)
    ours = view.reflected(
        np.arange(n), outgoing, np.tile(alpha, (n, 1)), white(n), frames[:, :2].astype(np.float32)
    )
    lobe = Microfacet(*alpha, Constant(1.0), multiple=False)
    incoming = np.einsum("mx,nkx->nmk", case.cube_map.directions, frames)
    local = np.einsum("nx,nkx->nk", outgoing, frames)[:, None]
    weights = lobe.eval(incoming, local)[..., 0] * np.maximum(incoming[..., 2], 0)
    weights = weights * case.cube_map.solid_angles * unpack(case.bits, 6 * RESOLUTION**2)
    assert relative(ours, weights @ case.light) < 0.03


def test_below_the_horizon_a_lobe_is_zero_also_where_its_denominator_is(case):
    up, alpha = np.float32([[0, 0, 1]]), np.float32([0.5])
    # (cosine + height)^2 (alpha^2 - 1) + 2 (1 + cosine) is 0 here, with a cosine cut at 0.
    below = np.float32([[np.sqrt(1 - 0.625**2)], [0], [-0.625]])
    for lobe in lobe_values(below, up, up, alpha, None, 4):
        np.testing.assert_array_equal(lobe, 0)


def test_what_stands_in_the_way_sends_its_light(case):
    n = len(case.scene.points)
    case.field.update(None, np.ones_like(case.sent))
    outgoing = np.tile([0.0, 0.0, 1.0], (n, 1)).astype(np.float32)
    ours = GlossyView(case.field, case.normals).reflected(
        np.arange(n), outgoing, np.full(n, 1.0), white(n)
    )
    # Under a sky of radiance 1 besides, all that a lobe has comes in.
    case.field.update(np.ones_like(case.light), np.ones_like(case.sent))
    whole = GlossyView(case.field, case.normals).reflected(
        np.arange(n), outgoing, np.full(n, 1.0), white(n)
    )
    # In front of the wall, whose back returns no light.
    floor = case.scene.points.object_index == 0
    floor &= case.scene.to_world(case.scene.points.positions)[:, 0] < 0.85
    assert (ours[floor] < whole[floor]).all() and ours[floor].max() > 0.1
    open_lobe = Microfacet(1.0, 1.0, Constant(1.0), multiple=False)
    incoming = case.cube_map.directions[None]
    weights = open_lobe.eval(incoming, np.array([[[0, 0, 1.0]]]))[..., 0]
    weights = (weights * np.maximum(incoming[..., 2], 0) * case.cube_map.solid_angles).sum()
    np.testing.assert_allclose(whole[floor], weights, rtol=0.03)


def test_a_hard_sun_comes_in_by_its_own_bits(case):
    n = len(case.scene.points)
    light = np.full_like(case.light, 0.1)
    sun = case.cube_map.texel_of(np.array([[0.2, 0.3, 0.9]]))[0]
    light[sun] = 1e5
    case.field.update(light, 0 * case.sent)
    assert case.field.bright.tolist() == [sun]
    assert case.field.rest.max() < 0.2
    outgoing = np.tile([0.0, 0.0, 1.0], (n, 1)).astype(np.float32)
    view = GlossyView(case.field, case.normals)
    ours = view.reflected(np.arange(n), outgoing, np.full(n, 0.3), white(n))
    seen = (case.normals[:, 2] > 0.2) & (ours[:, 0] > 0)
    case.light, kept = light, case.light
    wanted = case.dense(0.3, outgoing)
    case.light = kept
    np.testing.assert_allclose(ours[seen], wanted[seen], rtol=0.05, atol=0.05)
    dark = (case.normals[:, 2] > 0.2) & (np.abs(wanted[:, 0]) < 1)
    assert dark.any() and (ours[dark] < 2).all()


def test_light_in_detail_shows_in_narrow_lobes():
    case = Case()
    fine = CubeMap(FINER * RESOLUTION)
    way = fine.directions
    sharp = np.exp(400 * (way @ np.array([0.36, -0.48, 0.8]) - 1))[:, None] * [5.0, 5.0, 5.0]
    sharp = (sharp + 0.1).astype(np.float32)
    blocks = Blocks(fine, RESOLUTION)
    angles = fine.solid_angles[:, None]
    coarse = (blocks.sums(sharp * angles) / blocks.sums(angles)).astype(np.float32)
    n = len(case.scene.points)
    outgoing = np.tile([-0.36, 0.48, 0.8], (n, 1)).astype(np.float32)
    floor = case.scene.points.object_index == 0
    lobe = Microfacet(0.06, 0.06, Constant(1.0), multiple=False)
    weights = lobe.eval(way[None], outgoing[:1, None])[0, :, 0]
    weights = weights * np.maximum(way[:, 2], 0) * fine.solid_angles
    wanted, results = weights @ sharp, []
    for detailed in (None, sharp):
        case.field.update(coarse, 0 * case.sent, detailed=detailed)
        view = GlossyView(case.field, case.normals)
        ours = view.reflected(np.arange(n), outgoing, np.full(n, 0.06), white(n))
        results.append(np.abs(np.median(ours[floor, 0]) / wanted[0] - 1))
    assert results[1] < 0.04 < results[0]


def test_bright_texels_are_few_and_leave_the_mean_of_their_block():
    cube_map = CubeMap(RESOLUTION)
    blocks = Blocks(cube_map, SIDE)
    light = np.full((cube_map.n_directions, 3), 0.5, np.float32)
    assert not len(bright_texels(light, blocks)[0])
    light[37] = 500
    texels, more = bright_texels(light, blocks)
    assert texels.tolist() == [37]
    np.testing.assert_allclose(more, 499.5, rtol=1e-5)
    light[:] = 0
    assert not len(bright_texels(light, blocks)[0])


def test_mirrors_show_the_sky_or_what_is_met(case):
    n = len(case.scene.points)
    floor = np.flatnonzero(case.scene.points.object_index == 0)
    mirror = Mirror(case.field, case.bits)
    mirror.update(case.light, case.sent)
    up = np.tile([0.0, 0.0, 1.0], (n, 1)).astype(np.float32)
    seen = mirror.seen(floor, np.tile([-0.6, 0.0, 0.8], (len(floor), 1)))
    texel = case.cube_map.texel_of(np.array([[-0.6, 0.0, 0.8]]))[0]
    open_ = unpack(case.bits[floor], case.cube_map.n_directions)[:, texel] == 1
    np.testing.assert_array_equal(seen[open_], np.tile(case.light[texel], (open_.sum(), 1)))
    right = mirror.seen(floor, np.tile([0.98, 0.0, 0.199], (len(floor), 1)))
    # The wall's colours are of its own points, between 0.2 and 0.4.
    assert ((right > 0.19) & (right < 0.41)).all(axis=1).mean() > 0.5
    # Every other entry sends more by 10, and shows it where it is met.
    met = case.field.reflections.met
    entries = np.flatnonzero(met >= 0)[::2]
    mirror.resend(entries[:0], entries[:0], np.zeros((0, 3), np.float32))
    mirror.resend(entries, np.zeros(len(entries), int), np.full((1, 3), 10, np.float32))
    more = mirror.seen(floor, np.tile([0.98, 0.0, 0.199], (len(floor), 1))) - right
    brought = np.isclose(more, 10, atol=1e-5).all(axis=1)
    assert ((more == 0).all(axis=1) | brought).all() and 0.2 < brought.mean() < 0.8
    mirror.update(case.light, case.sent)
    again = mirror.seen(floor, np.tile([0.98, 0.0, 0.199], (len(floor), 1)))
    np.testing.assert_array_equal(again, right)
    reflected = mirror.reflected(np.arange(n), case.normals, up, white(n))
    assert np.isfinite(reflected).all()


def glimpse(field, normals, rows, outgoing, alpha, powers):
    """(k, 3): what is seen of one light in lobes of one roughness."""
    about = Glimpses(field, normals, rows, outgoing, *one_kind(normals, alpha, powers))
    return about.reflected()


def one_kind(normals, alpha, powers):
    """The kind of all points, and what lobes of alpha (k,) and powers (k, ...), all equal, are."""

    def lobes_of(kinds, cosine):
        return [(alpha[:1].repeat(len(kinds)), powers[:1].repeat(len(kinds), axis=0))]

    return np.zeros(len(normals), np.int32), lobes_of


@pytest.mark.parametrize("alpha", [0.15, 0.3, 0.7])
def test_glimpses_are_right_in_the_mean(case, alpha):
    case.field.update(case.light, case.sent)
    rng = np.random.default_rng(3)
    rows = np.repeat(np.flatnonzero(case.scene.points.object_index == 0), 40)
    outgoing = rng.normal(size=(len(rows), 3)) * 0.3 + [0, 0, 1]
    outgoing = (outgoing / np.linalg.norm(outgoing, axis=1, keepdims=True)).astype(np.float32)
    work = rows, outgoing, np.full(len(rows), alpha, np.float32), white(len(rows), 2)
    exact = GlossyView(case.field, case.normals).reflected(*work)
    about = glimpse(case.field, case.normals, *work)
    np.testing.assert_allclose(about.mean(axis=0), exact.mean(axis=0), rtol=0.03)
    # And no more than so far off each.
    assert relative(about, exact) < 0.7


def test_facets_that_are_kept_serve_other_lights_and_changes_of_the_field(case, monkeypatch):
    case.field.update(case.light, case.sent)
    rng = np.random.default_rng(5)
    rows = np.repeat(np.flatnonzero(case.scene.points.object_index == 0), 3)
    outgoing = rng.normal(size=(len(rows), 3)) * 0.3 + [0, 0, 1]
    outgoing = (outgoing / np.linalg.norm(outgoing, axis=1, keepdims=True)).astype(np.float32)
    # A coat that two of three points have.
    kinds = (np.arange(len(case.normals)) % 3 > 0).astype(np.int32)

    def lobes_of(kinds, cosine):
        wide, narrow = np.full(len(kinds), 0.4), np.full(len(kinds), 0.15)
        return [(wide, white(len(kinds))), (narrow, white(len(kinds)) * kinds[:, None, None])]

    work = case.field, case.normals, rows, outgoing, kinds, lobes_of
    kept = Glimpses(*work)
    sun = case.light.copy()
    sun[case.cube_map.texel_of(np.array([[0.2, 0.3, 0.9]]))] = 300
    results = []
    for light in (case.light, sun):
        case.field.update(light, case.sent)
        results.append(kept.reflected())
        np.testing.assert_array_equal(results[-1], Glimpses(*work).reflected())
    assert results[1].sum() > 1.5 * results[0].sum() and kept.nbytes > 20 * len(rows)
    wide, narrow = (
        glimpse(case.field, case.normals, rows, outgoing, np.full(1, alpha), white(1))
        for alpha in (0.4, 0.15)
    )
    np.testing.assert_allclose(results[1], wide + narrow * kinds[rows, None], rtol=1e-5)
    monkeypatch.setattr(bright_lobes, "_MOST", 1)
    np.testing.assert_allclose(kept.reflected(), results[1], rtol=1e-5)
    monkeypatch.undo()
    monkeypatch.setattr(module, "_MOST_KEPT", 10)
    many = Glimpses(*work)
    np.testing.assert_array_equal(many.reflected(), results[1])
    assert many.nbytes == 0


def test_what_is_seen_again_is_what_a_field_that_took_it_in_shows(case):
    reflections = case.field.reflections
    entries = np.flatnonzero(reflections.met >= 0)[::2]
    who, which = np.unique(reflections.met[entries], return_inverse=True)
    rows = np.repeat(np.flatnonzero(case.scene.points.object_index == 0), 4)
    outgoing = np.random.default_rng(2).normal(size=(len(rows), 3)) * 0.5 + [0, 0, 1]
    outgoing = (outgoing / np.linalg.norm(outgoing, axis=1, keepdims=True)).astype(np.float32)
    alpha, powers = np.full(len(rows), 0.4), white(len(rows), 2)
    same = one_kind(case.normals, alpha, powers)
    about = Glimpses(case.field, case.normals, rows, outgoing, *same)
    case.field.update(case.light, case.sent, settled=False)
    before = about.reflected()
    change = np.random.default_rng(3).uniform(0.5, 2, (len(who), 3)).astype(np.float32)
    case.field.resend(entries, which, change)
    brought = about.reflected() - before
    matrices = about.returned(entries, which, len(who))
    seen = [matrix @ values for matrix, values in zip(matrices, change.T, strict=True)]
    # The field has 8 bits for each value.
    assert relative(np.stack(seen, axis=1), brought) < 0.02 and brought.max() > 0.1
    assert not any(matrix.nnz for matrix in about.returned(entries[:0], which[:0], 5))
    many = np.tile(np.arange(len(rows)), (1 << 16) // len(rows) + 2)
    about = Glimpses(case.field, case.normals, rows[many], outgoing[many], *same)
    (matrix, *_) = about.returned(entries, which, len(who))
    assert matrix[1 << 16 :].nnz
    case.field.settle()
    settled = case.field.values.copy()
    case.field.update(case.light, case.sent)
    case.field.resend(entries, which, change)
    case.field.settle()
    np.testing.assert_array_equal(case.field.values, settled)


def test_a_glimpse_from_below_a_smooth_normal_is_light_all_the_same(case):
    case.field.update(case.light, case.sent)
    rows = np.flatnonzero(case.scene.points.object_index == 0)
    below = np.tile(np.float32([0.995, 0.0, -0.1]), (len(rows), 1))
    about = glimpse(
        case.field, case.normals, rows, below, np.full(len(rows), 0.3), white(len(rows))
    )
    assert np.isfinite(about).all() and (about.sum(axis=1) > 0).mean() > 0.5


@pytest.mark.parametrize("way", WAYS)
def test_rough_diffuse_light_is_that_of_the_dense_sum(case, way):
    case.field.update(case.light, 0 * case.sent)
    outgoing = (way / np.linalg.norm(way)).astype(np.float32)
    rows = np.flatnonzero(case.normals @ outgoing > 0.1)
    colour = np.float32([0.9, 0.5, 0.1])
    ours = rough_share(
        case.field, rows, case.normals[rows].astype(np.float32), np.tile(outgoing, (len(rows), 1)),
        np.full(len(rows), 0.8, np.float32), np.tile(colour, (len(rows), 1)),
    )  # fmt: skip
    frames = local_frames(case.normals[rows])
    incoming = np.einsum("mx,nkx->nmk", case.cube_map.directions, frames)
    view = np.einsum("x,nkx->nk", outgoing, frames)[:, None]
    weight = np.maximum(incoming[..., 2], 0) * case.cube_map.solid_angles
    weight = (weight * unpack(case.bits[rows], 6 * RESOLUTION**2))[..., None] * case.light
    lobe = OrenNayar(colour, 0.8).eval(incoming, view)
    wanted = (lobe * weight).sum(axis=1) / colour
    even = weight.sum(axis=1) / np.pi
    lit = even[:, 0] > 0.05 * even[:, 0].max()
    assert relative((ours * even)[lit], wanted[lit]) < 0.015
    assert relative(even[lit], wanted[lit]) > 0.05
    # What is smooth sends as much to all sides.
    smooth = rough_share(
        case.field, rows[:9], case.normals[rows[:9]].astype(np.float32),
        np.tile(outgoing, (9, 1)), np.zeros(9, np.float32), np.tile(colour, (9, 1)),
    )  # fmt: skip
    np.testing.assert_allclose(smooth, 1, rtol=1e-5)
