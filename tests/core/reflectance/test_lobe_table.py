import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import haar_rows
from prt_core.reflectance import F82Tint, Microfacet, Phong, directional_albedo
from prt_core.reflectance.lobe_table import LobeTable, kept_wavelets
from prt_core.sphere import CubeMap, tangent_frames


def some_views(n=11, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outgoing = normals + 0.6 * rng.normal(size=(n, 3))
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    outgoing *= np.sign(np.einsum("ni,ni->n", normals, outgoing))[:, None]
    return normals, outgoing


def lobe(evaluate, normal, outgoing, blocks):
    """What each block brings, summed over finer texels."""
    cube_map = CubeMap(4 * blocks)
    frame = tangent_frames(normal[None])[0]
    values = evaluate(cube_map.directions @ frame.T, (frame @ outgoing)[None])
    values = values.mean(axis=1) * np.maximum(cube_map.vectors @ normal, 0)
    return values.reshape(6, blocks, 4, blocks, 4).sum(axis=(2, 4)).ravel()


def mixed(table, normals, outgoing):
    """(n, blocks) the lobes that the table says."""
    keys, _, _, scale = table.look_up(normals, outgoing)
    rows = table.rows(keys.ravel()).toarray()
    blocks = haar_rows(rows, table.cube_map.resolution, inverse=True).reshape(*keys.shape, -1)
    return np.einsum("nkb,nk->nb", blocks, scale[:, 0])


@pytest.fixture(scope="module")
def fine():
    return LobeTable(Phong(6).eval, n_kept=384, n_blocks=8, n_mirrored=16, n_tilts=6)


def test_lobes_are_those_of_the_reflectance(fine):
    normals, outgoing = some_views()
    result = mixed(fine, normals, outgoing)
    wanted = np.stack(
        [lobe(Phong(6).eval, x, o, 8) for x, o in zip(normals, outgoing, strict=True)]
    )
    error = np.linalg.norm(result - wanted, axis=1) / np.linalg.norm(wanted, axis=1)
    assert np.median(error) < 0.05 and error.max() < 0.15
    # What is reflected in all comes out whole, whatever the cells are.
    np.testing.assert_allclose(result.sum(axis=1), wanted.sum(axis=1), rtol=0.04)


def test_a_tenth_of_the_wavelets_holds_most_of_a_lobe(fine):
    few = LobeTable(Phong(6).eval, n_kept=38, n_blocks=8, n_mirrored=16, n_tilts=6)
    normals, outgoing = some_views(5, 2)
    whole, part = mixed(fine, normals, outgoing), mixed(few, normals, outgoing)
    error = np.linalg.norm(part - whole, axis=1) / np.linalg.norm(whole, axis=1)
    assert error.max() < 0.13
    assert few.nbytes == few.places.size * 8 < fine.nbytes / 9


def test_lobes_are_made_for_one_mirror_direction_of_48(fine):
    # The triangle between a face's middle, edge and corner: 8 rows of it.
    assert len(fine.places) == 36 * fine.n_cells
    assert 80 < fine.n_cells < 100


def test_colours_are_those_of_the_reflected_share():
    metal = Microfacet(0.3, 0.3, F82Tint((0.9, 0.5, 0.2)))
    table = LobeTable(metal.eval, n_kept=20, n_blocks=4, n_mirrored=4, n_tilts=3)
    cosine = np.array([0.3, 0.7, 0.95])
    views = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)
    np.testing.assert_allclose(table.share(cosine), directional_albedo(metal, views), rtol=0.01)
    scale = table.look_up(*some_views(3))[3]
    assert scale.shape == (3, 3, 4)
    assert (scale[:, 0].sum(axis=1) > scale[:, 2].sum(axis=1)).all()


def test_what_does_not_fit_is_said(fine):
    with pytest.raises(PRTError, match="n_mirrored: expected a whole number >= 2|from 2 to 256"):
        LobeTable(Phong(6).eval, n_mirrored=1)
    with pytest.raises(PRTError, match="keys: expected those of look_up"):
        fine.rows([10**9])
    with pytest.raises(PRTError, match="share: expected a number above 0"):
        kept_wavelets(0.0, 6144)
    assert kept_wavelets(0.01, 6144) == 61
