"""Bake, relight and save inside Blender, without a window, with the extension installed:

blender -b SCENE.blend --python examples/headless.py -- LIGHT.exr OUTPUT.blend
"""

import sys
from pathlib import Path

import bpy

import prt_core
from prt_core.blender import write_colours

light, output = map(Path, sys.argv[sys.argv.index("--") + 1 :])
store = output.with_suffix(".prt")

# None: the scene that is open. Baked anew where it is not the one that was baked before.
report = prt_core.bake(None, store, resolution=16, restart="changed")
print(f"{report['points']:,} points, {report['rays']:,} rays by {report['back_end']}")

for name, colours in prt_core.relight(store, light).items():
    item = bpy.data.objects.get(name)
    # Curves, texts and instances have no mesh of their own: `prt relight --blend` realises them.
    if item and item.type == "MESH" and len(item.data.loops) == len(colours):
        write_colours(item, colours, name="Baked light")
        print(f"{name}: colours of {len(colours):,} corners")
bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve()), copy=True)
