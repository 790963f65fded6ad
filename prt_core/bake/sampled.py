"""Visibility that is sampled: certified, asked again where it is too far off, and stored."""

import time

import numpy as np

from prt_core.bake import visibility
from prt_core.bake.visibility import DENSE, STAGE, blocks
from prt_core.runtime.progress import Pace, Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.sampling import (
    AgreementSettings,
    CertificateSettings,
    LevelDone,
    certificate_steps,
    certified_together,
    probe_lights,
    refine_agreement,
    sampler_named,
    trace_rest,
)
from prt_core.sampling.tracer import count_bits
from prt_core.transport.visibility import horizon_bits

# What sampling makes: the bits, and which of them were traced.
SAMPLES = STAGE, "traced"
# Blocks written at once.
_TOGETHER = 8
# Objects that are certified together and have fewer rays than this are traced whole.
_SMALL = 1 << 15
# Where neighbours are wrong more often than so many times the tolerance, as a share of how often
# they see light, asking them does not pay.
_HOPELESS = 8
# Where the choice is free: the second look costs a fifth of the rays, and the certificate tells
# whether it was needed.
_CHEAPEST = {"looks": 0}
# What is asked again where the tolerance is not met; after the last all that is left is traced.
TURNS = (
    {"neighbours": 6, "candidates": 12, "checks": 32, "edge_halvings": 0},
    {"neighbours": 12, "candidates": 16, "checks": 128, "edge_halvings": 0},
)


# What is left to ask after a change lies beside outlines: checks are cheap, and most of those at
# random fall on what is known.
_AFTER_A_CHANGE = {"checks": 16, "edge_halvings": 2}


def sampler_settings(settings, method, reuse=None):
    """The settings of a bake's sampler, where some is known before (see `Reuse`) or nothing is."""
    _, kind = sampler_named(method)
    more = dict(_CHEAPEST) if settings.method == "auto" else {}
    if kind is AgreementSettings:
        more["most_wrong"] = _HOPELESS * settings.tolerance
        more |= {} if reuse is None else _AFTER_A_CHANGE
    return kind(seed=settings.seed, **more)


def sample_arrays(store, shape):
    """The arrays `SAMPLES` of a store, (n_points, n_bytes) uint8."""
    return [store.create(name, shape, "uint8", (visibility.BLOCK, shape[1])) for name in SAMPLES]


def sampled_steps(
    store, scene, cube_map, caster, method, settings, lights, pace, pictures, reuse=None
):  # fmt: skip
    """Sample all points together, certify, and store; yields `Progress`.

    What `reuse` knows is not asked.

    Returns
    -------
    attributes : dict
        For the report (see `visibility_steps`).
    spent : dict of str -> float
        Seconds by stage.
    """
    start = time.perf_counter()
    rays = Pace(pace, 1 << 15)
    sampler, _ = sampler_named(method)
    wanted = sampler_settings(settings, method, reuse)
    more = {} if reuse is None else {"known": reuse.known(cube_map)}
    steps = sampler(scene, cube_map, caster, wanted, pace=rays, **more)
    sampled = yield from (steps if pictures is None else _shown(steps, pictures))
    dense = getattr(sampled, "dense", None)
    spent = {"visibility": time.perf_counter() - start, "certificate": 0.0}
    groups = certified_together(scene)
    small = small_groups(groups.index, cube_map)
    if reuse is not None:
        small &= ~reuse.still
    if small.any():
        sampled = yield from trace_rest(scene, cube_map, caster, sampled, small, pace=rays)

    def ask_again(sampled, points, turn):
        return asked_again_steps(scene, cube_map, caster, settings, sampled, points, turn, rays)

    sampled, errors, turns = yield from certified_steps(
        scene, cube_map, caster, sampled, lights, settings, groups, ask_again, spent, rays, reuse
    )
    start = time.perf_counter()
    arrays = sampled.bits, sampled.traced
    for targets, array in zip(sample_arrays(store, sampled.bits.shape), arrays, strict=True):
        parts = blocks(len(array))
        for first in range(0, len(parts), _TOGETHER):
            together = parts[first : first + _TOGETHER]
            on_all_cores(
                lambda block, to=targets, of=array: to.__setitem__(block, of[block]), together
            )
            yield Progress("store", together[-1].stop, len(array))
    if dense is not None:
        store.write(DENSE, dense.points.astype(np.int32))
    spent["store"] = time.perf_counter() - start
    traced = int(count_bits(sampled.traced))
    above = sampled.attributes.get("hemisphere_entries")
    if above is None:
        parts = blocks(len(scene.points))
        above = sum(int(count_bits(horizon_bits(scene, cube_map, part))) for part in parts)
    attributes = sampled_attributes(
        scene, cube_map, method, sampled, errors, turns, settings, traced, above
    )
    return (attributes if dense is None else {**attributes, "dense": len(dense.points)}), spent


def asked_again_steps(scene, cube_map, caster, settings, sampled, points, turn, rays):
    """What is found where points, (n_points,) bool, are asked again: `Sampled`, by steps."""
    if turn < len(TURNS):
        careful = AgreementSettings(seed=settings.seed, **TURNS[turn])
        return refine_agreement(scene, cube_map, caster, careful, sampled, points, turn, pace=rays)
    return trace_rest(scene, cube_map, caster, sampled, points, pace=rays)


def certified_steps(
    scene, cube_map, caster, sampled, lights, settings, groups, ask_again, spent, rays, reuse=None
):
    """Certify, and ask again until the tolerance is met; yields `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    sampled : Sampled
    lights : dict of str -> (n_directions, 3) float32, callable() -> dict, or None
    settings : BakeSettings
    groups : Groups
        What is certified together.
    ask_again : generator function(sampled, points, turn) -> Sampled
    spent : dict of str -> float
        Seconds by stage; added to.
    rays : Pace
    reuse : Reuse, optional
        Of another bake, whose draws must not be drawn again: they were put right there. Groups of
        points that stay as they were are not certified: they are off by what they do not show.

    Returns
    -------
    sampled : Sampled
    errors : list of ObjectError
    turns : int
        How often it was asked again.
    """
    lights = (lights() if callable(lights) else lights) or probe_lights(cube_map)
    poor, errors, turn = np.unique(groups.index), {}, 0
    if reuse is not None:
        poor = np.setdiff1d(poor, groups.index[reuse.still])
    if not len(poor):
        return sampled, [], turn
    for turn in range(len(TURNS) + 2):
        start = time.perf_counter()
        drawn = CertificateSettings(seed=settings.seed)
        attributes = yield from certificate_steps(
            scene, cube_map, caster, sampled, lights, drawn, turn + (reuse.turn if reuse else 0),
            pace=rays, groups=groups, wanted=poor,
        )  # fmt: skip
        spent["certificate"] += time.perf_counter() - start
        # What a group has passed it need not pass again: only the others are asked again.
        errors.update(zip(poor, attributes, strict=True))
        poor = [number for number in poor if errors[number].worst > settings.tolerance]
        if not poor or turn > len(TURNS):
            break
        start = time.perf_counter()
        sampled = yield from ask_again(sampled, np.isin(groups.index, poor), turn)
        spent["visibility"] += time.perf_counter() - start
    return sampled, list(errors.values()), turn


def _shown(steps, pictures):
    """The steps of a sampler, whose levels are shown."""
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value
        if isinstance(progress, LevelDone):
            pictures.level(progress.points, progress.bits)
        yield progress


def small_groups(group, cube_map):
    """(n_points,) bool: points of groups that cost less to trace whole than to certify."""
    rays = np.bincount(group) * (cube_map.n_directions // 2)
    return (rays < _SMALL)[group]


def sampled_attributes(scene, cube_map, method, sampled, errors, turns, settings, traced, above):
    """What the report says of it; `traced` entries of those `above` the horizons were traced."""
    worst = max((item.worst for item in errors), default=0.0)
    return {
        "method": method,
        "rays": int(sampled.rays),
        "entries_percent": 100 * traced / max(len(scene.points) * cube_map.n_directions, 1),
        "hemisphere_percent": 100 * traced / max(above, 1),
        "certificate": [item.attributes() for item in errors],
        "visibility_error": worst,
        "tolerance_met": bool(worst <= settings.tolerance),
        "sampling": {
            **sampled.attributes,
            "turns": turns,
            "hemisphere_entries": above,
            "seconds": {stage: round(value, 3) for stage, value in sampled.seconds.items()},
        },
    }
