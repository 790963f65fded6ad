"""The snippets of docs/engines relight a .glb as the bake does: three.js in a headless browser."""

import functools
import html
import http.server
import json
import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

from prt_core import export_glb, load
from prt_core.basis import harmonics
from prt_core.export.glb.geometry import Geometry
from prt_core.export.glb.placement import TO_GLTF
from prt_core.relight.forms import load_compressed
from tests.engines.conftest import HERE

ROOT = HERE.parents[1]


def sky(directions):
    """Radiance (n, 3) from directions (n, 3) of glTF's axes, as the page has it."""
    side = np.maximum(directions @ [0.6, 0.64, 0.48], 0)
    return np.stack(
        [0.3 + 3 * side, 0.4 + 2 * side**2, 0.5 + directions[:, 1] * 0.25], axis=1
    ).astype(np.float32)


@pytest.fixture(scope="module")
def page(baked, tmp_path_factory):
    """What the page finds, in a browser without a window."""
    home = Path(os.environ.get("PRT_NODE_MODULES", HERE / "node_modules"))
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None or not (home / "three").is_dir():
        pytest.skip("needs chromium, and 'make engines' once")
    folder = tmp_path_factory.mktemp("page")
    (folder / "three").symlink_to((home / "three").resolve())
    shutil.copy(HERE / "relight.html", folder)
    for name in ("prt_three.js", "prt.gdshader"):
        shutil.copy(ROOT / "docs" / "engines" / name, folder)
    light = sky(baked.cube_map.directions @ TO_GLTF.T)
    export_glb(baked, folder / "scene.glb", light, weights=True, harmonics=True)
    handler = functools.partial(Silent, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        done = subprocess.run(
            [browser, "--headless", "--no-sandbox", "--disable-gpu-sandbox",
             "--enable-unsafe-swiftshader", "--use-angle=swiftshader",
             "--virtual-time-budget=60000", f"--user-data-dir={folder / 'profile'}", "--dump-dom",
             f"http://127.0.0.1:{server.server_port}/relight.html"],
            capture_output=True, text=True, timeout=300,
        )  # fmt: skip
    finally:
        server.shutdown()
    found = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found and found[1], done.stderr[-2000:]
    result = json.loads(html.unescape(found[1]))
    assert not result["errors"], result["errors"]
    return result


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def shown(page, kind):
    parts = [np.array(part).reshape(-1, 4)[:, :3] for part in page[kind]]
    return np.concatenate(parts)


def points_of(bake):
    geometry = Geometry(bake.scene)
    parts = [geometry.surfaces(number)[1] for number in range(len(bake.scene.objects))]
    return np.concatenate([surface.points for part in parts for surface in part])


def test_weights_in_a_shader_are_the_compressed_form(baked, page):
    light = sky(baked.cube_map.directions @ TO_GLTF.T)
    form, _ = load_compressed(load(baked.path))
    form.model.border_points_ = form.model.border_points_[:0]
    form.model.shares_ = form.model.shares_[:0]
    truth = baked.transport.exit_radiance(form.model.product(light)).toward()[points_of(baked)]
    assert np.abs(shown(page, "weights") - truth).max() < 1e-3 * truth.max()
    assert np.abs(shown(page, "godot") - truth).max() < 1e-3 * truth.max()


def test_harmonics_in_a_shader_are_near_the_bake(baked, page):
    # The page's light is wide: nine harmonics hold most of it.
    light = sky(baked.cube_map.directions @ TO_GLTF.T)
    own = baked.transport.exit_radiance(baked.transport.product(light)).toward()
    truth = own[points_of(baked)]
    error = shown(page, "harmonics") - truth
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(truth)


def test_the_page_spells_the_harmonics_as_the_files_do():
    text = (ROOT / "docs" / "engines" / "prt_three.js").read_text()
    body = re.search(r"function harmonics\(.*?return \[(.*?)\];", text, re.DOTALL)[1]
    directions = np.random.default_rng(1).normal(size=(7, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = directions.T
    values = eval(f"[{' '.join(body.split())}]", {"x": x, "y": y, "z": z})
    values = np.stack([value * np.ones(7) for value in values], axis=1)
    np.testing.assert_allclose(values, harmonics(directions, 3), atol=1e-8)
