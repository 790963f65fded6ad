"""Methods asked for with settings of their own, from the text to the form in the store."""

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress, relight_points
from prt_core.bake.compress import standing_lights
from prt_core.bake.report_lines import compressed_lines, trial_lines
from prt_core.compress import Task, candidate_names, method_from_text, method_named, method_names
from prt_core.compress.choice.methods import describe, settings_of
from tests.meshes import plane, sphere

SKY = standing_lights()["low soft sun"]


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    path = tmp_path_factory.mktemp("asked") / "a.prt"
    ball = sphere(7, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(11, albedo=0.7)], max_hidden=0)
    run(bake_steps(scene, path, BakeSettings(resolution=4, tolerance=0.05)))
    return path


@pytest.fixture(scope="module")
def task(baked):
    bake = load(baked)
    return Task.of(bake.transport, bake.scene.points, 3)


def test_settings_hold_all_along_the_ladder(task):
    plain = method_named("cpca").budgets(task)
    asked = method_from_text("cpca:method=iterative,n_sketch=5").budgets(task)
    assert all((m.method, m.n_sketch, m.seed) == ("iterative", 5, 3) for m in asked)
    # What is the same is there once.
    sizes = [(m.n_clusters, m.n_components) for m in asked]
    assert sizes == list(dict.fromkeys((m.n_clusters, m.n_components) for m in plain))
    assert len(sizes) < len(plain)
    orders = [m.order for m in method_from_text("harmonics:order=4").budgets(task)]
    assert orders == [4]
    wavelets = method_from_text("wavelet4d:error=0.1").budgets(task)
    assert [(m.error, m.bits) for m in wavelets] == [(0.1, 7), (0.1, 8), (0.1, 9)]
    assert method_from_text("pca") == method_named("pca")


# The method, what the form has, and the words that say it.
METHODS = {
    "cpca:method=iterative,n_clusters=5,n_components=3": "method iterative",
    "irradiance": "irradiance",
    "wavelet4d:rows=d4,error=0.1,bits=9": "rows d4",
    "wavelet4d:columns=haar,error=0.1,bits=9": "columns haar",
    "wavelet4d:mode=2d,error=0.1,bits=9": "mode 2d",
    "wavelet4d:mode=4d,error=0.1,bits=9": "mode 4d",
    "wavelet4d:scaling=levels,dither=true,error=0.1,bits=11": "dither True",
    "wavelet4d:scaling=none,bits=none,error=0.1": "scaling none",
    "haar:selection=area,n_terms=90,step=0.001": "selection area",
    "haar:selection=unweighted,n_terms=none,step=0.001": "selection unweighted",
}


@pytest.fixture(scope="module")
def attributes_of(baked):
    """Compress by a method, and keep what it says."""
    known = {}

    def attributes(method, again=False):
        if again or method not in known:
            known[method] = compress(baked, method=method, tolerance=0.1, lights={"sky": SKY})
        return known[method]

    return attributes


@pytest.mark.parametrize("method", METHODS)
def test_what_is_built_is_compressed_stored_relit_and_named(baked, attributes_of, method):
    attributes = attributes_of(method, again=True)
    assert (
        attributes["method"] == method.partition(":")[0] and attributes["asked"]["method"] == method
    )
    # One setting of one method is not tried before: there is no choice.
    assert attributes["trials"] == [] and attributes["why"] == "all that was asked for"
    assert list(trial_lines(attributes)) == [
        f"chosen: {attributes['method']}, all that was asked for"
    ]
    assert METHODS[method] in next(iter(compressed_lines(attributes)))
    result = relight_points(load(baked), SKY, rotation=65, form="compressed")
    exact = relight_points(load(baked), SKY, rotation=65, form="exact")
    error = np.linalg.norm(result - exact) / np.linalg.norm(exact)
    assert attributes["lights"] == 3 and attributes["error"] < (
        0.5 if method == "irradiance" else 0.12
    )
    assert error <= attributes["worst"] * 1.001


def test_methods_differ(attributes_of):
    """Each selects what it names: other settings give other bytes."""
    sizes = {}
    for method in METHODS:
        attributes = attributes_of(method)
        sizes[method] = attributes["bytes"], round(attributes["error"], 9)
    assert len(set(sizes.values())) == len(sizes)


def test_what_auto_does_not_try_is_there_by_name():
    assert set(method_names()) - set(candidate_names()) >= {"irradiance"}
    assert method_from_text("irradiance").settings == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("best", "method: expected one of cpca, pca, "),
        ("cpca:foo=1", "'cpca' has the settings n_clusters, n_components, method, .*; got 'foo'"),
        ("cpca:seed=1", "'cpca' has the settings .*; got 'seed'"),
        ("irradiance:order=3", "'irradiance' has no settings; got 'order'"),
        ("cpca:method=quick", "'cpca': method: expected one of static, iterative, got 'quick'"),
        ("cpca:n_clusters=0", "'cpca': n_clusters: expected a whole number >= 1, got 0"),
        ("cpca:n_clusters=many", "'cpca': n_clusters: expected a whole number >= 1, got 'many'"),
        ("pca:n_components=1.5", "'pca': n_components: expected a whole number"),
        ("pca:tolerance=2", "'pca': tolerance: expected a number above 0 and below 1"),
        ("vq:n_sketch=0", "'vq': n_sketch: expected a whole"),
        ("harmonics:order=11", "'harmonics': order: expected a whole number from 1 to 10"),
        ("haar:selection=size", "'haar': selection: expected one of unweighted, area, transport"),
        ("haar:step=0", "'haar': step: expected a number above 0"),
        ("wavelet4d:rows=9/7", "'wavelet4d': rows: expected one of haar, d4, d6, d8"),
        ("wavelet4d:columns=d5", "'wavelet4d': columns: expected one of multiwavelet, haar, d4"),
        ("wavelet4d:mode=3d", "'wavelet4d': mode: expected one of adaptive, 4d, 2d"),
        ("wavelet4d:dither=maybe", "'wavelet4d': dither: expected True or False"),
        ("wavelet4d:bits=1", "'wavelet4d': bits: expected a whole number from 2 to 16"),
        ("wavelet4d:scaling=log", "'wavelet4d': scaling: expected one of root, levels, none"),
    ],
)
def test_what_there_is_not_is_said_with_what_there_is(text, message):
    with pytest.raises(PRTError, match=message) as caught:
        method_from_text(text)
    assert "\n" not in str(caught.value)


def test_what_is_for_images_is_refused_for_points(task):
    with pytest.raises(PRTError, match="columns: expected one of multiwavelet, haar for points"):
        method_from_text("wavelet4d:columns=9/7").budgets(task)
    with pytest.raises(PRTError, match="'block_pca' takes the pixels of an image"):
        method_from_text("block_pca:size=4").budgets(task)


def test_settings_are_told_in_plain_values(task):
    model = method_named("wavelet4d").budgets(task)[2]
    printed = settings_of(model)
    assert (
        printed["columns"] == "multiwavelet" and printed["n_terms"] is None and printed["bits"] == 7
    )
    assert "columns=multiwavelet" in describe(model) and "seed" not in describe(model)
