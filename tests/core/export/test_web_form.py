"""What a page holds: codes that stand for the form, points along a curve, lights."""

import base64
import json
import tomllib
import zlib
from pathlib import Path

import numpy as np
import pytest

import prt_core
from prt_core.bake import BakeSettings, bake_steps, load
from prt_core.basis import haar_areas
from prt_core.cli import main
from prt_core.errors import PRTError
from prt_core.export.web import files
from prt_core.export.web.curve import hilbert_index
from prt_core.export.web.form import coded_form, form_steps
from prt_core.export.web.pack import Pack, shared_exponent
from prt_core.export.web.sources import from_rgbe, page_images, rgbe, shrunk
from prt_core.export.web.squeeze import short_names, squeezed
from prt_core.export.web.surface import surface_of
from prt_core.light import EnvironmentMap
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from tests.meshes import plane, sphere

RNG = np.random.default_rng(7)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    meshes = [plane(9, name="floor", albedo=0.6), sphere(7, 0.4, (0, 0, 0.5), name="ball")]
    path = tmp_path_factory.mktemp("web") / "a.prt"
    run(bake_steps(Scene.from_meshes(meshes), path, BakeSettings(resolution=8, tolerance=0.05)))
    return load(path)


def test_neighbours_along_the_curve_are_neighbours_in_space():
    cells = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    order = np.argsort(hilbert_index(cells.astype(float)))
    assert (np.abs(np.diff(cells[order], axis=0)).sum(axis=1) == 1).all()


def test_arrays_come_back_as_they_were_packed():
    pack = Pack({"title": "</script>"})
    array = RNG.integers(0, 60000, (5, 3)).astype(np.uint16)
    pack.add("codes", array, differences=True)
    text = pack.script()
    assert "</script" not in text
    entry = json.loads(text[len("window.PRT_DATA=") : -2])["arrays"]["codes"]
    data = np.frombuffer(zlib.decompress(base64.b64decode(entry["data"])), np.uint8)
    steps = np.ascontiguousarray(data.reshape(2, -1).T).view(np.uint16).reshape(5, 3)
    assert (np.cumsum(steps, axis=0, dtype=np.uint16) == array).all()


def test_shared_exponents_are_near():
    colours = np.exp(RNG.normal(0, 3, (200, 3)))
    codes, factor = shared_exponent(colours)
    step = 2.0 ** ((codes >> 27).astype(float) - 24)
    back = np.stack([codes & 511, codes >> 9 & 511, codes >> 18 & 511], axis=1) * step[:, None]
    assert (np.abs(back / factor - colours).max(axis=1) <= colours.max(axis=1) / 500).all()
    assert shared_exponent(np.zeros((2, 3)))[0].tolist() == [0, 0]


def test_a_shrunk_image_keeps_its_power():
    pixels = np.ones((40, 80, 3), np.float32)
    pixels[7, 11] = 900
    small = shrunk(EnvironmentMap(pixels), 12).pixels

    def power(values):
        z = np.sin(np.pi / 2 - np.arange(len(values) + 1) / len(values) * np.pi)
        return (values.mean(axis=1) * (z[:-1] - z[1:])[:, None]).sum()

    assert small.shape == (12, 24, 3) and np.isclose(power(small), power(pixels), rtol=5e-3)
    assert np.array_equal(from_rgbe(rgbe(small)), small)


def test_the_page_has_lights_of_its_own():
    images = page_images()
    assert len(images) >= 3 and all(image.pixels.max() > 0 for image in images.values())


def test_codes_stand_for_the_form(bake):
    model, form = run(form_steps(bake))
    assert "made for the page" in form
    coded = coded_form(model)
    light = RNG.random((bake.transport.n_directions, 3)).astype(np.float32)
    exact, near = model.product(light), coded.model.product(light)
    assert 0 < np.linalg.norm(near - exact) < 0.01 * np.linalg.norm(exact)
    first = coded.rows[0] * coded.steps[0][_kinds(coded)]
    assert np.allclose(first, coded.model.affine_[0].mean, atol=1e-7)


def _kinds(coded):
    """Which of a row's steps each feature has: that of its level, or the last."""
    code = coded.model.code_
    level, _ = haar_areas(code.resolution)
    return np.concatenate([level, np.full(code.n_features - len(level), level.max() + 1)])


def test_a_bake_lends_its_own_form(bake):
    prt_core.compress(bake.path, method="cpca", tolerance=0.5)
    _, form = run(form_steps(load(bake.path)))
    assert form == "the bake's own cpca"


def test_triangles_are_those_of_the_scene_and_show_hidden_points(bake):
    scene = bake.scene
    scene_of_two = Scene.from_meshes([plane(2, name="large")])
    assert scene_of_two.triangle_level.max() > 1
    for built in (scene, scene_of_two):
        surface = surface_of(built)
        positions = built.points.positions[surface.points]
        corners = positions[surface.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1).sum() / 2
        a, b, c = np.moveaxis(built.vertices[built.triangles], 1, 0)
        assert np.isclose(area, np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
        assert sorted(surface.points) == sorted(set(built.lattice))
    front = positions[surface.triangles]
    assert (np.cross(front[:, 1] - front[:, 0], front[:, 2] - front[:, 0])[:, 2] > 0).all()


def test_scripts_are_squeezed_but_strings_are_not():
    script = '// why\nconst a = "b + c", d = 1 - -2;\n  return e\n  `f = ${g}`;\n'
    assert squeezed(script) == 'let a="b + c",d=1 - -2;return e\n`f = ${g}`;'
    assert squeezed("x = y.split(/a +b/);\n") == "x=y.split(/a +b/);"
    assert squeezed("if (a) {\n  b();\n}\nelse c();\n") == "if(a){b()}else c();"
    shader = "`void main() {\n  a = 0.5;\n}`;\n"
    assert squeezed(shader) == "`void main(){a=.5;}`;"
    two = "const a = [1, 2];\nlet {b} = a;\nfor (let c = 0; c < 1.50; c++) b();\n"
    assert squeezed(two) == "let a=[1,2],{b}=a;for(let c=0;c<1.5;c++)b();"


def test_names_of_all_scripts_are_short_but_not_those_of_properties():
    first = "function longName(x) { return x; }\nconst longValue = 1, word = 2;\n"
    second = (
        "const tall = {tall: 1};\nclass Shape {}\nconst text = `${word}`;\nlongName(new Shape());"
    )
    names = short_names([first, second])
    assert set(names) == {"longName", "longValue", "Shape", "text"}
    assert squeezed(second, names).endswith(f"{names['longName']}(new {names['Shape']}());")


def test_what_is_wrong_is_said_before_the_work(bake, tmp_path):
    for what, settings in (
        ("no such setting", {"bit": True}),
        ("bits", {"bits": "yes"}),
        ("there is no such image", {"lights": ["missing.exr"]}),
        ("is one file", {"one_file": False}),
    ):
        with pytest.raises(PRTError, match=what):
            prt_core.export_web(bake, tmp_path / "page.html", **settings)
    assert not list(tmp_path.iterdir())
    (tmp_path / "style.css").write_text("my own style")
    with pytest.raises(PRTError, match="has a style.css already, which is of no page of prt"):
        prt_core.export_web(bake, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["style.css"]
    (tmp_path / "index.html").write_text("my own page")
    with pytest.raises(PRTError, match="another's page"):
        prt_core.export_web(bake, tmp_path)
    assert (tmp_path / "index.html").read_text() == "my own page"
    # Nor into a bake, which the next --restart would replace with the page in it.
    for one_file in (None, True):
        prt_core.BakeStore(tmp_path / "other.prt", "a").update()
        with pytest.raises(PRTError, match="is a bake or a light field.*name another folder"):
            prt_core.export_web(bake, tmp_path / "other.prt", one_file=one_file)
        assert [path.name for path in (tmp_path / "other.prt").iterdir()] == ["zarr.json"]


def test_the_package_carries_the_page():
    folder = Path(files.__file__).parent
    settings = tomllib.loads((Path(prt_core.__path__[0]).parent / "pyproject.toml").read_text())
    patterns = settings["tool"]["setuptools"]["package-data"]["prt_core.export.web"]
    packed = {path for pattern in patterns for path in folder.glob(pattern)}
    assert packed == set((folder / "page").iterdir())
    assert {path.name for path in packed if path.suffix == ".js"} == set(
        sum(files.SCRIPTS.values(), ())
    )
    texts = files.page_files({files.DATA: ""}, "", False)
    assert set(texts) == {"data.js", "page.js", "style.css", "index.html"}
    assert len(texts["page.js"].encode()) <= 40000


def test_the_command_is_the_call(bake, tmp_path, capfd):
    line = ["export", "web", str(bake.path), "-o", str(tmp_path / "page.html"), "--no-bits"]
    assert main(line) == 0
    text = capfd.readouterr().out
    assert "suns are soft" in text and "in the mean" in text and "of 12 turned lights" in text
    same = prt_core.export_web(bake, tmp_path / "same", bits=False, one_file=True)
    page = (tmp_path / "page.html").read_bytes()
    assert page == (tmp_path / "same" / "index.html").read_bytes() and same["bytes"] == len(page)
    assert main([*line, "--title", "A & B", "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["output"] == str(tmp_path / "page.html")
    assert "<title>A &amp; B</title>" in (tmp_path / "page.html").read_text()
    assert main(["export", "web", "missing.prt", "-o", str(tmp_path / "no")]) == 2
    assert not (tmp_path / "no").exists()
