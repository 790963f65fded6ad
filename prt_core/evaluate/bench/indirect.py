"""Direct-to-indirect transfer against all bounces by the gather operator."""

import time

import numpy as np

from prt_core.compress.direct_to_indirect import DirectToIndirect
from prt_core.errors import expect
from prt_core.evaluate.metrics import colour_error
from prt_core.runtime.progress import Progress


def indirect_steps(transport, basis, received, points=None, kept=(0.01, 0.02, 0.05)):
    """Measure direct-to-indirect transfer; a generator of `Progress`.

    Parameters
    ----------
    transport : Transport
    basis : PointHaar or PointMultiwavelet
    received : sequence of (n_points, 3) float32
        Direct light of lamps (see `lamp_light`): those of a way that they move along.
    points : (n,) int, optional
        That are looked at; default: all.
    kept : sequence of float
        Shares of the coefficients of a row.

    Returns
    -------
    list of dict
        form, kept, points, bytes, seconds, ms (a light), l2_indirect and l2_mean, l2_worst of all
        that is received. First all bounces by the gather operator, at all points.
    """
    expect(len(received), "received: give at least one light")
    points = np.arange(transport.n_points) if points is None else np.asarray(points)
    begun = time.perf_counter()
    whole = [transport.with_bounces(light) for light in received]
    spent = 1e3 * (time.perf_counter() - begun) / len(received)
    gather = transport.gather
    n_bytes = gather.data.nbytes + gather.indices.nbytes + gather.indptr.nbytes
    exact = {"l2_indirect": 0.0, "l2_mean": 0.0, "l2_worst": 0.0}
    rows = [
        {"form": "bounces by the gather operator", "kept": None, "points": transport.n_points,
         "bytes": n_bytes, "seconds": 0.0, "ms": spent, **exact}
    ]  # fmt: skip
    for index, share in enumerate(kept):
        begun = time.perf_counter()
        form = DirectToIndirect(transport, basis, points, share)
        seconds = time.perf_counter() - begun
        begun = time.perf_counter()
        results = [form.indirect(light) for light in received]
        spent = 1e3 * (time.perf_counter() - begun) / len(received)
        indirect, errors = [], []
        for light, wanted, result in zip(received, whole, results, strict=True):
            light, wanted = light[points], wanted[points]
            indirect.append(colour_error(result, wanted - light)["l2"])
            errors.append(colour_error(result + light, wanted)["l2"])
        rows.append(
            {"form": f"direct to indirect, {100 * share:g} %", "kept": share,
             "points": len(points), "bytes": form.nbytes, "seconds": seconds, "ms": spent,
             "l2_indirect": float(np.mean(indirect)), "l2_mean": float(np.mean(errors)),
             "l2_worst": max(errors)}
        )  # fmt: skip
        yield Progress("direct to indirect", index + 1, len(kept))
    return rows
