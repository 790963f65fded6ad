"""The report of a bake: what it holds, what it cost, how near it is, what to know of it."""

import platform
from dataclasses import asdict

import numpy as np

from prt_core.bake.bounce_error import LOCAL
from prt_core.rays import MOST_LAYERS
from prt_core.runtime.cores import n_cores
from prt_core.runtime.machine import peak_bytes
from prt_core.transport.emission import MOST_TURNS, TURN
from prt_core.transport.gather import ROUND
from prt_core.version import __version__

# Share of the bounce rays that may meet places without a bake point before it is said.
_MANY_HIDDEN = 0.005
_RAY_STAGES = (
    "details",
    "visibility",
    "certificate",
    "reflections",
    "gloss certificate",
    "emission",
    "gather",
)


def bake_report(
    scene,
    cube_map,
    caster,
    settings,
    seen,
    emitted,
    bounced,
    seconds,
    store,
    reflected,
    certified=None,
):
    """What a finished bake says of itself (see `bake_steps`).

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    seen : dict
        What `visibility_steps` returns.
    emitted : EmissionResult
    bounced : Bounced
    seconds : dict of str -> float
        By stage.
    store : BakeStore
    reflected : ReflectionResult
    certified : GlossError, optional

    Returns
    -------
    dict
    """
    rounds, error = bounced.rounds, bounced.error
    # The gravest first: of many lines a panel shows only the first ones.
    messages = [*_missed(seen, emitted, bounced, certified, settings.tolerance), *scene.messages]
    too_deep = getattr(caster, "too_deep", 0) + seen.get("too_deep", 0)
    if too_deep:
        messages.append(
            f"{too_deep:,} rays met more than {MOST_LAYERS} surfaces that let light pass, "
            "and were taken as blocked there"
        )
    traced = sum(seconds.get(stage, 0) for stage in _RAY_STAGES)
    by_kind = {
        "rays_visibility": seen["rays"],
        "rays_details": store.attributes.get("rays_details", 0),
        "rays_gather": bounced.rays,
        "rays_short": bounced.short_rays,
    }
    if emitted.emitters:
        by_kind["rays_emission"] = emitted.rays
    if reflected.points:
        by_kind["rays_reflections"] = reflected.rays + reflected.short_rays
    if certified is not None:
        by_kind["rays_gloss_certificate"] = certified.rays
    rays = sum(by_kind.values())
    gloss = None if certified is None else certified.worst[1]
    errors = error, emitted.error, gloss
    within = [value is None or value <= settings.tolerance for value in errors]
    enclosed = bounced.enclosed or None
    within.append(enclosed is None or enclosed <= LOCAL * settings.tolerance)
    met = seen["tolerance_met"] and all(within)
    refined = _refined(scene)
    return {
        "points": len(scene.points),
        "hidden_points": int((~scene.points.visible).sum()),
        "details": len(scene.details),
        "triangles": len(scene.triangles),
        "directions": cube_map.n_directions,
        "back_end": caster.name,
        "rays": rays,
        **by_kind,
        "rays_per_second": rays / max(traced, 1e-9),
        "rays_a_point": rounds * ROUND,
        "error": error,
        **({"error_enclosed": enclosed} if enclosed else {}),
        "tolerance": settings.tolerance,
        "tolerance_met": met,
        "hidden_hits": bounced.hidden,
        "back_points": len(np.unique(scene.lattice_back[scene.lattice_back >= 0])),
        "dark_backs": bounced.dark_backs,
        **({"refined": refined} if refined else {}),
        **({"glossy_points": reflected.points} if reflected.points else {}),
        **({} if certified is None else {"gloss_error": asdict(certified)}),
        **({"emitters": emitted.emitters} if emitted.emitters else {}),
        **{k: v for k, v in seen.items() if k not in ("rays", "tolerance_met", "too_deep")},
        "skipped": {**_spared(scene, seen), **bounced.skipped},
        "seconds": {stage: round(value, 3) for stage, value in seconds.items()},
        "bytes": store.nbytes(),
        "peak_bytes": peak_bytes(),
        "cores": n_cores(),
        "versions": {
            "prt_core": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "messages": messages,
    }


def _refined(scene):
    """Name -> new vertices of each object whose edges were split."""
    refined = {item.name: item.refined for item in scene.objects if item.refined is not None}
    return {name: int((each.vertex_round > 0).sum()) for name, each in refined.items()}


def _spared(scene, seen):
    """What was not done because the scene does not need it."""
    skipped = {}
    attributes = seen["sampling"]
    if attributes:
        skipped["visibility_rays"] = attributes["hemisphere_entries"] - seen["rays"]
        skipped["open_points"] = attributes.get("open_points", 0)
    albedo = np.hstack([scene.points.albedo, scene.points.mean_albedo])
    if (albedo.reshape(-1, 2, 3) == albedo.reshape(-1, 2, 3)[..., :1]).all():
        skipped["grey"] = True
    return skipped


def _missed(seen, emitted, bounced, certified, tolerance):
    """What is not as it was asked for, in a line each."""
    if not seen["tolerance_met"]:
        yield (
            f"the visibility may be {seen['visibility_error']:.2%} off in relit colours, more "
            f"than the tolerance of {tolerance:.2%}; bake with --method exhaustive"
        )
    if certified is not None and certified.worst[1] > tolerance:
        light, error = certified.worst
        yield (
            f"what views show of gloss may be {error:.2%} off ('{light}'), more than the tolerance "
            f"of {tolerance:.2%}; bake with a higher --resolution, or ask for less"
        )
    for item in emitted.emitters:
        if item["error"] > tolerance:
            yield (
                f"emitter '{item['name']}': its direct light may be {item['error']:.2%} off, more "
                f"than the tolerance of {tolerance:.2%}, with the most rays that are cast "
                f"({MOST_TURNS * TURN} of each kind); it is hardly seen from where it shines"
            )
    if bounced.error is not None and bounced.error > tolerance:
        yield (
            f"the bounces may be {bounced.error:.2%} off in relit colours, more than the "
            f"tolerance of {tolerance:.2%}, with the most rays that are cast "
            f"({bounced.rounds * ROUND} a point); light reaches this scene through little of what "
            "its points see"
        )
    elif (bounced.enclosed or 0) > LOCAL * tolerance:
        yield (
            f"in enclosed places the bounces may be {bounced.enclosed:.2%} off of the light there, "
            f"more than {LOCAL * tolerance:.2%}, with the most rays that are cast "
            f"({bounced.rounds * ROUND} a point)"
        )
    if bounced.hidden > _MANY_HIDDEN:
        yield (
            f"{bounced.hidden:.1%} of the bounce rays met places that none of their bake points "
            "sees, and were taken as dark; make the faces there smaller"
        )
