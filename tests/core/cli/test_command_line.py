"""Bad command lines: one line, an exit code, nothing written; and what is said at the end."""

import json
import os
import resource
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from prt_core import BakeSettings, BakeStore, Lamp, Scene, bake_steps, export_glb, load, run
from prt_core.bake.measure import standing_lights
from prt_core.cli import main
from prt_core.light import read_image, write_image
from prt_core.scene import Camera, with_camera_image
from tests.meshes import caster_of, plane, sphere

ROOT = Path(__file__).resolve().parents[3]

LAMP = Lamp("point", (1, 2, 3), (0, 0, 4), name="bulb")
CAMERA = Camera(np.eye(4), 0.5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Bakes with and without lamps and an image, lights, and things in the way."""
    folder = tmp_path_factory.mktemp("lines")
    scene = Scene.from_meshes([sphere(4, 0.5, (0, 0, 0.6), name="ball"), plane(3)], max_hidden=0)
    settings = BakeSettings(resolution=2, tolerance=0.1)
    world = np.ones((24, 3), np.float32)
    run(bake_steps(scene, folder / "a.prt", settings, [LAMP], world, CAMERA))
    run(bake_steps(scene, folder / "bare.prt", settings))
    above = np.eye(4)
    above[2, 3] = 3.0
    camera = Camera(above, 0.5)
    seen = with_camera_image(scene, caster_of(scene), camera, 3, 2, 1)
    run(bake_steps(seen, folder / "image.prt", settings))
    write_image(folder / "sky.exr", standing_lights()["low soft sun"].pixels)
    write_image(folder / "wide.exr", np.ones((3, 5, 3), np.float32))
    write_image(folder / "hot.exr", np.full((2, 4, 3), 3e38, np.float32))
    (folder / "file").write_text("in the way")
    (folder / "open.blend").write_bytes(b"no blend")
    (folder / "taken.npz").mkdir()
    (folder / "taken.png").mkdir()
    return folder


@pytest.fixture(autouse=True)
def inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def prt(line, capfd):
    """(exit code, what was printed, lines of errors) of a command line."""
    capfd.readouterr()
    try:
        code = main(line.split() if isinstance(line, str) else line)
    except SystemExit as end:
        code = end.code
    out, err = capfd.readouterr()
    return code, out, err.splitlines()


def contents(folder):
    """Every path and what it is, of a folder."""
    return {path: path.is_dir() or path.read_bytes() for path in folder.rglob("*")}


RELIGHT = "relight a.prt --light sky.exr --output o.npz"
GLB = "export glb a.prt --light sky.exr -o o.glb"
LONG = "n" * 300
# Each with a part of what is said.
BAD = {
    # numbers
    f"{RELIGHT} --exposure nan": "--exposure: expected a number from -64 to 64, got nan",
    f"{RELIGHT} --exposure 200": "--exposure: expected",
    f"{RELIGHT} --exposure one": "invalid float value",
    f"{RELIGHT} --strength 1e39": "--strength: expected a number from 0 to 1e+15",
    f"{RELIGHT} --strength -1": "--strength: expected",
    f"{RELIGHT} --strength nan": "--strength: expected",
    f"{RELIGHT} --strength 1e15": "times the brightest of sky.exr",
    f"{RELIGHT} --rotate inf": "--rotate: expected a number, got inf",
    f"{RELIGHT} --bounces -1": "expected auto or a number",
    f"{RELIGHT} --bounces 1.5": "expected auto or a number",
    "relight a.prt --lamps --lamp-samples 0 --output o.npz": "--lamp-samples: expected a whole",
    "relight a.prt --lamps --lamp-samples -3 --output o.npz": "--lamp-samples: expected a whole",
    "relight a.prt --lamps --lamp-samples 99999999 --output o.npz": "--lamp-samples: expected",
    f"{RELIGHT} --turn 0": "expected 1 to 99,999 frames",
    f"{RELIGHT} --turn 100000": "expected 1 to 99,999 frames",
    f"{RELIGHT} --turn ²": "expected 1 to 99,999 frames",
    f"{RELIGHT} --png p.png --size 0x5": "expected WIDTHxHEIGHT",
    f"{RELIGHT} --png p.png --size 5": "expected WIDTHxHEIGHT",
    f"{RELIGHT} --png p.png --size 90000x90000": "GB of memory, there are",
    "compress a.prt --tolerance nan": "tolerance: expected a number above 0 and below 1, got nan",
    "compress a.prt --tolerance 1": "tolerance: expected",
    "compress a.prt --megabytes 0": "megabytes: expected a number above 0",
    "compress a.prt --megabytes inf": "megabytes: expected",
    "compress a.prt --milliseconds -1": "milliseconds: expected",
    "compress a.prt --seed -1": "seed: expected a whole number from 0 to 4294967295, got -1",
    "compress a.prt --seed 99999999999": "seed: expected",
    "bake open.blend --resolution 0": "resolution: expected a whole number from 1 to 1024, got 0",
    "bake open.blend --resolution -1": "resolution: expected",
    "bake open.blend --resolution 4000": "resolution: expected",
    "bake open.blend --seed -1": "seed: expected",
    "bake open.blend --tolerance nan": "tolerance: expected",
    "bake open.blend --tolerance 0": "tolerance: expected",
    "bake open.blend --method guess": "method: expected one of auto, exhaustive",
    "bake open.blend --caster magic": "invalid choice",
    "bake open.blend --camera-pixels 9x9 --pixel-samples 0": "pixel samples: expected a whole",
    "bake open.blend --camera-pixels 9x9 --pixel-samples 99": "pixel samples: expected",
    "bake open.blend --camera-pixels 9000x9": "camera pixels: expected a whole number from 1 to",
    "bake open.blend --camera-pixels 8192x8192 --pixel-samples 8": "GB of memory, there are",
    "bake open.blend --geometry-image ball 0": "geometry image: size: expected a whole number",
    "bake open.blend --geometry-image ball many": "--geometry-image: expected OBJECT N",
    "bake open.blend --geometry-image ball 9999999": "geometry image: size: expected",
    "bench compress a.prt -o r --budgets -1": "budgets: expected whole numbers >= 0",
    "bench compress a.prt -o r --rotate nan": "--rotate: expected a number, got nan",
    "bench compress a.prt -o r --seed -1": "seed: expected",
    "bench compress a.prt -o r --methods best": "method: expected one of cpca",
    "bench compress a.prt -o r --methods pca:size=3": "'pca' has the settings n_components, tol",
    "relight a.prt --emission A=1 A=2 --output o.npz": "--emission: 'A' is there twice",
    "compress a.prt --method best": "method: expected auto, cpca, pca, vq, haar, wavelet4d, harm",
    "compress a.prt --method pca:size=3": "'pca' has the settings n_components, tolerance; got",
    "compress a.prt --method cpca:method=quick": "method: expected one of static, iterative, got",
    "compress a.prt --method cpca:n_clusters": "expected NAME:key=value,key=value, got",
    "compress a.prt --method auto:seed=3": "method: expected auto, cpca",
    "bench sampling open.blend -o r --resolution 0": "resolution: expected",
    "bench rays open.blend --points 0": "--points: expected a whole number >= 1, got 0",
    "bench rays open.blend --resolution 0": "resolution: expected",
    "bench sampling open.blend -o r --methods huang:features=0": "features: expected",
    # files
    "relight none.prt --light sky.exr --output o.npz": "none.prt: there is no such bake",
    "relight file --light sky.exr --output o.npz": "is a file, expected a folder",
    f"relight {LONG}.prt --light sky.exr --output o.npz": "too long",
    "relight a.prt --light none.exr --output o.npz": "none.exr: there is no such image",
    "relight a.prt --light wide.exr --output o.npz": "twice as wide as high, got 5 x 3",
    "relight a.prt --light hot.exr --output o.npz": "hot.exr: radiance expected at most 1e+15",
    "relight a.prt --light file --output o.npz": "expected an .exr or .hdr image",
    f"relight a.prt --light {LONG}.exr --output o.npz": "too long",
    "relight a.prt --light sky.exr --output o.csv": "o.csv: expected a name that ends in .npz",
    "relight a.prt --light sky.exr --output taken.npz": "taken.npz: is a directory",
    "relight a.prt --light sky.exr --output no/o.npz": "there is no folder 'no'; make it first",
    "relight a.prt --light sky.exr --output file/o.npz": "file/o.npz: not a directory",
    f"relight a.prt --light sky.exr --output {LONG}.npz": "too long",
    "relight a.prt --light sky.exr --png o.jpg": "expected a name that ends in .png",
    "relight a.prt --light sky.exr --png taken.png": "taken.png: is a directory",
    "relight a.prt --light sky.exr --png no/o.png": "there is no folder 'no'",
    "relight a.prt --light sky.exr --png /proc/o.png": "/proc/o.png: ",
    "relight image.prt --light sky.exr --image o.jpg": "a name that ends in .png or .exr",
    "relight a.prt --light sky.exr --blend o.npz": "expected a name that ends in .blend",
    "relight a.prt --light sky.exr --blend no/o.blend": "there is no folder 'no'",
    "relight a.prt --light sky.exr --blend o.blend --scene no.blend": "no such .blend file",
    "relight a.prt --light sky.exr --blend o.blend --scene file": "file: expected a .blend file",
    "relight a.prt --light sky.exr --output no/o_#.npz --turn 3": "there is no folder 'no'",
    "bake none.blend": "none.blend: there is no such .blend file",
    "bake open.blend -o o.npz": "o.npz: expected a name that ends in .prt",
    "bake open.blend -o no/o.prt": "there is no folder 'no'; make it first",
    "bake open.blend -o file/o.prt": "file/o.prt: not a directory",
    f"bake open.blend -o {LONG}.prt": "too long",
    "bake open.blend -o /proc/o.prt": "/proc/o.prt: ",
    "bench compress a.prt -o file": "expected a folder, this is a file",
    "bench compress a.prt -o no/r": "there is no folder 'no'",
    "bench compress a.prt -o r --light none.exr": "none.exr: there is no such image",
    "bench compress none.prt -o r --light sky.exr": "there is no such bake",
    "bench sampling open.blend -o file/r": "file/r: not a directory",
    "compress none.prt": "there is no such bake",
    "compress none.prt --method none": "there is no such bake",
    "compress a.prt --light none.exr": "none.exr: there is no such image",
    "compress a.prt --light hot.exr": "hot.exr: radiance expected at most 1e+15",
    "info none.prt": "there is no such bake",
    # what contradicts, and what would change nothing
    "relight a.prt --light sky.exr": "relight: nothing to write",
    "relight a.prt --output o.npz": "relight: no light",
    f"{RELIGHT} --size 9x9": "--size: changes nothing without --png",
    f"{RELIGHT} --scene open.blend": "--scene: changes nothing without --blend",
    f"{RELIGHT} --attribute Lit": "--attribute: changes nothing without --blend",
    f"{RELIGHT} --domain point": "--domain: changes nothing without --blend",
    f"{RELIGHT} --lamp-samples 9": "--lamp-samples: changes nothing without --lamps or",
    f"{RELIGHT} --caster embree": "--caster: no ray is cast",
    "relight a.prt --lamps --rotate 3 --output o.npz": "--rotate: changes nothing without --light",
    "relight a.prt --lamps --sharp-sun --output o.npz": "--sharp-sun: changes nothing without",
    "relight a.prt --lamps --form exact --output o.npz": "--form: lamps are always exact",
    "relight a.prt --light world --rotate 3 --output o.npz": "--rotate: the world's light is fixed",
    "relight a.prt --light world --sharp-sun --output o.npz": "--sharp-sun: needs an environ",
    "relight bare.prt --light world --output o.npz": "the bake has none",
    "relight bare.prt --lamps --output o.npz": "the baked scene had no lamps",
    "relight a.prt --light sky.exr --image o.png": "--image: this bake holds none",
    "relight image.prt --light sky.exr --image o.png --png o.png": "named for two outputs",
    "relight a.prt --light sky.exr --image o.png --turn 2": "--image: this bake holds none",
    "compress a.prt --of image": "of: this bake holds no image; bake with --camera-pixels",
    "compress a.prt --of texels": "invalid choice",
    "compress a.prt --method none --of image": "--of: changes nothing with --method none",
    "compress a.prt --method block_pca": "'block_pca' takes the pixels of an image",
    "export glb a.prt -o o.glb": "export glb: no light; give --light IMAGE",
    "export glb a.prt --light sky.exr": "the following arguments are required: -o/--output",
    "export glb a.prt --light sky.exr -o o.gltf": "o.gltf: expected a name that ends in .glb",
    "export glb a.prt --light sky.exr -o file/o.glb": "file/o.glb: not a directory",
    "export glb a.prt --light none.exr -o o.glb": "none.exr: there is no such image",
    "export glb a.prt --lamps --rotate 3 -o o.glb": "--rotate: changes nothing without --light",
    "export glb a.prt --lamps --form exact -o o.glb": "--form: lamps are always exact",
    "export glb none.prt --light sky.exr -o o.glb": "none.prt: there is no such bake",
    f"{GLB} --albedo --light-only": "not allowed with argument",
    f"{GLB} --material multiplied --albedo": "would have it twice; take colours 'light'",
    f"{GLB} --material shiny": "invalid choice",
    f"{GLB} --white 0": "white: expected a number above 0",
    f"{GLB} --components 3": "--components: changes nothing without --weights",
    f"{GLB} --texels 1": "--texels: changes nothing without --weights",
    f"{GLB} --weights --components 40": "components: expected a whole number from 1 to 32",
    f"{GLB} --weights": "weights: there is no compressed form; make one with 'prt compress'",
    f"{GLB} --view camera --light-only": "view: light that is received has none",
    f"{GLB} --view 1,2,3": "this bake knows of no gloss",
    f"{RELIGHT} --frames 1-2": "--frames: changes nothing without --turn",
    f"{RELIGHT} --turn 3 --frames 2-4": "--frames: --turn 3 has frames 1 to 3, got 2-4",
    f"{RELIGHT} --turn 3 --frames 2-1": "expected A-B or A, frames from 1 on",
    f"{RELIGHT} --turn 3 --frames 0-1": "expected A-B or A, frames from 1 on",
    f"{RELIGHT} --turn 3 --frames 1 --progressive": "a frame adds to the one before",
    f"{RELIGHT} --progressive": "--progressive: changes nothing without --turn",
    f"{RELIGHT} --turn 2 --progressive --form exact": "adds to a compressed form",
    f"{RELIGHT} --turn 2 --blend o.blend": "--turn: turns an image's light",
    "relight a.prt --light world --turn 2 --output o.npz": "--turn: turns an image's light",
    "relight a.prt --light sky.exr --blend open.blend --scene open.blend": "its own copy",
    "relight a.prt --light sky.exr --output o.npz --form compressed": "there is no compressed",
    "bake open.blend --pixel-samples 3": "--pixel-samples: changes nothing without --camera-pixels",
    "bake open.blend --refine-vertices 3": "--refine-vertices: changes nothing without --refine",
    "bake open.blend --refine-tolerance 0.1": "--refine-tolerance: changes nothing without",
    "bake open.blend --refine --refine-vertices many": "refine vertices: expected a number as",
    "bake open.blend --refine --refine-vertices -3": "refine vertices: expected a number as",
    "bake open.blend --refine --refine-tolerance 2": "refine tolerance: expected",
    "bake open.blend --refine --atlas 64": "refine: the UV maps of a lightmap belong to",
    "bake open.blend --open": "--open: changes nothing without --finish",
    "bake open.blend --dask here": "dask: expected local:N, an address as tcp://HOST:8786",
    "bake open.blend --dask local:0": "dask: expected local:N",
    "bake-blocks a.prt --share 2/2": "--share: expected I/N with I from 0 to N - 1",
    "bake-blocks a.prt --share 0/2 --blocks 1": "--share: chooses blocks",
    "info http://here/a.prt": "bake: expected a path, or an address that begins with s3://",
    "info s3://bucket": "bake: expected s3://BUCKET/NAME",
    f"{RELIGHT} --png s3://bucket/o.png": "--png: expected a path on this machine",
    "info a.prt --refined where.jpg": "where.jpg: expected a name that ends in .png",
    "info a.prt --refined where.png": "refined: no edge of this bake's meshes was split",
    "bake open.blend --parametrisation uv": "--parametrisation: changes nothing without",
    "bake open.blend --camera-pixels 9x9 --geometry-image a 9": "a bake holds one",
    "compress a.prt --method none --tolerance 0.1": "it takes no tolerance",
    "compress a.prt --method none --light sky.exr": "it takes no tolerance",
    "compress a.prt --method none --seed 3": "--seed: changes nothing with --method none",
    "bench compress a.prt -o r --resolution 4": "--resolution: changes nothing for a bake",
    # commands
    "": "required",
    "bend": "invalid choice",
    "bake": "required: scene",
    "info": "required: bake",
    "bench": "required: WHAT",
    "relight a.prt --lihgt sky.exr --output o.npz": "unrecognized arguments",
}


@pytest.mark.parametrize("line", BAD)
def test_a_bad_line_is_one_line_and_writes_nothing(line, folder, capfd):
    before = contents(folder)
    code, out, errors = prt(line, capfd)
    assert code not in (0, None) and out == ""
    assert len(errors) == 1 and errors[0].startswith("prt: ") and BAD[line] in errors[0], errors
    assert contents(folder) == before


def test_an_empty_attribute_and_an_empty_path_are_refused(capfd):
    words = [*RELIGHT.split(), "--blend", "o.blend", "--attribute"]
    for name in ("", " "):
        code, _, errors = prt([*words, name], capfd)
        assert code == 2 and errors == ["prt: --attribute: expected a name, got an empty one"]
    for words in (["relight", "", "--light", "sky.exr", "--output", "o.npz"],
                  ["relight", "a.prt", "--light", "sky.exr", "--output", ""],
                  ["relight", "a.prt", "--light", "", "--output", "o.npz"],
                  ["info", ""], ["bake", "open.blend", "-o", ""]):  # fmt: skip
        code, _, errors = prt(words, capfd)
        assert code == 2 and len(errors) == 1 and "expected" in errors[0], (words, errors)


def test_a_budget_that_cannot_be_kept_leaves_what_was_there(folder, capfd):
    assert prt("compress a.prt --method harmonics --tolerance 0.5 --light sky.exr", capfd)[0] == 0
    before = contents(folder)
    budgets = {
        "--megabytes 1e-9": "MB, by",
        "--milliseconds 1e-9 --method vq": "ms, by vq",
        "--tolerance 0.1 --megabytes 1e-9 --method pca": "MB, by pca",
    }
    for line, what in budgets.items():
        code, out, errors = prt(f"compress a.prt {line} --light sky.exr", capfd)
        assert code == 2 and out == "" and len(errors) == 1
        assert "cannot be kept; the least is" in errors[0] and what in errors[0]
        assert "Nothing was stored" in errors[0]
    assert contents(folder) == before


def test_a_method_with_settings_of_its_own_is_made_and_named(folder, capfd):
    line = "compress bare.prt --method wavelet4d:rows=d4,columns=haar,mode=4d,error=0.1,bits=9"
    code, out, _ = prt(f"{line} --tolerance 0.5 --light sky.exr", capfd)
    assert code == 0 and "tried on a sample" not in out
    printed = prt("info bare.prt", capfd)[1]
    for word in ("wavelet4d", "rows d4", "columns haar", "mode 4d", "error 0.1", "bits 9"):
        assert word in printed
    assert "settings" in prt("info bare.prt --json", capfd)[1]
    assert prt("compress bare.prt --method none", capfd)[0] == 0


def test_an_image_is_compressed_stored_and_relit_as_one(folder, capfd):
    line = "compress image.prt --method wavelet4d:error=0.02,bits=12 --tolerance 0.1"
    code, out, _ = prt(f"{line} --light sky.exr", capfd)
    assert code == 0 and "of the image" in out
    printed = prt("info image.prt", capfd)[1]
    assert "of the image" in printed and "columns 9/7" in printed
    relight = "relight image.prt --light sky.exr --rotate 40 --image"
    for transport in ("compressed", "exact"):
        code, out, _ = prt(f"{relight} {transport}.exr --form {transport}", capfd)
        assert code == 0 and "3 x 2 pixels relit" in out and transport[:7] in out
    quick, exact = (read_image(folder / f"{t}.exr") for t in ("compressed", "exact"))
    assert quick.shape == exact.shape == (2, 3, 3) and exact.any()
    away = np.linalg.norm(quick - exact)
    assert 0 < away < 0.1 * np.linalg.norm(exact)
    code, out, _ = prt(f"{relight} turn_#.png --turn 2 --form compressed", capfd)
    assert code == 0 and "2 frames of 3 x 2 pixels relit compressed" in out and "ms" in out
    assert (folder / "turn_1.png").exists() and (folder / "turn_2.png").exists()
    # Of the points there is none: the exact way, or what is wrong in one line.
    code, out, _ = prt("relight image.prt --light sky.exr --output o.npz --image o.png", capfd)
    assert code == 0 and "points relit exactly" in out
    refused = "relight image.prt --light sky.exr --output o.npz --form compressed"
    code, _, errors = prt(refused, capfd)
    assert code == 2 and len(errors) == 1 and "it is of the image, not of the points" in errors[0]
    line = "compress image.prt --of points --method pca --tolerance 0.3 --light sky.exr"
    code, out, _ = prt(line, capfd)
    assert code == 0 and "of the image" not in out
    for name in ("compressed.exr", "exact.exr", "turn_1.png", "turn_2.png", "o.npz", "o.png"):
        (folder / name).unlink()
    code, _, errors = prt("compress image.prt --method irradiance", capfd)
    assert code == 2 and "'irradiance' takes points" in errors[-1] and "--of points" in errors[-1]
    assert prt("compress image.prt --method none", capfd)[0] == 0


def test_a_turning_light_is_relit_progressively(folder, capfd):
    relight = "relight a.prt --light sky.exr --output p_#.npz --turn 3 --progressive"
    assert prt("compress a.prt --method none", capfd)[0] == 0
    assert "there is no compressed form" in prt(relight, capfd)[2][-1]
    assert prt("compress a.prt --method pca --tolerance 0.5 --light sky.exr", capfd)[0] == 0
    code, _, errors = prt(relight, capfd)
    assert code == 2 and "progressive: adds to a compressed form by haar, this" in errors[0]
    haar = "compress a.prt --method haar:n_terms=3,step=0.001 --tolerance 0.9 --light sky.exr"
    assert prt(haar, capfd)[0] == 0
    result = {}
    for option in ("--progressive", "--form compressed", "--form exact"):
        code, out, _ = prt(f"{relight.removesuffix('--progressive')} {option}", capfd)
        assert code == 0 and "3 frames" in out
        frames = [np.load(folder / f"p_{i}.npz")["ball"] for i in (1, 2, 3)]
        result[option] = np.array(frames)
    exact = result.pop("--form exact")
    # The first frame is three wavelets of the light either way; later ones have more of it.
    progressive, cut = result.values()
    np.testing.assert_allclose(progressive[0], cut[0], rtol=1e-4, atol=1e-5)
    assert np.linalg.norm(progressive[2] - exact[2]) < 0.8 * np.linalg.norm(cut[2] - exact[2])
    assert prt("compress a.prt --method none", capfd)[0] == 0
    for i in (1, 2, 3):
        (folder / f"p_{i}.npz").unlink()


def test_a_missed_tolerance_is_said_loudly(folder, capfd):
    line = "compress a.prt --method harmonics --tolerance 1e-6 --light sky.exr"
    code, out, errors = prt(line, capfd)
    assert code == 0 and not errors
    assert out.splitlines()[-1].startswith("  MISSED  NOT within the tolerance of 0.00%")
    assert "NOT within the tolerance" in prt("info a.prt", capfd)[1]
    code, out, errors = prt(f"{line} --json", capfd)
    assert code == 0 and json.loads(out)["tolerance_met"] is False
    assert len(errors) == 1 and "NOT within the tolerance" in errors[0]


def test_many_bounces_are_as_many_as_matter(folder, capfd):
    """In a moment: nothing is added after a few dozen."""
    for bounces, name in ((1_000_000, "m"), (300, "f")):
        line = f"relight a.prt --light sky.exr --bounces {bounces} --output {name}.npz"
        assert prt(f"{line} --form exact", capfd)[0] == 0
    many, few = (dict(np.load(folder / f"{name}.npz")) for name in "mf")
    for name in many:
        np.testing.assert_array_equal(many[name], few[name])
    settings = BakeSettings(resolution=2, tolerance=0.1, bounces=1_000_000)
    scene = load(folder / "bare.prt").scene
    run(bake_steps(scene, folder / "many.prt", settings))
    assert load(folder / "many.prt").transport.rows([3]).shape == (1, 24, 3)


def test_a_name_that_is_a_word_of_the_writer_is_an_object(folder, capfd):
    """Arrays are named by objects, whatever these are called."""
    meshes = [plane(3, name="file"), plane(3, z=1.0, name="allow_pickle")]
    scene = Scene.from_meshes(meshes, max_hidden=0)
    run(bake_steps(scene, folder / "names.prt", BakeSettings(resolution=2, bounces=0)))
    assert prt("relight names.prt --light sky.exr --output names.npz", capfd)[0] == 0
    assert set(np.load(folder / "names.npz").files) == {"file", "allow_pickle"}


def test_what_is_said_of_an_image_is_printed(folder, capfd):
    import OpenEXR

    pixels = standing_lights()["even sky"].pixels
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    layers = {f"{layer}.{c}": pixels[..., i].copy() for layer in ("V.AO", "V.Combined")
              for i, c in enumerate("RGB")}  # fmt: skip
    with OpenEXR.File(header, layers) as file:
        file.write(str(folder / "layers.exr"))
    said = "layers.exr: read is V.Combined, not V.AO"
    for line in ("relight bare.prt --light layers.exr --output o.npz --png o.png --size 4x3",
                 "relight bare.prt --light layers.exr --output t_#.npz --turn 2",
                 "compress bare.prt --method harmonics --tolerance 0.5 --light layers.exr",
                 "info bare.prt"):  # fmt: skip
        code, out, errors = prt(line, capfd)
        assert code == 0 and not errors and f"note    {said}" in out, (line, out)


def test_a_picture_without_a_camera_says_so(folder, capfd):
    out = prt("relight bare.prt --light sky.exr --png c.png --size 4x3", capfd)[1]
    assert "no camera" in out
    out = prt("relight a.prt --light sky.exr --png c.png --size 4x3", capfd)[1]
    assert "no camera" not in out


def test_a_glb_is_that_of_the_call(folder, capfd):
    line = "export glb a.prt --light sky.exr --rotate 20 --light-only --colours u16 -o o.glb"
    code, out, errors = prt(line, capfd)
    assert (code, errors) == (0, []) and out.startswith("o.glb: 2 objects, ")
    assert "relit exactly, COLOR_0 times " in out and out.rstrip().endswith(" is light")
    export_glb("a.prt", "call.glb", "sky.exr", rotation=20.0, colours="light", encoding="u16")
    assert Path("o.glb").read_bytes() == Path("call.glb").read_bytes()
    code, out, _ = prt(f"{GLB} --harmonics --json", capfd)
    said = json.loads(out)
    assert code == 0 and said["output"] == "o.glb" and said["objects"] == 2
    assert prt(f"{GLB} --material multiplied", capfd)[1].rstrip().endswith(" is light")
    # Pixels that a bake has beside its points belong to no object.
    code, out, _ = prt("export glb image.prt --light sky.exr -o o.glb", capfd)
    assert code == 0 and out.startswith("o.glb: 2 objects, ")
    for name in ("o.glb", "call.glb"):
        Path(name).unlink()


def test_names_that_the_terminal_cannot_show_are_shown_otherwise(folder):
    """And a reader that goes away, or a full disk behind stdout, is no traceback."""
    scene = Scene.from_meshes([plane(3, name="Würfel ☀")], max_hidden=0)
    run(
        bake_steps(scene, folder / "names.prt", BakeSettings(resolution=2, bounces=0), restart=True)
    )
    command = [sys.executable, "-m", "prt_core", "info", str(folder / "names.prt")]
    # Buffered as in a terminal of anyone's, so that the end of the program meets the full disk.
    env = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUNBUFFERED": ""}
    options = {"cwd": ROOT, "env": env}
    done = subprocess.run(command, capture_output=True, text=True, **options)
    assert done.returncode == 0 and "W\\xfcrfel \\u2600: 16 corners" in done.stdout

    def small_disk():
        resource.setrlimit(resource.RLIMIT_FSIZE, (9, 9))

    with open(folder / "said", "w") as said:
        done = subprocess.run(command, stdout=said, stderr=subprocess.PIPE, text=True,
                              preexec_fn=small_disk, **options)  # fmt: skip
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "file too large" in done.stderr


def test_stored_lamps_are_what_they_were(folder):
    assert BakeStore(folder / "a.prt").attributes["lamps"][0].keys() == asdict(LAMP).keys()
