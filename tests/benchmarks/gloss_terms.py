"""How many in-out terms relit colours need: `python -m tests.benchmarks.gloss_terms [SIZE [SKY]]`.

Points that see the whole sky, their normals and views even over what can be, under the skies that
come with Blender (or one of them), against the sum of the BRDF over all texels. Without shadows.
"""

import sys
import time

import numpy as np

from prt_core.blender.studio import ALL, studio_paths
from prt_core.light import EnvironmentMap
from prt_core.reflectance import (
    AshikhminShirley,
    Lambert,
    Microfacet,
    Phong,
    Sum,
    in_out_factors,
    local_frames,
)
from prt_core.sphere import CubeMap

N_POINTS, N_TERMS = 256, 160
CUBE = CubeMap(32)
LOBES = {
    "Phong 5": Phong(5),
    "Phong 10": Phong(10),
    "Phong 10, half diffuse": Sum([Lambert(0.5), Phong(10, 0.5)]),
    "Phong 20": Phong(20),
    "Ashikhmin-Shirley 10, 100": AshikhminShirley(10, 100),
    "GGX 0.8": Microfacet(0.64, 0.64),
    "GGX 0.6": Microfacet(0.36, 0.36),
    "GGX 0.5": Microfacet(0.25, 0.25),
    "GGX 0.4": Microfacet(0.16, 0.16),
}


def points():
    """Directions to all texels (n, m, 3) and to the viewer (n, 1, 3), in frames of the points."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(N_POINTS, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosine, turn = rng.uniform(0.2, 1, N_POINTS), rng.uniform(0, 2 * np.pi, N_POINTS)
    flat = np.sqrt(1 - cosine**2)
    outgoing = np.stack([flat * np.cos(turn), flat * np.sin(turn), cosine], axis=-1)[:, None]
    incoming = np.einsum("nij,mj->nmi", local_frames(normals), CUBE.directions)
    return incoming.astype(np.float32), outgoing.astype(np.float32)


def needed(errors, most):
    """The first number of terms from which on the error stays below `most`, or None."""
    above = np.flatnonzero(errors >= most)
    n = int(above[-1]) + 2 if len(above) else 1
    return n if n <= len(errors) else None


def main(size=48, sky=None):
    incoming, outgoing = points()
    skies = [EnvironmentMap.read(path).to_cube_map(CUBE) for path in
             studio_paths([sky] if sky else ALL).values()]  # fmt: skip
    # Each with the same brightness.
    light = np.stack([sky * (CUBE.solid_angles[:, None] / sky.mean()) for sky in skies], axis=1)
    light = light.reshape(CUBE.n_directions, -1).astype(np.float32)
    for name, lobe in LOBES.items():
        start = time.process_time()
        factors = in_out_factors(lobe, N_TERMS, size)
        seconds = time.process_time() - start
        truth, terms = [], []
        for first in range(0, N_POINTS, 16):
            part = slice(first, first + 16)
            value = lobe.eval(incoming[part], outgoing[part])[..., 0]
            truth.append(value * np.maximum(incoming[part][..., 2], 0) @ light)
            taken = factors.incoming_factor(slice(None), incoming[part])
            sent = factors.outgoing_factor(slice(None), outgoing[part])[:, 0]
            terms.append(np.einsum("nmk,ml->nkl", taken, light, optimize=True) * sent)
        truth, terms = np.concatenate(truth), np.cumsum(np.concatenate(terms), axis=1)
        off = np.linalg.norm(terms - truth[:, None], axis=(0, 2)) / np.linalg.norm(truth)
        print(f"{name:26} 4 terms {off[3]:.1%}; 5 % {needed(off, 0.05)}, 2 % {needed(off, 0.02)}, "
              f"{N_TERMS} {off[-1]:.2%} (of the lobe {factors.error:.1%}), {seconds:.1f} s",
              flush=True)  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
