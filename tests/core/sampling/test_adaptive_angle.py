import numpy as np
import pytest

from prt_core.runtime.progress import run
from prt_core.sampling.adaptive_angle import AngularGrid, adaptive_steps, windows
from prt_core.sampling.tracer import Tracer
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import horizon_bits, unpack
from tests.meshes import caster_of, plane, sphere


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(8, 0.4, (0, 0, 0.5)), plane(9)])


@pytest.mark.parametrize("n", [1, 2, 3, 5, 11])
def test_windows_cross_the_edges_of_faces(n):
    cube_map = CubeMap(n)
    texels = windows(cube_map, 7)
    assert texels.max() < cube_map.n_directions
    around = np.zeros((cube_map.n_directions,) * 2, bool)
    row = np.repeat(np.arange(cube_map.n_directions), texels.shape[1])
    inside = texels.ravel() >= 0
    around[row[inside], texels.ravel()[inside]] = True
    # Unfolding is symmetric: who lies in my window has me in its own.
    np.testing.assert_array_equal(around, around.T)
    assert around.diagonal().all()
    # No texel is left out because a face ends: only the cube's corners cut a window short, one of
    # them where the face is wide enough, else all four.
    reach, corners = min(3, n), 1 if n >= 7 else 4
    counts = inside.reshape(texels.shape).sum(axis=1)
    assert (counts >= (2 * reach + 1) ** 2 - corners * reach**2).all()


def test_windows_hold_what_is_near_and_nothing_else():
    cube_map = CubeMap(16)
    texels = windows(cube_map, 7)
    cosine = cube_map.directions @ cube_map.directions.T
    # Half a window is 3.5 texels: none further than its diagonal, all nearer than two texels.
    for direction in (0, 7, 15, 16 * 15, 300, 700, 1535):
        mine = texels[direction][texels[direction] >= 0]
        assert cosine[direction, mine].min() > np.cos(2.5 * 3.5 * np.sqrt(2) / 16)
        near = np.flatnonzero(cosine[direction] > np.cos(1.0 / 16))
        assert np.isin(near, mine).all()


def test_the_grid_is_every_second_row_and_column():
    grid = AngularGrid(CubeMap(8))
    assert len(grid.grid) * 4 == 6 * 64
    assert grid.on_grid.sum() == len(grid.grid)
    # Every window of 7 x 7 holds at least nine samples of it, or six at a corner of the cube.
    distinct = [len(np.unique(row)) for row in grid.neighbours]
    assert min(distinct) >= 6
    assert max(distinct) == 16


def test_what_is_traced_is_true_and_what_agrees_is_borrowed(scene):
    cube_map, caster = CubeMap(16), caster_of(scene)
    points = np.arange(0, len(scene.points), 3)
    tracer = Tracer(scene, cube_map, caster)
    rows = run(adaptive_steps(scene, tracer, points, AngularGrid(cube_map)))
    truth = visibility_bits(scene, cube_map, caster, points)
    np.testing.assert_array_equal(rows.bits & rows.traced, truth & rows.traced)
    above = horizon_bits(scene, cube_map, points)
    assert not (rows.traced & ~above).any()
    assert not (rows.bits & ~above).any()
    assert not (rows.features & ~rows.traced).any()
    share = np.unpackbits(rows.traced).sum() / np.unpackbits(above).sum()
    assert 0.25 <= share < 0.7
    assert tracer.rays == np.unpackbits(rows.traced).sum()
    wrong = np.unpackbits(rows.bits ^ truth).sum() / np.unpackbits(above).sum()
    assert wrong < 0.01


def test_an_edge_of_the_shadow_is_traced_on_both_faces(scene):
    """A blocker that covers one face of the cube map exactly: its edge is the face's edge."""
    cube_map = CubeMap(8)
    grid = AngularGrid(cube_map, 5)
    face = np.arange(cube_map.n_directions) // 64 == 2
    seen = np.packbits(~face & grid.on_grid, bitorder="little")[None]
    blocked = np.packbits(face & grid.on_grid, bitorder="little")[None]
    any_seen, any_blocked = (
        unpack(bits, cube_map.n_directions, np.uint8)[0].view(bool)
        for bits in grid.disagreement(seen, blocked)
    )
    edge = any_seen & any_blocked
    beside = windows(cube_map, 5)
    touches = np.array([len({*(face[t[t >= 0]])}) == 2 for t in beside])
    assert edge.any()
    assert not (edge & ~touches).any()
    assert set(np.flatnonzero(edge) // 64) >= {0, 1, 2, 4, 5}
