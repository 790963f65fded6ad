"""Compressors side by side on one bake: size, seconds, milliseconds, errors."""

import time
from dataclasses import dataclass

import numpy as np

from prt_core.compress import (
    Irradiance,
    Task,
    border_pairs,
    method_from_text,
    neighbour_pairs,
    seam,
)
from prt_core.compress.choice.choose import FAILURES, radiance_of, reason_of, relative_l2
from prt_core.compress.choice.methods import describe, settings_of
from prt_core.errors import expect
from prt_core.runtime.machine import peak_bytes, reset_peak
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

# White lights that estimate the matrix' error; points of the dense product that is timed.
_WHITE, _DENSE_POINTS = 6, 2048
# What a row of a method that failed has none of.
_NOTHING = dict.fromkeys(
    ("bytes", "bits_a_coefficient", "seconds", "peak_bytes", "ms_median", "ms_worst", "matrix_l2",
     "matrix_psnr", "relit_l2_mean", "relit_l2_worst", "worst_light", "relit_psnr", "seam",
     "seam_rms", "failure")
)  # fmt: skip


@dataclass
class Truth:
    """What compressors are measured against.

    Attributes
    ----------
    lights : dict of str -> (n_directions, 3) float32
    colours : dict of str -> (n_points, 3) float32
        Of the exact transport, all bounces.
    white, white_colours : list
        Lights that are noise, and the exact colours under them.
    largest : float
        Of the transport's entries, in a sample of rows.
    seconds : list of float
        What each exact colour took.
    """

    lights: dict
    colours: dict
    white: list
    white_colours: list
    largest: float
    seconds: list


def bench_compress_steps(bake, name, methods, lights, budget_numbers=None, seed=0, evaluators=None):
    """Fit and measure methods; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
    name : str
        Of the scene, for the rows.
    methods : sequence of str
        NAME or NAME:key=value,key=value (see `method_from_text`).
    lights : dict of str -> (n_directions, 3) float32
    budget_numbers : sequence of int, optional
        Which of each method's budgets; default: all.
    seed : int
    evaluators : dict, optional
        Filled with what gives products, by the label of its row (for pictures).

    Returns
    -------
    list of dict
        scene, points, directions, method, label, settings, bytes, bits_a_coefficient, seconds,
        peak_bytes, ms_median, ms_worst, matrix_l2, matrix_psnr, relit_l2_mean, relit_l2_worst,
        relit_psnr, worst_light, seam, seam_rms. First the dense product, the bake itself
        (`exact`), and irradiance without shadows, the floor. Bytes of a method are those that
        relighting reads; seconds count what all methods of a bake share. A method that failed
        has None for all that was to be measured, and `failure` says why.
    """
    chosen = [method_from_text(method) for method in methods]
    expect(lights, "light: give at least one")
    task = Task.of(bake.transport, bake.scene.points, seed, bake.dense)
    began = time.perf_counter()
    yield from task.rows.prepare_steps()
    prepared = time.perf_counter() - began
    truth = yield from _truth(bake.transport, lights, seed)
    pairs = neighbour_pairs(task.positions, task.normals, task.groups)
    head = {"scene": name, "points": task.n_points, "directions": bake.transport.n_directions}
    rows = [{**head, **row} for row in _references(task, truth)]
    for method in chosen:
        budgets = method.budgets(task)
        for budget in range(len(budgets)) if budget_numbers is None else budget_numbers:
            if budget >= len(budgets):
                continue
            model = budgets[budget]
            label = f"{method.name} ({describe(model)})"
            row = {
                **head,
                **_NOTHING,
                "method": method.name,
                "label": label,
                "settings": settings_of(model),
                "budget": budget,
            }
            try:
                measured = yield from _measured(
                    method, model, task, truth, pairs, label, evaluators
                )
                measured["seconds"] += prepared
            except FAILURES as error:
                measured = {"failure": reason_of(error)}
            rows.append({**row, **measured})
    return rows


def _measured(method, model, task, truth, pairs, label, evaluators):
    """Fit a model and measure it; a generator of `Progress` that returns its figures."""
    reset_peak()
    began = time.perf_counter()
    yield from model.fit_steps(task.rows)
    if method.finish is not None:
        method.finish(model, task)
    seconds = time.perf_counter() - began
    peak = peak_bytes()
    evaluator = method.evaluator(model, task.subject.read_bits)
    figures = {
        **_size(model.nbytes, task),
        "seconds": seconds,
        "peak_bytes": peak,
        **_matrix(model, truth, task),
        **(yield from _relit(evaluator, model, truth, task, pairs, label)),
    }
    if evaluators is not None:
        evaluators[label] = evaluator
    return figures


def _truth(transport, lights, seed):
    colours, seconds = {}, []
    for index, (name, light) in enumerate(lights.items()):
        start = time.perf_counter()
        colours[name] = transport.radiance(light)
        seconds.append(time.perf_counter() - start)
        yield Progress("exact", index + 1, len(lights))
    rng = generator(seed, Stage.BENCH_MATRIX)
    shape = transport.n_directions, 3
    white = [rng.standard_normal(shape).astype(np.float32) for _ in range(_WHITE)]
    sample = np.sort(rng.choice(transport.n_points, min(64, transport.n_points), replace=False))
    largest = float(np.abs(transport.rows(sample)).max())
    # Received light is cut at zero: each half of the noise by itself.
    sides = [
        transport.radiance(np.maximum(w, 0)) - transport.radiance(np.maximum(-w, 0)) for w in white
    ]
    return Truth(lights, colours, white, sides, largest, seconds)


def _references(task, truth):
    """The dense product, the exact bake and irradiance."""
    transport = task.transport
    n_entries = 3 * task.n_points * task.rows.n_directions
    sample = np.arange(min(_DENSE_POINTS, task.n_points))
    dense = [np.ascontiguousarray(transport.direct(sample)) for _ in range(3)]
    spent = []
    for light in list(truth.lights.values())[:8]:
        start = time.perf_counter()
        for matrix, channel in zip(dense, np.ascontiguousarray(light.T), strict=True):
            matrix @ channel
        spent.append((time.perf_counter() - start) * task.n_points / len(sample))
    exact = {"matrix_l2": 0.0, "relit_l2_mean": 0.0, "relit_l2_worst": 0.0, "seam": None}
    yield {
        "method": "dense", "label": "dense product", "settings": {"of_points": len(sample)},
        **_size(4 * n_entries, task), "seconds": None, "peak_bytes": None, **exact,
        "ms_median": 1e3 * float(np.median(spent)), "ms_worst": 1e3 * max(spent),
    }  # fmt: skip
    gather = transport.gather
    n_bytes = transport.bits.nbytes + transport.normals.nbytes + transport.albedo.nbytes
    if gather is not None:
        n_bytes += gather.data.nbytes + gather.indices.nbytes + gather.indptr.nbytes
    yield {
        "method": "exact", "label": "exact (bits and K)", "settings": {},
        **_size(n_bytes, task), "seconds": 0.0, "peak_bytes": None, **exact,
        "ms_median": 1e3 * float(np.median(truth.seconds)), "ms_worst": 1e3 * max(truth.seconds),
    }  # fmt: skip
    start = time.perf_counter()
    model = Irradiance().fit(task.rows)
    seconds = time.perf_counter() - start
    errors, spent = [], []
    for name, light in truth.lights.items():
        start = time.perf_counter()
        radiance = radiance_of(model, task.subject, light)
        spent.append(time.perf_counter() - start)
        errors.append(relative_l2(radiance, truth.colours[name]))
    yield {
        "method": "irradiance", "label": "irradiance", "settings": {},
        **_size(model.nbytes, task), "seconds": seconds, "peak_bytes": None, "matrix_l2": None,
        "relit_l2_mean": float(np.mean(errors)), "relit_l2_worst": max(errors), "seam": None,
        "ms_median": 1e3 * float(np.median(spent)), "ms_worst": 1e3 * max(spent),
    }  # fmt: skip


def _size(n_bytes, task):
    entries = 3 * task.n_points * task.rows.n_directions
    return {"bytes": int(n_bytes), "bits_a_coefficient": 8 * n_bytes / entries}


def _matrix(model, truth, task):
    """Relative L2 error of the whole matrix, and its PSNR, from white lights.

    The mean square of a matrix times white noise is the square of its Frobenius norm.
    """
    model = model.uncut()
    lost = kept = 0.0
    for light, wanted in zip(truth.white, truth.white_colours, strict=True):
        radiance = radiance_of(model, task.subject, light).astype(np.float64)
        lost += float(((radiance - wanted) ** 2).sum())
        kept += float((wanted.astype(np.float64) ** 2).sum())
    entries = 3 * task.n_points * task.rows.n_directions
    rms = np.sqrt(lost / (len(truth.white) * entries))
    psnr = 20 * np.log10(truth.largest / rms) if rms and truth.largest else None
    # A black scene has no size that an error could be a share of.
    share = np.sqrt(lost / kept) if kept else float(lost > 0)
    return {"matrix_l2": float(share), "matrix_psnr": psnr and float(psnr)}


def _relit(evaluator, model, truth, task, pairs, label):
    labels = getattr(model, "labels_", None)
    border = None if labels is None else border_pairs(labels, pairs)
    radiance_of(evaluator, task.subject, next(iter(truth.lights.values())))
    errors, spent, psnr, seams = {}, [], [], []
    for index, (name, light) in enumerate(truth.lights.items()):
        start = time.perf_counter()
        radiance = radiance_of(evaluator, task.subject, light)
        spent.append(time.perf_counter() - start)
        wanted = truth.colours[name]
        errors[name] = relative_l2(radiance, wanted)
        expect(np.isfinite(errors[name]), f"its colours are not finite under {name}")
        rms = max(float(np.sqrt(((radiance - wanted).astype(np.float64) ** 2).mean())), 1e-30)
        if wanted.any():
            psnr.append(20 * np.log10(float(wanted.max()) / rms))
        if border is not None:
            seams.append(seam(radiance, wanted, border))
        yield Progress(label.split(" ")[0], index + 1, len(truth.lights))
    worst = max(errors, key=errors.get)
    return {
        "ms_median": 1e3 * float(np.median(spent)),
        "ms_worst": 1e3 * max(spent),
        "relit_l2_mean": float(np.mean(list(errors.values()))),
        "relit_l2_worst": errors[worst],
        "worst_light": worst,
        "relit_psnr": float(np.mean(psnr)) if psnr else None,
        "seam": max((s["largest"] for s in seams), default=None),
        "seam_rms": float(np.mean([s["rms"] for s in seams])) if seams else None,
    }
