"""The same with the objects in hand, a bounce more or less and another albedo.

python examples/objects.py SCENE.blend LIGHT.exr
"""

import sys

import numpy as np

from prt_core import BakeSettings, EnvironmentMap, Scene, bake_steps, load, open_blend, run
from prt_core.evaluate import render_view, to_display, write_png

blend, image = sys.argv[1:3]
open_blend(blend)
from prt_core.blender import read_meshes  # noqa: E402  (needs bpy)

scene = Scene.from_meshes(read_meshes())
settings = BakeSettings(resolution=16, tolerance=0.01, caster="auto")
steps = bake_steps(scene, "example_objects.prt", settings, restart=True)
run(steps, lambda p: print(f"\r{p.stage} {p.done:,} of {p.total:,}", end=""))

bake = load("example_objects.prt")
transport = bake.transport
light = EnvironmentMap.read(image).to_cube_map(bake.cube_map, rotation=45)
direct = transport.radiance(light, bounces=0)
everything = transport.radiance(light)
print(f"\nbounces add {everything.mean() / direct.mean() - 1:.1%}")

# The bake does not know the albedo: T follows when it changes.
transport.albedo = np.full_like(transport.albedo, 0.9)
caster = bake.make_caster(rays="camera")
picture = render_view(bake, transport.radiance(light), caster)
write_png("example_objects.png", to_display(picture, bake.view_transform))
