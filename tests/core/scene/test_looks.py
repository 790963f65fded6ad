"""What rays of light meet, and what backs are, where that is not what is shown."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.rays import transmitted
from prt_core.reflectance import QUANTITIES, Materials
from prt_core.scene import Mesh, Scene, mesh_digests, with_backs
from prt_core.scene.paint import Look
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore, read_scene, write_scene
from prt_core.transport import Transport
from tests.meshes import Stripes, plane

RED, BLUE = (0.7, 0.1, 0.2), (0.05, 0.3, 0.9)


def look(mesh, albedo=RED, **more):
    n = len(mesh.corner_vertex)
    values = {
        name: np.full((n, QUANTITIES[name].n_channels), value) for name, value in more.items()
    }
    return Look(Materials(albedo=np.tile(albedo, (n, 1)), **values))


def sheet(**looks):
    mesh = plane(4, name="sheet", z=0.5, receives=False)
    return replace(mesh, **{name: look(mesh, **values) for name, values in looks.items()})


def test_backs_have_materials_of_their_own():
    mesh = sheet(back={"albedo": BLUE})
    scene = Scene.from_meshes([plane(5), mesh])
    scene = with_backs(scene, scene.triangle_object == 1)
    front = np.flatnonzero((scene.points.object_index == 1) & (scene.opposite >= 0))
    back = np.setdiff1d(front, scene.lattice)
    front = np.setdiff1d(front, back)
    assert len(back) == len(front) > 15
    for points, colour in ((front, [0.5] * 3), (back, BLUE)):
        np.testing.assert_allclose(scene.points.albedo[points], [colour] * len(points), atol=1e-6)
        np.testing.assert_allclose(
            scene.points.mean_albedo[points], [colour] * len(points), atol=1e-6
        )
    places = np.flatnonzero(scene.triangle_object == 1)[:2], np.full((2, 2), 0.3)
    met = scene.materials_at(*places, np.array([False, True])).albedo
    np.testing.assert_allclose(met, [[0.5] * 3, BLUE])


def test_paint_of_backs_is_theirs_between_the_corners():
    mesh = plane(2, 0, 1, name="sheet", z=0.5)
    mesh = replace(mesh, back=Look(mesh.materials, Stripes(mesh, edge=0.47)))
    scene = Scene.from_meshes([plane(3), mesh])
    scene = with_backs(scene, scene.triangle_object == 1)
    back = scene.points.albedo[scene.lattice_back[scene.lattice_back >= 0]]
    # Red on one side of the edge, green on the other, as `Stripes` has it; grey is the front.
    np.testing.assert_allclose(np.unique(back[:, 0]), [0, 0.8], atol=1e-6)
    means = scene.points.mean_albedo[np.unique(scene.lattice_back[scene.lattice_back >= 0])]
    assert ((means[:, 0] > 0.05) & (means[:, 0] < 0.75)).any()


def test_what_is_bounced_may_be_another_colour_than_what_is_shown():
    scene = Scene.from_meshes([plane(5), sheet(bounced={"albedo": RED, "emission": 3.0})])
    mine = scene.points.object_index == 1
    np.testing.assert_allclose(scene.points.albedo[mine], 0.5)
    np.testing.assert_allclose(scene.points.mean_albedo[mine], [RED] * mine.sum(), atol=1e-6)
    assert scene.emitters == ("sheet",) and not scene.points.materials.emission.any()
    place = np.flatnonzero(scene.triangle_object == 1)[:1], np.full((1, 2), 0.2)
    for back in (False, True):
        # A back that is not told apart is as the front is met.
        np.testing.assert_allclose(scene.emission_at(*place, np.array([back])), 3)
    for shown, colour in ((True, [0.5] * 3), (False, RED)):
        met = scene.materials_at(*place, np.array([False]), shown=shown)
        np.testing.assert_allclose(met.albedo, [colour])


def test_an_emitter_may_shine_by_one_side_alone(tmp_path):
    scene = Scene.from_meshes([plane(5), sheet(back={"albedo": RED, "emission": 2.0})])
    assert scene.emitters == ("sheet",)
    place = np.flatnonzero(scene.triangle_object == 1)[:2], np.full((2, 2), 0.2)
    sent = scene.emission_at(*place, np.array([False, True]))
    np.testing.assert_allclose(sent, [[0] * 3, [2] * 3])
    store = BakeStore(tmp_path / "s.prt", "a")
    store.update(**write_scene(store, scene))
    assert read_scene(BakeStore(tmp_path / "s.prt")).emitters == ("sheet",)


@pytest.fixture
def one_way():
    """Half clear from the front, opaque from the back; all clear to shadow rays."""
    mesh = sheet(
        bounced={"opacity": 0.5}, back={"albedo": BLUE, "opacity": 1.0}, shadow={"opacity": 0.0}
    )
    return Scene.from_meshes([plane(5), mesh])


def through(scene, rays):
    """(2,) share of the light that gets through the sheet, downwards and upwards."""
    starts = scene.to_frame([[0.1, 0.2, 0.7], [0.1, 0.2, 0.3]]).astype(np.float32)
    ways, limits = np.float32([[0, 0, -1], [0, 0, 1]]), np.float32([0.4, 0.4]) / scene.size
    caster = scene.make_caster("embree", rays)
    return transmitted(caster, starts, ways, limits.astype(np.float32))


def test_opacity_belongs_to_a_side_and_to_a_kind_of_ray(one_way, tmp_path):
    np.testing.assert_allclose(through(one_way, "diffuse"), [0.5, 0], atol=1e-4)
    np.testing.assert_allclose(through(one_way, "shadow"), [1, 1])
    store = BakeStore(tmp_path / "s.prt", "a")
    store.update(**write_scene(store, one_way))
    again = read_scene(BakeStore(tmp_path / "s.prt"))
    assert again.fingerprint() == one_way.fingerprint()
    np.testing.assert_allclose(through(again, "diffuse"), [0.5, 0], atol=1e-4)
    np.testing.assert_allclose(through(again, "shadow"), [1, 1])


def test_a_look_is_part_of_what_a_bake_is_made_of(one_way):
    plain = sheet()
    meshes = [plain, *(sheet(**{name: {"opacity": 0.5}}) for name in ("bounced", "back", "shadow"))]
    assert len({mesh_digests([mesh])["sheet"] for mesh in meshes}) == 4
    prints = {Scene.from_meshes([plane(5), mesh]).fingerprint() for mesh in meshes}
    assert len(prints) == 4
    with pytest.raises(PRTError, match="sheet: back: opacity: expected values from 0 to 1, got 2"):
        sheet(back={"opacity": 2.0})
    with pytest.raises(PRTError, match="sheet: shadow: expected a Look, got 3"):
        replace(plain, shadow=3)


def test_albedo_above_1_is_shown_and_bounces_as_1():
    scene = Scene.from_meshes([plane(5, albedo=(2.5, 0.5, 1.0)), plane(2, z=1, name="grey")])
    mine = scene.points.object_index == 0
    np.testing.assert_allclose(scene.points.albedo[mine], [(2.5, 0.5, 1)] * mine.sum())
    np.testing.assert_allclose(scene.points.mean_albedo[mine], [(1, 0.5, 1)] * mine.sum())
    assert [m for m in scene.messages if "above 1" in m] == [
        "plane: albedo above 1 is shown as it is, but bounces as 1"
    ]
    n, cube_map = len(scene.points), CubeMap(4)
    parts = cube_map, np.zeros((n, cube_map.n_directions // 8), np.uint8), None
    both = scene.points.materials, scene.points.mean_materials
    shown = Transport(*parts, scene.points.normals, both[0], mean_materials=both[1])
    assert shown.albedo.max() == 2.5
    for wrong in ({"materials": both[0]}, {"materials": both[1], "mean_materials": both[0]}):
        with pytest.raises(PRTError, match=r"albedo: expected values .* got 2.5"):
            Transport(*parts, scene.points.normals, **wrong)


def test_bent_quads_of_flat_meshes_are_shaded_by_their_triangles():
    corners = np.array([[-1, -1, 0.5], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    up = np.tile([0, 0, 1.0], (4, 1))
    mesh = Mesh("quad", corners, np.arange(4), up, triangles, np.full((4, 3), 0.5), flat=True)
    scene = Scene.from_meshes([mesh])
    for triangle in (0, 1):
        size = int(scene.lattice_sizes[triangle])
        lattice = scene.lattice[scene.lattice_start[triangle] :][:size]
        inner = lattice[lattice >= 4]
        assert len(inner)
        wanted = scene.triangle_normals[[triangle] * len(inner)]
        assert abs(wanted[0, 2]) < 0.95
        np.testing.assert_allclose(scene.points.normals[inner], wanted, atol=1e-6)
    smooth = Scene.from_meshes([replace(mesh, flat=False)])
    np.testing.assert_allclose(smooth.points.normals[:, 2], 1)
    assert mesh_digests([mesh]) != mesh_digests([replace(mesh, flat=False)])
