"""Another view of a bake with gloss under the same light: what it costs, and what it is."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.light import EnvironmentMap
from prt_core.rays.caster import known_casters
from prt_core.relight import relighter as module
from prt_core.relight.coarse_view import CoarseView
from prt_core.relight.gloss import Gloss
from prt_core.relight.glossy_points import METAL, SeenMetal
from prt_core.relight.lighting import Lighting
from prt_core.relight.point_lobes import PointLobes
from prt_core.relight.relighter import Relighter
from prt_core.transport import View
from prt_core.transport.incoming_field import IncomingField
from prt_core.transport.view_map import ViewMap
from tests.meshes import plane, sphere

CASTER = "embree" if "embree" in known_casters() else "brute"
SKY = EnvironmentMap(
    np.random.default_rng(4).random((8, 16, 3)).astype(np.float32) + np.float32(0.2), "sky"
)
LAMP = Lamp("point", (30, 20, 10), (1.0, -1.5, 2.5), radius=0.2)
LIGHTING = Lighting(SKY, lamps=[LAMP], lamp_samples=2, exposure=0.5)
ONE, OTHER = (View(np.array(place)) for place in ([-3.0, -2.0, 2.5], [2.0, -1.0, 1.2]))


def of(mesh, **gloss):
    n = len(mesh.materials.albedo)
    gloss = {name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in gloss.items()}
    return replace(mesh, materials=mesh.materials.replaced(**gloss))


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    path = tmp_path_factory.mktemp("views") / "a.prt"
    floor = of(plane(12, name="floor"), dielectric=1.0, roughness=0.5)
    gold = np.float32([1, 0.7, 0.3])
    ball = of(sphere(14, 0.4, (0, 0, 0.5)), metal=gold, stand_in=0.5 * gold, roughness=0.4)
    scene = Scene.from_meshes([floor, ball], max_hidden=0)
    run(bake_steps(scene, path, BakeSettings(resolution=8, caster=CASTER, bounces=1, gloss=True)))
    return load(path)


def test_another_view_is_that_of_relighting_bit_by_bit_and_leaves_the_light_alone(
    bake, monkeypatch
):
    relighter = Relighter(bake, CASTER)
    assert relighter.lit is None
    first = relighter.radiance(LIGHTING, view=ONE)
    assert relighter.lit is LIGHTING
    wanted = Relighter(bake, CASTER).radiance(LIGHTING, view=OTHER)
    # Neither received light, nor lamps' rays, nor the field of incoming light are asked for again.
    for kind, name in (
        (module.Environments, "read"), (module.LampLight, "steps"), (module.EmittedLight, "of"),
        (IncomingField, "update"),
    ):  # fmt: skip
        monkeypatch.setattr(kind, name, None)
    np.testing.assert_array_equal(run(relighter.view_steps(OTHER)), wanted)
    np.testing.assert_array_equal(run(relighter.view_steps(ONE, pace=0.01)), first)
    assert np.abs(wanted - first).max() > 0.05 * first.max()


def test_a_coarse_view_is_near_and_exact_where_it_is_evaluated(bake):
    relighter = Relighter(bake, CASTER)
    relighter.radiance(SKY, view=ONE)
    fine, *coarse = (run(relighter.view_steps(OTHER, every=every)) for every in (1, 2, 4, 16))
    points = bake.scene.points
    chosen = CoarseView(points, np.arange(len(points)), 4).chosen
    assert 0.2 < chosen.mean() < 0.3
    # Lobes of a class of roughness share a cut, which other points can change a little.
    np.testing.assert_allclose(coarse[1][chosen], fine[chosen], rtol=0.1, atol=0.01 * fine.max())
    errors = [np.linalg.norm(each - fine) / np.linalg.norm(fine) for each in coarse]
    without = np.linalg.norm(relighter.radiance(SKY) - fine) / np.linalg.norm(fine)
    # The ball has 182 points: of one of four few are left for its reflections.
    assert 0 < errors[0] < errors[1] < errors[2] < without
    assert errors[0] < 0.15 and errors[1] < 0.4 * without
    away = np.einsum("nx,nx->n", OTHER.outgoing(bake.scene.to_world(points.positions)),
                     points.normals) <= 0  # fmt: skip
    np.testing.assert_array_equal(coarse[1][away], fine[away])


def test_points_between_follow_those_that_face_the_viewer(bake):
    points = bake.scene.points
    n = len(points)
    coarse = CoarseView(points, np.arange(n), 3)
    rest = ~coarse.chosen
    values = np.where(coarse.chosen, 7.0, -1.0).astype(np.float32)[:, None].repeat(2, axis=1)
    facing = points.normals[:, 2] > 0
    coarse.follow(values, facing)
    np.testing.assert_allclose(values[rest & (points.normals[:, 2] > 0.3)], 7, rtol=1e-6)
    assert (values[rest & ~facing] == -1).all()
    # What is known besides stays as it is.
    values = np.where(coarse.chosen, 7.0, -1.0).astype(np.float32)[:, None]
    coarse.follow(values, facing, rest & (points.object_index == 1))
    ball = points.object_index == 1
    assert (values[rest & ball] == -1).all() and (values[rest & ~ball & facing] == 7).any()
    # Values of one object do not reach the other.
    values = points.object_index.astype(np.float32)[:, None].copy()
    coarse.follow(values, np.ones(n, bool))
    np.testing.assert_allclose(values[:, 0], points.object_index, atol=1e-6)


def test_few_points_of_an_object_are_evaluated_themselves(bake):
    points = bake.scene.points
    ball = np.flatnonzero(points.object_index == 1)
    glossy = np.concatenate([np.flatnonzero(points.object_index == 0), ball[:2]])
    assert CoarseView(points, glossy, 16).chosen[ball[:2]].any()
    alone = CoarseView(points, ball[:5], 64)
    assert alone.chosen.sum() == 5 and not alone.chosen[ball[5:]].any()


def test_what_is_seen_from_several_points_along_one_direction_is_there_once(bake):
    gloss = Gloss(bake, CASTER)
    parts, points = gloss._parts, bake.scene.points
    strong = [part.strength() > METAL for part in parts]
    seen = SeenMetal([part.field.reflections for part in parts], strong, len(points))
    assert (np.diff(seen.keys) > 0).all()
    lengths = [part.stop - part.start for part in seen.parts]
    owner, outgoing = np.repeat(np.arange(len(parts)), lengths), seen.outgoing[:]
    sights = np.column_stack([owner, seen.row, outgoing])
    assert 0 < len(np.unique(sights, axis=0)) == len(seen)
    assert len(seen) < sum(len(entries) for entries, _ in seen.entries)
    ball = points.object_index == 1
    for part, (entries, which) in zip(parts, seen.entries, strict=True):
        reflections = part.field.reflections
        met = reflections.met[entries]
        who = [parts[p].points[row] for p, row in zip(owner, seen.row, strict=True)]
        np.testing.assert_array_equal(np.array(who)[which], met)
        ways = -reflections.blocks.directions[reflections.block[entries]]
        np.testing.assert_allclose(outgoing[which], ways, atol=1e-6)
        # The floor reflects less than metals do.
        assert ball[met].all()
        assert (ball[reflections.met] & (reflections.met >= 0)).sum() == len(entries)


def test_without_a_light_there_is_no_view(bake, monkeypatch):
    relighter = Relighter(bake, CASTER)
    with pytest.raises(PRTError, match="view: no light is known yet; relight with a view first"):
        run(relighter.view_steps(ONE))
    relighter.radiance(LIGHTING, view=ONE)
    # A light that did not come to its end is no light.
    with monkeypatch.context() as broken:
        broken.setattr(Gloss, "light", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            relighter.radiance(LIGHTING, view=OTHER)
    with pytest.raises(PRTError, match="no light is known"):
        run(relighter.view_steps(ONE))
    relighter.radiance(LIGHTING, view=ONE)
    with pytest.raises(PRTError, match="every: expected a whole number >= 1"):
        run(relighter.view_steps(ONE, every=0))
    with pytest.raises(PRTError, match="view: expected"):
        run(relighter.view_steps((1, 2, 3)))
    relighter.close()
    with pytest.raises(PRTError, match="no light is known"):
        run(relighter.view_steps(ONE))


def test_maps_of_views_serve_views_that_move_until_the_light_changes(bake, monkeypatch):
    relighter = Relighter(bake, CASTER)
    with pytest.raises(PRTError, match="no light is known yet"):
        run(relighter.map_views_steps())
    relighter.radiance(LIGHTING, view=ONE)
    fine = run(relighter.view_steps(OTHER))
    # Without maps, nothing is looked up.
    np.testing.assert_array_equal(run(relighter.view_steps(OTHER, mapped=True)), fine)
    assert not relighter.maps_views
    # So few points would not be worth it.
    monkeypatch.setattr(ViewMap.__init__, "__defaults__", (0, None))
    steps = relighter.map_views_steps()
    next(steps)
    steps.close()
    assert not relighter.maps_views
    run(relighter.map_views_steps())
    assert relighter.maps_views
    mapped = run(relighter.view_steps(OTHER, mapped=True))
    points = bake.scene.points
    outgoing = OTHER.outgoing(bake.scene.to_world(points.positions))
    # Where views graze, blocks of so few texels are too large for lobes that are evaluated.
    seen = np.einsum("nx,nx->n", outgoing, points.normals) > 0.4
    off = np.linalg.norm((mapped - fine)[seen]) / np.linalg.norm(fine[seen])
    assert 0 < off < 0.02
    # All points are looked up, and none follows another.
    np.testing.assert_array_equal(run(relighter.view_steps(OTHER, every=8, mapped=True)), mapped)
    np.testing.assert_array_equal(run(relighter.view_steps(OTHER)), fine)
    relighter.radiance(replace(LIGHTING, strength=2.0), view=ONE)
    assert not relighter.maps_views
    with pytest.raises(PRTError, match="mapped: expected"):
        run(relighter.view_steps(OTHER, mapped=3))
    # Where maps do not pay, lobes are evaluated as ever.
    monkeypatch.setattr(ViewMap.__init__, "__defaults__", (10**6, None))
    run(relighter.map_views_steps())
    assert relighter.maps_views
    np.testing.assert_array_equal(
        run(relighter.view_steps(OTHER, mapped=True)), run(relighter.view_steps(OTHER))
    )


def test_lobes_below_a_coat_that_is_narrow_have_no_map(bake):
    gloss = Gloss(bake, CASTER)
    kinds, first, least = gloss.lobes.kinds()
    assert len(first) == 2 and len(np.unique(kinds)) == 2
    np.testing.assert_allclose(np.unique(least), [0.16, 0.25], rtol=1e-5)
    materials = bake.scene.points.materials[np.arange(3)]
    coat = {"coat": [[0], [1], [1]], "coat_roughness": [[0.1], [0.1], [0.8]]}
    brushed = {"metal": np.ones((3, 3)), "anisotropy": [[0], [0], [0.5]], "tangent": np.eye(3)}
    for more, wanted in ((coat, [0.25, 0.01, 0.25]), (brushed, [0.25, 0.25, 0])):
        more = {name: np.float32(value) for name, value in more.items()}
        lobes = PointLobes(materials.replaced(**more), bake.scene.points.normals[:3])
        np.testing.assert_allclose(lobes.kinds()[2], wanted, rtol=1e-3)
