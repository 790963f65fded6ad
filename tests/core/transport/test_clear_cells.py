"""Where no place has to ask which bake points it sees."""

import numpy as np

from prt_core.rays import Hits
from prt_core.scene import Scene
from prt_core.transport import Sharing
from prt_core.transport.clear_cells import clear_cells
from tests.meshes import caster_of, plane, sphere, wall


def clear_of(meshes, **options):
    scene = Scene.from_meshes(meshes, max_hidden=0, **options)
    caster = caster_of(scene)
    return scene, caster, *clear_cells(scene, caster)


def test_cells_of_smooth_surfaces_are_clear():
    for mesh in (plane(9), sphere(12), sphere(12, inside=True)):
        scene, _, clear, n_rays = clear_of([mesh])
        assert clear[:, 0].all()
        assert n_rays < 2 * len(scene.triangles)


def test_cells_that_a_wall_stands_on_are_not():
    # Between the columns of vertices at 0.25 and 0.5.
    scene, _, clear, _ = clear_of([plane(9, name="floor"), wall(0.4, 1.0, 1.2)])
    floor = scene.triangle_object == 0
    x = scene.to_world(scene.vertices)[scene.triangles][:, :, 0]
    crossed = (x.min(axis=1) < 0.4) & (x.max(axis=1) > 0.4)
    assert not clear[floor & crossed].any()
    assert clear[floor & ~crossed, 0].all()


def test_hits_are_handed_as_by_who_asks_but_with_fewer_rays():
    meshes = [plane(9, name="floor"), wall(0.4, 1.0, 1.2, n=5), sphere(8, 0.3, (-0.4, 0, 0.5))]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    caster, rng = caster_of(scene), np.random.default_rng(0)
    starts = scene.ray_origins[rng.integers(0, len(scene.points), 20000)]
    directions = rng.normal(size=(20000, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pick = rng.random(20000, np.float32)
    hits = Hits.joined([caster.intersect(starts, directions)])
    asked, *_, many = Sharing(scene).ends(caster, hits, directions, pick)
    handed, *_, few = Sharing(scene, caster).ends(caster, hits, directions, pick)
    assert (asked != handed).mean() < 1e-3
    assert few.sum() < 0.4 * many.sum()


def test_a_side_that_returns_no_light_is_not_clear():
    _, _, clear, _ = clear_of([plane(5)])
    assert clear[:, 0].all() and not clear[:, 1].any()
