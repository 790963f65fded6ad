"""The report of `bench.compress`: error against size and time, relit images beside the truth."""

from dataclasses import replace

import numpy as np

from prt_core.compress.choice.choose import radiance_of
from prt_core.compress.subject import Subject
from prt_core.evaluate.png import to_srgb
from prt_core.evaluate.report import Report, curve_plot
from prt_core.evaluate.view import CameraRays
from prt_core.scene import auto_camera

_COLUMNS = [
    ("label", ""),
    ("bytes", ",d"),
    ("bits_a_coefficient", ".3f"),
    ("seconds", ".1f"),
    ("peak_bytes", ",d"),
    ("ms_median", ".2f"),
    ("ms_worst", ".2f"),
    ("matrix_l2", ".2%"),
    ("matrix_psnr", ".1f"),
    ("relit_l2_mean", ".2%"),
    ("relit_l2_worst", ".2%"),
    ("relit_psnr", ".1f"),
    ("worst_light", ""),
    ("seam", ".2%"),
    ("seam_rms", ".3%"),
    ("failure", ""),
]
_LABELS = {
    "megabytes": "megabytes",
    "ms_median": "milliseconds a light",
    "seconds": "seconds to compress",
    "error": "error, %",
}
_WIDTH, _HEIGHT, _TANGENT = 400, 300, 0.26
# Differences are shown so many times brighter; the row of a method nearest to this is shown.
_FACTOR, _SHOWN_ERROR = 10, 0.01


def compress_report(bake, caster, rows, evaluators, light_name, light, n_lights):
    """A `Report` of what `bench_compress_steps` returned.

    Parameters
    ----------
    bake : Bake
    caster : RayCaster
        For the pictures.
    rows : list of dict
    evaluators : dict of str -> object
        What relights, by label.
    light_name, light : str, (n_directions, 3) float32
        Shown.
    n_lights : int

    Returns
    -------
    Report
    """
    panels = (("relit_l2_mean", "relit colours, mean"), ("relit_l2_worst", "relit, worst light"),
              ("matrix_l2", "matrix"))  # fmt: skip
    flat = [
        {**row, "megabytes": row["bytes"] / 1e6, "error": 100 * row[key], "panel": panel}
        for key, panel in panels
        for row in rows
        if row[key] and row["method"] not in ("dense", "exact")
    ]
    plot = curve_plot(
        flat, ["megabytes", "ms_median", "seconds"], "error", "panel", "method", _LABELS
    )
    first = rows[0]
    exact = next(row for row in rows if row["method"] == "exact")
    notes = [
        f"Scene {first['scene']}: {first['points']:,} points, {first['directions']:,} directions, "
        f"RGB, all bounces. Relit errors are relative L2 against the exact bake over {n_lights} "
        "lights; the matrix' error is estimated by white lights; a seam is the largest jump of "
        "the error across a cluster's border, relative to the mean colour.",
        f"Exactly a light takes {exact['ms_median']:.0f} ms from the bits, "
        f"{first['ms_median']:.0f} ms as a dense product (timed on "
        f"{first['settings']['of_points']:,} of the points).",
    ]
    pictures = _pictures(bake, caster, rows, evaluators, light_name, light)
    title = f"Compression of {first['scene']}"
    return Report(title, rows, _COLUMNS, notes, {"error": plot}, pictures)


def _pictures(bake, caster, rows, evaluators, light_name, light):
    """The scene under one light by each method, where it is nearest to one per cent."""
    camera = replace(auto_camera(bake.scene), tangent=_TANGENT)
    rays = CameraRays(bake.scene, caster, camera, _WIDTH, _HEIGHT)
    truth = bake.transport.radiance(light)
    image = rays.picture(truth)
    stops = -np.log2(max(float(np.percentile(image.max(axis=-1), 97)), 1e-6))
    shown, differences = [("exact", to_srgb(image, stops))], []
    fitted = [row for row in rows if row["label"] in evaluators]
    for method in dict.fromkeys(row["method"] for row in fitted):
        own = [row for row in fitted if row["method"] == method]
        best = min(own, key=lambda row: abs(np.log(max(row["relit_l2_mean"], 1e-9) / _SHOWN_ERROR)))
        colours = radiance_of(evaluators[best["label"]], Subject(bake.transport), light)
        caption = f"{best['label']}: {best['bytes'] / 1e6:.1f} MB, {best['ms_median']:.1f} ms"
        shown.append((caption, to_srgb(rays.picture(colours), stops)))
        away = rays.picture(_FACTOR * np.abs(colours - truth))
        differences.append((caption, to_srgb(away, stops)))
    return [
        (f"Under '{light_name}'", shown),
        (f"{_FACTOR} times the difference from the exact colours", differences),
    ]
