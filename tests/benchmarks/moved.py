"""What a bake costs that reuses the one before a change: `prt bake --reuse`.

python tests/benchmarks/moved.py    into docs/benchmarks

Ten objects, 60 thousand points. One is moved, added, deleted, deformed; each time the new scene is
baked whole and from the old bake, in one process, by CPU seconds. Both are relit under three
lights, one of them a hard sun, and held against each other: what differs is the error of both.
"""

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "blend_scenes")]

import build  # noqa: E402
from prt_core.bake import BakeSettings, bake_steps  # noqa: E402
from prt_core.bake.load import load  # noqa: E402
from prt_core.blender.depsgraph import read_meshes_steps  # noqa: E402
from prt_core.light import sun_light  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from prt_core.scene import Scene, mesh_digests  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402

PAGE = "moved"
SETTINGS = BakeSettings(caster="embree")
# Where objects stand, in rows of three.
STEP = 1.3


def ten_objects():
    """Three of Suzanne, three rings, three balls and the ground under them: a dict of meshes."""
    build.clear()
    build.grid("ground", 145, -2.6, 2.6, build.diffuse("floor", (0.5, 0.5, 0.5)))
    clay = build.diffuse("clay", (0.7, 0.6, 0.5))
    for column in range(3):
        place = (column - 1) * STEP
        item = build.suzanne(f"monkey {column}", clay, 2, 0.8)
        item.location = place, -STEP, 0.002
        bpy.ops.mesh.primitive_torus_add(
            major_segments=64, minor_segments=40, major_radius=0.3, minor_radius=0.12,
            location=(place, 0, 0.43), rotation=(np.pi / 2, 0, 0.4 * column),
        )  # fmt: skip
        build.added(f"ring {column}", clay, smooth=True)
        bpy.ops.mesh.primitive_ico_sphere_add(
            subdivisions=5, radius=0.3, location=(place, STEP, 0.302)
        )
        build.added(f"ball {column}", clay, smooth=True)
    bpy.context.view_layer.update()
    meshes = run(read_meshes_steps(bpy.context.scene.session_uid))
    return {mesh.name: mesh for mesh in meshes}
