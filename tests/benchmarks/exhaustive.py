"""Every entry of the visibility of a measuring scene, kept under PRT_CACHE (/tmp).

python -m tests.benchmarks.exhaustive    traces those of all measuring scenes
"""

import os

import numpy as np

from prt_core.blender.measuring import CACHE, MODELS, measuring_scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits


def exhaustive_bits(name, scene, cube_map, caster="embree"):
    """Every entry traced; kept by the digest of the scene. (n_points, n_bytes) uint8."""
    key = f"{name}_{caster}_{cube_map.resolution}_{scene.fingerprint()[:16]}.npy"
    kept = CACHE / "truth" / key
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        tracer = scene.make_caster(caster)
        bits = visibility_bits(scene, cube_map, tracer, slice(0, len(scene.points)))
        tracer.close()
        part = kept.with_suffix(f".{os.getpid()}.part")
        with part.open("wb") as file:
            np.save(file, bits)
        part.replace(kept)
    return np.load(kept)


def _main():
    for name in MODELS:
        scene = measuring_scene(name)
        bits = exhaustive_bits(name, scene, CubeMap(32))
        counts = np.bincount(scene.points.object_index)
        shares = np.unpackbits(bits, axis=1).mean(axis=1)
        seen = [shares[scene.points.object_index == i].mean() for i in range(2)]
        print(f"{name}: {len(scene.points):,} points {counts}, seen {np.round(seen, 4)}")


if __name__ == "__main__":
    _main()
