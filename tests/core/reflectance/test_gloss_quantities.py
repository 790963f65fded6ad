"""Gloss goes wherever materials go, takes no room where there is none, and may lack a tangent."""

import numpy as np

from prt_core import BakeSettings, bake_steps, load, run
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.scene import Scene, mesh_digests
from prt_core.store import BakeStore, read_scene
from tests.core.scene.test_scene import quad
from tests.meshes import Stripes

SETTINGS = BakeSettings(resolution=3, tolerance=0.2, caster="brute")
GLOSS = dict(
    stand_in=0.125, glossy=0.25, metal=(0.5, 0.25, 0.125), metal_edge=0.5, dielectric=0.75,
    tint=(1, 0.5, 0.5), ior=1.25, roughness=0.375, anisotropy=0.5, tangent=(0.6, 0.8, 0),
    single=0.25, coat=0.5, coat_roughness=0.125, coat_ior=2.0, coat_tint=(0.5, 1, 1),
    diffuse_roughness=0.25,
)  # fmt: skip


def glossy_quad(**more):
    mesh = quad(two_sided=True)
    values = {
        name: np.tile(np.broadcast_to(np.float64(value), QUANTITIES[name].n_channels), (4, 1))
        for name, value in (GLOSS | more).items()
    }
    mesh.materials = mesh.materials.replaced(**values)
    return mesh


def test_a_bake_keeps_all_of_it(tmp_path):
    scene = Scene.from_meshes([glossy_quad()], max_hidden=50)
    run(bake_steps(scene, tmp_path / "a.prt", SETTINGS))
    store = BakeStore(tmp_path / "a.prt")
    assert store.attributes["materials"] == ["albedo", *GLOSS]
    assert read_scene(store).fingerprint() == scene.fingerprint()
    materials = load(tmp_path / "a.prt").transport.materials
    for name, value in GLOSS.items():
        found = getattr(materials, name)
        assert found.dtype == np.float32 and len(found) == len(scene.points)
        np.testing.assert_allclose(found, np.broadcast_to(value, found.shape), atol=1e-6)
    np.testing.assert_allclose(materials.albedo - materials.stand_in, 0.375, atol=1e-6)


def test_each_changes_what_a_bake_is_of():
    before = mesh_digests([glossy_quad()]), Scene.from_meshes([glossy_quad()]).fingerprint()
    for name in GLOSS:
        other = glossy_quad(**{name: QUANTITIES[name].default})
        assert mesh_digests([other]) != before[0], name
        assert Scene.from_meshes([other]).fingerprint() != before[1], name


def test_surfaces_without_it_hold_one_row_each():
    mesh = quad()
    scene = Scene.from_meshes([mesh], max_hidden=50)
    points = scene.points
    around, weights = np.array([[0, 1, 2]] * 7), np.full((7, 3), 1 / 3)
    joined = Materials.joined([points.materials, points.materials[2:5]])
    several = [mesh.materials, points.materials, points.mean_materials, joined, joined[[1, 3]],
               points.materials.between(around, weights)]  # fmt: skip
    for materials in several:
        for name in GLOSS:
            values = getattr(materials, name)
            assert values.strides[0] == 0 and values.shape[0] == len(materials), name
            assert (values == np.float32(QUANTITIES[name].default)).all()
        assert materials.nondefault() == ["albedo"]
    assert mesh.materials.in_steps().shape == (4, 3)
    # Where only one of two has a quantity, both have it.
    both = Materials.joined([points.materials, Scene.from_meshes([glossy_quad()]).points.materials])
    assert (both.ior[0], both.ior[-1]) == (1.5, 1.25) and both.ior.flags.writeable


def test_some_places_are_given_others():
    rows = np.zeros((5, 3))
    plain, shiny = Materials(albedo=rows), Materials(albedo=rows[:2] + 1, ior=np.full((2, 1), 2.0))
    plain.put(np.array([1, 4]), shiny)
    np.testing.assert_array_equal(plain.albedo[:, 0], [0, 1, 0, 0, 1])
    np.testing.assert_array_equal(plain.ior[:, 0], [1.5, 2, 1.5, 1.5, 2])
    assert plain.tint.strides[0] == 0 and shiny.equals(plain[[1, 4]])
    assert not plain.equals(Materials(albedo=plain.albedo))


def test_without_a_tangent_there_is_none_between():
    tangent = np.array([[1, 0, 0], [0, 0, 0], [0, 0, 0], [-1, 0, 0]], float)
    materials = Materials(albedo=np.zeros((4, 3)), tangent=tangent)
    around = np.array([[0, 1, 2], [1, 2, 1], [0, 3, 1]])
    weights = np.array([[0.5, 0.25, 0.25], [0.5, 0.25, 0.25], [0.5, 0.5, 0]])
    with np.errstate(all="raise"):
        between = materials.between(around, weights).tangent
    # A direction beside none, none at all, and opposite ones.
    np.testing.assert_array_equal(between, [[1, 0, 0], [0, 0, 0], [0, 0, 0]])
    mesh = glossy_quad(tangent=0.0)
    points = Scene.from_meshes([mesh], max_hidden=50).points
    assert not points.materials.tangent.any() and "tangent" not in points.nondefault()


def test_means_over_what_is_painted_have_it():
    mesh = glossy_quad()
    mesh.paint = Stripes(mesh, 0.0)
    points = Scene.from_meshes([mesh], max_hidden=200).points
    for name in GLOSS.keys() - {"stand_in"}:
        mean = getattr(points.mean_materials, name)
        np.testing.assert_allclose(mean, np.broadcast_to(GLOSS[name], mean.shape), atol=1e-6)
    # What gloss sends besides, in the mean of all views.
    assert (points.mean_materials.stand_in > np.float32(GLOSS["stand_in"]) + 0.05).all()


def test_of_what_is_partly_clear_more_reflects():
    mesh = glossy_quad(albedo=0.25)
    mesh.materials = mesh.materials.replaced(opacity=np.full((4, 1), 0.5))
    points = Scene.from_meshes([mesh]).points
    assert points.materials.stand_in[0, 0] == 0.125 and points.materials.metal[0, 0] == 0.5
    met = points.mean_materials
    sent = with_mean_gloss(mesh.materials)
    for name in ("albedo", "stand_in"):
        wanted = np.minimum(2 * getattr(sent, name)[0], 1)
        np.testing.assert_allclose(getattr(met, name), np.tile(wanted, (len(points), 1)), rtol=1e-6)
    np.testing.assert_allclose(met.metal[0], [1, 0.5, 0.25])
    np.testing.assert_allclose(met.ior, 1.25)
