"""Views of a field in every way that fits into memory, against the slow one."""

import numpy as np
import pytest

from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_compress import compress_light_field_steps, compressed_light_field
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_view import field_toward
from prt_core.bake.light_field_viewer import FieldViewer
from prt_core.errors import PRTError
from prt_core.runtime.progress import run
from prt_core.transport import View
from tests.core.bake.test_light_field_store import Arithmetic, scene

ANGLES, LIGHTS = (5, 3), ("one", "two")
WEIGHTS = np.float32([[0.5, 0, 2], [1, 3, 0.25]])
VIEWS = [View(position=[3, -2, 1.5]), View(direction=[0.3, -1, 0.5]), View(position=[-1, 4, 0])]
STRENGTHS = dict(zip(LIGHTS, WEIGHTS, strict=True))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("field") / "field.slf"
    settings = LightFieldSettings(angles=ANGLES, samples=4)
    run(capture_light_field(scene(), Arithmetic(LIGHTS), path, settings))
    run(compress_light_field_steps(path, "haar", psnr=50.0))
    return path


def kind_bytes(field):
    """Bytes that just suffice for each kind."""
    one = 12 * len(field) * ANGLES[0] * ANGLES[1]
    return {"each light": 2 * one, "each light in 16 bits": one, "coefficients": one - 1}


@pytest.mark.parametrize("kind", ["each light", "each light in 16 bits"])
def test_a_captured_field_is_shown_as_by_the_slow_way(path, kind):
    field = load_light_field(path)
    viewer = FieldViewer(field, most_bytes=kind_bytes(field)[kind])
    assert viewer.kind == kind
    # The look-up in single precision, or numbers of 11 bits.
    tolerance = 5e-5 if kind == "each light" else 2e-3
    for view in VIEWS:
        for weights in (None, WEIGHTS, WEIGHTS[:, 0]):
            if weights is None:
                strengths = None
            else:
                strengths = dict(zip(LIGHTS, weights, strict=True))
            slow, used = field_toward(field, view, strengths, "exact")
            quick = run(viewer.steps(view, weights))
            assert used == "exact" and quick.dtype == np.float32
            error = np.abs(quick - slow[field.point]).max() / slow.max()
            assert error < tolerance, (kind, error)


def test_three_lights_fall_back_to_their_mixture(tmp_path):
    lights = ("one", "two", "three")
    settings = LightFieldSettings(angles=ANGLES, samples=4)
    run(capture_light_field(scene(), Arithmetic(lights), tmp_path / "three.slf", settings))
    field = load_light_field(tmp_path / "three.slf")
    viewer = FieldViewer(field, most_bytes=12 * len(field) * 15)
    assert viewer.kind == "mixture"
    for strengths in ({"one": 2.0}, {"two": [0, 1, 3.0]}):
        for view in VIEWS[:2]:
            slow, _ = field_toward(field, view, strengths)
            quick = run(viewer.steps(view, field.weights(strengths)))
            np.testing.assert_allclose(quick, slow[field.point], atol=5e-5 * slow.max())


def test_a_compressed_field_is_shown_from_tables_or_coefficients(path):
    field = load_light_field(path)
    compressed = compressed_light_field(field)
    for kind, most_bytes in kind_bytes(field).items():
        viewer = FieldViewer(field, compressed, most_bytes)
        assert viewer.kind == kind
        for view in (*VIEWS, VIEWS[-1]):
            # The last view stays while the lamps change.
            for strengths in (STRENGTHS, {"one": 0.5}, {"two": 0.0}):
                slow, used = field_toward(field, view, strengths, "compressed")
                quick = run(viewer.steps(view, field.weights(strengths)))
                assert used == "compressed"
                error = np.abs(quick - slow[field.point]).max() / slow.max()
                assert error < 2e-3, (kind, error)


def test_what_takes_too_much_memory_is_said_before_it_is_taken(path):
    field = load_light_field(path)
    with pytest.raises(PRTError, match="GB of memory to look at; compress it"):
        FieldViewer(field, most_bytes=100)
    with pytest.raises(PRTError, match="most_bytes: expected"):
        FieldViewer(field, most_bytes=-1)


def test_black_lights_and_large_ones_keep_their_range(path):
    field = load_light_field(path)
    captured = field.radiance

    class Scaled:
        shape, chunks = captured.shape, captured.chunks

        def __getitem__(self, part):
            values = captured[part]
            return values * np.float32(0 if part[0] == 1 else 1e7)

    field.radiance = Scaled()
    viewer = FieldViewer(field, most_bytes=kind_bytes(field)["each light in 16 bits"])
    whole = run(viewer.steps(VIEWS[0]))
    exact = 1e7 * field_toward(load_light_field(path), VIEWS[0], {"two": 0}, "exact")[0]
    np.testing.assert_allclose(whole, exact[field.point], rtol=2e-3)
    assert not run(viewer.steps(VIEWS[0], [0, 1])).any()


def test_a_viewer_in_a_point_is_said(path):
    field = load_light_field(path)
    viewer = FieldViewer(field)
    place = field.scene.to_world(field.scene.points.positions[field.point[3]])
    with pytest.raises(PRTError, match="step back"):
        run(viewer.steps(View(position=place)))
