"""The report of `bench_sampling`: curves, relit images beside the truth, where rays were cast."""

from dataclasses import asdict, replace

import numpy as np

from prt_core.evaluate.png import to_srgb
from prt_core.evaluate.report import Report, curve_plot, flattened, heat_colours
from prt_core.evaluate.view import CameraRays
from prt_core.sampling import sampler_named
from prt_core.sampling.tracer import count_bits
from prt_core.scene import auto_camera
from prt_core.transport import received_light

_COLUMNS = [
    ("label", ""),
    ("back_end", ""),
    ("object", ""),
    ("points", ",d"),
    ("entries_percent", ".2f"),
    ("hemisphere_percent", ".1f"),
    ("rays", ",d"),
    ("seconds", ".2f"),
    ("time_ratio", ".3f"),
    ("matrix_l2", ".2%"),
    ("interval_low", ".2%"),
    ("interval_high", ".2%"),
    ("worst_point", ".1%"),
    ("relit_l2", ".2%"),
    ("relit_p95", ".2%"),
    ("relit_max", ".1%"),
    ("peak_bytes", ",d"),
]
_LABELS = {
    "entries_percent": "entries traced, % of all",
    "seconds": "seconds",
    "matrix_l2": "relative L2 error of the matrix",
}
_WIDTH, _HEIGHT, _TANGENT = 400, 300, 0.26
# Objects that get a panel in the plot: the largest.
_PANELS = 6
# Differences are shown so many times brighter.
_FACTOR = 10


def sampling_report(scene, cube_map, caster, rows, results, lights):
    """A `Report` of what `bench_sampling_steps` returned.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
        For the pictures.
    rows, results
        From `bench_sampling_steps`.
    lights : dict of str -> (n_directions, 3) float32
        The first is shown.

    Returns
    -------
    Report
    """
    plot = error_plot(rows)
    # What is worth a look stands in the middle.
    camera = replace(auto_camera(scene), tangent=_TANGENT)
    rays = CameraRays(scene, caster, camera, _WIDTH, _HEIGHT)
    pictures = []
    if lights:
        pictures += _relit(scene, cube_map, rays, results, *next(iter(lights.items())))
    pictures.append(_where(cube_map, rays, results))
    pictures += [
        _exploration(rays, label, sampled.dense)
        for label, sampled in results.items()
        if getattr(sampled, "dense", None) is not None
    ]
    notes = [
        f"Scene {rows[0]['scene']}: {len(scene.points):,} points, {cube_map.n_directions:,} "
        "directions. Errors are relative L2 of the direct matrix (visibility times cosine "
        "integrals) against every entry traced by the same back-end; relit errors are those of "
        f"the worst of {len(lights)} lights. Rays, seconds and memory are of the whole scene.",
    ]
    return Report(f"Sampling {rows[0]['scene']}", rows, _COLUMNS, notes, {"error": plot}, pictures)


def error_plot(rows, x=("entries_percent", "seconds")):
    """PNG of errors against entries and seconds: panels for each of the largest objects."""
    flat = [{**flattened(row), "object": _panel(row), "curve": _curve(row)} for row in rows]
    largest = sorted({(row["points"], row["object"]) for row in rows}, reverse=True)[:_PANELS]
    largest = {name for _, name in largest}
    flat = [row for row, whole in zip(flat, rows, strict=True) if whole["object"] in largest]
    return curve_plot(flat, list(x), "matrix_l2", "object", "curve", _LABELS)


def _panel(row):
    return f"{row['object']}, {row['back_end']}"


def _curve(row):
    """Numbers among a sampler's settings make one curve, words (ways to go) one each."""
    if row["method"] == "exhaustive":
        return row["method"]
    usual = asdict(sampler_named(row["method"])[1]())
    words = {k: v for k, v in row["settings"].items() if isinstance(v, str) and v != usual[k]}
    return " ".join([row["method"], *words.values()])


def _relit(scene, cube_map, rays, results, light_name, light):
    """The scene under one light by each method, and its difference from the truth."""
    white = scene.points.albedo

    def lit(sampled):
        return white * received_light(sampled.bits, scene.points.normals, cube_map, light)

    truth = lit(results["exhaustive"])
    image = rays.picture(truth)
    stops = -np.log2(max(float(np.percentile(image.max(axis=-1), 97)), 1e-6))
    shown = [("every entry traced", to_srgb(image, stops))]
    differences = []
    for label, sampled in results.items():
        if label != "exhaustive":
            colours = lit(sampled)
            shown.append((label, to_srgb(rays.picture(colours), stops)))
            away = rays.picture(_FACTOR * np.abs(colours - truth))
            differences.append((label, to_srgb(away, stops)))
    return [
        (f"Direct light of '{light_name}'", shown),
        (f"{_FACTOR} times the difference from every entry traced", differences),
    ]


def _where(cube_map, rays, results):
    """How many entries of each point were traced, on one logarithmic scale."""
    shown = []
    for label, sampled in results.items():
        counts = count_bits(sampled.traced, axis=1)
        colours = heat_colours(
            np.maximum(counts, 1), 1, cube_map.n_directions / 2, logarithmic=True
        )
        shown.append((f"{label}: {counts.mean():,.0f} a point", to_srgb(rays.picture(colours))))
    return "Entries traced at each point, 1 (dark) to half of all (bright), logarithmic", shown


def _exploration(rays, label, dense):
    """Local ranks, and the dense points: white the first iteration, then green to red."""
    # Points that see nothing have rank 0.
    rank = heat_colours(np.maximum(dense.rank, 1), 1, logarithmic=True)
    last = max(int(dense.iteration.max(initial=0)), 1)
    share = (dense.iteration / last)[:, None]
    chosen = rank * np.float32(0.25)
    colours = (1 - share) * [0.1, 0.9, 0.1] + share * [1.0, 0.1, 0.05]
    colours[dense.iteration == 0] = 1
    chosen[dense.points] = colours
    return (
        f"Exploration by local rank: {label}",
        [
            (f"local rank, 1 to {dense.rank.max()}", to_srgb(rays.picture(rank))),
            (
                f"{len(dense.points):,} dense points over it: first iteration white, then green "
                "to red",
                to_srgb(rays.picture(chosen)),
            ),
        ],
    )
