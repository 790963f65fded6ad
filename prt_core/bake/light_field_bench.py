"""Compressors side by side on one light field: errors, bytes, seconds of training, milliseconds."""

import math
import time

import numpy as np

from prt_core.bake.light_field_view import camera_at, view_of
from prt_core.compress.choice.choose import FAILURES, reason_of
from prt_core.errors import expect
from prt_core.evaluate.report import Report, curve_plot
from prt_core.lightfield.methods import METHODS
from prt_core.lightfield.surface_light_field import SurfaceLightField
from prt_core.runtime.progress import Progress

# Views that are timed: half a degree apart, from so many radii away.
_N_VIEWS, _STEP, _RADII = 7, np.radians(0.5), 3.0
# What a row of a method that failed has none of.
_MEASURED = (
    "psnr", "luma_psnr", "psnr_per_sample", "fixed_bytes", "coded_bytes", "fixed_percent",
    "coded_percent", "dictionary_bytes", "seconds", "decoded_ms", "coefficients_ms",
    "failure",
)  # fmt: skip
_COLUMNS = [
    ("field", ""), ("label", ""), ("goal", ""), ("psnr", ".1f"), ("luma_psnr", ".1f"),
    ("psnr_per_sample", ".1f"), ("fixed_bytes", ",d"), ("coded_bytes", ",d"),
    ("fixed_percent", ".3f"), ("coded_percent", ".3f"), ("dictionary_bytes", ",d"),
    ("seconds", ".1f"), ("decoded_ms", ".2f"), ("coefficients_ms", ".2f"), ("failure", ""),
]  # fmt: skip
_LABELS = {
    "coefficients": "coefficients of luma",
    "coded_percent": "coded, % of raw",
    "fixed_percent": "fixed width, % of raw",
    "luma_psnr": "PSNR of luma, dB (equation 5)",
    "psnr": "PSNR of R, G, B, dB (equation 5)",
}


def bench_light_field_steps(
    field, name, methods=tuple(METHODS), coefficients=(), psnrs=(), n_clusters=1, peak=None, seed=0
):
    """Fit and measure methods at several sizes; a generator of `Progress`.

    Parameters
    ----------
    field : LightField
    name : str
        Of the field, for the rows.
    methods : sequence of str
        `NAME` or `NAME:key=value,…` (see `SurfaceLightField`).
    coefficients : sequence of int
        Numbers of luma that are kept of each point.
    psnrs : sequence of float
        Decibels of equation 5 that are reached.
    n_clusters : int
    peak : float, optional
        Radiance of the brightest lamp; default: the largest of the field.
    seed : int

    Returns
    -------
    list of dict
        field, points, cells, lights, raw_bytes, method, label, goal, coefficients, goal_psnr, peak,
        psnr (of R, G and B; None: no error at all), luma_psnr, psnr_per_sample, fixed_bytes,
        coded_bytes, fixed_percent, coded_percent (of raw float32), dictionary_bytes, seconds (of
        the whole fit), decoded_ms and coefficients_ms (a view of all points, from decoded blocks
        and from coefficients: the median). A method that cannot reach its goal has None for all of
        that, and `failure` says why.

    Raises
    ------
    PRTError
        No goal, or a method or goal is wrong.
    """
    models = models_of(methods, coefficients, psnrs, n_clusters, peak, seed)
    whole = np.empty(field.radiance.shape[1:], np.float32)
    for block, tables in field.tables(field.weights()):
        whole[block] = tables
        yield Progress("read", block.stop, len(field))
    raw = 4 * math.prod(field.radiance.shape)
    ways = list(_ways(field))
    rows = []
    for model in models:
        count = model.n_coefficients
        row = {
            "field": name, "points": len(field), "cells": math.prod(field.angles),
            "lights": len(field.lights), "raw_bytes": raw,
            "method": model.method.partition(":")[0], "label": model.method,
            "goal": f"{model.psnr:g} dB" if count is None else f"{count} coefficients",
            "coefficients": count, "goal_psnr": model.psnr, "peak": None,
            **dict.fromkeys(_MEASURED),
        }  # fmt: skip
        try:
            row |= yield from _measured(model, field, whole, raw, ways)
        except FAILURES as error:
            row["failure"] = reason_of(error)
        rows.append(row)
    return rows


def models_of(methods, coefficients, psnrs, n_clusters=1, peak=None, seed=0):
    """The `SurfaceLightField` of every method and goal, none fitted; `PRTError` on a wrong one."""
    goals = [{"n_coefficients": n} for n in coefficients] + [{"psnr": p} for p in psnrs]
    expect(goals, "bench: expected at least one number of coefficients or PSNR")
    more = {"n_clusters": n_clusters, "peak": peak, "seed": seed}
    return [
        SurfaceLightField(method, **goal, **more).expect_params()
        for method in methods
        for goal in goals
    ]


def _measured(model, field, whole, raw, ways):
    began = time.perf_counter()
    yield from model.fit_steps(field.radiance, field.frames)
    seconds = time.perf_counter() - began
    error = model.error(whole)
    coded = model.coded_nbytes
    dictionaries = [part.dictionary_nbytes for light in model.compressors_ for part in light]
    yield Progress("views", 0, 0)
    return {
        "peak": error.peak,
        "psnr": _finite(error.psnr),
        "luma_psnr": _finite(error.luma_psnr),
        "psnr_per_sample": _finite(error.psnr_per_sample),
        "fixed_bytes": int(model.nbytes),
        "coded_bytes": int(coded),
        "fixed_percent": 100 * model.nbytes / raw,
        "coded_percent": 100 * coded / raw,
        "dictionary_bytes": int(sum(dictionaries)),
        "seconds": seconds,
        "decoded_ms": _milliseconds(model.viewer(), ways),
        "coefficients_ms": _milliseconds(model.viewer(most_bytes=0), ways),
    }


def _ways(field):
    """Directions (n_points, 3) from the points to each of some viewers on an arc."""
    positions = field.scene.to_world(field.scene.points.positions[field.point])
    low, high = positions.min(axis=0), positions.max(axis=0)
    middle, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    for angle in _STEP * np.arange(_N_VIEWS):
        place = middle + _RADII * radius * np.array([np.cos(angle), np.sin(angle), 0.6])
        yield view_of(camera_at(field, place)).outgoing(positions).astype(np.float32)


def _milliseconds(viewer, ways):
    """The median of all views but the first, which makes what the others use."""
    spent = []
    for directions in ways:
        began = time.perf_counter()
        viewer.toward(directions)
        spent.append(time.perf_counter() - began)
    return 1e3 * float(np.median(spent[1:]))


def _finite(decibels):
    """Decibels as JSON knows them: None where there is no error at all."""
    return decibels if math.isfinite(decibels) else None


def light_field_bench_report(rows):
    """A `Report` of what `bench_light_field_steps` returned, of one field or several.

    Parameters
    ----------
    rows : list of dict

    Returns
    -------
    Report
    """
    names = list(dict.fromkeys(row["field"] for row in rows))
    notes = [
        f"{row['field']}: {row['points']:,} points, {row['cells']:,} directions, {row['lights']} "
        f"light{'s' if row['lights'] > 1 else ''}, {row['raw_bytes'] / 1e6:.1f} MB as float32."
        for row in (next(row for row in rows if row["field"] == name) for name in names)
    ]
    notes.append(
        "PSNR is that of equation 5 of Miandji et al. 2013: the peak, the radiance of the "
        "brightest lamp, over the root mean square norm of an HRDF's error; per sample the mean "
        "is over directions as well. Fixed width is what is kept in memory, coded what is stored. "
        "A view is of all points."
    )
    plots = {}
    measured = [row for row in rows if row["failure"] is None]
    counted = [row for row in measured if row["coefficients"] is not None]
    reached = [row for row in measured if row["goal_psnr"] is not None]
    if counted:
        plots["coefficients"] = curve_plot(
            counted, "coefficients", "luma_psnr", "field", "label", _LABELS, ("x",)
        )
    if reached:
        plots["sizes"] = curve_plot(
            reached, ["fixed_percent", "coded_percent"], "psnr", "field", "label", _LABELS, ("x",)
        )
    return Report(f"Light fields: {', '.join(names)}", rows, _COLUMNS, notes, plots)
