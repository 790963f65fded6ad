"""Albedo between the corners: bake points inside faces, and what a point stands for."""

import numpy as np
import pytest

from prt_core import BakeSettings, bake_steps, load, run
from prt_core.scene import Scene, mesh_digests
from prt_core.sphere import CubeMap
from prt_core.transport import (
    Transport,
    gather_hits,
    gather_operator,
    reference_rows,
    visibility_bits,
)
from tests.core.scene.test_scene import quad
from tests.meshes import Stripes, caster_of, plane


def painted(edge=0.5, **options):
    mesh = quad(albedo=0.3, **options)
    mesh.paint = Stripes(mesh, edge)
    return mesh


def test_hidden_points_have_the_colour_of_their_place():
    scene = Scene.from_meshes([painted()], max_hidden=500)
    x = scene.to_world(scene.points.positions)[:, 0]
    hidden = ~scene.points.visible
    assert hidden.sum() > 100
    wanted = np.where((x < 0.5)[:, None], [0.8, 0.1, 0.0], [0.0, 0.6, 0.2])
    np.testing.assert_allclose(scene.points.albedo[hidden], wanted[hidden], atol=1e-6)
    # Corners show what they were given.
    np.testing.assert_allclose(scene.points.albedo[~hidden], 0.3, atol=1e-6)


@pytest.mark.parametrize("max_hidden", [0, 500])
def test_points_stand_for_the_mean_around_them(max_hidden):
    scene = Scene.from_meshes([painted(), plane(5, z=3, albedo=0.7)], max_hidden=max_hidden)
    points = scene.points
    mine = points.object_index == 0
    # K shares evenly met places out by their weights: what is bounced is that of the whole face.
    weights = np.bincount(scene.lattice, minlength=len(points)).astype(float)
    level = scene.triangle_level[0]
    if max_hidden == 0:
        assert level == 1
        result = (weights[mine] @ points.mean_albedo[mine]) / weights[mine].sum()
        np.testing.assert_allclose(result, [0.5, 0.6 * 0.375 + 0.1 * 0.625, 0.075], atol=0.03)
    else:
        x = scene.to_world(points.positions)[:, 0]
        far = mine & (np.abs(x - 0.5) > 5 / level)
        wanted = np.where((x < 0.5)[:, None], [0.8, 0.1, 0.0], [0.0, 0.6, 0.2])
        np.testing.assert_allclose(points.mean_albedo[far], wanted[far], atol=1e-6)
        near = mine & (np.abs(x - 0.5) < 0.5 / level)
        assert ((points.mean_albedo[near, 0] > 0.1) & (points.mean_albedo[near, 0] < 0.7)).all()
    np.testing.assert_array_equal(points.mean_albedo[~mine], points.albedo[~mine])


def transport_of(scene, rounds):
    cube_map, caster = CubeMap(4), caster_of(scene)
    every = slice(0, len(scene.points))
    bits = visibility_bits(scene, cube_map, caster, every)
    hits = np.hstack([gather_hits(scene, caster, every, 0, r).hits for r in range(rounds)])
    points = scene.points
    gather = gather_operator(hits, len(points))
    return cube_map, caster, Transport(
        cube_map, bits, gather, points.normals, points.albedo, 1e-6, None, points.mean_albedo
    )  # fmt: skip


def test_a_painted_wall_bounces_its_paint_as_path_tracing_says():
    """One face, its corners grey: what it sends is red and green."""
    wall = painted(name="wall", origin=(-2, 1, 0), x=(4, 0, 0), y=(0, 0, 2))
    scene = Scene.from_meshes([plane(9, -1, 1, name="floor", albedo=0.7), wall], max_hidden=400)
    cube_map, caster, transport = transport_of(scene, 32)
    place = scene.to_world(scene.points.positions)
    points = [int(np.linalg.norm(place - p, axis=1).argmin()) for p in ((0, 0.5, 0), (0, 0, 0))]
    truth, error = reference_rows(scene, cube_map, caster, points, n_paths=3000, max_bounces=3)
    rows = transport.rows(points)
    direct = transport.rows(points, indirect=False)
    sky = (rows - direct).sum(axis=1), (truth - direct).sum(axis=1)
    # Corner colours alone would give the same in all channels, and a half of the red too little.
    assert (sky[1][:, 0] > 2 * sky[1][:, 2]).all()
    np.testing.assert_allclose(sky[0], sky[1], rtol=0.12)
    columns = transport.columns(np.arange(cube_map.n_directions))[points]
    np.testing.assert_allclose(columns, rows, atol=2e-4 * rows.max())
    caster.close()


def test_what_is_painted_belongs_to_the_digest_and_the_store(tmp_path):
    one, other = mesh_digests([painted()]), mesh_digests([painted(0.6)])
    assert one != other and one == mesh_digests([painted()])
    scene = Scene.from_meshes([painted(), plane(7, z=0.5, albedo=0.6)])
    assert (
        scene.fingerprint()
        != Scene.from_meshes([painted(0.6), plane(7, z=0.5, albedo=0.6)]).fingerprint()
    )
    settings = BakeSettings(resolution=4, tolerance=0.1)
    run(bake_steps(scene, tmp_path / "painted.prt", settings))
    bake = load(tmp_path / "painted.prt")
    np.testing.assert_array_equal(
        bake.scene.points.mean_albedo[: len(scene.points)], scene.points.mean_albedo
    )
    assert bake.transport.mean_albedo is not None
    plain = Scene.from_meshes([quad(), plane(7, z=0.5, albedo=0.6)])
    run(bake_steps(plain, tmp_path / "plain.prt", settings))
    assert load(tmp_path / "plain.prt").transport.mean_albedo is None


class Kinds(Stripes):
    """Stripes that say which faces they paint alike."""

    asked = 0

    def alike(self, corners):
        return np.zeros(len(corners), int)

    def at(self, corners, weights):
        Kinds.asked += len(corners)
        return {"albedo": 0.1 + 0.8 * weights}


def test_faces_that_are_painted_alike_are_sampled_once():
    means = []
    for kind in (Kinds, type("Alone", (Kinds,), {"alike": Stripes.alike})):
        mesh = plane(5)
        mesh.paint, Kinds.asked = kind(mesh), 0
        points = Scene.from_meshes([mesh], max_hidden=0).points
        means.append((points.mean_albedo, Kinds.asked))
    (once, few), (each, many) = means
    np.testing.assert_allclose(once, each, atol=1e-6)
    assert many > 25 * few
    # Corners of other weights differ, so it is no mean of everything.
    assert np.ptp(once, axis=0).min() > 0.1
