"""A quantity that is one line in the table is found wherever materials go."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, bake_steps, load, run
from prt_core.errors import PRTError
from prt_core.reflectance import QUANTITIES, Materials, Quantity, expect_materials
from prt_core.scene import Camera, Scene, mesh_digests, with_camera_image, with_details
from prt_core.store import BakeStore, read_scene
from tests.core.scene.test_scene import quad
from tests.meshes import Stripes, caster_of, plane

DEFAULT = 0.25
SETTINGS = BakeSettings(resolution=3, tolerance=0.2, caster="brute")
CAMERA = Camera([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]], 0.3)


@pytest.fixture
def shine(monkeypatch):
    """One line, as whoever adds a quantity writes it."""
    monkeypatch.setitem(QUANTITIES, "shine", Quantity(1, 0, 1, step=1 / 8, default=DEFAULT))


def rough(scale=0.1, **options):
    """A square whose shine is linear in x, from 0 at x = -2."""
    mesh = quad(**options)
    x = mesh.vertices[mesh.corner_vertex, :1]
    mesh.materials = mesh.materials.replaced(shine=scale * (x + 2))
    return mesh


def meshes(mesh):
    return [mesh, plane(3, 0, 1, z=0.7, albedo=0.6, two_sided=True)]


def wanted(scene):
    """What `rough` has where each point of it lies."""
    return 0.1 * (scene.to_world(scene.points.positions)[:, :1] + 2)


def test_points_have_it_between_the_corners(shine):
    scene = Scene.from_meshes(meshes(rough(two_sided=True)), max_hidden=400)
    points = scene.points
    mine = points.object_index == 0
    hidden = mine & ~points.visible
    assert hidden.sum() > 200
    assert points.materials.shine.shape == (len(points), 1)
    assert points.materials.shine.dtype == points.materials.albedo.dtype == np.float32
    for materials in (points.materials, points.mean_materials):
        np.testing.assert_allclose(materials.shine[mine], wanted(scene)[mine], atol=1e-6)
        np.testing.assert_array_equal(materials.shine[~mine], np.float32(DEFAULT))


def test_details_and_pixels_have_it(shine):
    scene = Scene.from_meshes([rough()], max_hidden=0)
    places = np.array([[0.2, 0.5], [0.7, 0.1], [0.1, 0.05]], np.float32)
    detailed = with_details(scene, np.array([0, 1, 1]), places, np.zeros(3, bool))
    seen = with_camera_image(scene, caster_of(scene), CAMERA, 7, 5, 1)
    for more, n_new in ((detailed, 3), (seen, 35)):
        assert len(more.points) == len(scene.points) + n_new
        # Where only points are known as well: those of a scene that was read.
        more.surfaces = None
        for materials in (more.points.materials, more.points.mean_materials):
            np.testing.assert_allclose(materials.shine, wanted(more), atol=1e-6)
        middle = more.materials_at(np.array([0]), np.array([[0.5, 0.25]]), np.array([False]))
        corners = scene.to_world(scene.vertices[scene.triangles[0]])[:, 0]
        np.testing.assert_allclose(
            middle.shine, [[0.1 * (corners @ [0.25, 0.5, 0.25] + 2)]], atol=1e-6
        )


def test_what_is_painted_is_told_in_part(shine):
    """Stripes of albedo; the shine beneath is that of the corners, and its mean of the area."""
    mesh = rough()
    mesh.paint = Stripes(mesh, 0.0)
    scene = Scene.from_meshes([mesh], max_hidden=400)
    points, x = scene.points, scene.to_world(scene.points.positions)[:, 0]
    inside = (np.abs(x) < 1.9) & ~points.visible
    np.testing.assert_allclose(points.materials.shine, wanted(scene), atol=1e-6)
    np.testing.assert_allclose(
        points.mean_materials.shine[inside], wanted(scene)[inside], atol=0.01
    )
    left = inside & (x < 0)
    np.testing.assert_allclose(points.albedo[left], np.tile([0.8, 0.1, 0], (left.sum(), 1)))

    class Matte:
        """Paint of another quantity."""

        def at(self, corners, weights):
            return {"shine": np.full((len(corners), 1), 0.9)}

        def alike(self, corners):
            return np.arange(len(corners))

        def texels(self, corners):
            return np.ones(len(corners))

        def digest(self):
            return b"matte"

    mesh.paint = Matte()
    matte = Scene.from_meshes([mesh], max_hidden=400).points
    hidden = ~matte.visible
    np.testing.assert_allclose(matte.materials.shine[hidden], 0.9)
    np.testing.assert_allclose(matte.albedo, 0.5)


def test_corners_share_a_point_where_it_agrees(shine):
    def count(step):
        mesh = plane(3)
        values = np.full((len(mesh.corner_vertex), 1), 0.5)
        # Of the four corners at the middle vertex one differs.
        values[np.flatnonzero(mesh.corner_vertex == 4)[1]] += step
        mesh.materials = mesh.materials.replaced(shine=values)
        return len(Scene.from_meshes([mesh], max_hidden=0).points)

    assert count(0.01) == 9 and count(0.2) == 10


def test_it_is_in_all_digests(shine):
    one, other = [Scene.from_meshes(meshes(rough(scale))) for scale in (0.1, 0.11)]
    again = Scene.from_meshes(meshes(rough(0.1)))
    assert one.fingerprint() != other.fingerprint() and one.fingerprint() == again.fingerprint()
    for name in ("materials", "mean_materials"):
        materials = getattr(one.points, name)
        halved = materials.replaced(shine=materials.shine / 2)
        changed = replace(one, points=replace(one.points, **{name: halved}))
        assert changed.fingerprint() != one.fingerprint()
    digests = [mesh_digests(meshes(rough(scale))) for scale in (0.1, 0.11)]
    assert digests[0]["floor"] != digests[1]["floor"]
    assert digests[0]["plane"] == digests[1]["plane"]


def test_a_transport_has_it_and_lets_it_be_replaced(shine, tmp_path):
    scene = Scene.from_meshes(meshes(rough()), max_hidden=0)
    run(bake_steps(scene, tmp_path / "a.prt", SETTINGS))
    bake = load(tmp_path / "a.prt")
    scene, transport = bake.scene, bake.transport
    kept, before = transport.materials, transport.fingerprint()
    np.testing.assert_allclose(kept.shine[scene.points.object_index == 0].max(), 0.4)
    transport.materials = kept.replaced(shine=kept.shine * np.float32(0.5))
    assert transport.fingerprint() != before
    transport.materials = kept
    assert transport.fingerprint() == before
    transport.mean_materials = kept.replaced(shine=kept.shine * np.float32(0.5))
    assert transport.fingerprint() != before


def test_it_is_in_the_store(shine, tmp_path):
    scene = Scene.from_meshes(meshes(rough()), max_hidden=50)
    run(bake_steps(scene, tmp_path / "a.prt", SETTINGS))
    store = BakeStore(tmp_path / "a.prt")
    assert {"point_shine", "point_mean_shine"} <= set(store.names())
    assert store.attributes["materials"] == ["albedo", "shine"]
    result = read_scene(store)
    for name in ("materials", "mean_materials"):
        assert getattr(result.points, name).equals(getattr(scene.points, name))
    assert result.fingerprint() == scene.fingerprint()
    scene.points.materials.shine[3] = 1.1
    with pytest.raises(PRTError, match="'shine' are not finite, not distinct or out of"):
        run(bake_steps(scene, tmp_path / "b.prt", SETTINGS))


def test_bakes_from_before_it_was_known_stay_what_they_are(tmp_path, monkeypatch):
    def prints():
        scene = Scene.from_meshes(meshes(quad()), max_hidden=50)
        return scene, [mesh_digests(meshes(quad())), scene.fingerprint()]

    scene, before = prints()
    run(bake_steps(scene, tmp_path / "a.prt", SETTINGS))
    transport = load(tmp_path / "a.prt").transport.fingerprint()
    store = BakeStore(tmp_path / "a.prt", "r+")
    # As it was written before its materials were named.
    store._attributes.pop("materials")
    store.update()
    monkeypatch.setitem(QUANTITIES, "shine", Quantity(1, 0, 1, step=1 / 8, default=DEFAULT))
    assert prints()[1] == before
    bake = load(tmp_path / "a.prt")
    assert bake.scene.fingerprint() == before[1] and bake.transport.fingerprint() == transport
    np.testing.assert_array_equal(bake.transport.materials.shine, DEFAULT)
    run(bake_steps(prints()[0], tmp_path / "a.prt", SETTINGS))


def test_a_bake_of_what_is_not_known_is_refused(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(QUANTITIES, "shine", Quantity(1, 0, 1, step=1 / 8, default=DEFAULT))
        run(bake_steps(Scene.from_meshes([rough()]), tmp_path / "a.prt", SETTINGS))
    with pytest.raises(PRTError, match="its materials have albedo, shine, this library knows"):
        load(tmp_path / "a.prt")
    store = BakeStore(tmp_path / "a.prt", "r+")
    for named in ([], "albedo", None, ["shine"], [["albedo"]]):
        store.update(materials=named)
        with pytest.raises(PRTError):
            load(tmp_path / "a.prt")


def test_means_of_directions_are_directions(monkeypatch):
    grain = Quantity(3, -1, 1, step=1e-3, default=(1, 0, 0), is_direction=True)
    monkeypatch.setitem(QUANTITIES, "grain", grain)
    mesh = quad()
    # A corner each of four directions, a right angle from the next.
    turned = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    mesh.materials = mesh.materials.replaced(grain=turned)
    points = Scene.from_meshes(meshes(mesh), max_hidden=300).points
    length = np.linalg.norm(points.materials.grain, axis=1)
    hidden = (points.object_index == 0) & ~points.visible
    assert hidden.sum() > 100 and np.ptp(points.materials.grain[hidden], axis=0)[:2].min() > 1
    # In the very middle of opposite ones there is none.
    assert ((abs(length - 1) < 1e-6) | (length < 1e-6)).all()
    assert (abs(length - 1) < 1e-6).mean() > 0.9
    assert (points.materials.grain[points.object_index == 1] == [1, 0, 0]).all()


def test_means_stay_in_their_range():
    third = Materials(albedo=np.ones((3, 3)), translucency=np.ones((3, 3)))
    weights = np.array([[0.7, 0.2, 0.1 + 1e-15]])
    assert weights.sum() > 1
    result = third.between(np.array([[0, 1, 2]]), weights).translucency
    np.testing.assert_array_equal(result, 1)
    albedo = QUANTITIES["albedo"]
    assert albedo.highest(bounced=True) == 1 + 1e-5 and albedo.lowest == 0
    assert albedo.highest() == 64 * (1 + 1e-5)


def test_materials_are_taken_joined_and_compared():
    rng = np.random.default_rng(2)
    albedo = rng.random((7, 3))
    materials = Materials(albedo=albedo)
    assert len(materials) == 7 and len(Materials.joined([])) == 0
    joined = Materials.joined([materials[:2], materials[2:]])
    assert joined.equals(materials) and not joined.equals(materials[::-1])
    assert not joined.equals(materials[:5])
    np.testing.assert_array_equal(materials[[3, 5]].albedo, albedo[[3, 5]])
    other = materials.replaced(albedo=albedo / 2)
    assert other.albedo[3, 1] == albedo[3, 1] / 2 and materials.albedo is albedo


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: Materials(), "materials: expected albedo, \\(n, 3\\); it has no default"),
        (lambda: Materials(albedo=np.ones((5, 2))), "albedo: expected an array of shape \\(n, 3"),
        (lambda: Materials(gleam=1), "materials: expected albedo, .*got gleam"),
        (
            lambda: expect_materials("a", Materials(albedo=np.ones((5, 3))), 7),
            "a: materials: expec",
        ),
        (
            lambda: expect_materials("a", np.full((5, 3), 64.1), 5),
            "a: albedo: expected values from",
        ),
        (
            lambda: expect_materials("a", np.full((5, 3), 64 + 1e-6), 5),
            "a: albedo: expected values",
        ),
        (lambda: expect_materials("a", np.full((5, 3), np.nan), 5), "a: albedo: 15 values are NaN"),
        (lambda: expect_materials("a", None, 5), "a: albedo: expected Materials or an array"),
        (lambda: Materials(albedo="red"), "albedo: expected an array of numbers"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    with pytest.raises(PRTError, match=message) as caught:
        call()
    assert len(str(caught.value).splitlines()) == 1
    expect_materials("a", np.full((5, 3), 1 + 1e-6), 5, rounded=True)
