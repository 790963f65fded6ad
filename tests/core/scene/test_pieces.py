"""Cut-outs as geometry: pieces lie where opacity says, rims let as much light pass."""

import numpy as np
import pytest

from prt_core.scene.opacity import Opacity
from prt_core.scene.pieces import pieces_of
from prt_core.scene.scene import Scene
from tests.meshes import plane


def discs(n, radii):
    """An `Opacity` of triangles of n^2 cells with round holes, two triangles alike."""
    middles = Opacity.middles(n)
    rows = [np.where(np.hypot(*(middles - 0.3).T) > radius, 65535, 0) for radius in radii]
    first = np.repeat(np.arange(len(radii)), 2).astype(np.int32) * n * n
    # Neighbours in the list of triangles are not of one kind.
    first = np.concatenate([first[::2], first[1::2]])
    along = np.full(len(first), n, np.int32)
    return Opacity(first, along, np.concatenate(rows).astype(np.uint16))


def area(corners):
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


@pytest.mark.parametrize("n", [1, 6, 8, 24, 32])
@pytest.mark.parametrize("most", [1, 1 << 19])
def test_pieces_are_where_opacity_says(n, most):
    opacity = discs(n, (0.2, 0.35, 0.05))
    triangles = np.arange(6)[::-1]
    pieces = pieces_of(opacity, triangles, most)
    for triangle in range(6):
        mine = pieces.triangle == triangle
        cells = opacity.cells[opacity.first[triangle] + np.arange(n * n)]
        sure = mine & pieces.is_opaque
        # All of a triangle that is cut as finely as its cells, and no more of one that is not.
        opaque, possible = area(pieces.corners[sure]).sum(), area(pieces.corners[mine]).sum()
        share = (cells > 0).mean()
        assert opaque <= share + 1e-9 <= possible + 2e-9
        if most > 1:
            assert opaque == pytest.approx(share) and not (mine & ~pieces.is_opaque).any()
        middles = pieces.corners[sure].mean(axis=1)
        assert (opacity.at(np.full(len(middles), triangle), middles) == 1).all()


def test_large_parts_stay_whole():
    opacity = discs(32, (0.2,))
    pieces = pieces_of(opacity, np.arange(2))
    assert len(pieces.triangle) < (opacity.cells > 0).sum()
    assert area(pieces.corners).max() > 60 / 32**2


class Grating:
    """Opacity 1 and 0 in stripes, with slopes between them."""

    def __init__(self, mesh, slope):
        self._x, self.slope = mesh.vertices[mesh.corner_vertex, 0], slope

    def at(self, corners, weights):
        x = np.einsum("mk,mk->m", weights, self._x[corners])
        wave = 0.5 + np.cos(2 * np.pi * x) / self.slope
        return {"opacity": np.clip(wave, 0, 1)[:, None]}

    def alike(self, corners):
        return np.arange(len(corners))

    def texels(self, corners):
        return np.full(len(corners), 2048.0)

    def digest(self):
        return np.float64(self.slope).tobytes()


@pytest.mark.parametrize(("slope", "cut"), [(0.2, True), (2.0, False)])
def test_rims_are_one_or_the_other_and_nothing_is_lost(slope, cut):
    mesh = plane(2, -1, 1)
    mesh.paint = Grating(mesh, slope)
    opacity = Scene.from_meshes([mesh], max_hidden=0).opacity
    between = (opacity.cells > 0) & (opacity.cells < opacity.opaque)
    assert between.any() != cut
    assert opacity.cells.mean() / opacity.opaque == pytest.approx(0.5, abs=0.004)
