import csv
import json
from dataclasses import asdict

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.evaluate.bench.sampling import (
    Method,
    bench_sampling_steps,
    matrix_errors,
    parse_method,
)
from prt_core.evaluate.bench.sampling_report import _curve
from prt_core.runtime.progress import run
from prt_core.sampling import HuangSettings, probe_lights
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import Transport, visibility_bits
from prt_core.transport.visibility import horizon_bits, unpack
from tests.meshes import caster_of, plane, sphere

KEYS = {
    "scene", "method", "back_end", "object", "entries_percent", "rays", "seconds", "matrix_l2",
    "relit_l2", "interval_low", "interval_high", "peak_bytes", "hemisphere_percent",
    "worst_point", "relit_p95", "relit_max", "settings", "time_ratio",
}  # fmt: skip


@pytest.fixture(scope="module")
def measured():
    scene = Scene.from_meshes([sphere(8, 0.4, (0, 0, 0.5), name="ball"), plane(13)])
    cube_map, caster = CubeMap(8), caster_of(scene)
    methods = [parse_method(text) for text in ("agreement", "huang:features=30", "exhaustive")]
    lights = probe_lights(cube_map)
    rows, results = run(
        bench_sampling_steps(scene, cube_map, caster, methods, lights, "ball", seed=2)
    )
    return scene, cube_map, caster, rows, results, lights


def test_a_row_for_every_method_and_object(measured):
    scene, cube_map, caster, rows, results, _ = measured
    assert [(row["label"], row["object"]) for row in rows] == [
        (label, name)
        for label in ("exhaustive", "agreement", "huang (features 30)")
        for name in ("ball", "plane")
    ]
    assert list(results) == ["exhaustive", "agreement", "huang (features 30)"]
    for row in rows:
        assert KEYS <= set(row), KEYS - set(row)
        assert row["scene"] == "ball"
        assert row["back_end"] == caster.name
        assert row["settings"].get("seed", 2) == 2
    json.dumps(rows)


def test_errors_are_those_of_the_matrix(measured):
    scene, cube_map, caster, rows, results, lights = measured
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    np.testing.assert_array_equal(results["exhaustive"].bits, truth)
    for row in rows:
        mine = scene.points.object_index == ["ball", "plane"].index(row["object"])
        result = results[row["label"]]
        points = np.flatnonzero(mine)
        d = [
            Transport(cube_map, bits, None, scene.points.normals, scene.points.albedo).direct(
                points
            )
            for bits in (result.bits, truth)
        ]
        wanted = np.linalg.norm(d[0] - d[1]) / np.linalg.norm(d[1])
        assert row["matrix_l2"] == pytest.approx(wanted, abs=1e-6)
        of_rows = np.linalg.norm(d[0] - d[1], axis=1)
        size = np.sqrt((np.linalg.norm(d[1], axis=1) ** 2).mean())
        assert row["worst_point"] == pytest.approx(of_rows.max() / size, abs=1e-5)
        relit = [x.astype(np.float64) @ lights["low sun"] for x in d]
        wanted = np.linalg.norm(relit[0] - relit[1]) / np.linalg.norm(relit[1])
        assert row["relit"]["low sun"]["l2"] == pytest.approx(wanted, abs=1e-5)
        assert row["relit_l2"] >= row["relit"]["low sun"]["l2"]
        assert row["relit_p95"] <= row["relit_max"]


def test_entries_are_those_traced(measured):
    scene, cube_map, _, rows, results, _ = measured
    above = unpack(horizon_bits(scene, cube_map, slice(0, len(scene.points))), 384)
    for row in rows:
        mine = scene.points.object_index == ["ball", "plane"].index(row["object"])
        traced = unpack(results[row["label"]].traced, 384)
        assert row["entries_percent"] == pytest.approx(100 * traced[mine].mean())
        share = traced[mine].sum() / above[mine].sum()
        assert row["hemisphere_percent"] == pytest.approx(100 * share)
        assert row["rays"] == traced.sum()
    exhaustive = rows[0]
    assert exhaustive["hemisphere_percent"] == 100
    assert exhaustive["matrix_l2"] == exhaustive["worst_point"] == exhaustive["relit_l2"] == 0
    assert exhaustive["time_ratio"] == 1


def test_the_interval_is_by_rays_of_its_own(measured):
    _, _, _, rows, results, _ = measured
    for row in rows[2:]:
        assert row["interval_low"] <= row["certificate_l2"] <= row["interval_high"]
        assert 0.3 * row["matrix_l2"] < row["interval_high"] < 3 * row["matrix_l2"] + 0.02
        assert row["certificate_rays"] > 0
    # It puts right rows that it finds wrong, but not in what is measured.
    assert (results["huang (features 30)"].bits != results["exhaustive"].bits).any()


def test_matrix_errors_of_nothing_wrong_are_zero(measured):
    scene, cube_map, _, _, results, _ = measured
    bits = results["exhaustive"].bits
    errors, sizes = matrix_errors(scene, cube_map, bits, bits)
    assert not errors.any()
    assert (sizes[scene.points.object_index == 1] > 0).all()


def test_the_report_is_whole_in_one_page(measured, tmp_path):
    pytest.importorskip("matplotlib")
    from prt_core.evaluate.bench.sampling_report import sampling_report
    from prt_core.evaluate.report import write_report

    scene, cube_map, caster, rows, results, lights = measured
    report = sampling_report(scene, cube_map, caster, rows, results, lights)
    page = write_report(tmp_path / "new", report)
    assert json.loads((page.parent / "rows.json").read_text()) == rows
    with (page.parent / "rows.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    assert float(table[3]["matrix_l2"]) == rows[3]["matrix_l2"]
    assert float(table[3]["relit.low sun.p95"]) == rows[3]["relit"]["low sun"]["p95"]
    text = page.read_text()
    # The plot; 3 relit, 2 differences, 3 of entries, 2 of the exploration.
    assert text.count("data:image/png;base64,") == 11
    assert 'src="http' not in text and "href" not in text
    for row in rows:
        assert f"<td class=text>{row['label']}</td>" in text
    assert (page.parent / "error.png").read_bytes().startswith(b"\x89PNG")
    relit = dict(report.pictures[0][1])
    assert np.ptp(relit["every entry traced"]) > 100
    away = dict(report.pictures[1][1])["huang (features 30)"]
    assert 0 < np.count_nonzero(away) < away.size


def test_methods_by_text():
    assert parse_method("huang") == Method("huang", {})
    result = parse_method("huang:features=200,radius=0.1,reconstruction=least_squares")
    assert result.settings == {"features": 200, "radius": 0.1, "reconstruction": "least_squares"}
    assert result.label == "huang (features 200, radius 0.1, reconstruction least_squares)"
    assert result.made_settings(7).seed == 7
    assert parse_method("huang:seed=3").made_settings(7).seed == 3
    for text, message in (
        ("huang:features", "key=value"),
        ("huang:wrong=1", "has the settings"),
        ("huang:features=0", "features"),
        ("magic", "no sampler 'magic'"),
        ("exhaustive:seed=1", "no settings"),
    ):
        with pytest.raises(PRTError, match=message) as caught:
            parse_method(text).made_settings(0)
        assert "\n" not in str(caught.value)


def test_other_ways_of_a_sampler_are_curves_of_their_own():
    def row(method, **settings):
        return {"method": method, "settings": {**settings}}

    usual = asdict(HuangSettings())
    rows = [row("huang", **usual), row("huang", **{**usual, "features": 7}),
            row("huang", **{**usual, "columns": "wang"}), row("exhaustive")]  # fmt: skip
    assert [_curve(r) for r in rows] == ["huang", "huang", "huang wang", "exhaustive"]
