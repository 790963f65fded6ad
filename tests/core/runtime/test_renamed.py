"""Old public names work for one release, and warn."""

from importlib import import_module

import numpy as np
import pytest

import prt_core
from prt_core.cli import main
from prt_core.relight.forms import CompressedForm
from prt_core.runtime.renamed import renamed_keyword
from prt_core.sampling import Sampled
from prt_core.store import BakeStore
from tests.meshes import plane

SKY = np.ones((96, 3), np.float32)
LAMP = prt_core.Lamp("point", (1, 2, 3), (0, 0, 2), name="bulb")


def warns(new):
    return pytest.warns(DeprecationWarning, match=new)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("renamed") / "plate.prt"
    scene = prt_core.Scene.from_meshes([plane()])
    settings = prt_core.BakeSettings(resolution=4, caster="brute")
    prt_core.run(prt_core.bake_steps(scene, path, settings, [LAMP]))
    return path


def test_relight_of_objects_is_radiance(path):
    bake = prt_core.load(path)
    exact = bake.transport.radiance(SKY)
    with warns("Transport.radiance"):
        np.testing.assert_array_equal(bake.transport.relight(SKY), exact)
    relighter = prt_core.Relighter(bake)
    with warns("Relighter.radiance"):
        np.testing.assert_array_equal(relighter.relight(SKY), exact)
    assert exact.max() > 0


def test_the_keyword_transport_is_form(path):
    for call in (prt_core.relight, prt_core.relight_points):
        with warns("'form' now"):
            call(path, SKY, transport="exact")
        with pytest.raises(prt_core.PRTError, match="form: "), warns("'form' now"):
            call(path, SKY, transport="something")
    with warns("'form' now"):
        assert prt_core.Relighter(prt_core.load(path), transport="exact").form == "exact"


def test_facts_are_attributes(path):
    store = BakeStore(path)
    bits = np.zeros((2, 3), np.uint8)
    sampled = Sampled(bits, bits, 7, attributes={"levels": [5]})
    form = CompressedForm("pca", None, {"bytes": 11})
    for holder in (store, sampled, form):
        with warns(f"{type(holder).__name__}.attributes"):
            assert holder.facts == holder.attributes and holder.attributes


def test_names_of_modules():
    # The package has a function of that name.
    compress = import_module("prt_core.compress")
    with warns("method_from_text"):
        assert compress.method_asked is compress.method_from_text
    with warns("ClusterEvaluator"):
        assert compress.ClusterRelighter is compress.ClusterEvaluator
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = compress.no_such_thing


def test_a_keyword_by_both_names_is_refused():
    @renamed_keyword(old="new")
    def call(new=None):
        return new

    assert call(new=3) == 3
    with warns("'new' now"):
        assert call(old=5) == 5
    with pytest.raises(TypeError, match="both"):
        call(old=5, new=7)


def test_the_option_transport_says_what_it_is_now(path, tmp_path, capfd):
    np.save(tmp_path / "sky.npy", SKY)
    line = ["relight", str(path), "--lamps", "--output", str(tmp_path / "o.npz")]
    main([*line, "--transport", "exact"])
    assert "--transport is --form now" in capfd.readouterr().err
    main([*line, "--form", "exact"])
    assert "is --form now" not in capfd.readouterr().err
