"""Which triangles each kind of ray meets, by what number, and that a bake keeps it."""

import numpy as np
import pytest

from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.errors import PRTError
from prt_core.light.local import Lamp
from prt_core.relight import Lighting, Relighter
from prt_core.runtime.progress import run
from prt_core.scene import RAYS, Scene, mesh_digests
from tests.meshes import plane

HEIGHTS = {"floor": 0.0, "no_shadow": 1.0, "no_diffuse": 2.0, "no_camera": 3.0}


def plates(far=False):
    """A floor, and plates above it that one kind of ray does not meet, from below upwards."""
    meshes = [plane(3, name="floor")]
    for name, z in list(HEIGHTS.items())[1:]:
        flag = f"{name.removeprefix('no_')}_rays"
        meshes.append(plane(2, name=name, z=z, receives=False, **{flag: False}))
    if far:
        # Small, and so far away that it needs coordinates of its own.
        meshes.append(plane(2, 1e6, 1e6 + 0.5, name="far", receives=False))
    return Scene.from_meshes(meshes, max_hidden=0)


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize(
    ("rays", "first"), [("shadow", "no_diffuse"), ("diffuse", "no_shadow"), ("camera", "no_shadow")]
)
def test_rays_meet_what_sees_them(rays, first, far):
    scene = plates(far)
    assert (len(scene.frames) > 1) == far
    origin = scene.to_frame(np.array([[0.3, 0.2, 0.1], [0.3, 0.2, 1.5], [0.3, 0.2, 2.5]]))
    origin = origin.astype(scene.ray_origins.dtype)
    up = np.tile(np.float32([0, 0, 1]), (3, 1))
    caster = scene.make_caster("embree", rays)
    hits = caster.intersect(origin, up)
    met = [scene.objects[i].name for i in scene.triangle_object[hits.triangle]]
    assert met[0] == first
    second = {"shadow": "no_diffuse", "diffuse": "no_camera", "camera": "no_diffuse"}[rays]
    assert met[1] == second
    assert caster.occluded(origin, up).tolist() == [True, True, rays != "camera"]
    assert (hits.triangle[2] < 0) == (rays == "camera")
    caster.close()
    with pytest.raises(PRTError, match="rays: expected one of shadow, diffuse, camera"):
        scene.make_caster("embree", "glossy")


def test_what_nothing_meets_is_not_in_the_way():
    scene = Scene.from_meshes([plane(3, **dict.fromkeys(RAYS, False))])
    caster = scene.make_caster("embree")
    down = np.tile(np.float32([0, 0, -1]), (5, 1))
    assert not caster.occluded(scene.ray_origins[:5] + np.float32([0, 0, 1]), down).any()
    assert (caster.intersect(scene.ray_origins[:5], down).triangle == -1).all()


def test_digests_tell_it_and_a_bake_keeps_it(tmp_path):
    plain, deaf = plane(3, name="a"), plane(3, name="a", shadow_rays=False)
    assert mesh_digests([plain]) != mesh_digests([deaf])
    assert Scene.from_meshes([plain]).fingerprint() != Scene.from_meshes([deaf]).fingerprint()
    lid = plane(3, -3, 3, name="lid", z=1.0, receives=False, shadow_rays=False)
    scene = Scene.from_meshes([plane(5, name="floor"), lid], max_hidden=0)
    assert "1 objects are seen by only one of shadow and diffuse rays (lid)" in scene.messages[0]
    settings = BakeSettings(resolution=5, bounces=0, caster="embree")
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    bake = load(tmp_path / "a.prt")
    assert [item.shadow_rays for item in bake.scene.objects] == [True, False]
    # The sky is behind the lid, the lamp shines through it.
    white = np.ones((bake.cube_map.n_directions, 3), np.float32)
    seen = bake.scene.points.visible
    assert bake.transport.received(white)[seen].max() < 0.35
    lamp = Lamp("point", np.full(3, 10.0), np.array([0, 0, 2.0]))
    relighter = Relighter(bake, caster="embree")
    shown = run(relighter.steps(Lighting(lamps=[lamp])))
    relighter.close()
    assert np.asarray(shown)[seen].min() > 0.01
