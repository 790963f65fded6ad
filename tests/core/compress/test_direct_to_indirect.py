import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import PointHaar, PointMultiwavelet
from prt_core.compress.direct_to_indirect import DirectToIndirect
from prt_core.light import Lamp
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import Transport, gather_hits, gather_operator, lamp_light
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(4)


@pytest.fixture(scope="module")
def scene():
    """A ball on the floor of a dome: light goes on many times."""
    dome = sphere(8, 1.6, (0, 0, 0.4), inside=True, name="dome", albedo=(0.8, 0.8, 0.5))
    ball = sphere(6, 0.4, (0.2, 0, 0.45), name="ball", albedo=(0.7, 0.7, 0.1))
    return Scene.from_meshes([dome, ball, plane(13, albedo=(0.6, 0.6, 0.3))])


@pytest.fixture(scope="module")
def transport(scene):
    caster, every = caster_of(scene), slice(0, len(scene.points))
    hits = [gather_hits(scene, caster, every, 0, r).hits for r in range(4)]
    gather = gather_operator(np.concatenate(hits, axis=1), len(scene.points))
    dark = np.zeros((len(scene.points), CUBE.n_directions // 8), np.uint8)
    return Transport(CUBE, dark, gather, scene.points.normals, scene.points.albedo)


@pytest.fixture(scope="module")
def lights(scene):
    """Direct light of a lamp at places along a way."""
    caster = caster_of(scene)
    places = [(-0.8, -0.5, 1.2), (-0.3, -0.9, 0.6), (0.7, -0.6, 0.9)]
    lamps = [Lamp("point", (100, 80, 60), place) for place in places]
    return [lamp_light(scene, caster, [lamp]) for lamp in lamps]


def bases(scene):
    parts = scene.points.positions, scene.points.normals, scene.points.object_index
    return PointHaar(*parts), PointMultiwavelet(*parts)


def error(result, wanted):
    return float(np.linalg.norm(result - wanted) / np.linalg.norm(wanted))


def test_whole_rows_are_all_bounces(scene, transport, lights):
    points = np.arange(3, transport.n_points, 7)
    for basis in bases(scene):
        form = DirectToIndirect(transport, basis, points, kept=1.0)
        for received in lights:
            wanted = transport.with_bounces(received)
            # Both series end within the transport's tolerance.
            assert error(form.product(received), wanted[points]) < 2e-3
            assert error(form.indirect(received), (wanted - received)[points]) < 5e-3


def test_a_few_wavelets_hold_the_light_of_lamps_that_move(scene, transport, lights):
    points = np.arange(0, transport.n_points, 9)
    wanted = [(transport.with_bounces(received) - received)[points] for received in lights]
    basis, errors = bases(scene)[0], {}
    for kept in (0.02, 0.05):
        form = DirectToIndirect(transport, basis, points, kept)
        result = [form.indirect(received) for received in lights]
        errors[kept] = max(error(*pair) for pair in zip(result, wanted, strict=True))
    plain = DirectToIndirect(transport, basis, points, 0.05, by_scale=False)
    largest = max(error(plain.indirect(e), w) for e, w in zip(lights, wanted, strict=True))
    assert errors[0.05] < 0.05 and errors[0.02] < 0.12
    assert errors[0.05] < errors[0.02] and 2 * errors[0.05] < largest


def test_channels_that_bounce_alike_are_kept_once(scene, transport):
    form = DirectToIndirect(transport, bases(scene)[0], np.arange(9), 0.05)
    assert form.rows[0] is form.rows[1] and form.rows[1] is not form.rows[2]
    n_kept = round(0.05 * transport.n_points)
    assert form.rows[0].nnz <= 9 * n_kept
    assert form.nbytes == sum(
        r.data.nbytes + r.indices.nbytes + r.indptr.nbytes for r in (form.rows[0], form.rows[2])
    )


def test_what_does_not_fit_is_said(scene, transport):
    basis = bases(scene)[0]
    direct = Transport(CUBE, transport.bits, None, transport.normals, transport.materials)
    with pytest.raises(PRTError, match="transport: expected one with bounces"):
        DirectToIndirect(direct, basis)
    with pytest.raises(PRTError, match=r"basis: expected one of \d+ points, got one of 5"):
        DirectToIndirect(transport, PointHaar(np.eye(5, 3)))
    form = DirectToIndirect(transport, basis, [0, 1], 0.1)
    with pytest.raises(PRTError, match=r"received: expected an array of shape \(\d+, 3\)"):
        form.indirect(np.ones((4, 3), np.float32))
