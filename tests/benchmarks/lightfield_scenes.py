"""Scenes like those of Miandji et al. 2013, captured by Cycles, compressed, and seen beside it.

    python tests/benchmarks/lightfield_scenes.py [NAME …]   # captures, and what each is

Their figure 4: a sphere over a plane, of one glossy material, and three small lamps. Their figure
1: translucent, gold and glossy; silver and glossy under ten lamps; a gold ring and its caustics.
Fields are kept in build/bench/lightfield and made where they are missing; pictures go into docs.
"""

import math
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "blend_scenes")]

import build  # noqa: E402
import prt_core.blender  # noqa: E402, F401
from prt_core import PRTError, light_field  # noqa: E402
from prt_core.bake.light_field import points_of  # noqa: E402
from prt_core.bake.light_field_load import load_light_field  # noqa: E402
from prt_core.bake.light_field_view import field_picture, view_of  # noqa: E402
from prt_core.blender.camera import read_camera  # noqa: E402
from prt_core.blender.light_field_scene import light_field_camera  # noqa: E402
from prt_core.blender.passes.traces import no_output  # noqa: E402
from prt_core.blender.small_render import small_render  # noqa: E402
from prt_core.evaluate import contact_sheet, to_srgb, write_png  # noqa: E402
from prt_core.lightfield import SurfaceLightField  # noqa: E402

FOLDER = ROOT / "build" / "bench" / "lightfield"
ANGLES, PEAK = (32, 16), 40.0
WIDTH, HEIGHT, CYCLES_SAMPLES = 200, 150, 64
ALPHAS = (0.5, 0.05, 0.005)
GOLD, SILVER = (1.0, 0.77, 0.34), (0.96, 0.95, 0.91)


@dataclass(frozen=True)
class Case:
    """A scene, and what is taken of it.

    Attributes
    ----------
    build : callable
        Makes it the open scene.
    samples : int
        Paths of each direction.
    psnr : float
        Decibels of equation 5 that its compressed form reaches.
    objects : tuple of str, or None for all
    grid : int, optional
        Points along a side, over the object; default: its vertices.
    paper_percent : float, optional
        What the paper's scene of this kind takes of raw.
    """

    build: object
    samples: int
    psnr: float
    objects: tuple | None = None
    grid: int | None = None
    paper_percent: float | None = None


def material(name, diffuse=None, metal=None, alpha=0.05, share=0.5):
    """A diffuse colour and GGX gloss of an alpha, mixed; or one of them alone."""
    made = build.diffuse(name, diffuse or (0, 0, 0))
    if metal is None:
        return made
    tree = made.node_tree
    gloss, output = tree.nodes.new("ShaderNodeBsdfAnisotropic"), tree.nodes["Material Output"]
    gloss.distribution = "GGX"
    # Cycles squares what its slider says.
    gloss.inputs["Roughness"].default_value = math.sqrt(alpha)
    gloss.inputs["Color"].default_value = (*metal, 1)
    if diffuse is None:
        tree.links.new(gloss.outputs[0], output.inputs["Surface"])
        return made
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = share
    tree.links.new(tree.nodes["Diffuse BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(gloss.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return made


def translucent(name, colour):
    """Light that walks within, as through wax."""
    made = build.principled(name, colour)
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Subsurface Weight"].default_value = 1
    inputs["Subsurface Radius"].default_value = (1.0, 0.5, 0.3)
    inputs["Subsurface Scale"].default_value = 0.3
    return made


def small_lamp(name, place, radius, colour=(1, 1, 1), radiance=PEAK):
    """A lamp that is a ball of a radiance."""
    watts = radiance * 4 * math.pi**2 * radius**2
    return build.lamp(name, "POINT", place, watts, shadow_soft_size=radius, color=colour)


def ball(name, place, radius, made, segments=24):
    """A sphere without a UV map, so that a grid goes all over it."""
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=segments, ring_count=segments // 2, radius=radius, location=place, calc_uvs=False
    )
    item = build.added(name, made, smooth=True)
    build.apply_all(item)
    return item


def dark():
    """An empty scene under a black sky."""
    build.clear()
    world = bpy.context.scene.world
    world.node_tree.nodes["Background"].inputs[0].default_value = (0, 0, 0, 1)
    # Every direction of a light field is a picture of its own: no noise that is even over pixels.
    bpy.context.scene.cycles.sampling_pattern = "TABULATED_SOBOL"


def sphere_on_plane(alpha):
    """Figure 4's scene at a roughness."""
    dark()
    shared = material("shared", (0.45, 0.3, 0.22), (0.9, 0.9, 0.9), alpha)
    ball("sphere", (0, 0, 1), 1, shared, 96)
    build.grid("floor", 2, -4, 4, shared)
    small_lamp("warm", (2.5, -2.0, 3.0), 0.2, (1, 0.95, 0.85))
    small_lamp("cold", (-2.8, -1.0, 2.2), 0.15, (0.75, 0.85, 1))
    small_lamp("red", (0.5, 2.8, 2.6), 0.12, (1, 0.8, 0.7))
    build.camera((1.2, -4.6, 2.2), (0, 0, 0.95))


def translucent_gold_glossy():
    """Figure 1a: an area lamp and three small ones."""
    dark()
    build.grid("floor", 64, -2.4, 2.4, material("floor", (0.4, 0.4, 0.42)))
    ball("wax", (-1.1, 0.1, 0.6), 0.6, translucent("wax", (0.8, 0.5, 0.4)), 96)
    ball("gold", (0.15, 0.5, 0.6), 0.6, material("gold", None, GOLD, 0.05), 96)
    glossy = material("glossy", (0.1, 0.2, 0.45), (0.8, 0.8, 0.8), 0.05, 0.3)
    ball("glossy", (1.2, -0.3, 0.5), 0.5, glossy, 96)
    disk = {"shape": "DISK", "size": 1.6}
    build.lamp("disk", "AREA", (0, -0.5, 4), 120, **disk)
    small_lamp("one", (2.5, -2.0, 3.0), 0.2)
    small_lamp("two", (-2.8, -1.0, 2.6), 0.15, (0.75, 0.85, 1))
    small_lamp("three", (0.5, 2.8, 2.6), 0.15, (1, 0.8, 0.7))
    build.camera((0.4, -5.4, 2.9), (0, 0, 0.4))


def silver_and_glossy():
    """Figure 1b: ten small lamps in a ring."""
    dark()
    floor = material("floor", (0.3, 0.26, 0.22), (0.6, 0.6, 0.6), 0.2, 0.3)
    build.grid("floor", 64, -2.4, 2.4, floor)
    ball("silver", (-0.9, 0.2, 0.7), 0.7, material("silver", None, SILVER, 0.03), 96)
    for i, alpha in enumerate((0.2, 0.05)):
        glossy = material(f"glossy {alpha}", (0.35, 0.1 + 0.2 * i, 0.1), (0.8,) * 3, alpha, 0.4)
        ball(f"glossy {alpha}", (0.55 + 0.75 * i, 0.5 - 0.9 * i, 0.45), 0.45, glossy, 96)
    for i in range(10):
        angle = 2 * math.pi * i / 10
        place = 3 * math.cos(angle), 3 * math.sin(angle), 2.4 + 0.4 * (i % 2)
        small_lamp(f"lamp {i}", place, 0.12)
    build.camera((0.4, -5.4, 2.9), (0, 0, 0.4))


def gold_ring():
    """Figure 1c: a ring lies on a diffuse plane that gets its caustics; six small lamps."""
    dark()
    build.grid("floor", 72, -2, 2, material("floor", (0.5, 0.48, 0.45)))
    bpy.ops.mesh.primitive_torus_add(
        major_segments=160, minor_segments=32, major_radius=0.8, minor_radius=0.16,
        location=(0, 0, 0.16), generate_uvs=False,
    )  # fmt: skip
    build.apply_all(build.added("ring", material("gold", None, GOLD, 0.01), smooth=True))
    for i in range(6):
        angle = 2 * math.pi * (i + 0.3) / 6
        small_lamp(f"lamp {i}", (2.6 * math.cos(angle), 2.6 * math.sin(angle), 2.2), 0.2)
    build.camera((0.2, -3.9, 2.6), (0, 0, 0.05))


def soft_materials():
    """Wax, satin gold and satin lacquer in soft light: lobes and shadows wider than the field's
    angles and points."""
    dark()
    build.grid("floor", 48, -2, 2, material("floor", (0.4, 0.4, 0.42)))
    ball("wax", (-1.15, 0.1, 0.55), 0.55, translucent("wax", (0.8, 0.5, 0.4)), 48)
    ball("gold", (0.05, 0.4, 0.55), 0.55, material("gold", None, GOLD, 0.3), 48)
    lacquer = material("lacquer", (0.1, 0.2, 0.45), (0.8, 0.8, 0.8), 0.25, 0.3)
    ball("lacquer", (1.15, -0.2, 0.5), 0.5, lacquer, 48)
    build.lamp("panel", "AREA", (0.5, -1.5, 3.5), 160, shape="DISK", size=2.4)
    small_lamp("side", (-3.2, -1.0, 2.6), 0.8, (0.75, 0.85, 1), 8)
    build.camera((0.3, -4.6, 2.5), (0, 0, 0.3))


CASES = {
    f"sphere_{alpha}": Case(lambda a=alpha: sphere_on_plane(a), 32, 45.0, ("sphere",), 32)
    for alpha in ALPHAS
} | {
    "translucent_gold_glossy": Case(translucent_gold_glossy, 32, 65.0, paper_percent=12.0),
    "silver_and_glossy": Case(silver_and_glossy, 16, 59.95, paper_percent=11.0),
    "gold_ring": Case(gold_ring, 16, 67.55, paper_percent=3.6),
    "soft_materials": Case(soft_materials, 16, 60.0),
}


def open_case(name):
    """Make a case the open scene."""
    CASES[name].build()
    # Matrices are those of the places from here on.
    bpy.context.view_layer.update()
    return bpy.context.scene


def captured(name):
    """The `LightField` of a case, captured where it is missing."""
    case, path = CASES[name], FOLDER / f"{name}.slf"
    if not (path / "zarr.json").exists() or not _complete(path):
        FOLDER.mkdir(parents=True, exist_ok=True)
        open_case(name)
        light_field(
            None, path, objects=case.objects, grid=case.grid, hidden=0, angles=ANGLES,
            samples=case.samples, denoise=True,
        )  # fmt: skip
    return load_light_field(path)


def _complete(path):
    try:
        load_light_field(path)
    except PRTError as error:
        if "not finished" in str(error):
            return False
        raise
    return True


@cache
def denoised(name):
    """(n, m1, m2, 3): a case's field with the denoiser's result everywhere, and what that does.

    The capture keeps the noise of what loses energy by it, which is right for pictures. Tables of
    decibels cannot have it: noise of 17 % is an error of its own, larger than the codings'.

    Returns
    -------
    (n, m1, m2, 3) float32
    float
        Its sum as a share of the captured one.
    """
    field = captured(name)
    noisy = field.radiance[:]
    if field.report["denoised"] == 1:
        return noisy[0], 1.0
    camera, _ = light_field_camera(open_case(name).session_uid, field.scene)
    clean = camera.denoise(noisy, points_of(field.scene), field.report["samples"])
    return clean[0], float(clean.sum(dtype=np.float64) / noisy.sum(dtype=np.float64))


def arrays_of(name):
    """radiance (n, m1, m2, 3), frames, positions: as the tables of light fields take them."""
    field = captured(name)
    positions = field.scene.to_world(field.scene.points.positions[field.point])
    return denoised(name)[0], field.frames, positions.astype(np.float32)


@cache
def compressed(name, psnr):
    """A case's `SurfaceLightField` by CEOB, its error, and the seconds of the fit."""
    radiance, frames, _ = arrays_of(name)
    began = time.perf_counter()
    model = SurfaceLightField("ceob", psnr=psnr, peak=PEAK).fit(radiance, frames)
    return model, model.error(radiance), time.perf_counter() - began


def cycles_picture(seed, samples=CYCLES_SAMPLES):
    """(HEIGHT, WIDTH, 3): the open scene from its camera."""
    scene = bpy.context.scene
    with small_render(scene) as render:
        target = render.scene
        for item in scene.objects:
            target.collection.objects.link(item)
        target.world, target.camera = scene.world, scene.camera
        for setting in ("max_bounces", "diffuse_bounces", "glossy_bounces", "sampling_pattern"):
            setattr(target.cycles, setting, getattr(scene.cycles, setting))
        target.cycles.blur_glossy, target.cycles.seed = 0, seed
        with no_output():
            return render.pixels(WIDTH, HEIGHT, samples)


def field_seen(field, camera, model=None, shown=True):
    """A picture of a field by `model`, or white where it has points that are `shown`."""
    caster = field.scene.make_caster(rays="camera")
    try:
        values = np.zeros((len(field.scene.points), 3), np.float32)
        if model is None:
            values[field.point] = np.broadcast_to(shown, field.point.shape)[:, None]
        else:
            positions = field.scene.to_world(field.scene.points.positions[field.point])
            values[field.point] = model.toward(view_of(camera).outgoing(positions))
        return field_picture(field, values, camera, caster, WIDTH, HEIGHT)
    finally:
        caster.close()


@cache
def beside_cycles(name):
    """Relative L2 of the rebuilt view and of Cycles' other seed, by object, and three pictures.

    Of pixels that show captured objects alone, without their lamps.

    Returns
    -------
    dict of str to (float, float)
        Of all of them ("all"), and of each by its name where there are several.
    list of (str, ndarray)
        The rebuilt view, Cycles' and their difference.
    """
    field = captured(name)
    model = compressed(name, CASES[name].psnr)[0]
    camera = read_camera(open_case(name))
    truth, other = (cycles_picture(seed) for seed in (1, 2))
    ours = field_seen(field, camera, model)

    def away(seen):
        size = np.linalg.norm(truth[seen].astype(np.float64))
        return tuple(
            float(np.linalg.norm(picture[seen].astype(np.float64) - truth[seen]) / size)
            for picture in (ours, other)
        )

    def seen_of(shown):
        return field_seen(field, camera, shown=shown).min(axis=2) > 0.999

    seen = seen_of(True)
    rows = {"all": away(seen)}
    of_point = field.scene.points.object_index[field.point]
    numbers = np.unique(of_point)
    for number in numbers if len(numbers) > 1 else ():
        rows[field.scene.objects[number].name] = away(seen_of(of_point == number))
    stops = -np.log2(max(float(np.percentile(truth[seen].max(axis=-1), 97)), 1e-6))
    difference = np.where(seen[..., None], np.abs(ours - truth), 0)
    shown = [to_srgb(picture, stops) for picture in (ours, truth, difference)]
    labels = ["light field", f"Cycles, {CYCLES_SAMPLES} samples", "difference"]
    return rows, list(zip(labels, shown, strict=True))


def write_sheet(path, pictures):
    """Rows of three pictures."""
    labels, images = zip(*pictures, strict=True)
    write_png(path, contact_sheet(list(images), list(labels), 3))


def main(names):
    for name in names or CASES:
        report = captured(name).report
        print(
            f"{name}: {report['points']:,} points, noise {report['noise']:.1%}, "
            f"{report['seconds']:.0f} s, {(report['paths_per_second'] or 0) / 1e3:.0f} k paths/s, "
            f"denoised {report['denoised']}, {report['messages']}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
