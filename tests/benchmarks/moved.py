"""What a bake costs that reuses the one before a change: `prt bake --reuse`.

python tests/benchmarks/results.py --only moved    into docs/benchmarks

Ten objects, 60 thousand points. One is moved, added, deleted, deformed, painted; each time the new
scene is baked whole, from the old bake, and with every entry of the visibility traced, in one
process, by CPU seconds. All are relit under three lights, one of them a hard sun; both bakes are
held against the third.
"""

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
from prt_core.scene import Scene  # noqa: E402
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


def changes(meshes):
    """Name -> the meshes after a change of one of ten objects."""

    def without(name):
        return {key: mesh for key, mesh in meshes.items() if key != name}

    def shifted(name, *by):
        mesh = meshes[name]
        return {**meshes, name: replace(mesh, vertices=mesh.vertices + np.array(by))}

    ring = meshes["ring 1"]
    bent = ring.vertices + 0.06 * np.sin(6 * ring.vertices[:, [2, 0, 1]])
    ball = meshes["ball 1"]
    added = replace(ball, name="ball 3", vertices=ball.vertices + [0.6, -0.65, 0])
    return {
        "a ball is moved": shifted("ball 1", 0.25, 0.1, 0),
        "Suzanne is moved": shifted("monkey 1", 0.3, -0.2, 0),
        "a ball is added": {"ball 3": added, **meshes},
        "a ball is deleted": without("ball 1"),
        "a ring is deformed": {**meshes, "ring 1": replace(ring, vertices=bent)},
        "a ball is painted": {
            **meshes,
            "ball 1": replace(ball, materials=ball.materials.replaced(
                albedo=np.full_like(ball.materials.albedo, 0.2)
            )),
        },
    }  # fmt: skip


def lights(cube_map):
    """Three lights: an even sky, a low soft sun, and one as hard as a texel."""
    even = np.ones((cube_map.n_directions, 3), np.float32)
    soft, hard = (
        (0.05 * even + sun_light(cube_map, way, [3, 3, 3.0], angle=angle)).astype(np.float32)
        for way, angle in (([0.7, 0.3, 0.5], 0.4), ([-0.5, -0.3, 0.7], 0.05))
    )
    return {"even sky": even, "low soft sun": soft, "hard sun": hard}


def baked(meshes, path, settings=SETTINGS, **options):
    """A bake's report and its CPU seconds, reading of the meshes apart."""
    start = time.process_time()
    scene = Scene.from_meshes(list(meshes.values()))
    report = run(bake_steps(scene, path, settings, **options))
    return report, time.process_time() - start


def apart(path, other):
    """Relative difference of what two bakes show under each light, in Blender's corners."""
    one, two = load(path), load(other)
    result = {}
    for name, light in lights(one.cube_map).items():
        colours = [bake.colours(bake.transport.radiance(light)) for bake in (one, two)]
        a, b = (
            np.concatenate([each[key] for key in sorted(each)]).astype(np.float64)
            for each in colours
        )
        result[name] = np.linalg.norm(a - b) / np.linalg.norm(b)
    return result


def cost_and_error():
    """Lines of the table."""
    meshes = ten_objects()
    yield (
        "Ten objects, Embree. Seconds are those of the processor, all threads together; shares are "
        "those of a whole bake of the changed scene in the same run. Light is wrong by what relit "
        "colours, bounces and all, differ from those of a bake that traced every entry: those of "
        "the bake that reused, and in brackets those of the whole one. Both have a tolerance of "
        f"{SETTINGS.tolerance:.0%}, which nothing certifies for a sun of one texel."
    )
    yield ""
    yield "| what | points | asked anew | rays | seconds | even sky | low soft sun | hard sun |"
    yield "|---" * 8 + "|"
    with tempfile.TemporaryDirectory() as folder:
        before, whole, part, every = (Path(folder) / f"{n}.prt" for n in range(4))
        baked(meshes, before)
        for name, after in changes(meshes).items():
            report, seconds = baked(after, whole, restart=True)
            reused, less = baked(after, part, restart=True, reuse=before)
            baked(after, every, replace(SETTINGS, method="exhaustive"), restart=True)
            own, others = apart(part, every), apart(whole, every)
            print(name, less / seconds, reused["reused"]["line"], own, others, flush=True)
            yield (
                f"| {name} | {reused['points']:,} | {reused['reused']['points']:,} "
                f"| {reused['rays'] / report['rays']:.0%} | **{less / seconds:.2f}** | "
                + " | ".join(f"{own[light]:.2%} ({others[light]:.2%})" for light in own)
                + " |"
            )


SECTIONS = {"One of ten objects": lambda: list(cost_and_error())}

if __name__ == "__main__":
    write_sections(PAGE, SECTIONS)
