import json

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.bake.measure import standing_lights
from prt_core.compress import PCA, HaarLighting, TransportRows, candidate_names
from prt_core.compress.subject import Subject
from prt_core.evaluate.bench import compress as bench_compress
from prt_core.evaluate.bench.compress import _matrix, _truth, bench_compress_steps
from prt_core.evaluate.bench.compress_report import compress_report
from prt_core.evaluate.report import write_report
from tests.meshes import plane, sphere

KEYS = {"scene", "method", "settings", "bytes", "seconds", "ms_median", "ms_worst", "matrix_l2",
        "relit_l2_mean", "relit_l2_worst", "seam", "peak_bytes"}  # fmt: skip


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    ball = sphere(8, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    scene = Scene.from_meshes([ball, plane(9, albedo=0.7)])
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    run(bake_steps(scene, path, BakeSettings(resolution=4, tolerance=0.05)))
    return load(path)


@pytest.fixture(scope="module")
def lights(bake):
    return {
        f"{name} {turn}": image.to_cube_map(bake.cube_map, turn)
        for name, image in standing_lights().items()
        for turn in (130,)
    }


def test_every_method_and_budget_is_a_row(bake, lights, tmp_path):
    built = {}
    names = candidate_names()
    rows = run(bench_compress_steps(bake, "ball", names, lights, [0, 1], evaluators=built))
    assert [row["method"] for row in rows[:3]] == ["dense", "exact", "irradiance"]
    assert all(KEYS <= set(row) for row in rows)
    for name in names:
        own = [row for row in rows if row["method"] == name]
        assert [row["budget"] for row in own] == [0, 1]
        assert own[0]["bytes"] < own[1]["bytes"]
        assert own[0]["matrix_l2"] > own[1]["matrix_l2"] > 0
        assert own[0]["relit_l2_mean"] > own[1]["relit_l2_mean"]
        floor = rows[2]["relit_l2_mean"]
        assert all(0 < row["relit_l2_mean"] <= row["relit_l2_worst"] < floor for row in own)
        assert (own[0]["seam"] is not None) == (name in ("cpca", "pca", "vq"))
    entries = 3 * bake.transport.n_points * bake.transport.n_directions
    assert rows[0]["bytes"] == 4 * entries and rows[0]["bits_a_coefficient"] == 32
    caster = bake.make_caster()
    first = next(iter(lights.items()))
    report = compress_report(bake, caster, rows, built, *first, len(lights))
    page = write_report(tmp_path / "report", report)
    assert json.loads((tmp_path / "report" / "rows.json").read_text()) == rows
    assert (tmp_path / "report" / "error.png").read_bytes()[:4] == b"\x89PNG"
    # The exact one and each method, and the difference of each.
    assert page.read_text().count("<img") == 1 + 1 + 2 * len(names)


def test_white_lights_measure_the_matrix(bake, lights, monkeypatch):
    monkeypatch.setattr(bench_compress, "_WHITE", 150)
    transport = bake.transport
    rows = TransportRows(transport)
    truth = run(_truth(transport, lights, 0))
    every = np.arange(transport.n_points)
    wanted = transport.rows(every)
    model = PCA(12).fit(rows)
    result = model.reconstruct(every) * transport.albedo[:, None]
    error = np.linalg.norm(result - wanted) / np.linalg.norm(wanted)

    class Task:
        n_points = transport.n_points

    Task.rows, Task.transport, Task.subject = rows, transport, Subject(transport)
    measured = _matrix(model, truth, Task)
    assert measured["matrix_l2"] == pytest.approx(error, rel=0.1)
    # A light that is cut to few terms is not the matrix' fault.
    few = HaarLighting(4, step=1e-4).fit(rows)
    assert _matrix(few, truth, Task)["matrix_l2"] < 0.02 and few.n_terms == 4


def test_wrong_names_are_said(bake, lights):
    with pytest.raises(PRTError, match="method: expected one of cpca"):
        run(bench_compress_steps(bake, "ball", ["best"], lights))
    with pytest.raises(PRTError, match="light: give at least one"):
        run(bench_compress_steps(bake, "ball", ["pca"], {}))
