import numpy as np
import pytest

from prt_core import PRTError
from prt_core.sphere import Blocks, CubeMap


@pytest.mark.parametrize(("resolution", "side"), [(32, 8), (32, 16), (12, 4), (6, 1), (4, 4)])
def test_blocks_share_out_all_texels_and_their_solid_angle(resolution, side):
    blocks = Blocks(CubeMap(resolution), side)
    assert (np.sort(blocks.texels.ravel()) == np.arange(6 * resolution**2)).all()
    angles = blocks.sums(blocks.cube_map.solid_angles)
    np.testing.assert_allclose(angles, blocks.solid_angles, rtol=1e-12)
    texel = blocks.cube_map.texel_of(blocks.cube_map.directions)
    along = blocks.along(*blocks.cube_map.directions.T)
    np.testing.assert_array_equal(blocks.of_texel[texel], along)


@pytest.mark.parametrize(("resolution", "side"), [(32, 8), (16, 8), (8, 8), (12, 4), (6, 1)])
def test_shares_of_patterns_are_those_of_the_bits(resolution, side):
    rng = np.random.default_rng(3)
    blocks = Blocks(CubeMap(resolution), side)
    seen = rng.random((5, 6 * resolution**2)) < 0.4
    bits = np.packbits(seen, axis=1, bitorder="little")
    shares = blocks.pattern_shares(blocks.patterns(bits))
    angles = blocks.cube_map.solid_angles
    wanted = np.stack([blocks.sums(row * angles) / blocks.sums(angles) for row in seen])
    np.testing.assert_allclose(shares, wanted, rtol=1e-5)


def test_a_side_that_does_not_divide_the_resolution_is_refused():
    with pytest.raises(PRTError, match="side: expected a divisor of the 12 texels"):
        Blocks(CubeMap(12), 5)
