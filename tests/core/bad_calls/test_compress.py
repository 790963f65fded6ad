"""Wrong calls of `prt_core.compress`: parameters, rows, lights and choices."""

import importlib

import numpy as np
import pytest

from prt_core import basis
from prt_core.bake.compress import CompressSettings, compress_steps

from .calls import N_DIRECTIONS, RESOLUTION, RNG, Call, directions, faults_of, image, method, plain

# `prt_core.compress` is the call; the folder of that name is found by its path.
compress = importlib.import_module("prt_core.compress")


def some_rows(n=11):
    return RNG.random((n, N_DIRECTIONS, 3)).astype(np.float32)


def fitted(kind, **params):
    """A call that makes an estimator, fits it and relights from it."""

    def call(rows, light, **changed):
        model = kind(**{**params, **changed}).fit(rows)
        return model.product(light)

    return call


def estimator(kind, may=(), /, **params):
    """A `Call` for a compressor's parameters, rows and light."""

    def build(there):
        rows = compress.ArrayRows(some_rows(), RESOLUTION)
        call = fitted(kind, **params)
        return Call(call, {**params, "rows": rows, "light": there.light}, may)

    return build


CALLS = {
    "PCA": estimator(compress.PCA, n_components=3, tolerance=0.1),
    "BlockPCA": estimator(
        compress.BlockPCA, shape=(3, 5), size=4, n_components=2, pixels=np.arange(11)
    ),
    "ClusteredPCA": estimator(
        compress.ClusteredPCA,
        n_clusters=2,
        n_components=2,
        method="static",
        tolerance=0.1,
        n_sketch=5,
        seed=0,
    ),
    "VectorQuantisation": estimator(compress.VectorQuantisation, n_clusters=3, n_sketch=5, seed=0),
    "SparseClusteredPCA": estimator(
        compress.SparseClusteredPCA,
        dense=np.arange(0, 11, 2),
        neighbours=np.arange(0, 22, 2).reshape(11, 1) % 12 % 11 // 2 * 2,
        n_clusters=2,
        n_components=2,
        tolerance=0.1,
        n_sketch=5,
        seed=0,
    ),
    "HaarLighting": estimator(compress.HaarLighting, n_terms=5, selection="area", step=0.01),
    "Harmonics": estimator(compress.Harmonics, order=2),
    "Wavelet4D": estimator(
        compress.Wavelet4D,
        ("rows haar",),
        columns=basis.PointHaar(RNG.random((11, 3))),
        error=0.1,
        mode="adaptive",
        bits=9,
        scaling="root",
        dither=False,
        light_error=0.01,
        n_terms=9,
        memory=1 << 20,
        seed=0,
    ),
    "Wavelet4D.nbytes_wanted": plain(
        lambda **wanted: compress.Wavelet4D(**wanted).fit(
            compress.ArrayRows(some_rows(), RESOLUTION)
        ),
        ("nbytes_wanted None",),
        nbytes_wanted=3000,
        mode="2d",
    ),
    "Irradiance": lambda t: Call(
        fitted(compress.Irradiance),
        {"rows": compress.TransportRows(t.bake.transport), "light": t.light},
    ),
    "IncrementalLighting": lambda t: Call(
        lambda model, n_terms, light: compress.IncrementalLighting(model, n_terms).product(light),
        {
            "model": compress.HaarLighting().fit(compress.ArrayRows(some_rows(), RESOLUTION)),
            "n_terms": 3,
            "light": t.light,
        },
        ("n_terms None",),
    ),  # fmt: skip
    "ClusterEvaluator": lambda t: Call(
        lambda light, **rest: compress.ClusterEvaluator(**rest).product(light),
        {
            "model": compress.PCA(2).fit(compress.TransportRows(t.bake.transport)),
            "transport": t.bake.transport,
            "n_terms": 9,
            "error": 0.01,
            "n_exact": 3,
            "bright": 0.01,
            "light": t.light,
        },
        ("transport None", "n_terms None"),
    ),  # fmt: skip
    "ArrayRows": plain(
        compress.ArrayRows,
        ("array another axis",),
        array=some_rows(),
        resolution=RESOLUTION,
        reads=np.array([0, 1, 1]),
    ),  # fmt: skip
    "TransportRows": lambda t: Call(
        lambda points, **rest: compress.TransportRows(**rest).features(points),
        {
            "transport": t.bake.transport,
            "rank": 3,
            "natural": True,
            "seed": 0,
            "points": np.array([0, 2]),
        },
    ),  # fmt: skip
    "SomeRows": plain(
        compress.SomeRows, rows=compress.ArrayRows(some_rows()), points=np.array([1, 3])
    ),
    "RowCode.plain": plain(
        compress.RowCode.plain,
        n_directions=24,
        n_outputs=3,
        resolution=2,
        natural=True,
        reads=np.array([0, 1, 1]),
    ),
    "Compressor.predict": method(
        lambda t: compress.PCA(2).fit(some_rows()), "predict", rows=some_rows(5)
    ),
    "Compressor.transform": method(
        lambda t: compress.PCA(2).fit(some_rows()), "transform", rows=some_rows(5)
    ),
    "Compressor.inverse_transform": method(
        lambda t: compress.PCA(2).fit(some_rows()),
        "inverse_transform",
        coordinates=lambda t: compress.PCA(2).fit(some_rows()).transform(some_rows(5)),
    ),
    "Compressor.reconstruct": method(
        lambda t: compress.PCA(2).fit(some_rows()), "reconstruct", points=np.array([0, 3])
    ),
    **{
        f"{type(model).__name__}.entries": method(
            lambda t, model=model: model.fit(compress.ArrayRows(some_rows(), RESOLUTION)),
            "entries",
            points=np.array([0, 3]),
            columns=np.array([5, 2]),
        )
        for model in (
            compress.PCA(2),
            compress.HaarLighting(),
            compress.Harmonics(2),
            compress.Wavelet4D(),
        )
    },  # fmt: skip
    "Compressor.from_state": plain(
        compress.PCA.from_state, state=compress.PCA(2).fit(some_rows()).state()
    ),
    "Limits": plain(
        compress.Limits,
        ("megabytes huge", "milliseconds huge"),
        tolerance=0.1,
        megabytes=3.0,
        milliseconds=4.0,
    ),  # fmt: skip
    "Task.of": lambda t: Call(
        compress.Task.of,
        {"transport": t.bake.transport, "points": t.bake.scene.points, "seed": 0},
    ),
    "Task.sample": method(
        lambda t: compress.Task.of(t.bake.transport, t.bake.scene.points),
        "sample",
        ("n_patches None",),
        n_points=4,
        n_patches=2,
    ),
    "choose_steps": lambda t: Call(
        compress.choose_steps,
        {
            "task": compress.Task.of(t.bake.transport, t.bake.scene.points),
            "names": ["harmonics"],
            "limits": compress.Limits(0.5),
            "lights": {"sky": t.light},
        },
    ),  # fmt: skip
    "method_named": plain(compress.method_named, name="pca"),
    "register_method": plain(compress.register_method, method=compress.method_named("pca")),
    "neighbour_pairs": plain(
        compress.neighbour_pairs,
        ("positions 3e38", "normals", "groups", "k huge"),
        positions=RNG.random((7, 3)),
        normals=directions(7),
        groups=np.arange(7) % 2,
        k=2,
    ),
    "border_pairs": plain(
        compress.border_pairs, labels=np.array([0, 1, 1]), pairs=np.array([[0, 1], [1, 2]])
    ),
    "seam": plain(
        compress.seam,
        colours=np.ones((3, 3)),
        truth=np.ones((3, 3)),
        pairs=np.array([[0, 1], [1, 2]]),
    ),
    "CompressSettings": plain(
        CompressSettings,
        ("megabytes huge", "milliseconds huge"),
        method="pca",
        tolerance=0.1,
        megabytes=3.0,
        milliseconds=4.0,
        seed=0,
    ),
    "compress_steps": lambda t: Call(
        compress_steps,
        {
            "bake": t.bake,
            "settings": CompressSettings("harmonics", 0.5),
            "lights": {"sky": image()},
        },
        ("lights None", "settings None"),
    ),  # fmt: skip
}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    faults = faults_of(CALLS[name](there), there.folder)
    assert not faults, "\n".join(faults)
