"""`prt bench lightfield` on a field of a few points."""

import csv
import json

import numpy as np
import pytest

from prt_core import run
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_load import load_light_field
from prt_core.cli import main
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.lightfield.surface_light_field import SurfaceLightField
from prt_core.scene import Scene
from tests.meshes import sphere

ANGLES, PEAK = (9, 7), 5.0


class Shiny:
    """A camera of one light whose highlight lies elsewhere at each point."""

    name, lights, most_points = "shiny", (), 1 << 20

    def shoot(self, points, angles, samples, seed):
        local = HRDFLayout(*angles).directions.reshape(*angles, 3)
        ways = np.einsum("ijk,nkx->nijx", local, points.frames)
        lobe = np.maximum(ways @ np.array([0.6, 0.0, 0.8]), 0) ** 20
        values = (0.2 + 4 * lobe)[..., None] * [1.0, 0.6, 0.3]
        return values[None].astype(np.float32), np.zeros(len(points), np.float32), 0.0


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("bench") / "ball.slf"
    scene = Scene.from_meshes([sphere(5, 0.5, (0.1, 0, 0.2))], 0)
    settings = LightFieldSettings(ANGLES, samples=1)
    run(capture_light_field(scene, Shiny(), path, settings))
    return path


def test_methods_are_measured_and_reported(path, tmp_path, capfd):
    line = ["bench", "lightfield", str(path), "-o", str(tmp_path / "r"), "--peak", f"{PEAK}",
            "--methods", "haar", "ceob:n_pairs=2", "--coefficients", "3", "11",
            "--psnr", "30", "190", "--json"]  # fmt: skip
    assert main(line) == 0
    rows = json.loads(capfd.readouterr().out)
    assert [row["goal"] for row in rows[:4]] == ["3 coefficients", "11 coefficients", "30 dB",
                                                 "190 dB"]  # fmt: skip
    assert len(rows) == 8 and {row["label"] for row in rows} == {"haar", "ceob:n_pairs=2"}
    for few, many, reached, beyond in (rows[:4], rows[4:]):
        assert few["luma_psnr"] < many["luma_psnr"] and few["coded_bytes"] < many["coded_bytes"]
        assert 30 <= reached["psnr"] < 32
        assert beyond["psnr"] is None and "dB" in beyond["failure"]
    # The figures are those of the field itself.
    field = load_light_field(path)
    model = SurfaceLightField("haar", n_coefficients=11, peak=PEAK).fit(
        field.radiance, field.frames
    )
    error, row = model.error(field.radiance[0]), rows[1]
    assert row["psnr"] == pytest.approx(error.psnr) and row["peak"] == PEAK
    assert row["psnr_per_sample"] == pytest.approx(error.psnr + 10 * np.log10(63))
    assert row["raw_bytes"] == 12 * 63 * len(field)
    assert row["coded_percent"] == pytest.approx(100 * model.coded_nbytes / row["raw_bytes"])
    assert row["fixed_bytes"] == model.nbytes
    assert row["decoded_ms"] > 0 and row["coefficients_ms"] > 0 and row["seconds"] > 0
    names = {"rows.json", "rows.csv", "report.html", "coefficients.png", "sizes.png"}
    assert {file.name for file in (tmp_path / "r").iterdir()} == names
    with open(tmp_path / "r" / "rows.csv", newline="") as file:
        assert [each["goal"] for each in csv.DictReader(file)] == [r["goal"] for r in rows]
    page = (tmp_path / "r" / "report.html").read_text()
    assert "ball" in page and "ceob:n_pairs=2" in page


def test_compress_counts_decibels_from_the_same_peak(path, tmp_path, capfd):
    bench = ["bench", "lightfield", str(path), "-o", str(tmp_path / "r"), "--methods", "haar"]
    assert main([*bench, "--coefficients", "11", "--psnr", "30", "--peak", "7", "--json"]) == 0
    rows = json.loads(capfd.readouterr().out)

    def compress(*words):
        line = ["lightfield", "compress", str(path), "--method", "haar", *words, "--json"]
        assert main(line) == 0
        return json.loads(capfd.readouterr().out)

    for row, words in zip(rows, (["--coefficients", "11"], ["--psnr", "30"]), strict=True):
        form = compress(*words, "--peak", "7")
        assert form["psnr"] == pytest.approx(row["psnr"]) and form["peak"] == row["peak"] == 7
        assert form["coded_nbytes"] == row["coded_bytes"] and form["settings"]["peak"] == 7
    # The largest of the field is some 4: decibels below a higher peak leave a larger error.
    assert compress("--psnr", "30")["error"] < 0.8 * form["error"]
    # An error as a share of white is what it is, from wherever decibels are counted.
    plain, counted = compress(), compress("--peak", "7")
    assert plain["coded_nbytes"] == counted["coded_nbytes"] and plain["peak"] == plain["white"]
    apart = 20 * np.log10(7 / plain["white"])
    assert counted["psnr"] - plain["psnr"] == pytest.approx(apart, abs=1e-6)
    assert main(["lightfield", "compress", str(path), "--peak", "0"]) == 2
    assert main(["lightfield", "compress", str(path), "--method", "none", "--peak", "3"]) == 2
    errors = capfd.readouterr().err.splitlines()
    assert len(errors) == 2 and "peak: expected" in errors[0] and "it takes no PSNR" in errors[1]
    assert main(["lightfield", "compress", str(path), "--method", "none"]) == 0


def test_the_table_has_a_line_a_row(path, tmp_path, capfd):
    line = ["bench", "lightfield", str(path), "-o", str(tmp_path / "r"), "--methods", "dct",
            "--coefficients", "3", "--psnr", "190"]  # fmt: skip
    assert main(line) == 0
    head, measured, failed, page, *_ = capfd.readouterr().out.splitlines()
    assert "coded %" in head and "3 coefficients" in measured and "out: " in failed
    assert "report.html: written" in page


@pytest.mark.parametrize(
    "words, said",
    {
        "--methods best": "method: expected one of ceob",
        "--methods ceob:size=3": "'ceob' has the settings",
        "--coefficients 0": "n_coefficients: expected",
        "--psnr nan": "psnr: expected",
        "--coefficients --psnr": "expected at least one number of coefficients or PSNR",
        "--clusters 0": "--clusters: expected a whole number >= 1",
        "--peak 0": "--peak: expected",
    }.items(),
)
def test_a_bad_line_is_one_line_before_the_work(words, said, path, tmp_path, capfd):
    code = main(["bench", "lightfield", str(path), "-o", str(tmp_path / "r"), *words.split()])
    errors = capfd.readouterr().err.splitlines()
    assert code == 2 and len(errors) == 1 and said in errors[0], errors
    assert not (tmp_path / "r").exists()
