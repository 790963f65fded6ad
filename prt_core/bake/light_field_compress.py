"""A light field's compressed form, kept beside it in its store.

Decibels are counted from the brightest radiance, as published. Where a sun is reflected that is
thousands of times what a picture shows, and forty decibels below it is more than the rest. So
without another goal the error of a direction is a share of the white level, which 99 % of the
directions of each light stay below.
"""

import math
import time

import numpy as np

from prt_core.bake.light_field_load import load_light_field
from prt_core.errors import expect, expect_number
from prt_core.lightfield.surface_light_field import SurfaceLightField, coded_nbytes_of
from prt_core.runtime.progress import Progress
from prt_core.store import (
    AGAIN,
    BakeStore,
    compressed_attributes,
    read_compressed,
    remove_compressed,
    write_compressed,
)

# What is asked for by itself; the share of directions below the white level, and how many are read
# for it.
TOLERANCE = 0.02
_BELOW_WHITE, _READ = 0.99, 1 << 22


def compress_light_field_steps(
    path,
    method="ceob",
    psnr=None,
    megabytes=None,
    n_coefficients=None,
    n_clusters=1,
    seed=0,
    tolerance=None,
    peak=None,
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
        How far: one of them, or `tolerance`.
    n_clusters : int or None
        None: as many as make it smallest.
    seed : int
    tolerance : float, optional
        Root mean square error of a direction, as a share of the white level. Default, where
        nothing else says how far: 0.02.
    peak : float, optional
        Radiance of the brightest lamp, from which decibels are counted; default: the largest of
        the field, or, with `tolerance`, the white level.

    Returns
    -------
    dict or None
        method, settings, psnr, psnr_per_sample, luma_psnr, peak, white, error (as `tolerance`),
        nbytes, coded_nbytes, raw_nbytes, seconds; None for `none`.

    Raises
    ------
    PRTError
        It cannot be read, or a setting is wrong.
    """
    goals = {"psnr": psnr, "megabytes": megabytes, "n_coefficients": n_coefficients}
    asked = {name: goal for name, goal in goals.items() if goal is not None}
    if method == "none":
        expect(
            not asked and tolerance is None and peak is None,
            "method 'none' removes the compressed form; it takes no PSNR, peak, size or "
            "coefficients",
        )
        load_light_field(path)
        remove_compressed(BakeStore(path, "r+"))
        return None
    expect(
        tolerance is None or not asked,
        f"tolerance: says how far, and so does {', '.join(asked)}; leave one of them out",
    )
    if not asked:
        tolerance = TOLERANCE if tolerance is None else tolerance
        expect_number("tolerance", tolerance, above=0, below=1)
        # Of the right kind until the field is known.
        asked = {"psnr": 0.0}
    more = {"n_clusters": n_clusters, "seed": seed, "peak": peak}
    model = SurfaceLightField(method, **asked, **more).expect_params()
    field = load_light_field(path)
    begun = time.perf_counter()
    white = white_level(field.radiance)
    if tolerance is not None:
        # The errors of lights add up as those of strangers do.
        parts = math.prod(field.angles) / len(field.lights)
        peak = white if peak is None else peak
        decibels = 20 * np.log10(peak / white) - 20 * np.log10(tolerance) - 10 * np.log10(parts)
        model.set_params(psnr=float(decibels), peak=peak)
    yield from model.fit_steps(field.radiance, field.frames)
    spent = time.perf_counter() - begun
    whole = np.empty(field.radiance.shape[1:], np.float32)
    for block, tables in field.tables(field.weights()):
        whole[block] = tables
    error, state = model.error(whole), model.state()
    report = {
        "method": method,
        "settings": {"tolerance": tolerance, **goals, **more},
        "psnr": _finite(error.psnr),
        "luma_psnr": _finite(error.luma_psnr),
        "psnr_per_sample": _finite(error.psnr_per_sample),
        "peak": error.peak,
        "white": white,
        "error": math.sqrt(error.rgb / error.n_cells) / white,
        "nbytes": int(model.nbytes),
        "coded_nbytes": coded_nbytes_of(state),
        "raw_nbytes": 4 * math.prod(field.radiance.shape),
        "seconds": spent,
    }
    for name in write_compressed(BakeStore(path, "r+"), state, report):
        yield Progress(f"store {name}", 0, 0)
    return report


def white_level(radiance):
    """Radiance that 99 % of the directions of each light stay below; 1 where all is dark.

    Parameters
    ----------
    radiance : (n_lights, n_points, m1, m2, 3) float
        Read a light at a time, where it is large in part.

    Returns
    -------
    float
    """
    step = max(1, -(-math.prod(radiance.shape[1:]) // _READ))
    levels = []
    for light in range(radiance.shape[0]):
        table = np.asarray(radiance[light])[::step]
        lit = table.max(axis=-1)
        levels.append(float(np.quantile(lit[lit > 0], _BELOW_WHITE)) if (lit > 0).any() else 0.0)
    return max(levels) or 1.0


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
