"""Light fields as they are looked at: towards a view, as pictures, compressed, by the command."""

import numpy as np
import pytest

from prt_core import run
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_compress import (
    compress_light_field_steps,
    compressed_light_field,
    white_level,
)
from prt_core.bake.light_field_load import load_light_field
from prt_core.bake.light_field_view import (
    GREY,
    camera_at,
    field_picture,
    field_toward,
    uncaptured,
    view_of,
)
from prt_core.cli import main
from prt_core.errors import PRTError
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.rays import BruteForceCaster
from prt_core.scene import Camera, Scene, geometry_layout, with_geometry_image
from prt_core.transport import View
from tests.meshes import caster_of, plane, sphere

ANGLES = (19, 16)


def radiance_of(positions, ways):
    """What a viewer sees of a place: smooth in both."""
    base = 1 + ways @ np.array([0.5, -0.3, 0.2])
    return (base + 0.4 * positions[..., :1].squeeze(-1))[..., None] * [1.0, 0.6, 0.3]


class Smooth:
    """A camera of two lights, the second twice as bright."""

    name, lights, most_points = "smooth", ("key", "fill"), 1 << 20

    def shoot(self, points, angles, samples, seed):
        local = HRDFLayout(*angles).directions.reshape(*angles, 3)
        ways = np.einsum("ijk,nkx->nijx", local, points.frames)
        whole = radiance_of(points.positions[:, None, None], ways)
        parts = np.stack([whole / 3, whole * 2 / 3]).astype(np.float32)
        return parts, np.zeros(len(points), np.float32), 0.0


def capture(path, scene, view=None):
    settings = LightFieldSettings(ANGLES, samples=1)
    run(capture_light_field(scene, Smooth(), path, settings, view))
    return load_light_field(path)


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    scene = Scene.from_meshes([sphere(9, 0.5, (0.1, 0, 0.2)), plane(3, receives=False)], 0)
    camera = Camera(np.array([[1, 0, 0, 0], [0, 0, -1, -3], [0, 1, 0, 0.2], [0, 0, 0, 1.0]]), 0.3)
    return capture(tmp_path_factory.mktemp("views") / "a.slf", scene, camera)


def test_radiance_towards_a_place_is_that_of_its_directions(ball):
    place = np.array([2.0, -1.5, 1.0])
    positions = ball.scene.to_world(ball.scene.points.positions)
    view = View(position=place)
    radiance, used = field_toward(ball, view)
    ways = view.outgoing(positions)
    normals = ball.scene.points.normals
    seen = np.isin(np.arange(len(positions)), ball.point) & ((ways * normals).sum(axis=1) > 0.2)
    truth = radiance_of(positions, ways)
    assert used == "exact" and seen.sum() > 20
    assert np.abs(radiance - truth)[seen].max() < 0.02
    # Objects that were not captured are black.
    assert not radiance[ball.scene.points.object_index == 1].any()
    coloured, _ = field_toward(ball, view, {"key": 0.0, "fill": (1.5, 0, 3)})
    assert np.allclose(coloured[seen], radiance[seen] * [1, 0, 2], rtol=1e-5)


def test_pictures_show_the_field_from_the_camera_and_from_any_place(ball):
    caster = caster_of(ball.scene)
    for camera in (ball.camera, camera_at(ball, (0.3, 2.0, 1.0)), camera_at(ball, (0.1, 0, 3.0))):
        radiance, _ = field_toward(ball, view_of(camera))
        picture = field_picture(ball, radiance, camera, caster, 37, 23)
        assert picture.shape == (23, 37, 3)
        # The plane was not captured: as grey as is asked for, under the ball and beside it.
        bare = field_picture(ball, radiance, camera, caster, 37, 23, grey=0.0)
        shown = bare.sum(axis=2) > 0
        beside = ~shown & (picture.sum(axis=2) > 0)
        whole = (picture[beside] == np.float32(GREY)).all(axis=1)
        assert whole.sum() > 20 and (picture[beside] <= np.float32(GREY)).all()
        assert (picture[11, 18] == bare[11, 18]).all() and (picture >= bare).all()
        assert 0.05 < shown.mean() < 0.95 and not shown[0].any()
        middle = picture[11, 18]
        way = camera.position - [0.1, 0, 0.2]
        way /= np.linalg.norm(way)
        truth = radiance_of(np.array([0.1, 0, 0.2]) + 0.5 * way, way)
        assert np.allclose(middle, truth, rtol=0.05)


def test_a_grid_shows_its_texels_between_the_vertices(tmp_path):
    mesh = plane(2, -1, 1)
    mesh.corner_uv = mesh.vertices[mesh.corner_vertex, :2] / 2 + 0.5
    layout = geometry_layout(mesh, "uv")
    tracer = BruteForceCaster(layout.vertices, layout.triangles)
    flat = Scene.from_meshes([mesh, sphere(5, 0.2, (0, 0, 0.5))], 0)
    field = capture(tmp_path / "a.slf", with_geometry_image(flat, tracer, layout, 11))
    assert len(field) == 121
    camera = camera_at(field, (0, 0, 4.0))
    radiance, _ = field_toward(field, view_of(camera))
    picture = field_picture(field, radiance, camera, caster_of(field.scene), 41, 41)
    row, column = 20, 30
    x = (column + 0.5) / 41 * 2 - 1
    x *= 4 * camera.tangent
    way = np.array([0 - x, 0, 4.0])
    truth = radiance_of(np.array([x, 0, 0]), way / np.linalg.norm(way))
    assert np.allclose(picture[row, column], truth, rtol=0.03)
    # The ball has no points of the field.
    assert (picture[20, 20] == np.float32(GREY)).all() and uncaptured(field) == ["sphere"]


def test_the_compressed_form_is_near_and_is_used(ball):
    report = run(compress_light_field_steps(ball.store.path, "haar", psnr=45.0))
    assert report["psnr"] >= 45 and report["coded_nbytes"] < report["raw_nbytes"] / 4
    field = load_light_field(ball.store.path)
    model = compressed_light_field(field)
    assert model.n_lights_ == 2 and model.n_points_ == len(field)
    view = View(position=(2.0, -1.5, 1.0))
    near, used = field_toward(field, view, {"key": 0.5})
    exact, plain = field_toward(field, view, {"key": 0.5}, "exact")
    assert (used, plain) == ("compressed", "exact")
    error = np.linalg.norm(near - exact) / np.linalg.norm(exact)
    assert 0 < error < 0.05
    assert run(compress_light_field_steps(ball.store.path, "none")) is None
    with pytest.raises(PRTError, match="no compressed form; 'prt lightfield compress'"):
        field_toward(load_light_field(ball.store.path), view, form="compressed")
    with pytest.raises(PRTError, match="takes no PSNR"):
        run(compress_light_field_steps(ball.store.path, "none", psnr=40.0))
    with pytest.raises(PRTError, match="method"):
        run(compress_light_field_steps(ball.store.path, "jpeg"))


def test_by_itself_the_error_is_a_share_of_white_and_no_highlight_rules_it(ball):
    field = load_light_field(ball.store.path)
    report = run(compress_light_field_steps(ball.store.path, "haar"))
    assert 0.005 < report["error"] <= 0.02
    lit = np.asarray(field.radiance[0]).max(axis=-1)
    assert (lit <= white_level(field.radiance)).mean() >= 0.99
    glint = np.asarray(field.radiance[:])
    glint[0, 0, 0, 0] = 1e5
    assert white_level(glint) == pytest.approx(white_level(field.radiance), rel=0.02)
    assert white_level(0 * glint) == 1
    finer = run(compress_light_field_steps(ball.store.path, "haar", tolerance=0.004))
    assert finer["error"] <= 0.004 and finer["coded_nbytes"] > report["coded_nbytes"]
    with pytest.raises(PRTError, match="tolerance: says how far, and so does psnr"):
        run(compress_light_field_steps(ball.store.path, psnr=30.0, tolerance=0.1))
    with pytest.raises(PRTError, match="tolerance: expected"):
        run(compress_light_field_steps(ball.store.path, tolerance=1.5))
    run(compress_light_field_steps(ball.store.path, "none"))


def test_the_command_shows_and_compresses(ball, tmp_path, capsys):
    field, png = str(ball.store.path), str(tmp_path / "a.png")
    small = ["--png", png, "--size", "31x17"]
    assert main(["lightfield", "compress", field, "--method", "haar", "--psnr", "40"]) == 0
    assert main(["lightfield", "show", field, *small]) == 0
    assert main(["lightfield", "show", field, *small, "--view=1,-2,1", "--lamps", "*=0"]) == 0
    assert main(["lightfield", "info", field]) == 0
    lines = capsys.readouterr().out
    assert lines.count("not captured, drawn in grey: plane\n") == 2
    assert "dB below a peak" in lines and ", compressed" in lines and "compressed:" in lines
    assert main(["lightfield", "compress", field, "--method", "none"]) == 0
    assert "holds no compressed form" in capsys.readouterr().out


def test_a_camera_of_the_scene_looks_by_its_name(ball, tmp_path, capsys):
    """The bytes are those of a field whose own camera it is; a finished one takes what moved."""
    side = camera_at(ball, (2.0, 1.0, 0.5))
    path, settings = tmp_path / "a.slf", LightFieldSettings(ANGLES, samples=1)
    pictures = []
    for own, cameras, view in (
        (side, None, "camera"),
        (ball.camera, {"Side": side}, "Side"),
        (None, {"Side": side}, "Side"),
        (ball.camera, {"Side": ball.camera}, "Side"),
        (ball.camera, {}, "camera"),
    ):
        run(capture_light_field(ball.scene, Smooth(), path, settings, own, cameras=cameras))
        assert load_light_field(path).cameras == (cameras or {})
        command = ["lightfield", "show", str(path), "--view", view, "--png"]
        assert main([*command, str(tmp_path / "a.png")]) == 0
        pictures.append((tmp_path / "a.png").read_bytes())
    assert pictures[0] == pictures[1] == pictures[2] != pictures[3] == pictures[4]
    assert main(["lightfield", "show", str(path), "--view", "Side", "--png", "a.png"]) == 2
    assert "none by name and 'camera', its own, or give a place as x,y,z" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--view", "1,2"], "--view: the baked scene has none called '1,2' whose lens is followed"),
        (["--lamps", "key"], "--lamps: expected NAME=HOW"),
        (["--lamps", "key=bright"], "--lamps: 'key': expected a factor"),
        (["--lamps", "sun=1"], "light 'sun': the field has no such light"),
        (["--form", "compressed"], "has no compressed form"),
    ],
)
def test_wrong_flags_of_show_are_one_line(ball, tmp_path, capsys, flags, said):
    command = ["lightfield", "show", str(ball.store.path), "--png", str(tmp_path / "a.png")]
    assert main([*command, "--size", "5x3", *flags]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0]
    assert not (tmp_path / "a.png").exists()
