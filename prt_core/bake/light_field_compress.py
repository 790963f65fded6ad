"""A light field's compressed form, kept beside it in its store."""

import math
import time

import numpy as np

from prt_core.bake.light_field_load import load_light_field
from prt_core.errors import expect
from prt_core.lightfield.surface_light_field import SurfaceLightField
from prt_core.runtime.progress import Progress
from prt_core.store import (
    AGAIN,
    BakeStore,
    compressed_attributes,
    read_compressed,
    remove_compressed,
    write_compressed,
)


def compress_light_field_steps(
    path, method="ceob", psnr=None, megabytes=None, n_coefficients=None, n_clusters=1, seed=0
):
    """Compress a light field; a generator of `Progress`.

    Parameters
    ----------
    path : str or Path
        `NAME.slf`.
    method : str
        `NAME` or `NAME:key=value,…` (see `SurfaceLightField`), or `none`, which removes the form
        that is there.
    psnr, megabytes, n_coefficients : float, optional
        How far: exactly one of them; default: a PSNR of 40 dB.
    n_clusters : int or None
        None: as many as make it smallest.
    seed : int

    Returns
    -------
    dict or None
        method, settings, psnr, psnr_per_sample, luma_psnr, nbytes, coded_nbytes, raw_nbytes,
        seconds; None for `none`.

    Raises
    ------
    PRTError
        It cannot be read, or a setting is wrong.
    """
    goals = {"psnr": psnr, "megabytes": megabytes, "n_coefficients": n_coefficients}
    if method == "none":
        expect(
            not any(goal is not None for goal in goals.values()),
            "method 'none' removes the compressed form; it takes no PSNR, size or coefficients",
        )
        load_light_field(path)
        remove_compressed(BakeStore(path, "r+"))
        return None
    if all(goal is None for goal in goals.values()):
        goals["psnr"] = 40.0
    model = SurfaceLightField(method, n_clusters=n_clusters, seed=seed, **goals).expect_params()
    field = load_light_field(path)
    begun = time.perf_counter()
    yield from model.fit_steps(field.radiance, field.frames)
    spent = time.perf_counter() - begun
    whole = np.empty(field.radiance.shape[1:], np.float32)
    for block, tables in field.tables(field.weights()):
        whole[block] = tables
    error, state = model.error(whole), model.state()
    report = {
        "method": method,
        "settings": {**goals, "n_clusters": n_clusters, "seed": seed},
        "psnr": _finite(error.psnr),
        "luma_psnr": _finite(error.luma_psnr),
        "psnr_per_sample": _finite(error.psnr_per_sample),
        "peak": error.peak,
        "nbytes": int(model.nbytes),
        "coded_nbytes": len(state["data"]),
        "raw_nbytes": 4 * math.prod(field.radiance.shape),
        "seconds": spent,
    }
    for name in write_compressed(BakeStore(path, "r+"), state, report):
        yield Progress(f"store {name}", 0, 0)
    return report


def compressed_light_field(field):
    """The `SurfaceLightField` of a `LightField`'s compressed form; None where it has none.

    Raises
    ------
    PRTError
        It is damaged, or does not fit the field.
    """
    attributes = compressed_attributes(field.store)
    if attributes is None:
        return None
    model = SurfaceLightField.from_state(read_compressed(field.store, attributes))
    shape = model.n_lights_, model.n_points_, *model.layout_.shape, 3
    expect(
        shape == field.radiance.shape,
        f"{field.store.path}: its compressed form is of another light field; {AGAIN}",
    )
    return model


def _finite(decibels):
    """Decibels as JSON knows them: None where there is no error at all."""
    return decibels if math.isfinite(decibels) else None
