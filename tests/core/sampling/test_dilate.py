import numpy as np
import pytest

from prt_core.light import CubeMap
from prt_core.sampling.dilate import dilate


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


@pytest.mark.parametrize("resolution", [1, 2, 3, 5, 8, 11, 16])
def test_a_dilated_mask_is_the_union_of_all_neighbourhoods(resolution):
    n_directions = 6 * resolution**2
    rng = np.random.default_rng(resolution)
    mask = rng.random((7, n_directions)) < 0.05
    mask[0] = False
    wanted = mask[:, around(resolution)].any(axis=1)
    found = dilate(np.packbits(mask, axis=1, bitorder="little"), resolution)
    found = np.unpackbits(found, axis=1, bitorder="little")
    assert not found[:, n_directions:].any()
    np.testing.assert_array_equal(found[:, :n_directions] > 0, wanted)


def test_a_texel_at_an_edge_spreads_onto_the_next_face():
    mask = np.zeros((1, 6 * 64), bool)
    mask[0, 7] = True
    grown = np.unpackbits(
        dilate(np.packbits(mask, axis=1, bitorder="little"), 8), bitorder="little"
    )
    assert set(np.flatnonzero(grown) // 64) > {0}
