"""Rows in few coordinates that keep their distances."""

from dataclasses import dataclass

import numpy as np

from prt_core.compress.linalg import principal_rows
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

_BLOCK, _SAMPLE_FACTOR, _LEAST_SAMPLE = 512, 4, 1024


@dataclass
class Sketch:
    """Coordinates of rows along the principal directions of a sample of them.

    Attributes
    ----------
    basis : (n_sketch, n_features) float32
        Orthonormal, strongest first.
    coordinates : (n_points, n_sketch) float32
    rest : (n_points,) float32
        Squared length of what the coordinates leave out.
    """

    basis: np.ndarray
    coordinates: np.ndarray
    rest: np.ndarray


def sketch_steps(rows, n_sketch, seed=0):
    """A `Sketch` of all rows; one pass over them; a generator of `Progress`."""
    every = np.arange(rows.n_points)
    basis = yield from sketch_basis(rows, every, n_sketch, seed)
    return (yield from sketch_coordinates(rows, basis, every))


def sketch_basis(rows, points, n_sketch, seed=0):
    """Principal directions of a sample of some rows, (n_sketch, n_features) float32."""
    if hasattr(rows, "prepare_steps"):
        yield from rows.prepare_steps()
    n_sketch = min(n_sketch, len(points), rows.code.n_features)
    rng = generator(seed, Stage.SKETCH)
    n_sample = min(max(_SAMPLE_FACTOR * n_sketch, _LEAST_SAMPLE), len(points))
    sample = np.sort(rng.choice(points, n_sample, replace=False))
    return (
        yield from in_thread("sketch", lambda: principal_rows(rows.features(sample), n_sketch)[0])
    )


def sketch_coordinates(rows, basis, points):
    """`Sketch` of some rows along a basis; a generator of `Progress`."""

    def project(block):
        features = rows.features(block)
        coordinates = features @ basis.T
        rest = np.einsum("nf,nf->n", features, features)
        return coordinates, np.maximum(rest - np.einsum("nk,nk->n", coordinates, coordinates), 0)

    parts, done = [], 0
    blocks = [points[first : first + _BLOCK] for first in range(0, len(points), _BLOCK)]
    for part in in_parallel(project, blocks):
        parts.append(part)
        done += len(part[1])
        yield Progress("sketch", done, len(points))
    coordinates, rest = (np.concatenate(values) for values in zip(*parts, strict=True))
    return Sketch(basis, coordinates, rest)
