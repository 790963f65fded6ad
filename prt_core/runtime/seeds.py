"""The one table of random stages: what is drawn where never depends on what else was drawn."""

from enum import IntEnum, unique

import numpy as np


@unique
class Stage(IntEnum):
    """What random numbers are drawn for; a number is never used again for something else."""

    GATHER = 1
    LAMPS = 2
    REFERENCE = 3
    AGREEMENT = 4
    CERTIFICATE = 5
    SKETCH = 6
    DETAILS = 7
    KMEANS = 8
    COLUMN_SAMPLE = 9
    DENSE_POINTS = 11
    RANK_SIGNS = 12
    SPARSE_RAYS = 13
    INDIRECT = 14
    SUBSPACE = 15
    DITHER = 16
    BENCH_MATRIX = 17
    GATHER_SHIFT = 18
    SIDES = 19
    EMISSION_RAYS = 21
    EMISSION_SAMPLES = 22
    EMISSION_SIDES = 23
    EXEMPLARS = 24
    HRDF_CLUSTERS = 25
    HRDF_TRAINING = 26
    ATOMS = 27
    POWER_ITERATION = 28
    HRDF_SAMPLE = 29
    LIGHT_FIELD = 31
    REFLECTIONS = 32
    LOBES = 33
    GLOSS_CERTIFICATE = 34
    PICTURES = 35


def generator(seed, stage, *key):
    """Random numbers of one stage.

    Parameters
    ----------
    seed : int
    stage : Stage
    *key : int
        What within the stage: turn, round, block, object; the same numbers in any order of work.

    Returns
    -------
    numpy.random.Generator
    """
    return np.random.default_rng([int(seed), int(stage), *(int(part) for part in key)])
