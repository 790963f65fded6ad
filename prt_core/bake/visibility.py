"""The visibility stage of a bake: every entry traced, or few of them and the error known."""

import time

import numpy as np

from prt_core.errors import PRTError, expect_one_of
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
    sampler_names,
    trace_rest,
)
from prt_core.sampling.tracer import Tracer, count_bits
from prt_core.store import JournalMismatch, RayJournal
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import horizon_bits

BLOCK = 2048
# What sampling makes: the bits, and which of them were traced.
_SAMPLES = "visibility", "traced"
# The points that a sampler traced densely, where it is one that does.
DENSE = "dense"
# Blocks written at once.
_TOGETHER = 8
# Below so many rays every entry is traced: it takes a second at most, and there is no error.
_FEW_RAYS = 1 << 21
# Objects that are certified together and have fewer rays than this are traced whole.
_SMALL = 1 << 15
# Where neighbours are wrong more often than so many times the tolerance, as a share of how often
# they see light, asking them does not pay.
_HOPELESS = 8
# Where the choice is free: the second look costs a fifth of the rays, and the certificate tells
# whether it was needed.
_CHEAPEST = {"looks": 0}
# What is left to ask after a change lies beside outlines: checks are cheap, and most of those at
# random fall on what is known.
_AFTER_A_CHANGE = {"checks": 16, "edge_halvings": 2}
# What is asked again where the tolerance is not met; after the last all that is left is traced.
_TURNS = (
    {"neighbours": 6, "candidates": 12, "checks": 32, "edge_halvings": 0},
    {"neighbours": 12, "candidates": 16, "checks": 128, "edge_halvings": 0},
)


def expect_method(method):
    """Raise `PRTError` unless `method` names a way to sample."""
    expect_one_of("method", method, ("auto", "exhaustive", *sampler_names()))


def chosen_method(method, n_points, n_directions):
    """What `auto` stands for: every entry where there are few, else sampling by agreement."""
    if method != "auto":
        return method
    return "exhaustive" if n_points * n_directions // 2 < _FEW_RAYS else "agreement"


def blocks(n_points):
    """Slices of the points that are stored together."""
    return [slice(f, min(f + BLOCK, n_points)) for f in range(0, n_points, BLOCK)]


def add_seconds(seconds, stage, spent):
    """Add to the time of a stage; attributes are written at its end, not after every block."""
    seconds[stage] = seconds.get(stage, 0.0) + spent


def visibility_steps(
    store, scene, cube_map, caster, settings, lights, seconds, pace, pictures=None, reuse=None
):
    """Visibility of a scene into a store; yields `Progress`; `pictures` are told of it.

    What `reuse` knows of it is not asked.

    Returns
    -------
    dict
        For the report: method, rays, entries_percent, hemisphere_percent, traced_percent by
        object, certificate, visibility_error, tolerance_met, skipped.
    """
    method = chosen_method(settings.method, len(scene.points), cube_map.n_directions)
    if method == "exhaustive":
        work = store, scene, cube_map, caster, seconds, pace, pictures, reuse
        rays = yield from _exhaustive(*work)
        store.update(seconds=seconds)
        _show_all(store, pictures)
        entries = len(scene.points) * cube_map.n_directions
        return {
            "method": method,
            "rays": rays,
            "entries_percent": 100 * rays / max(entries, 1),
            "hemisphere_percent": 100.0,
            "certificate": [],
            "visibility_error": 0.0,
            "tolerance_met": True,
            "sampling": {},
        }
    attributes = store.attributes.get("sampled")
    shape = len(scene.points), -(-cube_map.n_directions // 8)
    if attributes is not None and not (
        _holds_samples(store, shape) and _holds_dense(store, attributes)
    ):
        # A block of sampled bits hangs on others: it cannot be made again alone.
        attributes = None
    while attributes is None:
        journal = RayJournal(caster, store)
        try:
            attributes = yield from _sampled(
                store, scene, cube_map, journal, method, settings, lights, seconds, pace, pictures,
                reuse,
            )  # fmt: skip
        except JournalMismatch:
            # Written by another version, or on a machine that rounds otherwise: begin anew.
            continue
        store.update(sampled=attributes, seconds=seconds)
    RayJournal.clear(store)
    _show_all(store, pictures)
    return attributes


def _show_all(store, pictures):
    if pictures is not None:
        bits = store.array("visibility")
        pictures.visible(bits.shape[0] * bits.shape[1], lambda: bits[...])


def _sample_arrays(store, shape):
    return [store.create(name, shape, "uint8", (BLOCK, shape[1])) for name in _SAMPLES]


def _holds_samples(store, shape):
    return all(array.holds(slice(0, shape[0])) for array in _sample_arrays(store, shape))


def _holds_dense(store, attributes):
    """Whether the dense points are there, where the sampler had any; they are used from then on."""
    try:
        return attributes.get("dense") is None or len(store.read(DENSE)) == attributes["dense"]
    except PRTError:
        return False


def _exhaustive(store, scene, cube_map, caster, seconds, pace, pictures, reuse):
    n_points = len(scene.points)
    n_bytes = -(-cube_map.n_directions // 8)
    parts = blocks(n_points)
    bits = store.create("visibility", (n_points, n_bytes), "uint8", (BLOCK, n_bytes))
    counts = store.create("visibility_rays", (len(parts),), "int64", (1,))
    yield Progress("visibility", 0, n_points)
    pace = Pace(pace)
    for index, block in enumerate(parts):
        if not (bits.holds(block) and counts.holds(index)):
            start, tally = time.perf_counter(), []
            traced = np.empty((block.stop - block.start, n_bytes), np.uint8)
            for part in pace.parts(block.start, block.stop):
                inside = slice(part.start - block.start, part.stop - block.start)
                if reuse is None:
                    traced[inside] = visibility_bits(scene, cube_map, caster, part, tally.append)
                else:
                    known = reuse.rows(part, cube_map)
                    rest = _rest(scene, cube_map, caster, part, known, tally)
                    traced[inside] = yield from rest
                pace.worked()
                yield Progress("visibility", part.stop, n_points)
            counts[index] = sum(tally)
            bits[block] = traced
            add_seconds(seconds, "visibility", time.perf_counter() - start)
            if pictures is not None:
                pictures.block(block, traced)
        yield Progress("visibility", block.stop, n_points)
    return int(counts[...].sum())


def _rest(scene, cube_map, caster, points, rows, tally):
    """Bits of some points of which some are known: the others are traced; yields `Progress`."""
    bits, known, _, above = rows
    points = np.arange(points.start, points.stop)
    tracer = Tracer(scene, cube_map, caster, tally.append)
    wanted = above & ~known
    free = yield from tracer.trace(points, wanted)
    return bits & known | free


def _sampled(
    store, scene, cube_map, caster, method, settings, lights, seconds, pace, pictures, reuse
):  # fmt: skip
    """Sample, certify, and ask again until the tolerance is met; then store."""
    start = time.perf_counter()
    rays = Pace(pace, 1 << 15)
    sampler, kind = sampler_named(method)
    more = dict(_CHEAPEST) if settings.method == "auto" else {}
    if kind is AgreementSettings:
        more["most_wrong"] = _HOPELESS * settings.tolerance
        more |= {} if reuse is None else _AFTER_A_CHANGE
    wanted = kind(seed=settings.seed, **more)
    known = {} if reuse is None else {"known": reuse.known(cube_map)}
    steps = sampler(scene, cube_map, caster, wanted, pace=rays, **known)
    sampled = yield from (steps if pictures is None else _shown(steps, pictures))
    dense = getattr(sampled, "dense", None)
    spent = {"visibility": time.perf_counter() - start, "certificate": 0.0}
    lights = (lights() if callable(lights) else lights) or probe_lights(cube_map)
    groups = certified_together(scene)
    small = _small_groups(groups[0], cube_map)
    if small.any():
        sampled = yield from trace_rest(scene, cube_map, caster, sampled, small, pace=rays)
    poor, errors = np.unique(groups[0]), {}
    for turn in range(len(_TURNS) + 2):
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
        if not poor or turn > len(_TURNS):
            break
        start = time.perf_counter()
        again = np.isin(groups[0], poor)
        if turn < len(_TURNS):
            careful = AgreementSettings(seed=settings.seed, **_TURNS[turn])
            sampled = yield from refine_agreement(
                scene, cube_map, caster, careful, sampled, again, turn, pace=rays
            )
        else:
            sampled = yield from trace_rest(scene, cube_map, caster, sampled, again, pace=rays)
        spent["visibility"] += time.perf_counter() - start
    start = time.perf_counter()
    arrays = sampled.bits, sampled.traced
    for targets, array in zip(_sample_arrays(store, sampled.bits.shape), arrays, strict=True):
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
    for stage, value in spent.items():
        add_seconds(seconds, stage, value)
    attributes = _attributes(
        scene, cube_map, method, sampled, list(errors.values()), turn, settings
    )
    return attributes if dense is None else {**attributes, "dense": len(dense.points)}


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


def _small_groups(group, cube_map):
    """Points of groups that cost less to trace whole than to certify."""
    rays = np.bincount(group) * (cube_map.n_directions // 2)
    return (rays < _SMALL)[group]


def _attributes(scene, cube_map, method, sampled, errors, turns, settings):
    above = sampled.attributes.get("hemisphere_entries")
    if above is None:
        parts = blocks(len(scene.points))
        above = sum(int(count_bits(horizon_bits(scene, cube_map, part))) for part in parts)
    traced = int(count_bits(sampled.traced))
    worst = max((item.worst for item in errors), default=0.0)
    return {
        "method": method,
        "rays": int(sampled.rays),
        "entries_percent": 100 * traced / max(len(sampled.bits) * cube_map.n_directions, 1),
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
