import sys
from dataclasses import replace

import numpy as np
import pytest

from prt_core import (
    BakeSettings,
    EnvironmentMap,
    Lamp,
    Lighting,
    PRTError,
    Relighter,
    Scene,
    bake_steps,
    load,
    run,
)
from prt_core.bake.first_look import first_look_steps
from prt_core.bake.lights import Beside
from prt_core.bake.pictures import Pictures, handed_out
from prt_core.evaluate.metrics import colour_error
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from tests.core.store.conftest import expect_same
from tests.meshes import ball_on_paint, leaf, plane, sphere

SETTINGS = BakeSettings(resolution=8, tolerance=0.1, method="agreement", caster="auto", seed=3)
pictures_module = sys.modules["prt_core.bake.pictures"]


@pytest.fixture(scope="module", autouse=True)
def fewer_points():
    """As if there were a hundred times as many."""
    with pytest.MonkeyPatch.context() as patch:
        for name, count in (("_FIRST", 60), ("_COARSE", 150), ("_MOST", 400)):
            patch.setattr(pictures_module, name, count)
        patch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 128)
        yield


@pytest.fixture(scope="module")
def scene():
    return ball_on_paint(more=[leaf(), sphere(6, 0.3, (0.6, 0.6, 0.4), name="bead")])


def light(bake):
    """A sky that is bright on one side."""
    sky = np.random.default_rng(5).random((bake.cube_map.n_directions, 3))
    side = np.exp(6 * (bake.cube_map.directions @ [0.6, 0.3, 0.74] - 1))
    return (0.3 * sky + 5 * side[:, None]).astype(np.float32)


def baked(scene, path, settings=SETTINGS, pictures=None, **options):
    """The pictures of a bake."""
    pictures, taken = pictures or Pictures(), []
    steps = bake_steps(scene, path, settings, pictures=pictures, **options)
    run(handed_out(steps, pictures, taken.append))
    return taken


@pytest.fixture(scope="module")
def shown(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("shown") / "a.prt"
    return path, baked(scene, path)


def radiance(bake, emission="all"):
    """As anybody would relight it, with what shines in the scene."""
    return Relighter(bake, form="exact").radiance(Lighting(light(bake), emission=emission))


def errors_of(pictures, truth, emission):
    """Relative L2 of the colours of all objects."""
    wanted = truth.colours(radiance(truth, emission))
    names = sorted(wanted)
    return [
        colour_error(*(np.concatenate([c[n] for n in names]) for c in (colours, wanted)))["l2"]
        for colours in (picture.colours(radiance(picture, emission)) for picture in pictures)
    ]


def test_pictures_come_nearer_and_say_so(tmp_path):
    ball = sphere(16, 0.4, (0, 0, 0.45), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(33, -1.2, 1.2, name="floor", albedo=0.7)])
    pictures = baked(scene, tmp_path / "a.prt", replace(SETTINGS, tolerance=0.03))
    errors = errors_of(pictures, load(tmp_path / "a.prt"), "none")
    known = [picture.known_percent for picture in pictures]
    said = [picture.error for picture in pictures]
    assert len(pictures) >= 5 and known == sorted(known) and known[0] < 10 and known[-1] == 100
    # Of some sixty points a few decide: pictures side by side may differ by that.
    assert all(b <= 1.5 * a for a, b in zip(errors, errors[1:], strict=False)), errors
    assert all(b < a for a, b in zip(errors, errors[2:], strict=False)), errors
    assert all(b <= 1.02 * a for a, b in zip(said, said[1:], strict=False)), said
    assert errors[0] < 0.25 and errors[2] < 0.6 * errors[0] and said[2] < 0.7 * said[0]
    # An estimate, under other skies: neither a third of it nor three times as much.
    assert all(1 / 3 < a / b < 3 for a, b in zip(said[:3], errors[:3], strict=True)), (said, errors)


def test_what_glows_counts_in_what_is_said(shown):
    path, pictures = shown
    errors, said = errors_of(pictures, load(path), "all"), [p.error for p in pictures]
    # Of a bake each emitter's bounces are kept, here they are made anew.
    assert errors[-1] < 1e-3 and errors[-2] < 0.7 * errors[0]
    assert said[-2] < 0.7 * said[0] and said[0] > errors[0] / 3


def test_the_last_picture_is_the_finished_bake(shown):
    path, pictures = shown
    bake, last = load(path), pictures[-1]
    assert last.error == bake.report["error"] and not last.transport.is_coarse
    np.testing.assert_array_equal(
        last.transport.radiance(light(bake)), bake.transport.radiance(light(bake))
    )


def test_while_light_moves_few_points_stand_for_all(shown):
    first, *_, last = shown[1]
    assert first.coarse is None and last.coarse.transport.is_coarse
    assert len(last.coarse.transport.bits) < len(last.transport.bits) / 3
    few, all_of = (radiance(bake) for bake in (last.coarse, last))
    assert few.shape == all_of.shape and colour_error(few, all_of)["l2"] < 0.3


@pytest.mark.parametrize("method", ["agreement", "exhaustive"])
def test_a_bake_with_pictures_is_the_same(scene, tmp_path, method):
    settings = replace(SETTINGS, method=method)
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    taken = baked(scene, tmp_path / "b.prt", settings)
    expect_same(tmp_path / "a.prt", tmp_path / "b.prt")
    reports = [load(tmp_path / name).report for name in ("a.prt", "b.prt")]
    assert reports[0]["rays"] == reports[1]["rays"]
    assert taken[0].known_percent < 15 and taken[-1].known_percent == 100
    # Where every entry is traced blocks are shown.
    assert len(taken) >= 4


def test_a_bake_that_shows_itself_can_be_stopped(shown, scene, tmp_path):
    steps = bake_steps(scene, tmp_path / "b.prt", SETTINGS, pictures=Pictures())
    for _ in range(12):
        next(steps)
    steps.close()
    taken = baked(scene, tmp_path / "b.prt")
    expect_same(tmp_path / "b.prt", shown[0])
    assert taken[-1].known_percent == 100


def test_beside_the_caller_as_in_front_of_him(shown, scene, tmp_path):
    taken = baked(scene, tmp_path / "b.prt", pace=0.01)
    expect_same(tmp_path / "b.prt", shown[0])
    np.testing.assert_array_equal(radiance(taken[-1]), radiance(shown[1][-1]))


def test_pictures_take_no_more_than_their_share(scene, tmp_path):
    pictures = Pictures(share=1e-6, to_the_end=False)
    taken = baked(scene, tmp_path / "b.prt", pictures=pictures)
    # The first costs nothing; the next takes more than there is, and none comes after it.
    assert len(taken) == 2 and taken[0].known_percent < taken[1].known_percent < 100


def test_a_picture_waits_that_would_take_too_much(scene, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(pictures_module.time, "perf_counter", lambda: clock[0])
    pictures = Pictures(share=0.1)
    cube_map, n = CubeMap(8), len(scene.points)
    caster = scene.make_caster("auto", "diffuse", 8)
    pictures.begin(scene, cube_map, SETTINGS, caster, Beside())
    assert not pictures.is_due() and pictures.take() is not None and pictures.is_due()
    few = np.arange(150)
    pictures.level(few, visibility_bits(scene, cube_map, caster, few))
    pictures.take()
    pictures.spent(1.0)
    # All points are some n / 150 as many, which take the root of that as long.
    needed = 10 * (1 + (n / 150) ** 0.5)
    clock[0] = 0.99 * needed
    assert not pictures.is_due() and pictures.is_due(150)
    clock[0] = 1.01 * needed
    assert pictures.is_due()


def test_a_scene_that_is_known_is_looked_at_before_it_is_read_again(shown, scene, tmp_path):
    pictures = Pictures()
    run(first_look_steps(scene, SETTINGS, pictures, 0.01))
    first = pictures.take()
    np.testing.assert_array_equal(radiance(first), radiance(shown[1][0]))
    taken = baked(scene, tmp_path / "b.prt", pictures=pictures)
    expect_same(tmp_path / "b.prt", shown[0])
    assert taken[0].known_percent > 1.5 * first.known_percent
    # Of another scene there is another first look.
    pictures, other = Pictures(), Scene.from_meshes([plane(9), sphere(6, 0.3, (0, 0, 0.4))])
    run(first_look_steps(other, SETTINGS, pictures, 0.01))
    pictures.take()
    assert baked(scene, tmp_path / "c.prt", pictures=pictures)[0].known_percent < 15


def test_a_room_lit_by_a_glowing_wall_is_not_black_at_first(tmp_path):
    box = sphere(8, 1.2, inside=True, name="room", albedo=0.6)
    glow = sphere(5, 0.2, (0.3, 0, 0.4), name="lamp")
    from tests.meshes import glowing

    scene = Scene.from_meshes([box, glowing(glow, (4.0, 3.0, 2.0))])
    taken = baked(scene, tmp_path / "a.prt", replace(SETTINGS, tolerance=0.1))
    final = load(tmp_path / "a.prt")
    on = Lighting(emission="all")
    wanted, first = (
        bake.colours(Relighter(bake).radiance(on))["room"] for bake in (final, taken[0])
    )
    assert abs(colour_error(first, wanted)["mean"]) < 0.15
    assert colour_error(first, wanted)["l2"] < 0.35


def test_a_relighter_takes_another_state_of_the_bake(shown):
    pictures = shown[1]
    image = EnvironmentMap(np.random.default_rng(8).random((8, 16, 3), np.float32))
    asked = Lighting(image, lamps=[Lamp("point", (1, 2, 3), (0, 0, 4))], emission="all")
    one = Relighter(pictures[0], form="exact")
    for picture in (pictures[0], pictures[-1], pictures[-1].coarse, pictures[1]):
        one.replace(picture)
        alone = Relighter(picture, form="exact")
        np.testing.assert_array_equal(one.radiance(asked), alone.radiance(asked))
    # An image that was there is turned quickly while few points stand for all.
    turned = replace(asked, rotation=40.0)
    few, exact = one.radiance(turned), Relighter(pictures[1], form="exact").radiance(turned)
    assert (few != exact).any() and colour_error(few, exact)["l2"] < 0.05


def test_direct_light_only_gathers_nothing(scene, tmp_path):
    taken = baked(scene, tmp_path / "a.prt", replace(SETTINGS, bounces=0))
    assert all(picture.transport.gather is None for picture in taken)
    assert taken[-1].error == 0


def test_what_is_wrong_is_said(scene, tmp_path):
    with pytest.raises(PRTError, match="pictures: expected a Pictures"):
        run(bake_steps(scene, tmp_path / "a.prt", SETTINGS, pictures=3))
    for share in (0, 1, -1, "much", float("nan")):
        with pytest.raises(PRTError, match="share"):
            Pictures(share)
