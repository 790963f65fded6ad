import numpy as np
import pytest

from prt_core.sampling.dilate import chequer, dilate
from prt_core.sampling.tracer import count_bits
from prt_core.sphere import CubeMap


def around(resolution):
    """Eight texels around each, by geometry: a step of one texel on the face's plane."""
    cube_map = CubeMap(resolution)
    step = 2 / resolution
    places = (np.arange(resolution) + 0.5) * step - 1
    v, u = (x.ravel() for x in np.meshgrid(places, places, indexing="ij"))
    table = []
    for dv in (-step, 0, step):
        for du in (-step, 0, step):
            x, y = u + du, v + dv
            # Beyond a corner of the cube there is no texel: the one along the edge will do.
            corner = (np.abs(x) > 1) & (np.abs(y) > 1)
            y = np.where(corner, np.clip(y, -1 + step / 2, 1 - step / 2), y)
            table.append(cube_map.texel_of(cube_map.on_faces(x, y)))
    return np.stack(table)


@pytest.mark.parametrize("corners", [True, False])
@pytest.mark.parametrize("resolution", [1, 2, 3, 5, 8, 11, 16, 24, 32, 64])
def test_a_dilated_mask_is_the_union_of_all_neighbourhoods(resolution, corners):
    n_directions = 6 * resolution**2
    rng = np.random.default_rng(resolution)
    mask = rng.random((7, n_directions)) < 0.03
    mask[0] = False
    table = around(resolution) if corners else around(resolution)[[1, 3, 4, 5, 7]]
    wanted = mask[:, table].any(axis=1)
    result = dilate(np.packbits(mask, axis=1, bitorder="little"), resolution, corners)
    result = np.unpackbits(result, axis=1, bitorder="little")
    assert not result[:, n_directions:].any()
    np.testing.assert_array_equal(result[:, :n_directions] > 0, wanted)


def test_a_texel_at_an_edge_spreads_onto_the_next_face():
    mask = np.zeros((1, 6 * 64), bool)
    mask[0, 7] = True
    grown = np.unpackbits(
        dilate(np.packbits(mask, axis=1, bitorder="little"), 8), bitorder="little"
    )
    assert set(np.flatnonzero(grown) // 64) > {0}


def test_a_chequerboard_holds_every_other_texel_of_each_face():
    board = np.unpackbits(chequer(6), count=216, bitorder="little").reshape(6, 6, 6)
    assert board[:, 0, 0].all() and not (board[:, 1:] & board[:, :-1]).any()
    assert board.sum() == 108


@pytest.mark.parametrize("shape", [(3, 8), (3, 7), (1, 5), (0, 4)])
def test_bits_are_counted(shape):
    bits = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    spread = np.unpackbits(bits, axis=-1)
    assert count_bits(bits) == spread.sum()
    np.testing.assert_array_equal(count_bits(bits, axis=-1), spread.sum(axis=-1))
    np.testing.assert_array_equal(count_bits(bits[::2], axis=-1), spread[::2].sum(axis=-1))
