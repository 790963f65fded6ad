"""Emitters in a bake: furnaces, sums, other colours, stops and damage, compressed forms."""

import json
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Lighting, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress, relight, relight_points
from prt_core.cli import main
from prt_core.reflectance import Materials
from prt_core.relight import Relighter
from prt_core.scene import Mesh, with_camera_image
from prt_core.scene.camera import auto_camera
from prt_core.store import BakeStore
from tests.meshes import caster_of, glowing, plane, sphere

SETTINGS = BakeSettings(resolution=3, tolerance=0.02)
SKY = (1 + np.random.default_rng(3).random((54, 3))).astype(np.float32)
TUBE, SIGN = (4.0, 1.0, 0.5), (0.0, 3.0, 1.0)


def bake(meshes, path, settings=SETTINGS, **options):
    run(bake_steps(Scene.from_meshes(meshes, max_hidden=0), path, settings, **options))
    return load(path)


def downwards(mesh):
    return replace(
        mesh, triangle_corners=mesh.triangle_corners[:, ::-1], corner_normal=-mesh.corner_normal
    )


def lamps():
    """A floor with colours under two emitters, one of which has a texture of brightness."""
    floor = plane(7, name="floor", albedo=(0.6, 0.4, 0.2))
    tube = glowing(downwards(plane(2, -0.2, 0.1, name="tube", z=0.5, albedo=0.3)), TUBE)
    sign = glowing(downwards(plane(3, 0.3, 0.7, name="sign", z=0.4)), SIGN)
    brightness = np.linspace(0.2, 1, len(sign.corner_vertex))[:, None]
    emission = sign.materials.emission * brightness
    return [floor, tube, replace(sign, materials=sign.materials.replaced(emission=emission))]


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    return bake(lamps(), tmp_path_factory.mktemp("bakes") / "a.prt")


def shown(bake, light=None, **keywords):
    return relight_points(bake, light, **keywords)


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.8])
def test_a_closed_furnace(albedo, tmp_path):
    room = glowing(sphere(7, inside=True, albedo=albedo), (0.5, 0.25, 0.0))
    furnace = bake([room], tmp_path / "a.prt")
    wanted = np.array([0.5, 0.25, 0]) / (1 - albedo)
    colours = shown(furnace, emission="all")
    # At the poles, where triangles are thin, some rays begin below their own surface.
    np.testing.assert_allclose(colours.mean(axis=0), wanted, rtol=4e-3 / (1 - albedo))
    once = shown(furnace, emission="all", bounces=0).mean(axis=0)
    np.testing.assert_allclose(once, np.array([0.5, 0.25, 0]) * (1 + albedo), rtol=0.01)


def test_relighting_is_a_sum_over_emitters(lit):
    assert lit.emission.names == ("tube", "sign")
    both, tube, sign = (
        shown(lit, emission=e) for e in ("all", {"*": 0, "tube": 1}, {"tube": 0, "sign": 1})
    )
    np.testing.assert_allclose(both, tube + sign, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(
        shown(lit, emission={"tube": 3, "sign": 0.5}), 3 * tube + 0.5 * sign, rtol=1e-5, atol=1e-6
    )
    # They shine by themselves, under any other light, until they are put out.
    sky = shown(lit, SKY, emission="none")
    np.testing.assert_allclose(shown(lit, SKY), sky + both, rtol=1e-5, atol=1e-6)
    assert shown(lit, SKY, emission={"*": 0}).tobytes() == sky.tobytes()
    assert shown(lit, lamps=[], emission="none").max() == 0
    # What emits shows its own radiance.
    mine = lit.scene.points.emitter == 0
    np.testing.assert_allclose(tube[mine].mean(axis=0), TUBE, rtol=0.2)
    assert (tube[mine] >= np.float32(TUBE)).all()


def test_exposure_and_bounces_are_of_emitters_too(lit):
    np.testing.assert_allclose(
        shown(lit, emission="all", exposure=2), 4 * shown(lit, emission="all"), rtol=1e-6
    )
    orders = [shown(lit, emission="all", bounces=n).sum() for n in (0, 1, None)]
    assert orders[0] < orders[1] < orders[2]
    np.testing.assert_allclose(
        shown(lit, emission="all", bounces=None), shown(lit, emission="all"), rtol=2e-3, atol=1e-5
    )


def test_another_colour_is_what_a_bake_in_that_colour_gives(lit, tmp_path):
    meshes = lamps()
    meshes[1] = glowing(meshes[1], (2.0, 0.0, 4.0))
    blue = bake(meshes, tmp_path / "b.prt")
    recoloured = shown(lit, emission={"tube": (0.5, 0, 1)})
    np.testing.assert_allclose(recoloured, shown(blue, emission="all"), rtol=1e-4, atol=1e-5)
    # A texture keeps where it is bright; a factor is on top.
    one, two = (shown(lit, emission={"*": 0, "sign": how}) for how in (1, ((1, 1 / 3, 0), 2)))
    np.testing.assert_allclose(two[:, 1], 2 / 3 * one[:, 1], rtol=1e-4, atol=1e-6)
    assert two[:, 0].max() > 1 and one[:, 0].max() == 0
    by_text = shown(lit, emission={"tube": "#ff8000:1.5"})
    linear = [1.0, ((128 / 255 + 0.055) / 1.055) ** 2.4, 0.0]
    np.testing.assert_allclose(by_text, shown(lit, emission={"tube": (linear, 1.5)}), rtol=1e-6)


def test_albedo_that_is_replaced_bounces_the_emitters_light(lit):
    changed = load(lit.path)
    changed.transport.albedo = changed.transport.albedo * np.float32(0.5)
    halved = shown(changed, emission="all", bounces=0)
    own = lit.scene.points.materials.emission
    direct = shown(lit, emission="all", bounces=0)
    np.testing.assert_allclose(halved - own, (direct - own) / 2, rtol=1e-4, atol=1e-6)
    fewer, series = (shown(changed, emission="all", bounces=n) for n in ("baked", 40))
    np.testing.assert_allclose(fewer, series, rtol=0.02, atol=1e-4)
    floor = slice(0, 49)
    assert fewer[floor].sum() < 0.999 * shown(lit, emission="all")[floor].sum() / 2


@pytest.mark.parametrize(
    "emission, message",
    [
        ({"x": 1}, "the bake has no emitter 'x'; it has tube, sign"),
        ({"tube": -1}, "emission: 'tube'"),
        ({"tube": np.nan}, "emission: 'tube'"),
        ({"tube": "#ff88"}, "expected a colour as '#rrggbb', got '#ff88'"),
        ({"tube": "red"}, "expected a factor, '#rrggbb' or '#rrggbb:factor', got 'red'"),
        ({"tube": "#ff8800:x"}, "expected a factor"),
        ({"tube": (1, 2, 3, 4)}, "'tube': colour"),
        ({"tube": ((1, -2, 3), 1)}, "'tube': colour"),
        ({3: 1}, "emission: expected 'all', 'none', or a dict"),
        ("some", "emission: expected 'all', 'none', or a dict"),
        (2.5, "emission: expected 'all', 'none', or a dict"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(lit, emission, message):
    with pytest.raises(PRTError) as caught:
        shown(lit, emission=emission)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_bake_without_emitters_says_so(tmp_path):
    dark = bake([plane(3)], tmp_path / "a.prt")
    assert dark.emission is None and "emitters" not in dark.report
    with pytest.raises(PRTError, match="no emitter 'x'; nothing in it emits light"):
        shown(dark, SKY, emission={"x": 2})
    assert not any(name.startswith("emission") for name in BakeStore(dark.path).names())
    np.testing.assert_array_equal(shown(dark, SKY), shown(dark, SKY, emission="none"))


def test_the_light_of_the_compressed_form_and_of_emitters_add_up(lit, tmp_path):
    path = tmp_path / "c.prt"
    again = bake(lamps(), path)
    compress(path, method="pca", tolerance=0.2)
    form = load(path)
    relighter = Relighter(form)
    sky, both = (relighter.radiance(SKY, emission=e) for e in ("none", "all"))
    assert relighter.used == "compressed"
    np.testing.assert_allclose(both - sky, shown(again, emission="all"), rtol=1e-4, atol=1e-4)
    steps = relighter.steps(Lighting(SKY), pace=0.01)
    np.testing.assert_array_equal(run(steps), both)


def test_an_image_shows_the_emitters(tmp_path):
    floor, *lights = lamps()
    scene = Scene.from_meshes([floor, *map(downwards, lights)], max_hidden=0)
    scene = with_camera_image(scene, caster_of(scene), auto_camera(scene), 11, 7, 2)
    path = tmp_path / "a.prt"
    run(bake_steps(scene, path, SETTINGS))
    seen = load(path)
    pixels = Relighter(seen).radiance(emission={"*": 0, "tube": 1}, of="image")
    points = shown(seen, emission={"*": 0, "tube": 1})
    np.testing.assert_allclose(pixels, seen.image(points), rtol=1e-5)
    assert set(seen.scene.points.emitter[seen.scene.image.point]) == {-1, 0, 1}


def test_a_scene_in_which_nothing_meets_anything_is_compressed_as_well(tmp_path):
    path = tmp_path / "a.prt"
    alone = bake([glowing(plane(5, name="screen"), TUBE)], path)
    assert alone.transport.gather is None or not alone.transport.gather.nnz
    assert compress(path, method="pca", tolerance=0.2)["method"] == "pca"


def test_a_weak_bounce_still_shows_the_direct_light(tmp_path):
    black = bake(
        [plane(3, albedo=0.0), lamps()[1]], tmp_path / "a.prt", replace(SETTINGS, bounces=0)
    )
    assert black.emission.received is None
    colours = shown(black, emission="all")
    np.testing.assert_allclose(colours[:9], 0, atol=1e-6)
    grey = bake(
        [plane(3, albedo=0.5), lamps()[1]], tmp_path / "b.prt", replace(SETTINGS, bounces=0)
    )
    assert shown(grey, emission="all")[:9].min() > 1e-4


def test_command_line(lit, tmp_path, capsys):
    def prt(*words):
        code = main([str(word) for word in words])
        return code, "".join(capsys.readouterr())

    out = tmp_path / "c.npz"
    for words, emission in (
        (["all"], "all"),
        (["none", "sign=2"], {"*": 0, "sign": 2}),
        (["tube=#ff8000:1.5", "sign=0"], {"tube": "#ff8000:1.5", "sign": 0}),
    ):
        code, _ = prt("relight", lit.path, "--emission", *words, "--output", out)
        assert code == 0
        wanted = relight(lit, emission=emission)
        written = np.load(out)
        for name, values in wanted.items():
            np.testing.assert_array_equal(written[name], values)
    for words, message in (
        (["x=2"], "emission: the bake has no emitter 'x'; it has tube, sign"),
        (["tube"], "expected all, none or NAME=HOW, got 'tube'"),
        (["tube=red"], "--emission: 'tube': expected a factor"),
    ):
        code, said = prt("relight", lit.path, "--emission", *words, "--output", out)
        assert code != 0 and message in said and said.count("\n") == 1
    code, said = prt("info", lit.path)
    assert "emitter tube: radiance 4 1 0.5, 0.09 square units" in said
    assert "of the direct light of 'sign', within" in said
    code, said = prt("info", lit.path, "--json")
    assert [item["name"] for item in json.loads(said)["emitters"]] == ["tube", "sign"]


def test_an_emitter_of_a_mesh_without_names_is_called_as_it():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    up = np.tile([0, 0, 1.0], (3, 1))
    glow = Materials(albedo=np.zeros((3, 3)), emission=np.ones((3, 3)))
    mesh = Mesh("lamp", corners, np.arange(3), up, np.array([[0, 1, 2]]), glow)
    assert Scene.from_meshes([mesh]).emitters == ("lamp",)
    mesh.material_names, mesh.corner_material = ("", "neon"), np.full(3, 5)
    assert Scene.from_meshes([mesh]).emitters == ("neon",)
