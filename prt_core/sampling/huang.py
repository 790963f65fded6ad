"""Sparse precomputation of the visibility after Huang & Ramamoorthi (2010), whole.

A quarter of the points, chosen by exploration, is sampled densely but adaptively in angle; every
other point is a sparse combination of the dense points around it, found from a few hundred
directions that tell them apart. What comes out is thresholded to bits.
"""

import time
from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_kind,
    expect_number,
    expect_one_of,
    expect_seed,
    expect_whole,
)
from prt_core.sampling.adaptive_angle import AngularGrid
from prt_core.sampling.dense import DensePoints, dense_steps
from prt_core.sampling.rivals import COLUMN_CHOICES
from prt_core.sampling.sampled import Sampled, register_sampler
from prt_core.sampling.sparse import SparsePoints, sparse_blocks
from prt_core.sampling.tracer import Tracer

RECONSTRUCTIONS = ("l1", "least_squares", "full")
COLUMNS = ("features", *COLUMN_CHOICES)


@dataclass(frozen=True)
class HuangSettings:
    """Settings of `sample_huang`; the defaults are the paper's.

    Parameters
    ----------
    dense_share, first_share : float
        Share of each object's points that are dense, and of those of the first iteration.
    iterations : int
        After the first.
    window : int
        Texels of the window that decides about directions of dense points.
    features : int
        Directions traced at each sparse point.
    radius : float
        Of neighbourhoods, in units of the scene's size: the paper's 0.2 on a ground of 4.
    normal_weight : float
        Neighbours are nearest in position and, with this weight, in normal; 0 is the paper's.
    neighbours : int
        Dense points that a sparse one is made of, at most: the nearest.
    fewest : int
        So many neighbours are taken even from beyond the radius.
    rank_neighbours : int
    rank_threshold : float
        Singular values below this share of the largest do not count.
    rank_power : float
        Points are drawn in proportion to this power of their rank; 1 is the paper's.
    reconstruction : {"l1", "least_squares", "full"}
    columns : {"features", "hasan", "wang"}
        How the directions of sparse points are chosen: for each point by variance and features,
        or for each object by one of the rivals.
    reduced_rows : int
        Rows that the rivals cluster columns on.
    strength : float
        lambda of the sparse solutions, as a share of the least that makes them zero.
    quantity : {"transport", "visibility"}
        What is combined linearly: rows of T, or visibility weighted by each point's own cosine.
    threshold : float
        A direction is seen where the combination is above this share of its unoccluded value.
    fewest_dense : int
        Dense points of even the smallest object.
    seed : int
    """

    dense_share: float = 0.25
    first_share: float = 0.05
    iterations: int = 4
    window: int = 7
    features: int = 350
    radius: float = 0.05
    normal_weight: float = 0.02
    neighbours: int = 12
    fewest: int = 4
    rank_neighbours: int = 12
    rank_threshold: float = 0.1
    rank_power: float = 2.0
    reconstruction: str = "l1"
    columns: str = "features"
    reduced_rows: int = 300
    strength: float = 3e-3
    quantity: str = "transport"
    threshold: float = 0.4
    fewest_dense: int = 8
    seed: int = 0

    def __post_init__(self):
        for name in ("dense_share", "first_share", "threshold"):
            expect_number(name, getattr(self, name), above=0, most=1)
        for name in ("features", "neighbours", "fewest", "rank_neighbours", "fewest_dense",
                     "reduced_rows"):  # fmt: skip
            expect_whole(name, getattr(self, name), 1)
        expect_whole("iterations", self.iterations, 0)
        expect(
            expect_whole("window", self.window, 3) % 2 == 1,
            f"window: expected an odd number >= 3, got {self.window!r}",
        )
        for name in ("radius", "strength", "rank_power"):
            expect_number(name, getattr(self, name), above=0)
        expect_number("normal_weight", self.normal_weight, 0)
        expect_number("rank_threshold", self.rank_threshold, 0, 1)
        expect_one_of("reconstruction", self.reconstruction, RECONSTRUCTIONS)
        expect_one_of("columns", self.columns, COLUMNS)
        expect_one_of("quantity", self.quantity, ("transport", "visibility"))
        expect_seed(self.seed)


@dataclass
class HuangSampled(Sampled):
    """What came out, and the dense points it was made from; see `Sampled` for the rest.

    Attributes
    ----------
    dense : DensePoints
        Their rows are the exemplars that a compressor may start from; each sparse point is near
        to a combination of those around it.
    """

    dense: DensePoints | None = None


def sample_huang(scene, cube_map, caster, settings=None, tally=None, pace=None, factor=None):
    """Visibility from dense and sparse points; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : HuangSettings
    tally : callable(int), optional
        Told the number of rays of each batch.
    pace : Pace, optional
        In rays; the result is the same.
    factor : callable(points, directions) -> (n, m) float32, optional
        What is transported where all is seen, of either sign, in place of the cosine: an in-out
        term of the reflectance (see `TermFactor`). What comes out is the visibility that goes with
        it; the rows of the term are both multiplied.

    Returns
    -------
    HuangSampled
        `attributes`: dense_points, dense_entries, sparse_entries, mean_rank, neighbours_used (of
        each sparse point, mean) and duality_gap (the largest, as a share of |y|^2).
    """
    settings = HuangSettings() if settings is None else settings
    expect_kind("settings", settings, HuangSettings)
    expect(
        factor is None or (callable(factor) and settings.quantity == "transport"),
        "factor: expected a function of points and directions, and quantity 'transport'",
    )
    seconds = {}
    clock = _Clock(seconds)
    tracer = Tracer(scene, cube_map, caster, tally, pace)
    grid = AngularGrid(cube_map, settings.window)
    dense = yield from clock.around("dense", dense_steps(scene, tracer, grid, settings, factor))
    dense_rays = tracer.rays
    shape = len(scene.points), -(-cube_map.n_directions // 8)
    bits, traced = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    bits[dense.points], traced[dense.points] = dense.rows.bits, dense.rows.traced
    sparse = SparsePoints(scene, cube_map, tracer, dense, settings, clock.around, pace, factor)
    for points, neighbours in sparse_blocks(scene, dense, settings):
        bits[points], traced[points] = yield from sparse.fill(points, neighbours)
    attributes = {
        "dense_points": len(dense.points),
        "dense_entries": dense_rays,
        "sparse_entries": tracer.rays - dense_rays,
        "mean_rank": float(dense.rank.mean()) if len(dense.rank) else 0.0,
        **sparse.attributes(),
    }
    return HuangSampled(bits, traced, tracer.rays, seconds, attributes, dense)


class _Clock:
    """Adds the time that a generator works, not that its caller takes, to a stage."""

    def __init__(self, seconds):
        self.seconds = seconds

    def around(self, stage, steps):
        start = time.perf_counter()
        try:
            while True:
                progress = next(steps)
                self._add(stage, start)
                yield progress
                start = time.perf_counter()
        except StopIteration as end:
            self._add(stage, start)
            return end.value

    def _add(self, stage, start):
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


register_sampler("huang", sample_huang, HuangSettings)
