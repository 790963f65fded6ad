"""Blender's casters below surfaces that let light pass: the bits and hits of brute force."""

import numpy as np
import pytest

from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import gather_hits, visibility_bits
from tests.meshes import plane


@pytest.mark.parametrize("name", ["blender", "bvhtree"])
def test_blender_decides_as_brute_force_does(name):
    meshes = [plane(3, name="floor")]
    for i, share in enumerate((0.3, 0.6)):
        pane = plane(2, -7, 7, name=f"pane {i}", z=0.3 + 0.4 * i, receives=False)
        shares = np.full((len(pane.materials), 1), share)
        pane.materials = pane.materials.replaced(opacity=shares)
        meshes.append(pane)
    scene = Scene.from_meshes(meshes, max_hidden=0)
    every = slice(0, len(scene.points))
    bits, ends = [], []
    for caster in ("brute", name):
        rays = scene.make_caster(caster, resolution=5)
        try:
            bits.append(visibility_bits(scene, CubeMap(5), rays, every))
            ends.append(gather_hits(scene, rays, every, 3, 0).hits)
        finally:
            rays.close()
    assert 0.1 < np.unpackbits(bits[0]).mean() < 0.4
    np.testing.assert_array_equal(*bits)
    assert (ends[0] != ends[1]).mean() < 0.005
