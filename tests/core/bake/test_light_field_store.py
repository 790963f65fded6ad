"""Light fields into a store by a camera made of arithmetic: blocks, kills, damage, tolerances."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, bake_steps, light_field, load, relight_points, run
from prt_core.bake.field_denoise import denoise_steps
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_transport import TransportCamera
from prt_core.errors import PRTError
from prt_core.runtime.progress import Progress
from prt_core.scene import Scene
from prt_core.store import BakeStore
from tests.meshes import plane, sphere

ANGLES = (5, 3)
# Blocks of four points: 2^22 paths of fifteen directions.
SAMPLES = 1 << 16
SETTINGS = LightFieldSettings(angles=ANGLES, samples=SAMPLES)


def scene():
    return Scene.from_meshes([sphere(5, 0.3, (0, 0, 0.5))], max_hidden=0)


class Arithmetic:
    """A camera whose radiance is known, with noise that falls as that of samples."""

    name, most_points = "arithmetic", 1 << 20

    def __init__(self, lights=(), noise=0.0, missed=0.0, dark=False, colour=1.0, stop_at=None):
        self.lights, self.noise, self.missed, self.dark = lights, noise, missed, dark
        self.colour, self.stop_at, self.shots, self.denoised = colour, stop_at, 0, 0

    def shoot(self, points, angles, samples, seed):
        if self.shots == self.stop_at:
            os.kill(os.getpid(), signal.SIGKILL)
        self.shots += 1
        rng = np.random.default_rng(seed)
        rows, columns = angles
        cells = np.arange(rows * columns).reshape(rows, columns, 1)
        level = np.abs(points.positions).sum(axis=1)[:, None, None, None]
        radiance = self.colour * (level + cells * [0.25, 0.5, 1.0])
        radiance = radiance * (1 + self.noise / samples**0.5 * rng.normal(size=radiance.shape))
        radiance *= not self.dark
        shares = np.arange(1, max(len(self.lights), 1) + 1)
        parts = [radiance * share / shares.sum() for share in shares]
        missed = np.full(len(points), self.missed, np.float32)
        return np.stack(parts).astype(np.float32), missed, 1e-7

    def denoise(self, radiance, points, samples):
        """Of the lights, which come one after the other, the first alone keeps its energy."""
        assert len(radiance) == 1
        first = self.denoised % max(len(self.lights), 1) == 0
        self.denoised += 1
        return (radiance * (1.005 if first else 0.9)).astype(np.float32)


def capture(path, camera=None, settings=SETTINGS, **more):
    return run(capture_light_field(scene(), camera or Arithmetic(), path, settings, **more))


def arrays_of(path):
    """Bytes of all files but the attributes, whose seconds differ."""
    files = sorted(p for p in Path(path).rglob("*") if p.is_file())
    return {
        str(p.relative_to(path)): p.read_bytes() for p in files if p != Path(path) / "zarr.json"
    }


def test_what_is_captured_is_read_back(tmp_path):
    report = capture(tmp_path / "a.slf", Arithmetic(("key", "fill")))
    field = load_light_field(tmp_path / "a.slf")
    assert field.lights == ("key", "fill") and field.angles == ANGLES
    assert report["points"] == len(field) == len(field.scene.points) and report["missed"] == 0
    positions = field.scene.to_world(field.scene.points.positions[field.point])
    cells = np.arange(15).reshape(5, 3, 1) * [0.25, 0.5, 1.0]
    whole = np.concatenate([tables for _, tables in field.tables(field.weights())])
    level = (whole - cells)[..., 0]
    # Rays end a little inwards of the points.
    assert np.allclose(level, np.abs(positions).sum(axis=1)[:, None, None], atol=0.01)
    assert np.allclose(field.radiance[1], 2 * field.radiance[0], rtol=1e-6)
    frames = field.frames.astype(np.float64)
    assert np.allclose(np.linalg.det(frames), 1, atol=1e-6)
    assert np.allclose(frames[:, 2], field.scene.points.normals[field.point], atol=1e-6)


def test_lights_are_dimmed_and_coloured(tmp_path):
    capture(tmp_path / "a.slf", Arithmetic(("key", "fill")))
    field = load_light_field(tmp_path / "a.slf")
    weights = field.weights({"key": 0.5, "*": (0, 1, 2)})
    assert weights.tolist() == [[0.5] * 3, [0, 1, 2]]
    (block, tables) = next(field.tables(weights))
    key, fill = field.radiance[0, block], field.radiance[1, block]
    assert np.allclose(tables, 0.5 * key + fill * [0, 1, 2], rtol=1e-6)
    with pytest.raises(PRTError, match="'rim': the field has no such light; there are key, fill"):
        field.weights({"rim": 1})
    with pytest.raises(PRTError, match="light 'key'"):
        field.weights({"key": -1})


def test_what_was_stopped_goes_on_bit_by_bit(tmp_path):
    capture(tmp_path / "whole.slf", Arithmetic(noise=9.0))
    steps = capture_light_field(scene(), Arithmetic(noise=9.0), tmp_path / "a.slf", SETTINGS)
    for progress in steps:
        if progress.stage == "light field" and progress.done > 8:
            break
    steps.close()
    assert not BakeStore(tmp_path / "a.slf").is_complete
    with pytest.raises(PRTError, match="is not finished; run the same 'prt lightfield bake'"):
        load_light_field(tmp_path / "a.slf")
    camera = Arithmetic(noise=9.0)
    report = capture(tmp_path / "a.slf", camera)
    assert 2 < camera.shots < len(scene().points) / 4 + 2
    assert "went on" in report["messages"][-1]
    assert arrays_of(tmp_path / "a.slf") == arrays_of(tmp_path / "whole.slf")


def test_a_kill_in_a_block_goes_on_bit_by_bit(tmp_path):
    capture(tmp_path / "whole.slf", Arithmetic(noise=9.0))
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from tests.core.bake.test_light_field_store import *\n"
        "capture(sys.argv[2], Arithmetic(noise=9.0, stop_at=5))"
    )
    root = Path(__file__).parents[3]
    ended = subprocess.run([sys.executable, "-c", code, root, tmp_path / "a.slf"], cwd=root)
    assert ended.returncode == -signal.SIGKILL
    capture(tmp_path / "a.slf", Arithmetic(noise=9.0))
    assert arrays_of(tmp_path / "a.slf") == arrays_of(tmp_path / "whole.slf")


def test_another_look_of_the_same_scene_is_refused(tmp_path):
    capture(tmp_path / "a.slf")
    with pytest.raises(PRTError, match=r"a bake with another look; .*--restart"):
        capture(tmp_path / "a.slf", Arithmetic(colour=1.5))
    again = capture(tmp_path / "a.slf", Arithmetic(colour=1.5), restart=True)
    assert again["points"] and not (tmp_path / "a.slf.restart").exists()
    camera = Arithmetic(colour=1.5)
    assert capture(tmp_path / "a.slf", camera) == again and camera.shots == 2


def test_samples_rise_until_two_seeds_agree(tmp_path):
    settings = LightFieldSettings(ANGLES, samples=None, tolerance=0.02)
    report = capture(tmp_path / "a.slf", Arithmetic(noise=0.5), settings)
    # Noise of 0.5 / sqrt(samples), so 625 samples are enough.
    assert 300 < report["samples"] < 3000 and report["tolerance_met"]
    assert report["noise"] == pytest.approx(0.5 / report["samples"] ** 0.5, rel=0.3)
    given = capture(
        tmp_path / "b.slf", Arithmetic(noise=0.5), LightFieldSettings(ANGLES, samples=4)
    )
    assert given["noise"] == pytest.approx(0.25, rel=0.3) and given["tolerance_met"] is None


def test_the_denoiser_gets_a_light_and_some_points_at_a_time(monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.field_denoise"], "_PIXELS", 31)
    radiance = np.random.default_rng(3).random((2, 7, *ANGLES, 3)).astype(np.float32)
    asked, points = [], np.arange(7)

    class Halving:
        def denoise(self, noisy, some, samples):
            asked.append((some.tolist(), samples))
            assert (noisy[0] == radiance[int(len(asked) > 4), some]).all()
            return noisy / 2

    done = Progress("light field", 3, 9)
    steps = denoise_steps(Halving(), radiance, points, 5, done)
    clean = run(steps, lambda progress: asked.append(progress) if progress != done else None)
    assert asked == 2 * [([0, 1], 5), ([2, 3], 5), ([4, 5], 5), ([6], 5)]
    assert (clean == radiance / 2).all()


def test_only_denoised_light_that_keeps_its_energy_is_taken(tmp_path):
    settings = LightFieldSettings(ANGLES, SAMPLES, denoise=True)
    report = capture(tmp_path / "a.slf", Arithmetic(("key", "fill")), settings)
    capture(tmp_path / "b.slf", Arithmetic(("key", "fill")))
    one, two = (load_light_field(tmp_path / name) for name in ("a.slf", "b.slf"))
    assert np.allclose(one.radiance[0], 1.005 * two.radiance[0], rtol=1e-6)
    assert np.array_equal(one.radiance[1], two.radiance[1])
    assert report["denoised"] == 0.5
    assert "sphere: denoising changes the light of 'fill' by -10.0%" in report["messages"][0]
    assert "noisy" not in one.store and "denoised" not in one.store


def test_rays_that_miss_are_said_or_refused(tmp_path):
    report = capture(tmp_path / "a.slf", Arithmetic(missed=0.1))
    assert "sphere: 10% of its rays met something else" in report["messages"][0]
    with pytest.raises(PRTError, match="60% of the rays met something else than their points"):
        capture(tmp_path / "b.slf", Arithmetic(missed=0.6))
    assert not (tmp_path / "b.slf").exists()


def test_a_black_field_is_said(tmp_path):
    report = capture(tmp_path / "a.slf", Arithmetic(dark=True))
    assert "sphere: its field is black" in report["messages"][0] and report["noise"] == 0


def test_a_full_disk_is_one_line_and_goes_on(tmp_path, monkeypatch):
    capture(tmp_path / "whole.slf")
    count, replace = [0], os.replace

    def full(*names):
        count[0] += 1
        if count[0] > 60:
            raise OSError(28, "No space left on device")
        replace(*names)

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(PRTError, match=r"No space left.*make room") as error:
        capture(tmp_path / "a.slf")
    assert "\n" not in str(error.value)
    monkeypatch.undo()
    assert not list((tmp_path / "a.slf").rglob("*.part"))
    capture(tmp_path / "a.slf")
    assert arrays_of(tmp_path / "a.slf") == arrays_of(tmp_path / "whole.slf")


def test_a_tampered_store_is_refused_and_mended(tmp_path):
    path = tmp_path / "a.slf"
    capture(path)
    before = arrays_of(path)
    (path / "radiance" / "c" / "0" / "1" / "0" / "0" / "0").write_bytes(b"other")
    with pytest.raises(PRTError, match="not what was written there|another size|is not what"):
        list(load_light_field(path).tables(np.ones((1, 3))))
    text = (path / "zarr.json").read_text()
    (path / "zarr.json").write_text(text.replace('"lights": ["all"]', '"lights": ["sun"]'))
    with pytest.raises(PRTError, match="damaged or edited"):
        load_light_field(path)
    (path / "zarr.json").write_text(text)
    capture(path)
    assert arrays_of(path) == before


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"angles": (1, 1)}, "angles: expected two numbers of 2 to 1024, got 1 x 1"),
        ({"angles": (5, 0)}, "angles"),
        ({"samples": 0}, "samples"),
        ({"tolerance": 0}, "tolerance"),
        ({"denoise": 1}, "denoise"),
        ({"seed": -1}, "seed"),
    ],
)
def test_wrong_settings_are_one_line(wrong, said):
    with pytest.raises(PRTError, match=said):
        LightFieldSettings(**wrong)


def test_a_light_field_is_no_bake_and_a_bake_no_light_field(tmp_path):
    capture(tmp_path / "a.slf")
    with pytest.raises(PRTError, match="is a light field, not a bake"):
        load(tmp_path / "a.slf")


def test_objects_that_do_not_receive_have_no_points(tmp_path):
    silent = Scene.from_meshes([plane(3, receives=False)], max_hidden=0)
    with pytest.raises(PRTError, match="objects: none of them has a face"):
        run(capture_light_field(silent, Arithmetic(), tmp_path / "a.slf", SETTINGS))
    both = Scene.from_meshes([plane(3, receives=False), sphere(5, 0.3, (0, 0, 0.5))], 0)
    run(capture_light_field(both, Arithmetic(), tmp_path / "a.slf", SETTINGS))
    field = load_light_field(tmp_path / "a.slf")
    owner = both.points.object_index[field.point]
    assert set(owner) == {1} and len(field) == (both.points.object_index == 1).sum()


def test_the_field_of_a_bake_is_its_radiance_in_all_directions(tmp_path):
    meshes = [plane(5, albedo=0.6), sphere(5, 0.3, (0, 0, 0.5))]
    lamps = [Lamp("point", (5, 3, 2), (0, 0, 2), name="bulb"), Lamp("point", (1, 1, 1), (2, 0, 1))]
    sky = np.full((96, 3), 0.5, np.float32)
    settings = BakeSettings(resolution=4, tolerance=0.05)
    path = tmp_path / "a.prt"
    run(bake_steps(Scene.from_meshes(meshes), path, settings, lamps, sky))
    with pytest.raises(PRTError, match="is a bake, not a light field"):
        load_light_field(path)
    bake = load(path)
    camera = TransportCamera(bake, each=True)
    assert camera.lights[:2] == ("world", "bulb") and len(camera.lights) == 3
    run(capture_light_field(bake.scene, camera, tmp_path / "a.slf", LightFieldSettings(ANGLES)))
    field = load_light_field(tmp_path / "a.slf")
    truth = relight_points(bake, "world", lamps=True)[field.point]
    whole = np.concatenate([tables for _, tables in field.tables(field.weights())])
    assert np.allclose(whole, truth[:, None, None], rtol=1e-4, atol=1e-5)
    assert truth.mean() > 0.1
    with pytest.raises(PRTError, match="has no light of its own"):
        run(bake_steps(Scene.from_meshes(meshes), tmp_path / "dark.prt", settings))
        TransportCamera(load(tmp_path / "dark.prt"))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"grid": 0}, "grid: expected a whole number >= 1"),
        ({"hidden": -1}, "hidden: expected a whole number >= 0"),
        ({"lamps": "yes"}, "lamps: expected True or False"),
        ({"angles": "32x16"}, "angles: expected two whole numbers"),
        ({"unknown": 1}, "unknown: no such setting; there are angles, samples"),
        ({"objects": ["a"]}, "a.prt: its points are those of the bake"),
        ({}, "a.prt: there is no such bake"),
    ],
)
def test_wrong_calls_are_one_line_and_leave_nothing(tmp_path, wrong, said):
    with pytest.raises(PRTError, match=said) as error:
        light_field(tmp_path / "a.prt", tmp_path / "a.slf", **wrong)
    assert "\n" not in str(error.value) and not (tmp_path / "a.slf").exists()
    with pytest.raises(PRTError, match=r"a\.prt: expected a name that ends in \.slf"):
        light_field("a.blend", tmp_path / "a.prt")


def test_several_capture_shares_of_what_was_planned(tmp_path):
    whole = capture(tmp_path / "whole.slf")
    path = tmp_path / "a.slf"
    with pytest.raises(PRTError, match="there is no such bake"):
        capture(path, share=(0, 2))
    assert capture(path, plan=True)["blocks"] > 3
    shared = [capture(path, share=(number, 3))["blocks"] for number in range(3)]
    assert sum(shared) == capture(path, plan=True)["blocks"] and min(shared) > 0
    # They are there: who closes it shoots the pilot alone.
    camera = Arithmetic()
    report = capture(path, camera=camera)
    assert camera.shots == 2 and report["points"] == whole["points"]
    one, two = BakeStore(path).attributes, BakeStore(tmp_path / "whole.slf").attributes
    assert one["arrays"] == two["arrays"] and set(one) == set(two)
    assert capture(path, share=(1, 3)) == {"blocks": 0}
    with pytest.raises(PRTError, match="was planned with another .*samples; share it with"):
        other = LightFieldSettings(angles=ANGLES, samples=SAMPLES - 1)
        capture(path, settings=other, share=(0, 2))


def test_shares_are_of_a_plan(tmp_path):
    steps = capture_light_field(scene(), Arithmetic(), tmp_path / "a.slf", SETTINGS)
    while next(steps).stage != "light field":
        pass
    steps.close()
    with pytest.raises(PRTError, match="was not planned; run the same command with --plan first"):
        capture(tmp_path / "a.slf", share=(0, 2))
    for more in ({"share": (2, 2)}, {"share": (0, 0)}, {"share": 1}, {"plan": 1}):
        with pytest.raises(PRTError, match="^(share|plan): expected"):
            capture(tmp_path / "a.slf", **more)
    for more in ({"plan": True, "share": (0, 2)}, {"plan": True, "restart": True}):
        with pytest.raises(PRTError, match="^plan: one of plan, share and restart"):
            capture(tmp_path / "a.slf", **more)
