"""Samplers side by side on one scene: entries traced, seconds, errors of the matrix and relit."""

import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from prt_core.evaluate.metrics import colour_error
from prt_core.runtime.machine import peak_bytes, reset_peak
from prt_core.runtime.named_settings import expect_settings, named_settings, read_setting
from prt_core.runtime.progress import Progress
from prt_core.sampling import Sampled, certificate_steps, sampler_named
from prt_core.sampling.tracer import count_bits
from prt_core.transport import received_light, visibility_bits
from prt_core.transport.visibility import horizon_bits, unpack

_BLOCK = 2048


@dataclass(frozen=True)
class Method:
    """A sampler and settings of its own.

    Parameters
    ----------
    name : str
        `exhaustive` or a registered sampler.
    settings : dict
        Those that are not the default.
    """

    name: str
    settings: dict

    @property
    def label(self):
        """Name and settings, as tables and reports show them."""
        text = ", ".join(f"{key} {value}" for key, value in self.settings.items())
        return f"{self.name} ({text})" if text else self.name

    def made_settings(self, seed):
        """The sampler's settings; `PRTError` where it has none of a name."""
        if self.name == "exhaustive":
            expect_settings(self.name, self.settings, ())
            return None
        kind = sampler_named(self.name)[1]
        expect_settings(self.name, self.settings, asdict(kind()))
        return kind(**{"seed": seed, **self.settings})


def parse_method(text):
    """The `Method` of a `text` (see `named_settings`)."""
    name, settings = named_settings(text)
    return Method(name, {key: read_setting(value) for key, value in settings.items()})


def bench_sampling_steps(scene, cube_map, caster, methods, lights, name, seed=0):
    """Measure samplers against every entry traced; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    methods : sequence of Method
        The exhaustive one is measured first, asked for or not: it is the truth.
    lights : dict of str -> (n_directions, 3) float32
        For the relit error, and what they are called.
    name : str
        Of the scene, for the rows.
    seed : int
        Where a method does not set its own.

    Returns
    -------
    rows : list of dict
        One for each method and object: scene, method, label, settings, back_end, object, points,
        entries_percent (of n x n_directions), hemisphere_percent (of those above the horizon),
        rays, seconds, time_ratio (to exhaustive), stages, matrix_l2, worst_point, relit_l2 (the
        worst light), relit_p95, relit_max, relit (by light), interval_low, interval_high,
        certificate_l2, certificate_rays, peak_bytes. Rays, seconds and peak_bytes are those of
        the whole scene.
    results : dict of str -> Sampled
        By label; the exhaustive one is among them.
    """
    chosen = [(method, method.made_settings(seed)) for method in methods]
    chosen = [pair for pair in chosen if pair[0].name != "exhaustive"]
    # The first rays of a caster may build its tree: that is no method's own time.
    caster.occluded(scene.ray_origins[:1], cube_map.samples[:1].astype(np.float32))
    truth = yield from _measured(_exhaustive(scene, cube_map, caster))
    whole = truth.seconds["total"]
    above = yield from _above(scene, cube_map)
    wanted = {key: received_light(truth.bits, scene.points.normals, cube_map, light)
              for key, light in lights.items()}  # fmt: skip
    rows, results = [], {}
    for method, settings in [(Method("exhaustive", {}), None), *chosen]:
        sampled = truth
        if settings is not None:
            sampler = sampler_named(method.name)[0]
            sampled = yield from _measured(sampler(scene, cube_map, caster, settings))
        results[method.label] = sampled
        head = {
            "scene": name,
            "method": method.name,
            "label": method.label,
            "settings": {} if settings is None else asdict(settings),
            "back_end": caster.name,
        }
        cost = {
            "rays": int(sampled.rays),
            "seconds": sampled.seconds["total"],
            "time_ratio": sampled.seconds["total"] / whole,
            "stages": {k: v for k, v in sampled.seconds.items() if k != "total"},
            "peak_bytes": sampled.attributes["peak_bytes"],
        }
        certified = {}
        if settings is not None:
            certified = yield from _certified(scene, cube_map, caster, sampled)
        yield Progress("errors", 0, 0)
        of_points = matrix_errors(scene, cube_map, sampled.bits, truth.bits)
        relit = {key: received_light(sampled.bits, scene.points.normals, cube_map, light)
                 for key, light in lights.items()}  # fmt: skip
        for index, item in enumerate(scene.objects):
            mine = scene.points.object_index == index
            if mine.any():
                rows.append(
                    {
                        **head,
                        "object": item.name,
                        "points": int(mine.sum()),
                        **_entries(sampled.traced[mine], above[mine], cube_map),
                        **cost,
                        **_matrix_row(*(values[mine] for values in of_points)),
                        **_relit_row(relit, wanted, mine),
                        **certified.get(item.name, _NOT_CERTIFIED),
                    }
                )
    return rows, results


_NOT_CERTIFIED = {"interval_low": 0.0, "interval_high": 0.0, "certificate_l2": 0.0,
                  "certificate_rays": 0}  # fmt: skip


def _measured(steps):
    """Drive a sampler; add its time, less what its caller took, and its peak memory."""
    spent, result = 0.0, None
    reset_peak()
    while result is None:
        start = time.perf_counter()
        try:
            progress = next(steps)
        except StopIteration as end:
            result = end.value
        spent += time.perf_counter() - start
        if result is None:
            yield progress
    result.seconds["total"] = spent
    result.attributes["peak_bytes"] = peak_bytes()
    return result


def _exhaustive(scene, cube_map, caster):
    """Every entry traced, as the bake does it."""
    n_points, tally = len(scene.points), []
    shape = n_points, -(-cube_map.n_directions // 8)
    sampled = Sampled(np.empty(shape, np.uint8), np.empty(shape, np.uint8), 0)
    start = time.perf_counter()
    for first in range(0, n_points, _BLOCK):
        part = slice(first, first + _BLOCK)
        sampled.bits[part] = visibility_bits(scene, cube_map, caster, part, tally.append)
        sampled.seconds["rays"] = time.perf_counter() - start
        yield Progress("exhaustive", min(part.stop, n_points), n_points)
    sampled.rays = sum(tally)
    sampled.traced = horizon_bits(scene, cube_map, slice(0, n_points))
    return sampled


def _above(scene, cube_map):
    """(n_points,) int64: entries above the horizon of each point."""
    counts = []
    for first in range(0, len(scene.points), _BLOCK):
        part = slice(first, first + _BLOCK)
        counts.append(count_bits(horizon_bits(scene, cube_map, part), axis=1))
        yield Progress("errors", first, len(scene.points))
    return np.concatenate(counts)


def _certified(scene, cube_map, caster, sampled):
    """Interval of each object's matrix error, by rays of its own."""
    copy = replace(sampled, bits=sampled.bits.copy(), traced=sampled.traced.copy())
    certified = yield from certificate_steps(scene, cube_map, caster, copy, {})
    return {
        item.name: {
            "interval_low": item.matrix.low,
            "interval_high": item.matrix.high,
            "certificate_l2": item.matrix.error,
            "certificate_rays": int(copy.rays - sampled.rays),
        }
        for item in certified
    }


def matrix_errors(scene, cube_map, bits, truth):
    """Squared error and squared size of each row of the direct matrix.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    bits, truth : (n_points, n_bytes) uint8

    Returns
    -------
    errors, sizes : (n_points,) float64
    """
    vectors = cube_map.vectors.T.astype(np.float32)
    errors, sizes = np.zeros((2, len(bits)))
    for first in range(0, len(bits), _BLOCK):
        part = slice(first, first + _BLOCK)
        weight = (scene.points.normals[part] @ vectors) ** 2
        wrong = unpack(bits[part] ^ truth[part], cube_map.n_directions)
        errors[part] = np.einsum("pd,pd->p", weight, wrong)
        sizes[part] = np.einsum("pd,pd->p", weight, unpack(truth[part], cube_map.n_directions))
    return errors, sizes


def _entries(traced, above, cube_map):
    entries = int(count_bits(traced))
    return {
        "entries_percent": 100 * entries / (len(traced) * cube_map.n_directions),
        "hemisphere_percent": 100 * entries / max(int(above.sum()), 1),
    }


def _matrix_row(errors, sizes):
    """`worst_point`: the largest error of a row, as a share of the root mean square of all."""
    size = max(float(sizes.sum()), 1e-300)
    return {
        "matrix_l2": float(np.sqrt(errors.sum() / size)),
        "worst_point": float(np.sqrt(errors.max() * len(errors) / size)),
    }


def _relit_row(sampled, wanted, mine):
    """Errors of received light; `p95` and `max` are of points, as shares of the mean square."""
    relit = {}
    for key, truth in wanted.items():
        colours, truth = sampled[key][mine].astype(np.float64), truth[mine].astype(np.float64)
        size = max(float(np.sqrt((truth**2).sum(axis=1).mean())), 1e-300)
        of_points = np.sqrt(((colours - truth) ** 2).sum(axis=1)) / size
        relit[key] = {
            "l2": colour_error(colours, truth)["l2"],
            "p95": float(np.percentile(of_points, 95)),
            "max": float(of_points.max()),
        }
    worst = {
        f"relit_{what}": max((values[what] for values in relit.values()), default=None)
        for what in ("l2", "p95", "max")
    }
    return {**worst, "relit": relit}
