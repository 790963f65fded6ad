"""Rows from a few of their entries: least squares and sparse L1, many problems at once."""

from prt_core.reconstruct.l1_batched import L1Solutions, gram, l1_batched, l1_certificate
from prt_core.reconstruct.l1_interior_point import l1_interior_point
from prt_core.reconstruct.least_squares import least_squares

__all__ = [
    "L1Solutions",
    "gram",
    "l1_batched",
    "l1_certificate",
    "l1_interior_point",
    "least_squares",
]
