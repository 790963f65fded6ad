"""The emission stage of a bake: what points receive of each emitter, directly and with bounces."""

import time
from dataclasses import dataclass, field

import numpy as np

from prt_core.bake import visibility
from prt_core.bake.gather import read_gather
from prt_core.bake.visibility import add_seconds, blocks
from prt_core.errors import expect
from prt_core.rays import cast_on_all_cores
from prt_core.runtime.cores import n_cores
from prt_core.runtime.progress import Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.store import damage_as_error
from prt_core.transport import emitted_light, received_with_bounces, surface_lights
from prt_core.transport.emission import CHANNELS

# Of points and emitters: directly received light, and that with all bounces, three channels in the
# emitter's own colours and three in white (see `Emission`).
_DIRECT, _RECEIVED, _FIGURES = "emission_direct", "emission_received", "emission_figures"
# What a block and emitter notes: rays, and the squares of the error and of what is received.
_N_FIGURES = 3
# Blocks worked on together for each core.
_TOGETHER = 2
# Emitters under each of which alone the error of the bounces is measured; of more, the strongest,
# and the rest together.
_ALONE = 7


@dataclass(frozen=True)
class Emission:
    """What the points of a bake receive of its emitters, each as the file has it.

    Attributes
    ----------
    names : tuple of str
    direct : (n_emitters, n_points, 4) float32
        Irradiance / pi, before it bounces: in the emitter's own colours, and of its largest
        channel alone, which is what it sends out in another colour.
    received : (n_emitters, n_points, 6) float32, or None
        With all bounces: in its own colours, and where it is white instead. None: as `direct`.
    albedo : (n_points, 3) float32, or None
        The very array with which it bounced: where the transport has another, it bounces anew.
    """

    names: tuple
    direct: np.ndarray
    received: np.ndarray | None = None
    albedo: np.ndarray | None = None


@dataclass(frozen=True)
class EmissionResult:
    """What the rays of the emission stage came to.

    Attributes
    ----------
    rays : int
    error : float or None
        Of directly received light, relative; that of the worst emitter.
    emitters : list of dict
        name, radiance (mean, three channels), area (square units of the world), error.
    probes : (n_points, k) float32
        Light under which the error of the bounces is measured as well.
    """

    rays: int = 0
    error: float | None = None
    emitters: list = field(default_factory=list)
    probes: np.ndarray | None = None


def emission_steps(store, scene, caster, settings, seconds):
    """Direct light of the emitters of a scene into a store; yields `Progress`.

    Returns
    -------
    EmissionResult
    """
    if not scene.emitters:
        return EmissionResult()
    n_points, n_emitters = len(scene.points), len(scene.emitters)
    parts, start = blocks(n_points), time.perf_counter()
    shape, chunk = (n_emitters, n_points, CHANNELS), (1, visibility.BLOCK, CHANNELS)
    direct = store.create(_DIRECT, shape, "float32", chunk)
    table = len(parts), n_emitters, _N_FIGURES
    figures = store.create(_FIGURES, table, "float64", (1, *table[1:]))
    yield Progress("emission", 0, n_points)
    lights = surface_lights(scene)
    emitters = slice(0, n_emitters)

    def one(caster, index):
        points, seed = parts[index], settings.seed
        return emitted_light(scene, caster, lights, points, seed, settings.tolerance)

    group = max(caster.threads, n_cores()) * _TOGETHER
    todo = [
        index
        for index, part in enumerate(parts)
        if not (direct.holds(emitters, part) and figures.holds(index))
    ]
    for light in lights if todo else ():
        light.look_around(caster, settings.seed)
    for first in range(0, len(todo), group):
        batch = todo[first : first + group]
        for index, emitted in zip(batch, cast_on_all_cores(caster, one, batch), strict=True):
            direct[:, parts[index]] = emitted.received
            rays = np.full(n_emitters, emitted.n_rays / n_emitters)
            figures[index] = np.stack([rays, emitted.spread, emitted.size], axis=1)
        yield Progress("emission", parts[batch[-1]].stop, n_points)
    add_seconds(seconds, "emission", time.perf_counter() - start)
    with damage_as_error(store.path, f"'{_DIRECT}'"):
        rays, spread, size = np.moveaxis(figures[...].sum(axis=0), 1, 0)
        probes = _probes(direct[...])
    errors = np.sqrt(spread / np.maximum(size, 1e-300))
    return EmissionResult(
        int(round(rays.sum())) + sum(light.n_rays for light in lights),
        float(errors.max()),
        [
            {
                "name": light.name,
                "radiance": light.radiance.tolist(),
                "area": light.area * scene.size**2,
                "error": float(error),
            }
            for light, error in zip(lights, errors, strict=True)
        ],
        probes,
    )


def read_direct(store):
    """(n_emitters, n_points, 4) float32 of a bake under way: see `Emission.direct`."""
    return store.array(_DIRECT)[...]


def emission_probes(store):
    """The `probes` of an `EmissionResult`, of a bake whose emission is stored."""
    with damage_as_error(store.path, f"'{_DIRECT}'"):
        return _probes(read_direct(store))


def _probes(direct):
    """(n_points, k) float32: the strongest emitters alone, and all others together."""
    # Each as bright as the others: a weak one may be turned up when relighting.
    value = direct[..., -1]
    size = np.sqrt((value.astype(np.float64) ** 2).sum(axis=1))
    order = np.argsort(-size, kind="stable")
    order = order[size[order] > 0]
    columns = [value[i] / np.float32(size[i]) for i in order[:_ALONE]]
    if len(order) > _ALONE:
        columns.append(sum(value[i] / np.float32(size[i]) for i in order[_ALONE:]))
    return np.stack(columns, axis=1) if columns else np.zeros((value.shape[1], 0), np.float32)


def bounced_emission_steps(store, scene, rounds, settings, seconds, memory=None):
    """What points receive of each emitter with all bounces, into a store; yields `Progress`."""
    if not scene.emitters:
        return
    if not rounds:
        store.remove(_RECEIVED)
        return
    start, n_points = time.perf_counter(), len(scene.points)
    yield Progress("emission", 0, len(scene.emitters))
    with damage_as_error(store.path, "'gather'"):
        blocked = store.read("blocked", (n_points,), "float32")
        hits, room = store.array("gather"), (memory, store.path.parent)
        gather = read_gather(hits, range(rounds), blocked, *room)
    direct, albedo = store.array(_DIRECT), scene.points.mean_albedo
    shape = len(scene.emitters), n_points, 6
    received = store.create(_RECEIVED, shape, "float32", (1, visibility.BLOCK, 6))

    def one(index):
        light = direct[index]
        own, value = light[:, :3], np.repeat(light[:, 3:], 3, axis=1)
        parts = [
            received_with_bounces(gather, albedo, part, settings.series, settings.bounces)[0]
            for part in (own, value)
        ]
        received[index] = np.hstack(parts)

    emitters = range(len(scene.emitters))
    for first in range(0, len(emitters), n_cores()):
        on_all_cores(one, emitters[first : first + n_cores()])
        yield Progress("emission", first, len(emitters))
    add_seconds(seconds, "emission", time.perf_counter() - start)


def read_emission(store, scene, rounds, albedo):
    """`Emission` of a finished bake, None where nothing emits light.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    rounds : int
        Of bounce rays.
    albedo : (n_points, 3) float32
        With which points bounce.

    Raises
    ------
    PRTError
        It is missing, damaged or out of range.
    """
    if not scene.emitters:
        return None
    shape = len(scene.emitters), len(scene.points)
    direct = store.read(_DIRECT, (*shape, CHANNELS), "float32")
    received = store.read(_RECEIVED, (*shape, 6), "float32") if rounds else None
    for name, values in ((_DIRECT, direct), (_RECEIVED, received)):
        good = (
            values is None or not values.size or (values.min() >= 0 and np.isfinite(values).all())
        )
        expect(good, f"{store.path}: '{name}' is out of range; the bake is damaged")
    return Emission(scene.emitters, direct, received, albedo)
