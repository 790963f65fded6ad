"""In-out terms whose transport is sampled sparsely, each by itself: figure 20 of the paper.

Huang and Ramamoorthi 2010, section 7: their sampler runs on the matrix of each term. What it is
held against are the same terms with every entry traced, each term again.
"""

import time

import numpy as np

from prt_core.errors import expect, expect_kind
from prt_core.evaluate.metrics import colour_error
from prt_core.reflectance import InOutFactors
from prt_core.runtime.progress import Progress
from prt_core.sampling.agreement import sample_agreement
from prt_core.sampling.huang import sample_huang
from prt_core.sampling.tracer import count_bits
from prt_core.transport import visibility_bits
from prt_core.transport.terms import InOutTransport, TermFactor

# Points whose every entry is traced at once.
_BLOCK = 1024


def term_sampling_steps(scene, cube_map, caster, factors, lights, outgoing, settings=None):
    """Sample each term sparsely and whole, and all of them together; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    factors : InOutFactors
        Of all points.
    lights : dict of str -> (n_directions, n_channels) float
    outgoing : (n_points, 3) float
        Unit vectors to the viewer.
    settings : HuangSettings, optional

    Returns
    -------
    rows : list of dict
        For each term and object: term, object, points, dense_points, dense_angular, dense, sparse,
        entries (all in per cent: of points, of directions, and of all entries of the object), and
        of the term's all objects seconds and whole_seconds, of every entry.
    together : dict
        The bits of sampling by agreement, which serve all terms: entries in per cent, seconds.
    errors : dict of str -> (float, float)
        Relative L2 of relit colours by light, against the same terms of all entries: terms sampled
        by themselves, and together.
    """
    expect_kind("factors", factors, InOutFactors)
    expect(lights, "lights: give at least one")
    n_points, normals = len(scene.points), scene.points.normals
    rows, sparse = [], []
    for k in range(factors.n_terms):
        factor = TermFactor(factors, k, normals, cube_map)
        begun = time.process_time()
        sampled = yield from sample_huang(scene, cube_map, caster, settings, factor=factor)
        spent = time.process_time() - begun
        begun = time.process_time()
        whole = []
        for first in range(0, n_points, _BLOCK):
            part = slice(first, min(first + _BLOCK, n_points))
            whole.append(visibility_bits(scene, cube_map, caster, part))
            yield Progress("every entry", part.stop, n_points)
        seconds = {"seconds": spent, "whole_seconds": time.process_time() - begun}
        sparse.append(sampled.bits)
        rows += [{"term": k, **row, **seconds} for row in _by_object(scene, cube_map, sampled)]
    begun = time.process_time()
    shared = yield from sample_agreement(scene, cube_map, caster)
    together = {
        "entries": 100 * shared.rays / (n_points * cube_map.n_directions),
        "seconds": time.process_time() - begun,
    }
    parts = normals, cube_map
    truth = InOutTransport(np.concatenate(whole), *parts, factors)
    one = InOutTransport(shared.bits, *parts, factors)
    each = [InOutTransport(bits, *parts, factors.only(k)) for k, bits in enumerate(sparse)]
    errors = {}
    for index, (name, light) in enumerate(lights.items()):
        wanted = truth.set_light(light).toward(outgoing)
        received = [form.set_light(light).received for form in each]
        own = truth.receive(np.concatenate(received, axis=1)).toward(outgoing)
        results = own, one.set_light(light).toward(outgoing)
        errors[name] = tuple(colour_error(result, wanted)["l2"] for result in results)
        yield Progress("relit", index + 1, len(lights))
    return rows, together, errors


def _by_object(scene, cube_map, sampled):
    is_dense = np.zeros(len(scene.points), bool)
    is_dense[sampled.dense.points] = True
    traced = count_bits(sampled.traced, axis=1)
    for index, item in enumerate(scene.objects):
        mine = scene.points.object_index == index
        count = int(mine.sum())
        if not count:
            continue
        entries = count * cube_map.n_directions
        of_dense, dense = int((mine & is_dense).sum()), int(traced[mine & is_dense].sum())
        yield {
            "object": item.name,
            "points": count,
            "dense_points": 100 * of_dense / count,
            "dense_angular": 100 * dense / max(of_dense * cube_map.n_directions, 1),
            "dense": 100 * dense / entries,
            "sparse": 100 * int(traced[mine & ~is_dense].sum()) / entries,
            "entries": 100 * int(traced[mine].sum()) / entries,
        }
