"""Rays through what lets light pass: cut-outs, panes, several of them, on every back-end."""

import numpy as np
import pytest

from prt_core.light.local import Lamp
from prt_core.rays import transmitted
from prt_core.rays.caster import known_casters
from prt_core.rays.passing import MOST_LAYERS
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import gather_hits, lamp_light, received_light, visibility_bits
from tests.meshes import plane

CASTERS = [name for name in known_casters() if name != "bvhtree"]


class Checker:
    """Opacity in squares of a plane's x and y, all or nothing; told by the corners of a mesh."""

    def __init__(self, mesh, side):
        self._place = mesh.vertices[mesh.corner_vertex, :2]
        self.side = side

    def at(self, corners, weights):
        place = np.einsum("mk,mkx->mx", weights, self._place[corners])
        dark = np.floor(place / self.side).sum(axis=1) % 2
        return {"albedo": 0.7 * dark[:, None] * np.ones(3), "opacity": dark[:, None]}

    def alike(self, corners):
        return np.arange(len(corners))

    def texels(self, corners):
        return np.full(len(corners), 512.0)

    def digest(self):
        return np.float64(self.side).tobytes()


def pane(z, opacity, name, half=30.0, n=2, **settings):
    mesh = plane(n, -half, half, name=name, z=z, receives=False, **settings)
    mesh.materials = mesh.materials.replaced(opacity=np.full((len(mesh.materials), 1), opacity))
    return mesh


def sky_light(scene, caster, resolution=16):
    """What the visible points receive of a white sky."""
    cube_map = CubeMap(resolution)
    seen = np.flatnonzero(scene.points.visible)
    bits = visibility_bits(scene, cube_map, caster, seen)
    white = np.ones((cube_map.n_directions, 1))
    return received_light(bits, scene.points.normals[seen], cube_map, white)[:, 0]


def under_panes(*opacities):
    panes = [pane(0.3 + 0.2 * i, share, f"pane{i}") for i, share in enumerate(opacities)]
    return Scene.from_meshes([plane(5), *panes], max_hidden=0)


@pytest.mark.parametrize(("opacities", "through"), [([0.3], 0.7), ([0.3, 0.3], 0.49), ([0.9], 0.1)])
def test_a_pane_lets_its_share_of_the_sky_through(opacities, through):
    scene = under_panes(*opacities)
    caster = scene.make_caster("embree", resolution=16)
    received = sky_light(scene, caster)
    # Of 768 directions at random a bit would be off by 2 to 11 %.
    np.testing.assert_allclose(received, through, rtol=0.02 if through > 0.2 else 0.07)
    assert caster.too_deep == 0


@pytest.mark.parametrize("name", CASTERS)
def test_every_back_end_decides_alike(name):
    scene = under_panes(0.3, 0.6)
    one, other = (scene.make_caster(n, resolution=5) for n in ("brute", name))
    np.testing.assert_array_equal(
        *(visibility_bits(scene, CubeMap(5), c, slice(0, 20)) for c in (one, other))
    )
    ends = [gather_hits(scene, c, slice(0, 20), 3, 0) for c in (one, other)]
    np.testing.assert_array_equal(ends[0].hits, ends[1].hits)


@pytest.mark.parametrize("side", [0.25, 1.0])
def test_a_cut_out_is_exact(side):
    # The larger squares are made of whole pieces, the smaller ones are within them.
    mesh = plane(2, -2, 2, name="leaf", z=1.0)
    mesh.paint = Checker(mesh, side)
    scene = Scene.from_meshes([plane(3, -9, 9), mesh], max_hidden=0)
    # The triangles are right angles of 32 cells an edge: squares of 0.125, two a check.
    rng = np.random.default_rng(0)
    place = rng.uniform(-1.9, 1.9, (500, 2))
    # The diagonal of cells cuts none of the checks' edges.
    away = np.abs(place / side - np.rint(place / side)).min(axis=1) > 0.3
    place = place[away]
    starts = scene.to_frame(np.column_stack([place, np.full(len(place), 2.0)])).astype(np.float32)
    down = np.tile(np.float32([0, 0, -1]), (len(place), 1))
    hits = scene.make_caster("embree").intersect(starts, down)
    dark = np.floor(place / side).sum(axis=1) % 2 == 1
    assert 0.3 < dark.mean() < 0.7
    np.testing.assert_array_equal(scene.triangle_object[hits.triangle], np.where(dark, 1, 0))
    np.testing.assert_allclose(hits.distance * scene.size, np.where(dark, 1, 2), rtol=1e-5)
    share = transmitted(scene.make_caster("embree"), starts, -down)
    assert share.min() == 1
    # What is bounced where the leaf is: its albedo there, not the mean with the holes.
    mean = scene.points.mean_albedo[scene.points.object_index == 1]
    np.testing.assert_allclose(mean, 0.7, atol=1e-6)


def test_rays_end_at_a_pane_by_its_share_and_go_on_behind():
    scene = under_panes(0.3)
    caster = scene.make_caster("embree")
    rng = np.random.default_rng(1)
    ways = rng.normal(size=(5000, 3))
    ways = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
    ways[:, 2] = -np.abs(ways[:, 2]) - 0.2
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    starts = scene.to_frame(np.column_stack([rng.uniform(-1, 1, (5000, 2)), np.full(5000, 0.5)]))
    starts = starts.astype(np.float32)
    hits = caster.intersect(starts, ways)
    pane_hit = (hits.triangle >= 0) & (scene.triangle_object[hits.triangle] == 1)
    assert abs(pane_hit.mean() - 0.3) < 4 * np.sqrt(0.21 / 5000)
    ends = (starts + ways * hits.distance[:, None])[hits.triangle >= 0]
    heights = scene.to_world(ends)[:, 2]
    np.testing.assert_allclose(heights, np.where(pane_hit[hits.triangle >= 0], 0.3, 0), atol=1e-4)
    # As far as a limit rays meet what they meet.
    just = np.float32(0.19) / scene.size / -ways[:, 2]
    assert not caster.occluded(starts, ways, just).any()
    beyond = just / 0.19 * 0.21
    np.testing.assert_array_equal(caster.occluded(starts, ways, beyond), pane_hit)


def test_a_lamp_shines_through_panes_by_their_shares():
    lamp = Lamp("point", np.full(3, 100.0), np.array([0, 0, 2.0]))
    scenes = [under_panes(*shares) for shares in ([], [0.3, 0.3])]
    free, dimmed = (lamp_light(s, s.make_caster("embree", "shadow"), [lamp]) for s in scenes)
    seen = scenes[1].points.visible
    np.testing.assert_allclose(dimmed[seen], 0.49 * free, rtol=1e-4)


def test_more_layers_than_there_can_be_are_counted():
    scene = under_panes(*[0.01] * (MOST_LAYERS + 3))
    caster = scene.make_caster("embree")
    up = np.float32([[0, 0, 1]])
    assert transmitted(caster, scene.ray_origins[:1], up)[0] == 0
    assert caster.too_deep == 1


def test_panes_are_said_and_cut_outs_are_not():
    assert "pane0, pane1" in " ".join(under_panes(0.3, 0.5).messages)
    mesh = plane(2, -2, 2, name="leaf")
    mesh.paint = Checker(mesh, 0.25)
    scene = Scene.from_meshes([mesh])
    assert scene.opacity is not None and not scene.messages
    assert under_panes(0.0).messages == []


def test_an_opaque_scene_has_the_plain_caster():
    scene = Scene.from_meshes([plane(3)])
    assert scene.opacity is None
    assert type(scene.make_caster("brute")).__name__ == "BruteForceCaster"
