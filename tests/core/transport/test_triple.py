import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import haar_rows
from prt_core.evaluate import colour_error
from prt_core.reflectance import F82Tint, Microfacet, Phong
from prt_core.reflectance.lobe_table import LobeTable
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import View, visibility_bits
from prt_core.transport.dense_gloss import dense_reflection
from prt_core.transport.triple import TripleProducts
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(32)
LOBE = Phong(10)


def sky(sun=0.0):
    """A smooth light with some structure, and a sun of one texel."""
    d = CUBE.directions
    light = np.stack([1.2 + d[:, 2], 1 + 0.5 * np.sin(5 * d[:, 0]), 1 + 0.8 * d[:, 1]], axis=1)
    light[CUBE.texel_of([[0.3, 0.5, 0.8]])] += sun
    return light


@pytest.fixture(scope="module")
def points():
    scene = Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6)), plane(9)])
    bits = visibility_bits(scene, CUBE, caster_of(scene), slice(0, len(scene.points)))
    outgoing = View(position=(2, -3, 2)).outgoing(scene.to_world(scene.points.positions))
    return bits, scene.points.normals, outgoing


@pytest.fixture(scope="module")
def table():
    return LobeTable(LOBE.eval, n_kept=61, n_mirrored=16, n_tilts=5)


def test_nothing_is_lost_where_the_light_keeps_all(points, table):
    """The sum over texels of the table's own lobes, of the light and the bits."""
    bits, normals, outgoing = (part[::5] for part in points)
    light = np.random.default_rng(0).random((CUBE.n_directions, 2))
    form = TripleProducts(bits, normals, CUBE, table, LOBE.eval, light_kept=1.0, n_bright=0)
    result = form.set_light(light).toward(outgoing)
    facing = np.flatnonzero(np.einsum("ni,ni->n", normals, outgoing) > 0)
    keys, _, _, scale = table.look_up(normals[facing], outgoing[facing])
    blocks = haar_rows(table.rows(keys.ravel()).toarray(), 16, inverse=True)
    lobes = np.einsum("nkb,nk->nb", blocks.reshape(*keys.shape, -1), scale[:, 0])
    lobes = lobes.reshape(-1, 6, 16, 1, 16, 1).repeat(2, axis=3).repeat(2, axis=5) / 4
    seen = np.unpackbits(bits[facing], axis=1, count=CUBE.n_directions, bitorder="little")
    wanted = (lobes.reshape(len(facing), -1) * seen) @ light
    np.testing.assert_allclose(result[facing], np.maximum(wanted, 0), atol=2e-5)
    assert not np.delete(result, facing, axis=0).any()


@pytest.mark.parametrize("sun", [0.0, 3000.0])
def test_one_in_a_hundred_wavelets_is_near_the_dense_sum(points, table, sun):
    bits, normals, outgoing = points
    light = sky(sun)
    wanted = dense_reflection(bits, normals, CUBE, light, LOBE.eval, outgoing)
    form = TripleProducts(bits, normals, CUBE, table, LOBE.eval)
    assert form.n_kept == 61
    assert colour_error(form.set_light(light).toward(outgoing), wanted)["l2"] < 0.03
    # A second light is not mixed with the first.
    again = form.set_light(2 * light).toward(outgoing)
    assert colour_error(again, 2 * wanted)["l2"] < 0.03


def test_a_sun_has_to_be_taken_out(points, table):
    bits, normals, outgoing = points
    light = sky(3000.0)
    wanted = dense_reflection(bits, normals, CUBE, light, LOBE.eval, outgoing)
    whole = TripleProducts(bits, normals, CUBE, table, LOBE.eval, n_bright=0).set_light(light)
    assert 0.05 < colour_error(whole.toward(outgoing), wanted)["l2"] < 0.3


def test_metals_have_colour(points):
    bits, normals, outgoing = (part[::3] for part in points)
    metal = Microfacet(0.3, 0.3, F82Tint((0.9, 0.5, 0.2)))
    table = LobeTable(metal.eval, n_kept=61, n_mirrored=8, n_tilts=5)
    for light in (sky(), sky()[:, :1]):
        wanted = dense_reflection(bits, normals, CUBE, light, metal.eval, outgoing)
        form = TripleProducts(bits, normals, CUBE, table, metal.eval).set_light(light)
        assert colour_error(form.toward(outgoing), wanted)["l2"] < 0.06


def test_what_does_not_fit_is_said(points, table):
    bits, normals, outgoing = points
    with pytest.raises(PRTError, match=r"cube_map: expected 2\^k times the 16 blocks"):
        TripleProducts(bits[:, :108], normals, CubeMap(12), table, LOBE.eval)
    form = TripleProducts(bits, normals, CUBE, table, LOBE.eval)
    with pytest.raises(PRTError, match="light: none is set"):
        form.toward(outgoing)
    with pytest.raises(PRTError, match="light: expected values from 0"):
        form.set_light(-np.ones((CUBE.n_directions, 3)))
