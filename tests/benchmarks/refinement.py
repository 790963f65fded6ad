"""Refined meshes against Cycles: `prt bake --refine`, the mesh as it is, and all its edges split.

python tests/benchmarks/refinement.py [--only SCENE] [--pictures FOLDER]    into docs/benchmarks

Truth is what Cycles renders from the scene's camera: two renders of different seeds, kept in
build/bench. Ours is the bake, lit by the same lamps, drawn as renderers draw vertex colours. The
squared error is the mean of the product of the differences to either render, over pixels and
channels, relative to the product of the two: their noise takes no part in it, that of which places
of a pixel they look at neither. Ours looks at 64 even places of a pixel; of 16 an outline is often
a sixteenth of the pixel wrong, which is more than all the rest of a refined mesh. Pixels that show
more than one object measure outlines: so errors are given without them as well.
"""

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "blend_scenes")]

import build  # noqa: E402
from prt_core.bake import BakeSettings, bake_steps  # noqa: E402
from prt_core.bake.load import load  # noqa: E402
from prt_core.blender.camera import read_camera  # noqa: E402
from prt_core.blender.depsgraph import read_meshes_steps  # noqa: E402
from prt_core.blender.lamps import lamp_seen, see_lamps  # noqa: E402
from prt_core.evaluate import to_srgb, write_png  # noqa: E402
from prt_core.evaluate.view import CameraRays  # noqa: E402
from prt_core.relight.lighting import Lighting  # noqa: E402
from prt_core.relight.relighter import Relighter  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from prt_core.sampling import RefineSettings, refine_steps  # noqa: E402
from prt_core.scene import Scene  # noqa: E402
from prt_core.scene.refine import split_evenly  # noqa: E402
from tests.benchmarks.cycles_truth import set_cycles  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402

PAGE = "refinement"
KEPT = ROOT / "build" / "bench" / "refinement"
WIDTH, HEIGHT, SAMPLES = 480, 360, 256
# Places along each side of a pixel that our pictures look at.
PLACES = 8
# Of the bounces, far below what is measured.
TOLERANCE = 0.003


def low_poly_room():
    """A room of few faces with a window, furniture and a hard sun: shadows end between vertices."""
    build.clear()
    gap = 0.004
    white = build.diffuse("white", (0.75, 0.75, 0.72))
    wood = build.diffuse("wood", (0.55, 0.38, 0.22))
    build.grid("floor", 25, -2, 2, build.diffuse("floor", (0.6, 0.55, 0.5)))
    back = build.grid("back", 21, -2, 2, white)
    back.location, back.rotation_euler = (0, 2 + gap, 2 + gap), (np.pi / 2, 0, 0)
    right = build.grid("right", 21, -2, 2, build.diffuse("blue", (0.3, 0.45, 0.65)))
    right.location, right.rotation_euler = (2 + gap, 0, 2 + gap), (0, -np.pi / 2, 0)
    left = build.grid("left", 21, -2, 2, white)
    left.location, left.rotation_euler = (-2 - gap, 0, 2 + gap), (0, np.pi / 2, 0)
    # A window of 6 x 6 faces with a bar across.
    n = 20
    across = [row * n + column for row in range(7, 13) for column in range(7, 13) if row != 10]
    import bmesh

    mesh = bmesh.new()
    mesh.from_mesh(left.data)
    mesh.faces.ensure_lookup_table()
    bmesh.ops.delete(mesh, geom=[mesh.faces[i] for i in across], context="FACES")
    mesh.to_mesh(left.data)
    mesh.free()

    def block(name, size, place, material, cuts=0):
        bpy.ops.mesh.primitive_cube_add(size=1, location=place)
        item = build.added(name, material)
        item.scale = size
        if cuts:
            bpy.ops.object.mode_set(mode="EDIT")
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.mesh.subdivide(number_cuts=cuts)
            bpy.ops.object.mode_set(mode="OBJECT")
        build.apply_all(item)

    block("table", (1.2, 0.8, 0.06), (0.3, 0.4, 0.8), wood, 3)
    for number, (x, y) in enumerate([(-0.2, 0.1), (0.8, 0.1), (-0.2, 0.7), (0.8, 0.7)]):
        block(f"leg {number}", (0.08, 0.08, 0.76), (x, y, 0.39 + gap), wood, 1)
    block("crate", (0.6, 0.6, 0.6), (-0.9, -0.6, 0.3 + gap), wood, 2)
    block("shelf", (0.1, 1.2, 1.4), (1.7, 1.0, 0.7 + gap), wood, 3)
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=24, ring_count=12, radius=0.3, location=(0.5, 0.4, 1.135)
    )
    build.added("ball", build.diffuse("ball", (0.7, 0.25, 0.2)), smooth=True)
    bpy.context.scene.world = None
    build.lamp("sun", "SUN", (0, 0, 5), 4, (0.35, -0.75, 0.5), angle=np.radians(0.53))
    build.camera((0.2, -6.6, 2.4), (0, 0, 1.4), lens=40)


def coloured_walls():
    """The scene of that name under its four lamps."""
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "blend_scenes" / "03_coloured_walls.blend"))
    bpy.context.scene.world = None


SCENES = {
    "03_coloured_walls, its four lamps": coloured_walls,
    "low-poly room, hard sun": low_poly_room,
}


def truths(name):
    """Two (height, width, 3) renders by Cycles of the scene that is open."""
    KEPT.mkdir(parents=True, exist_ok=True)
    pictures = []
    for seed in (1, 2):
        path = KEPT / f"{name.split(',')[0].replace(' ', '_')}_{SAMPLES}_{seed}.npy"
        if not path.exists():
            np.save(path, rendered(seed))
        pictures.append(np.load(path))
    return pictures


def rendered(seed):
    scene = bpy.context.scene
    set_cycles(scene, SAMPLES, seed)
    scene.cycles.pixel_filter_type = "BOX"
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    with tempfile.TemporaryDirectory() as folder:
        render.filepath = str(Path(folder) / "view.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        pixels = np.empty(WIDTH * HEIGHT * 4, np.float32)
        image.pixels.foreach_get(pixels)
    return pixels.reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]


def read():
    """Meshes, lamps and camera of the scene that is open."""
    scene, messages, seen = bpy.context.scene, [], []

    def see(depsgraph):
        seen.extend(see_lamps(depsgraph.scene, depsgraph, messages))

    camera = read_camera(scene, messages)
    meshes = run(read_meshes_steps(scene.session_uid, None, (), messages, True, None, see))
    return meshes, [lamp_seen(each, scene, messages) for each in seen], camera


def picture(meshes, lamps, camera):
    """Our picture of meshes under lamps."""
    scene = Scene.from_meshes(meshes)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bake.prt"
        run(bake_steps(scene, path, BakeSettings(resolution=16, tolerance=TOLERANCE), lamps))
        bake = load(path)
        relighter = Relighter(bake)
        radiance = run(relighter.steps(Lighting(lamps=lamps, lamp_samples=256)))
        relighter.close()
        caster = bake.make_caster("auto", "camera")
        rays = CameraRays(bake.scene, caster, camera, WIDTH, HEIGHT, PLACES)
        caster.close()
        return rays.picture(radiance), _of_one_object(bake.scene, rays)


def _of_one_object(scene, rays):
    """(height, width) bool: pixels all of whose samples show the same object."""
    shown = np.where(rays.triangle >= 0, scene.triangle_object[rays.triangle], -1)
    shown = shown.reshape(HEIGHT, PLACES, WIDTH, PLACES)
    first = shown[:, :1, :, :1]
    return (shown == first).all(axis=(1, 3)) & (first[:, 0, :, 0] >= 0)


def error(ours, truths, pixels=slice(None)):
    """Relative L2 error of some pixels, without the noise of the truth."""
    ours, one, two = (image.astype(np.float64)[pixels] for image in (ours, *truths))
    return float(np.sqrt(max(((ours - one) * (ours - two)).mean(), 0) / (one * two).mean()))


def vertices(meshes):
    return sum(len(mesh.vertices) for mesh in meshes)


def variants(meshes, lamps):
    """Meshes by what was done to them."""
    yield "as it is", meshes
    for budget in ("1.5x",):
        settings = RefineSettings(tolerance=1e-4, vertices=budget)
        refined, told = run(refine_steps(meshes, lamps, None, settings))
        print(told)
        yield f"refined, {budget}", refined
    yield "all edges split", split_evenly(meshes)


def section(name, pictures=None):
    """Lines of one scene's section: an error and its share of that of the mesh as it is."""
    lines = [
        f"`{name}`. Relative L2 of {WIDTH} x {HEIGHT} pixels to Cycles' render from the camera, "
        f"two of {SAMPLES} samples; bakes at a tolerance of {TOLERANCE}, relit by the scene's "
        f"lamps with 256 shadow rays and shown at {PLACES} x {PLACES} places of each pixel. Noise "
        "of Cycles' renders is not in the figures: a squared error is the product of the "
        "differences to either of two seeds. Refinement was held by its vertices alone. *All edges "
        "split* is what one level of simple subdivision gives.",
        "",
        "| mesh | vertices | times | all pixels | as it is | of one object | as it is |",
        "|---" * 7 + "|",
    ]
    SCENES[name]()
    meshes, lamps, camera = read()
    truth = truths(name)
    first = None
    for kind, finer in variants(meshes, lamps):
        ours, inside = picture(finer, lamps, camera)
        off = error(ours, truth), error(ours, truth, inside)
        first = first or off
        lines.append(row(kind, vertices(finer), vertices(meshes), off, first))
        print(lines[-1], flush=True)
        if pictures:
            write_png(Path(pictures) / f"{name[:2]}_{kind.replace(' ', '_')}.png", to_srgb(ours))
    if pictures:
        write_png(Path(pictures) / f"{name[:2]}_cycles.png", to_srgb(truth[0]))
    return lines


def row(kind, count, before, off, first):
    return (
        f"| {kind} | {count:,} | {count / before:.2f} | {off[0]:.2%} | {off[0] / first[0]:.2f} "
        f"| {off[1]:.2%} | {off[1] / first[1]:.2f} |"
    )


SECTIONS = {
    "Four lamps": partial(section, "03_coloured_walls, its four lamps"),
    "A hard sun": partial(section, "low-poly room, hard sun"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only")
    parser.add_argument("--pictures")
    options = parser.parse_args()
    if options.pictures:
        for name in SCENES:
            if not options.only or options.only in name:
                section(name, options.pictures)
    else:
        chosen = {
            k: v for k, v in SECTIONS.items() if not options.only or options.only in v.args[0]
        }
        write_sections(PAGE, chosen)


if __name__ == "__main__":
    main()
