"""A whole field: goals, lights, views, state, and what it refuses."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.lightfield import METHODS, SurfaceLightField, field_error

COARSE = "ceob:n_pairs=4"
PEAK = 4.0


@pytest.fixture(scope="module")
def fitted(field):
    radiance, frames, _ = field
    return SurfaceLightField(COARSE, psnr=30.0, peak=PEAK, n_clusters=2).fit(radiance, frames)


def towards(positions, eye=(2.0, 1.0, 3.0)):
    ways = np.array(eye) - positions
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def bilinear(field, radiance, directions):
    """What a view is, by the layout's own look-up, from a table that was not compressed."""
    local = np.einsum("nij,nj->ni", field.frames_, directions)
    cells, weights = field.layout_.bilinear(local)
    table = radiance.reshape(len(radiance), -1, 3)
    return np.einsum("nk,nkc->nc", weights, np.take_along_axis(table, cells[..., None], axis=1))


@pytest.mark.parametrize("method", METHODS)
def test_an_error_is_reached_and_little_spared(method, field):
    radiance, frames, _ = field
    text = {"ceob": COARSE, "ksvd": "ksvd:n_atoms=24"}.get(method, method)
    # No atoms or harmonics of these numbers come nearer.
    goal = {"ksvd": 14.0, "harmonics": 14.0}.get(method, 30.0)
    model = SurfaceLightField(text, psnr=goal, peak=PEAK).fit(radiance[0], frames)
    error = model.error(radiance[0])
    assert goal <= error.psnr < goal + (3.0 if method == "harmonics" else 0.8), error.psnr
    assert error.luma_psnr > error.psnr - 3
    assert np.isclose(error.psnr_per_sample, error.psnr + 10 * np.log10(48))
    wanted = np.square(model.decode(slice(None)) - radiance[0], dtype=np.float64).sum()
    assert np.isclose(error.rgb, wanted / (3 * len(frames)))
    assert np.isclose(error.psnr, 20 * np.log10(PEAK / np.sqrt(error.rgb)))


def test_a_size_is_kept_to(field):
    radiance, frames, _ = field
    sizes = []
    for megabytes in (0.006, 0.008):
        model = SurfaceLightField("haar", megabytes=megabytes, peak=PEAK).fit(radiance[0], frames)
        assert 0.9 * megabytes < model.coded_nbytes / 1e6 <= megabytes
        sizes.append(model.error(radiance[0]).psnr)
    assert sizes[1] > sizes[0] + 1


def test_chroma_has_half_the_coefficients(field):
    radiance, frames, _ = field
    model = SurfaceLightField(COARSE, n_coefficients=9).fit(radiance[0], frames)
    assert [m.n_coefficients for m in model.compressors_[0]] == [9, 5, 5]
    assert [m.n_pairs for m in model.compressors_[0]] == [4, 1, 1]
    assert model.compressors_[0][0].rows_.counts.max() == 9
    assert model.compressors_[0][1].rows_.counts.max() <= 5


def test_clusters_and_pairs_are_those_of_the_smallest_field(field, monkeypatch):
    radiance, frames, _ = field
    monkeypatch.setattr("prt_core.lightfield.fit._LEAST_POINTS", 16)
    sizes = {}
    for n_clusters in (1, 2, None):
        model = SurfaceLightField("cpca", psnr=25.0, peak=PEAK, n_clusters=n_clusters)
        sizes[n_clusters] = model.fit(radiance[0], frames).coded_nbytes
        assert model.error(radiance[0]).psnr >= 25
    assert sizes[None] == min(sizes[1], sizes[2])
    # 61 points do not pay for eight pairs of bases.
    model = SurfaceLightField("ceob:n_pairs=8", threshold=0.3, n_clusters=None)
    assert model.fit(radiance[0], frames).compressors_[0][0].n_pairs < 8


def test_what_is_sent_everywhere_alike_needs_no_coefficients(field):
    radiance, frames, positions = field
    plain = SurfaceLightField(COARSE, threshold=0.05).fit(radiance[0], frames)
    # A diffuse part that differs from point to point, and has a colour.
    rough = 5 * np.abs(positions)[:, None, None]
    both = SurfaceLightField(COARSE, threshold=0.05).fit(radiance[0] + rough, frames)
    for a, b in zip(plain.compressors_[0], both.compressors_[0], strict=True):
        assert abs(a.n_numbers_ - b.n_numbers_) <= 0.1 * a.n_numbers_ + 5
    change = both.decode(slice(None)) - plain.decode(slice(None))
    assert np.abs(change.mean(axis=(1, 2)) - rough[:, 0, 0]).max() < 0.03
    assert both.bases_.shape == (1, 3, 61) and both.bases_.dtype == np.float16


def test_what_cannot_be_reached_is_said(field):
    radiance, frames, _ = field
    for method, goal, message in (
        ("ksvd:n_atoms=5", {"psnr": 60.0}, "psnr: 60 dB are out of reach"),
        ("ceob:n_pairs=8", {"megabytes": 0.001}, "megabytes: 0.001 are too few"),
    ):
        with pytest.raises(PRTError, match=message):
            SurfaceLightField(method, **goal, peak=PEAK).fit(radiance[0], frames)


def test_lights_add_up_and_can_be_dimmed_and_coloured(field, fitted):
    radiance, _, positions = field
    assert (fitted.n_lights_, fitted.n_points_) == radiance.shape[:2]
    assert fitted.labels_.shape == (2, 61) and set(fitted.labels_.ravel()) == {0, 1}
    ways = towards(positions)
    each = fitted.each_toward(ways)
    assert each.shape == (2, 61, 3)
    assert np.allclose(fitted.toward(ways), each.sum(axis=0), atol=1e-5)
    weights = np.array([[0.5, 0.2, 0.0], [0.0, 2.0, 1.0]])
    mixed = (each * weights[:, None]).sum(axis=0)
    assert np.allclose(fitted.toward(ways, weights), mixed, atol=1e-5)
    assert np.allclose(fitted.toward(ways, [0.0, 3.0]), 3 * each[1], atol=1e-5)
    assert not fitted.toward(ways, [0.0, 0.0]).any()
    # Both together are nearer than the sum of the errors of each.
    both = fitted.error(radiance.sum(axis=0)).psnr
    first = fitted.error(radiance[0], [1.0, 0.0]).psnr
    assert both > 28.5 and first > both - 0.1


def test_all_reads_of_a_field_agree(field, fitted):
    radiance, _, positions = field
    decoded = fitted.decode(slice(None))
    assert decoded.shape == radiance.shape[1:]
    points, cells = np.array([3, 3, 60, 17]), np.array([0, 47, 5, 20])
    wanted = decoded.reshape(61, -1, 3)[points, cells]
    assert np.allclose(fitted.entries(points, cells), wanted, atol=1e-5)
    for eye in ((2.0, 1.0, 3.0), (0.0, 0.0, -5.0), (0.9, 0.1, 0.2)):
        ways = towards(positions, eye)
        view = fitted.toward(ways)
        assert view.dtype == np.float32
        assert np.allclose(view, bilinear(fitted, decoded, ways), atol=2e-5)
        decoded_once, from_coefficients = fitted.viewer(), fitted.viewer(most_bytes=1000)
        assert decoded_once.is_decoded and not from_coefficients.is_decoded
        assert np.allclose(decoded_once.toward(ways), view, atol=2e-5)
        assert (from_coefficients.toward(ways) == view).all()
    weights = [0.25, 1.5]
    assert np.allclose(fitted.viewer(weights).toward(ways), fitted.toward(ways, weights), atol=2e-5)


def test_views_flicker_less_than_the_nearest_direction(field, fitted):
    radiance, _, positions = field
    angles = np.radians(0.5 * np.arange(24))
    eyes = 4 * np.stack([np.cos(angles), np.sin(angles), 0 * angles + 0.6], axis=1)
    decoded = fitted.decode(slice(None)).reshape(61, -1, 3)
    smooth, steps = [], []
    for eye in eyes:
        ways = towards(positions, eye)
        smooth.append(fitted.toward(ways))
        local = np.einsum("nij,nj->ni", fitted.frames_, ways)
        cells = fitted.layout_.nearest(local)
        steps.append(decoded[np.arange(61), cells])

    def flicker(views):
        return np.sqrt(np.square(np.diff(views, 2, axis=0)).mean())

    assert flicker(smooth) < 0.2 * flicker(steps)


def test_a_state_is_the_same_field(field, fitted):
    radiance, _, positions = field
    state = fitted.state()
    assert state["data"].nbytes < fitted.nbytes < radiance.nbytes
    # The text that describes it counts as well.
    assert state["data"].nbytes + 500 < fitted.coded_nbytes < state["data"].nbytes + 4000
    arrays = {k: v for k, v in state.items() if isinstance(v, np.ndarray)}
    assert set(arrays) == {"data", "frames"}
    import json

    plain = json.loads(json.dumps({k: v for k, v in state.items() if k not in arrays}))
    again = SurfaceLightField.from_state({**plain, **arrays})
    ways = towards(positions)
    assert (again.toward(ways) == fitted.toward(ways)).all()
    assert again.nbytes == fitted.nbytes and again.get_params() == fitted.get_params()
    assert again.error(radiance.sum(axis=0)) == fitted.error(radiance.sum(axis=0))


def test_a_damaged_state_is_refused(fitted):
    state = fitted.state()
    damages = [{k: v for k, v in state.items() if k != name} for name in state]
    damages += [
        {**state, "frames": state["frames"][:-1]},
        {**state, "data": state["data"][:-1]},
        {**state, "shape": [5, 6]},
        {**state, "compressors": state["compressors"][:1]},
        {**state, "compressors": [each[:2] for each in state["compressors"]]},
        {**state, "compressors": 3},
        {**state, "index": state["index"][1:]},
    ]
    rng = np.random.default_rng(0)
    for damage in damages:
        with pytest.raises(PRTError):
            SurfaceLightField.from_state(damage)
    for at in rng.integers(0, len(state["data"]), 40):
        data = state["data"].copy()
        data[at] ^= 1 << rng.integers(8)
        # A digest finds these in a store; here they may only not do worse than another picture.
        try:
            other = SurfaceLightField.from_state({**state, "data": data})
        except PRTError:
            continue
        assert np.isfinite(other.decode(np.array([0, 5]))).all()


def test_fields_of_little_or_extreme_content():
    frames = np.tile(np.eye(3), (4, 1, 1))
    up = np.tile([0.0, 0, 1], (4, 1))
    dark = SurfaceLightField(COARSE, psnr=40.0).fit(np.zeros((4, 5, 3, 3)), frames)
    assert not dark.toward(up).any() and dark.error(np.zeros((4, 5, 3, 3))).psnr == np.inf
    one = np.random.default_rng(0).random((4, 1, 1, 3)).astype(np.float32)
    for goal in ({"psnr": 50.0}, {"n_coefficients": 1}):
        model = SurfaceLightField(COARSE, **goal).fit(one, frames)
        assert np.allclose(model.toward(up), one[:, 0, 0], atol=0.02)
    caustic = np.random.default_rng(1).random((4, 6, 5, 3)).astype(np.float32)
    caustic[2, 3, 3] = 1e6
    model = SurfaceLightField(COARSE, threshold=0.01).fit(caustic, frames)
    decoded = model.decode(slice(None))
    assert np.isfinite(decoded).all()
    assert np.allclose(decoded[[0, 1, 3]], caustic[[0, 1, 3]], atol=0.2)
    assert np.allclose(decoded[2, 3, 3], 1e6, rtol=0.01)
    assert model.nbytes < 4 * caustic.nbytes


def test_wrong_calls_of_a_field_are_refused_in_one_line(field, fitted):
    radiance, frames, positions = field
    bad = radiance.copy()
    bad[1, 3, 2, 1, 0] = np.nan
    for arguments, message in (
        (({"psnr": 30.0}, bad, frames), "radiance of light 1: 1 values are NaN or infinite"),
        (({"psnr": 30.0}, radiance[0, 0], frames), "radiance: expected an array of shape"),
        (({"psnr": 30.0}, radiance[:, :, :0], frames), "radiance: expected an array of shape"),
        (({"psnr": 30.0}, radiance[0], frames[1:]), "frames: expected an array of shape"),
        (({}, radiance[0], frames), "light field: give one of"),
        (({"psnr": 30.0, "megabytes": 1.0}, radiance[0], frames), "got psnr, megabytes"),
        (({"n_coefficients": 3, "n_clusters": None}, radiance[0], frames), "give their number"),
        (({"psnr": 30.0, "n_clusters": 62}, radiance[0], frames), "62 clusters of 61 points"),
        (({"psnr": 30.0, "method": "ceob:x=1"}, radiance[0], frames), "has the settings"),
        (({"psnr": 30.0, "peak": 0}, radiance[0], frames), "peak: expected a number above 0"),
    ):
        with pytest.raises(PRTError, match=message):
            settings, *rest = arguments
            SurfaceLightField(**settings).fit(*rest)
    with pytest.raises(PRTError, match="holds nothing yet"):
        SurfaceLightField(psnr=3.0).toward(positions)
    ways = towards(positions)
    for weights in ([1.0], np.ones((2, 2)), [np.nan, 1.0], "red"):
        with pytest.raises(PRTError, match="weights: "):
            fitted.toward(ways, weights)
    with pytest.raises(PRTError, match="directions: expected an array of shape"):
        fitted.viewer().toward(ways[1:])
    with pytest.raises(PRTError, match="peak: expected a number above 0"):
        field_error(fitted, radiance[0], 0)
