"""Maps of views, against lobes over the same field of incoming light."""

import numpy as np
import pytest

from prt_core.reflectance import Constant, Microfacet
from prt_core.sphere import CubeMap
from prt_core.transport.glossy_view import GlossyView
from prt_core.transport.view_map import N_NODES, ViewMap, white_shares
from tests.core.transport.test_glossy_view import Case, relative

GOLD = np.float32([[0.9, 0.6, 0.3], [0.1, 0.4, 0.7], [0, 0, 0], [0, 0, 0]])


@pytest.fixture(scope="module")
def case():
    case = Case(2)
    case.light[case.cube_map.texel_of(np.array([[0.5, 0.2, 0.8]]))] = 200
    case.field.update(case.light, case.sent)
    return case


def made(case, kinds, lobes, least=0):
    """A map of lobes (alpha, powers (4, 3)) by kind."""
    alphas, powers = (np.array(parts, np.float32) for parts in zip(*lobes, strict=True))
    views = ViewMap(
        case.field, case.normals, kinds, lambda kind, _: [(alphas[kind], powers[kind])], least
    )
    views.make()
    return views


def differences(case, views, rows, alpha, powers, way):
    outgoing = np.tile(np.float32(way) / np.linalg.norm(way).astype(np.float32), (len(rows), 1))
    facing = (case.normals[rows] * outgoing).sum(axis=1) > 0.12
    rows, outgoing = rows[facing], outgoing[facing]
    work = np.full(len(rows), alpha, np.float32), np.tile(powers, (len(rows), 1, 1))
    exact = GlossyView(case.field, case.normals).reflected(rows, outgoing, *work)
    return relative(views.reflected(rows, outgoing), exact)


@pytest.mark.parametrize(("alpha", "bound"), [(0.2, 0.03), (0.3, 0.02), (0.6, 0.015)])
@pytest.mark.parametrize("way", [(0.3, -0.5, 0.8), (0.9, 0.1, 0.35), (0, 0, 1)])
def test_what_is_looked_up_is_what_lobes_are(case, way, alpha, bound):
    n = len(case.normals)
    views = made(case, np.zeros(n, int), [(alpha, GOLD)])
    assert views.has.all() and not views.left
    assert differences(case, views, np.arange(n), alpha, GOLD, way) < bound


def test_points_of_several_kinds_have_their_own_lobes_and_some_no_map(case):
    n = len(case.normals)
    kinds = np.arange(n) % 3 - 1
    grey = np.float32(np.tile([[0.04], [0.6], [0.36], [0]], 3))
    lobes = [(0.3, GOLD), (0.5, grey)]
    views = made(case, kinds, lobes)
    np.testing.assert_array_equal(views.has, kinds >= 0)
    for kind, (alpha, powers) in enumerate(lobes):
        rows = np.flatnonzero(kinds == kind)
        assert differences(case, views, rows, alpha, powers, (0.3, -0.5, 0.8)) < 0.03


def test_lobes_that_differ_little_share_maps_and_keep_their_own_colour(case):
    n = len(case.normals)
    colours = np.random.default_rng(1).uniform(0.45, 0.55, (n, 4, 3)).astype(np.float32)
    colours[:, 1:] = 0
    views = made(case, np.arange(n), [(0.3, powers) for powers in colours])
    assert len(np.unique(views._group)) < n
    rows = np.arange(n)
    up = np.tile(np.float32([0.3, -0.5, 0.81]), (n, 1))
    rows = rows[(case.normals * up).sum(axis=1) > 0.2]
    work = up[rows], np.full(len(rows), 0.3, np.float32), colours[rows]
    exact = GlossyView(case.field, case.normals).reflected(rows, *work)
    assert relative(views.reflected(rows, up[rows]), exact) < 0.02
    # Without a colour of its own each would be some 6 % off.
    ratio = views.reflected(rows, up[rows]) / exact
    assert ratio.std() < 0.03


def test_maps_that_would_not_pay_are_not_made(case):
    n = len(case.normals)
    views = made(case, np.zeros(n, int), [(0.3, GOLD)], least=n)
    assert not views.has.any() and not views.planned and not views.nbytes
    nothing = made(case, np.full(n, -1), [(0.3, GOLD)])
    assert not nothing.has.any() and not nothing.planned


def test_maps_are_there_when_all_pieces_are_made(case):
    n = len(case.normals)
    views = ViewMap(
        case.field, case.normals, np.zeros(n, int),
        lambda kind, _: [(np.full(len(kind), 0.3), np.tile(GOLD, (len(kind), 1, 1)))], 0,
    )  # fmt: skip
    views.make(1)
    assert 0 < views.left < views.planned and not views.has.any()
    views.make()
    assert not views.left and views.has.all()
    whole = made(case, np.zeros(n, int), [(0.3, GOLD)])
    np.testing.assert_allclose(views._nodes, whole._nodes.astype(int), atol=1)
    assert views.nbytes > 3 * n * N_NODES**2


def share_of(lobe, cosine):
    """What a lobe reflects of even light, summed over the texels of a fine cube map."""
    cube_map = CubeMap(128)
    above = cube_map.directions[:, 2] > 0
    incoming = cube_map.directions[above]
    view = np.array([[np.sqrt(1 - cosine**2), 0, cosine]])
    values = lobe.eval(incoming, view)[..., 0] * incoming[:, 2]
    return (values * cube_map.solid_angles[above]).sum()


def test_white_lobes_reflect_all_that_comes_where_nothing_is_lost():
    shares = white_shares()
    # Seen from straight above a narrow lobe loses next to nothing, a wide one some light.
    assert 0.98 < shares[0, -1, 0] < 1 and shares[-1, -1, 0] < 0.95
    for slider in (0.3, 1):
        lobe = Microfacet(slider**2, slider**2, Constant(1.0), multiple=False)
        assert abs(share_of(lobe, 0.25) / shares[-1 if slider == 1 else 0, 16, 0] - 1) < 0.01
    assert np.isfinite(shares).all() and (shares >= 0).all() and shares[..., 0].max() < 1.1
