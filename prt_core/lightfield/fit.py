"""How a light field is fitted: clusters, dictionaries, the threshold, then all coefficients.

A threshold that reaches an error or a size is searched for on a part of the points, with the
dictionaries as they are; then all points are written, and again where the part was not like all.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import PRTError
from prt_core.lightfield.clustering import cluster_hrdfs_steps
from prt_core.lightfield.code import byte_planes
from prt_core.lightfield.field_error import decibels
from prt_core.lightfield.goals import last_that_holds_steps
from prt_core.lightfield.hrdf import FROM_YCBCR, TO_YCBCR
from prt_core.runtime.seeds import Stage, generator

# What a change of luma, Cb or Cr does to R, G and B, in proportion to luma's.
_STRENGTHS = np.linalg.norm(FROM_YCBCR, axis=1) / np.sqrt(3)
# Points of the search, times that all points are written, and decibels that may be spared.
_SAMPLE, _WRITTEN, _SPARED = 2048, 4, 0.05
# Numbers of a field whose threshold is looked for are above about so much of its error.
_FIRST = 0.4
# What the chosen number of clusters is at most, and the points a cluster has at least.
_MOST_CLUSTERS, _LEAST_POINTS = 64, 64
# Bytes of a light's text beside its arrays, about.
_TEXT = 1200


@dataclass
class _Light:
    """One light: clusters, a trained compressor a channel, bases, and channels of some HRDFs."""

    labels: np.ndarray
    models: list
    bases: np.ndarray
    sample: np.ndarray
    sample_labels: np.ndarray

    def trials_steps(self, threshold):
        """Compressors of the sample with another threshold."""
        trials = []
        for c, model in enumerate(self.models):
            hrdfs, own = self.sample[c], threshold / _STRENGTHS[c]
            trials.append((yield from model.trial_steps(hrdfs, self.sample_labels, own)))
        return trials


def fit_lights_steps(field, lights, peak):
    """Compress all lights of a field; a generator of `Progress`.

    Parameters
    ----------
    field : SurfaceLightField
        Its parameters.
    lights : iterable of (n_points, m1, m2, 3) float32
        With `n_points`; iterated over several times.
    peak : float

    Returns
    -------
    list of (labels, compressors, bases)
        Of each light: (n_points,) int32, fitted ones of luma, Cb and Cr, (3, n_points) float16.
    """
    goal = field.goal()
    if field.n_clusters is not None:
        trained = yield from _train_steps(field, lights, field.n_clusters)
        threshold = goal.threshold
        if goal.is_searched:
            threshold = yield from _threshold_steps(goal, trained, peak)
    else:
        trained, threshold = yield from _smallest_steps(field, lights, peak)
    error = yield from _write_steps(lights, trained, threshold)
    for _ in range(_WRITTEN - 1 if goal.is_searched else 0):
        factor = _correction(goal, decibels(peak, error), _nbytes(trained))
        # Where the sample was all there is, a threshold that holds is the best one.
        if factor == 1 or (factor > 1) == (goal.psnr is not None) and _is_all(trained):
            break
        threshold *= factor
        error = yield from _write_steps(lights, trained, threshold)
    return [(light.labels, light.models, light.bases) for light in trained]


def _correction(goal, psnr, nbytes):
    """The factor of the threshold that brings a field to its goal; 1 where it is there."""
    if goal.psnr is not None:
        # The error goes about with the threshold.
        beyond = psnr - goal.psnr
        near = 0 <= beyond <= _SPARED or not np.isfinite(beyond)
        return 1 if near else 10 ** ((beyond - _SPARED / 2) / 20)
    # The number of coefficients goes about with its inverse.
    share = nbytes / (1e6 * goal.megabytes)
    return 1 if 0.97 <= share <= 1 else 1.015 * share


def _is_all(trained):
    return all(len(light.sample_labels) == len(light.labels) for light in trained)


def _channel(rgb, c):
    """(n, m1, m2) float32: luma, Cb or Cr."""
    return rgb @ TO_YCBCR[:, c].astype(np.float32)


def _above_base(hrdfs):
    """What HRDFs have beyond their base, and the base: (n,) float16, the median of each.

    It is what a rough surface sends everywhere alike. Bases that are learned for highlights have
    no vector for that, and would spread it over many small coefficients.
    """
    medians = np.median(hrdfs.reshape(len(hrdfs), -1), axis=1)
    most = float(np.finfo(np.float16).max)
    base = np.clip(medians, -most, most).astype(np.float16)
    return hrdfs - base.astype(np.float32)[:, None, None], base


def _train_steps(field, lights, n_clusters, n_halvings=0):
    """Clusters and dictionaries of all lights, these halved so many times."""
    goal, result = field.goal(), []
    # The dictionaries do not hang on the threshold; any will do until it is known.
    threshold = None if goal.n_coefficients else goal.threshold or 1.0
    model = field.compressor(n_coefficients=goal.n_coefficients, threshold=threshold)
    for _ in range(n_halvings):
        model = model.halved()
    for rgb in lights:
        luma = _channel(rgb, 0)
        labels = yield from cluster_hrdfs_steps(luma, n_clusters, field.seed)
        models = [model.clone(), model.for_chroma(), model.for_chroma()]
        chosen = slice(None)
        if len(rgb) > _SAMPLE:
            rng = generator(field.seed, Stage.HRDF_SAMPLE)
            chosen = np.sort(rng.choice(len(rgb), _SAMPLE, replace=False))
        bases, sample = [], []
        for c, each in enumerate(models):
            hrdfs, base = _above_base(luma if c == 0 else _channel(rgb, c))
            yield from each.train_steps(hrdfs, labels)
            bases.append(base)
            sample.append(hrdfs[chosen])
        result.append(_Light(labels, models, np.stack(bases), np.stack(sample), labels[chosen]))
    return result


def _threshold_steps(goal, trained, peak):
    """The largest threshold that reaches an error, or the smallest that reaches a size."""

    last = {}

    def holds_steps(threshold):
        with_size = goal.megabytes is not None
        error, nbytes = yield from _sampled_steps(trained, threshold, with_size)
        last.update(psnr=decibels(peak, error), nbytes=nbytes)
        return goal.reached(last["psnr"], nbytes)

    energy = sum(np.square(light.sample[0], dtype=np.float64).mean() for light in trained)
    first = np.sqrt(energy)
    if goal.psnr is not None:
        first = peak * 10 ** (-goal.psnr / 20)
    rising = goal.psnr is not None
    threshold = yield from last_that_holds_steps(holds_steps, _FIRST * first or 1.0, rising)
    if threshold is None and rising:
        raise PRTError(
            f"psnr: {goal.psnr:g} dB are out of reach of this method and dictionary, which end at "
            f"{last['psnr']:.1f}; ask for less, or choose another method"
        )
    if threshold is None:
        raise PRTError(
            f"megabytes: {goal.megabytes:g} are too few, for dictionaries and indices alone take "
            f"{last['nbytes'] / 1e6:.3g}; give more, or a smaller dictionary"
        )
    return threshold


def _sampled_steps(trained, threshold, with_size=True):
    """The error and the bytes that a threshold leads to, by the samples."""
    error, nbytes = 0.0, _others(trained)
    for light in trained:
        models = yield from light.trials_steps(threshold)
        error += _rgb_error(models, light.sample, slice(None)) / light.sample.shape[1]
        if with_size:
            scale = len(light.labels) / light.sample.shape[1]
            for model in models:
                dictionary = model.dictionary_nbytes
                nbytes += dictionary + (model.coded_nbytes - dictionary) * scale
    return error, nbytes


def _rgb_error(models, channels, points):
    """The squared error of a channel R, G or B on average, of some points' luma, Cb and Cr."""
    error = np.stack([model.decode(points) for model in models], axis=-1)
    error -= np.moveaxis(channels, 0, -1)
    return np.square(error @ FROM_YCBCR.astype(np.float32), dtype=np.float64).sum() / 3


def _write_steps(lights, trained, threshold):
    """Write all points of all lights; returns the error, the lights' together."""
    total = 0.0
    for rgb, light in zip(lights, trained, strict=True):
        for c, model in enumerate(light.models):
            if threshold is not None:
                model.set_params(threshold=float(threshold / _STRENGTHS[c]))
            yield from model.encode_steps(_above_base(_channel(rgb, c))[0], light.labels)
        for first in range(0, len(rgb), _SAMPLE):
            part = np.arange(first, min(first + _SAMPLE, len(rgb)))
            channels = np.stack([_above_base(_channel(rgb[part], c))[0] for c in range(3)])
            total += _rgb_error(light.models, channels, part) / len(rgb)
    return total


def _nbytes(trained):
    models = sum(model.coded_nbytes for light in trained for model in light.models)
    return models + _others(trained)


def _others(trained):
    """Bytes of clusters and bases, and of what is said of the arrays."""
    return sum(
        _TEXT + len(byte_planes(light.labels.astype(np.uint16))) + len(byte_planes(light.bases))
        for light in trained
    )


def _smallest_steps(field, lights, peak):
    """Clusters and dictionaries that make a field smallest at its error, or nearest at its size.

    First more clusters, as long as they pay for their dictionaries, then smaller dictionaries.
    """
    best, n_clusters, n_halvings = (yield from _attempt_steps(field, lights, peak, 1, 0)), 1, 0
    while 2 * n_clusters <= min(_MOST_CLUSTERS, lights.n_points / _LEAST_POINTS):
        other = yield from _attempt_steps(field, lights, peak, 2 * n_clusters, 0)
        if other[0] >= best[0]:
            break
        best, n_clusters = other, 2 * n_clusters
    while best[1][0].models[0].halved() is not None:
        other = yield from _attempt_steps(field, lights, peak, n_clusters, n_halvings + 1)
        if other[0] >= best[0]:
            break
        best, n_halvings = other, n_halvings + 1
    return best[1], best[2]


def _attempt_steps(field, lights, peak, n_clusters, n_halvings):
    """What a number of clusters costs, the trained lights, and the threshold."""
    goal = field.goal()
    trained = yield from _train_steps(field, lights, n_clusters, n_halvings)
    threshold = goal.threshold
    if goal.is_searched:
        threshold = yield from _threshold_steps(goal, trained, peak)
    error, nbytes = yield from _sampled_steps(trained, threshold)
    if goal.megabytes is not None:
        return error, trained, threshold
    if goal.psnr is not None:
        return nbytes, trained, threshold
    # Squared error of threshold^2 is worth a number, which takes about a byte.
    return error * 3 * lights.n_points / threshold**2 + nbytes, trained, threshold
