import numpy as np
import pytest

from prt_core import Scene, run
from prt_core.sampling.tracer import Tracer
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import unpack
from tests.meshes import caster_of, plane, sphere


@pytest.mark.parametrize("n_pairs", [0, 1, 4000])
def test_an_entry_that_is_named_often_is_traced_once(n_pairs):
    scene = Scene.from_meshes([sphere(8, 0.4, (0, 0, 0.5), name="ball"), plane(9, -1, 1)])
    cube_map, caster, printed = CubeMap(4), caster_of(scene), []
    rng = np.random.default_rng(0)
    point = rng.integers(0, 12, n_pairs)
    direction = rng.integers(0, cube_map.n_directions, n_pairs)
    normals = scene.points.geometric_normals[point]
    above = np.einsum("ij,ij->i", normals, cube_map.samples[direction]) > 0
    point, direction = point[above], direction[above]
    tracer = Tracer(scene, cube_map, caster, printed.append)
    free = run(tracer.trace_pairs(point, direction))
    n_entries = len(set(zip(point.tolist(), direction.tolist(), strict=True)))
    assert tracer.rays == sum(printed) == n_entries and (n_pairs < 2 or n_entries < len(point))
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    bits = unpack(truth, cube_map.n_directions)[point, direction]
    shading = np.einsum("ij,ij->i", scene.points.normals[point], cube_map.vectors[direction]) > 0
    np.testing.assert_array_equal(free[shading], bits[shading] > 0)
