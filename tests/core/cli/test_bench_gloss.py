"""`prt bench gloss` on a bake of a few points."""

import csv
import json

import numpy as np
import pytest

from prt_core import BakeSettings, Scene, bake_steps, run
from prt_core.cli import main
from prt_core.evaluate.bench.gloss import METHODS, family_of, nearer_and_quicker
from prt_core.evaluate.bench.term_sampling import term_sampling_steps
from prt_core.light import write_image
from prt_core.reflectance import Lambert, in_out_factors
from prt_core.sampling import HuangSettings
from prt_core.sphere import CubeMap
from prt_core.transport import View
from tests.meshes import caster_of, plane, sphere


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6)), plane(9)])


@pytest.fixture(scope="module")
def words(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("gloss")
    run(bake_steps(scene, folder / "ball.prt", BakeSettings(resolution=8, bounces=0)))
    rows, columns = np.mgrid[0:16, 0:32]
    image = 0.2 + (rows < 8)[..., None] * np.array([0.5, 0.8, 1.0]) + (columns > 20)[..., None]
    write_image(folder / "sky.exr", image.astype(np.float32))
    return ["bench", "gloss", str(folder / "ball.prt"), "--light", str(folder / "sky.exr"),
            "--rotate", "0", "90", "--sample", "40", "--view", "2,-3,2"]  # fmt: skip


def test_forms_are_measured_beside_the_dense_sum(words, tmp_path, capfd):
    line = [*words, "-o", str(tmp_path / "r"), "--methods", "dense", "default", "maps", "samples",
            "--roughness", "0.5", "--phong", "10", "--json"]  # fmt: skip
    assert main(line) == 0
    rows = json.loads(capfd.readouterr().out)
    names = ["GGX 0.5", "Phong 10"]
    assert [row["reflectance"] for row in rows] == [n for n in names for _ in range(7)]
    for name in names:
        by_form = {row["form"]: row for row in rows if row["reflectance"] == name}
        dense, default = by_form["dense sum"], by_form["field of incoming light (default)"]
        assert dense["l2_worst"] == 0 and 0 < default["l2_mean"] < 0.04
        mapped = by_form["field of incoming light, mapped (default)"]
        assert 0 < mapped["l2_mean"] < 0.04 and mapped["bytes"] > default["bytes"]
        assert default["l2_mean"] < by_form["lobe samples, 64, 16 texels apart"]["l2_mean"]
        assert default["l2_mean"] < by_form["reflection map"]["l2_mean"]
        assert default["megabytes"] == default["bytes"] / 1e6
        assert default["view_us"] == 1e3 * default["view_ms"] / default["facing"]
        assert dense["points"] == dense["facing"] == 40 < default["points"]
    files = {file.name for file in (tmp_path / "r").iterdir()}
    assert files == {"rows.json", "rows.csv", "report.html", "speed_error.png"}
    with open(tmp_path / "r" / "rows.csv", newline="") as file:
        assert [row["form"] for row in csv.DictReader(file)] == [row["form"] for row in rows]
    page = (tmp_path / "r" / "report.html").read_text()
    assert "Direct light of the sky alone" in page and "nearer than the default: " in page


def test_terms_say_where_lobes_are_too_narrow(words, tmp_path, capfd):
    line = [*words, "-o", str(tmp_path / "r"), "--methods", "terms", "--roughness", "0.3",
            "--phong"]  # fmt: skip
    assert main(line) == 0
    head, *lines = capfd.readouterr().out.splitlines()
    assert "view us" in head and sum("in-out terms" in line for line in lines) == 4
    assert sum("clustered" in line for line in lines) == 1
    assert any("note" in line and "below 0.45" in line for line in lines)


@pytest.mark.parametrize(
    "bad, said",
    {
        "--methods best": "methods: expected some of dense, default, terms",
        "--roughness 0": "roughness: expected",
        "--roughness 2": "roughness: expected",
        "--phong -1": "phong: expected",
        "--roughness --phong": "give at least one of them",
        "--sample 0": "--sample: expected a whole number >= 1",
        "--view here": "--view: the baked scene has none called 'here'",
        "--view camera": "--view camera: the baked scene has no camera",
    }.items(),
)
def test_a_bad_line_is_one_line(bad, said, words, tmp_path, capfd):
    assert main([*words, "-o", str(tmp_path / "r"), *bad.split()]) == 2
    errors = capfd.readouterr().err.splitlines()
    assert len(errors) == 1 and said in errors[0], errors
    assert not (tmp_path / "r").exists()


def test_forms_of_one_family_share_a_line():
    assert family_of("in-out terms, 4, clustered, 16 texels apart") == (
        "in-out terms, clustered, bright texels apart"
    )
    assert family_of("harmonics, 25 x 25 matrices, 0 texels apart") == "harmonics, whole matrices"
    assert set(METHODS) == {"dense", "default", "terms", "maps", "harmonics", "triple", "samples"}
    default = {"form": "field of incoming light (default)", "view_us": 5.0, "l2_mean": 0.02}
    other = {"form": "other", "view_us": 4.0, "l2_mean": 0.01}
    slow = {"form": "slow", "view_us": 9.0, "l2_mean": 0.01}
    rows = [{**row, "reflectance": "a"} for row in (default, other, slow)]
    assert nearer_and_quicker(rows) == [(rows[1], rows[0])]
    mapped = {"form": "field of incoming light, mapped (default)", "view_us": 1.0, "l2_mean": 0.02}
    rows += [{**mapped, "reflectance": "a"}]
    # The default's own is beaten, but quicker than it nothing is nearer.
    assert nearer_and_quicker(rows) == [(rows[1], rows[0])]
    rows[-1]["l2_mean"] = 0.019
    assert nearer_and_quicker(rows) == []


def test_terms_are_sampled_one_by_one_and_together(scene):
    outgoing = View(position=(2, -3, 2)).outgoing(scene.to_world(scene.points.positions))
    cube_map = CubeMap(8)
    lights = {"even": np.ones((cube_map.n_directions, 3))}
    factors = in_out_factors(Lambert(0.5), 2)
    steps = term_sampling_steps(
        scene, cube_map, caster_of(scene), factors, lights, outgoing, HuangSettings(features=30)
    )
    rows, together, errors = run(steps)
    assert [(row["term"], row["object"]) for row in rows] == [
        (k, item.name) for k in (0, 1) for item in scene.objects
    ]
    for row in rows:
        assert row["dense"] + row["sparse"] == pytest.approx(row["entries"])
        assert row["dense"] == pytest.approx(row["dense_points"] * row["dense_angular"] / 100)
        assert 5 < row["entries"] < 50 and row["seconds"] > 0 and row["whole_seconds"] > 0
    assert 0 < together["entries"] < 50
    assert max(errors["even"]) < 0.05
