"""A picture of gloss, shaded by pixels, beside what Cycles renders."""

import bpy
import numpy as np

import build
import prt_core
from prt_core.evaluate.view import CameraRays
from prt_core.light import write_image
from prt_core.relight.relighter import Relighter
from tests.benchmarks.gloss_pictures import cycles_picture
from tests.benchmarks.gloss_scenes import principled, world_image
from tests.conformance.quiet import quiet

SIZE = 64, 48


def smooth_sky():
    """A sky that is bright to one side, without a sun: there is little noise in its renders."""
    angle = np.pi * (1 - (np.arange(64) + 0.5) / 32)[None]
    up = np.pi * (0.5 - (np.arange(32) + 0.5) / 32)[:, None]
    bright = 0.3 + np.exp(3 * (np.cos(up) * np.cos(angle + 1.9) - 1)) + 0.4 * np.sin(up).clip(0)
    return (bright[..., None] * [1.0, 0.8, 0.6]).astype(np.float32)


def ball(name, material, place, radius):
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=24, ring_count=12, radius=radius, location=(*place, radius + 0.004)
    )
    build.added(name, material, smooth=True)


def test_a_picture_of_a_mirror_and_gold_is_that_of_cycles(tmp_path):
    build.clear()
    ball("mirror", principled("mirror", (0.9, 0.9, 0.9), Metallic=1, Roughness=0), (0.6, 0), 0.5)
    ball("gold", principled("gold", (0.9, 0.6, 0.3), Metallic=1, Roughness=0.4), (-0.6, 0), 0.5)
    build.grid("floor", 21, -1.5, 1.5, build.diffuse("floor", (0.3, 0.4, 0.5)))
    build.camera((0.8, -3.6, 1.8), (0, 0, 0.35), 45)
    bpy.context.view_layer.update()
    sky = tmp_path / "sky.exr"
    write_image(sky, smooth_sky())
    world_image(sky)
    with quiet():
        truth = cycles_picture(tmp_path / "truth.exr", *SIZE, 64, 1)
    prt_core.bake(None, tmp_path / "a.prt", gloss=True, method="exhaustive", resolution=16)
    bake = prt_core.load(tmp_path / "a.prt")
    caster = bake.make_caster("blender", "camera")
    rays = CameraRays(bake.scene, caster, bake.camera, *SIZE, 3)
    caster.close()
    relighter = Relighter(bake, "blender")
    picture = relighter.picture(rays, sky)
    # The bake knows the file's own world as well as the image.
    own = relighter.picture(rays, "world")
    coloured = rays.picture(relighter.radiance(sky), relighter.sky(prt_core.Lighting(sky)))
    assert relighter.mirror_rays > 1000
    relighter.close()
    error, before = (
        np.linalg.norm(each - truth) / np.linalg.norm(truth) for each in (picture, coloured)
    )
    assert error < 0.03 < 0.2 < before
    assert np.linalg.norm(own - picture) < 2e-3 * np.linalg.norm(picture)
