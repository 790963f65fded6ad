"""Bake a .blend and relight it: python examples/one_call.py SCENE.blend LIGHT.exr"""

import sys

import prt_core

blend, light = sys.argv[1:3]
prt_core.bake(blend, "example.prt")
colours = prt_core.relight("example.prt", light, rotation=30)
for name, values in colours.items():
    print(f"{name}: {len(values):,} corners, mean radiance {values.mean():.3f}")
