"""How often the certificate's 95 % interval holds the true error, over many seeds.

python -m tests.benchmarks.certificate_coverage [--seeds 200] [--scene NAME ...] [--json OUT]

For each scene, method and object: the true error, how many intervals of the matrix and of each
light hold it, how many lie below it, and how wide they are. 92 to 98 % of 200 is 184 to 196.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from prt_core.runtime.progress import run
from prt_core.sampling import Sampled, sampler_named
from prt_core.sampling.certificate import CertificateSettings, certificate_steps, probe_lights
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import received_light, unpack
from tests.meshes import plane, sphere

_BLENDS = Path(__file__).resolve().parents[2] / "blend_scenes"


def scene_named(name):
    if name == "balls":
        balls = [sphere(12, 0.4, (x, 0.3 * x, 0.45), name=f"ball {x}") for x in (-0.6, 0.5)]
        return Scene.from_meshes([*balls, plane(31, -1.5, 1.5)])
    from prt_core.blender.depsgraph import read_scene
    from prt_core.blender_access import open_blend

    open_blend(next(_BLENDS.glob(f"{name}*.blend")))
    return read_scene()


def true_errors(scene, cube_map, truth, sampled, lights):
    """{object index: (matrix error, {light: relit error})}."""
    vectors = cube_map.vectors
    result = {}
    for number in np.unique(scene.points.object_index):
        sums = np.zeros(2)
        points = np.flatnonzero(scene.points.object_index == number)
        for first in range(0, len(points), 512):
            subset = points[first : first + 512]
            worth = np.maximum(scene.points.normals[subset] @ vectors.T, 0) ** 2
            right = unpack(truth[subset], cube_map.n_directions)
            wrong = unpack(truth[subset] ^ sampled.bits[subset], cube_map.n_directions)
            sums += (worth * wrong).sum(), (worth * right).sum()
        relit = {}
        for name, light in lights.items():
            normals = scene.points.normals[points]
            right, said = (
                received_light(bits[points], normals, cube_map, light).astype(np.float64)
                for bits in (truth, sampled.bits)
            )
            relit[name] = np.sqrt(((right - said) ** 2).sum() / max((right**2).sum(), 1e-30))
        result[int(number)] = np.sqrt(sums[0] / max(sums[1], 1e-30)), relit
    return result


def coverage(scene, method, cube_map, n_seeds, settings=None, **sampler_settings):
    """Rows of counts for one scene and method."""
    lights = probe_lights(cube_map)
    caster = scene.make_caster("auto")
    sampler, kind = sampler_named(method)
    sampled = run(sampler(scene, cube_map, caster, kind(**sampler_settings)))
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    wanted = true_errors(scene, cube_map, truth, sampled, lights)
    found_of = {}
    for seed in range(n_seeds):
        subset = CertificateSettings(**{**(settings or {}), "seed": seed})
        copy = Sampled(sampled.bits.copy(), sampled.traced.copy(), 0)
        result = run(certificate_steps(scene, cube_map, caster, copy, lights, subset))
        for number, item in zip(sorted(wanted), result, strict=True):
            matrix, relit = wanted[number]
            for name, value, estimate in [
                ("matrix", matrix, item.matrix),
                *((light, relit[light], item.relit[light]) for light in relit),
            ]:
                of = value, estimate.error, estimate.low, estimate.high
                found_of.setdefault((item.name, name), []).append(of)
    caster.close()
    rows = []
    for (item, what), values in found_of.items():
        true, error, low, high = np.transpose(values)
        rows.append({
            "method": method, "object": item, "what": what, "true": float(true[0]),
            "mean_estimate": float(np.sqrt((error**2).mean())),
            "mean_low": float(low.mean()), "mean_high": float(high.mean()),
            "held": int(((low <= true) & (true <= high)).sum()),
            "understated": int((high < true).sum()), "seeds": n_seeds,
        })  # fmt: skip
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--scene", nargs="+", default=["balls", "04", "05"])
    parser.add_argument("--method", nargs="+", default=["agreement"])
    parser.add_argument("--resolution", type=int, default=16)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for name in options.scene:
        scene = scene_named(name)
        for method in options.method:
            for row in coverage(scene, method, CubeMap(options.resolution), options.seeds):
                rows.append({"scene": name, **row})
                print(
                    f"{name} {method} {row['object']:12} {row['what']:8} true {row['true']:.3%} "
                    f"mean {row['mean_estimate']:.3%} from {row['mean_low']:.3%} to "
                    f"{row['mean_high']:.3%} held {row['held']}/{row['seeds']}, "
                    f"understated {row['understated']}",
                    flush=True,
                )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
