"""Who takes what from whom while few points are known: shares of the known points around others."""

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from prt_core.errors import expect, expect_array, expect_kind
from prt_core.sampling.neighbours import Neighbours
from prt_core.scene import Scene

# Known points around another that it takes from, of so many near ones.
_AROUND, _CANDIDATES = 3, 4
# How far apart two points of different objects count whose normals differ by 1; and the cosine
# between normals above which a point tells another something.
_NORMAL, _FACES = 0.05, 0.3


class Spread:
    """Shares in which the points of a scene take from those that are known.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    groups : (n_points,) int64
        The objects of the points, of which each takes from itself first.
    """

    def __init__(self, scene):
        points = expect_kind("scene", scene, Scene).points
        self._n_points, self._normals = len(points), points.normals
        self.groups = points.object_index.astype(np.int64)
        self._neighbours = Neighbours(points, self.groups)
        self._places = np.hstack([points.positions, _NORMAL * points.normals])

    def shares(self, known):
        """(n_points, n_known) CSR float32: rows sum to 1; a known point has all from itself.

        Of three known points around on its object, the nearer the more; where none of them faces
        as it does, from the nearest one anywhere that does.

        Parameters
        ----------
        known : (n_known,) int
            At least one.
        """
        known = self._checked("known", known)
        other = np.ones(self._n_points, bool)
        other[known] = False
        rows, columns, weights = self._taken(known, np.flatnonzero(other), False)
        rows, columns = np.concatenate([known, rows]), np.concatenate([known, columns])
        weights = np.concatenate([np.ones(len(known), np.float32), weights])
        shape = self._n_points, len(known)
        return sp.csr_matrix((weights, (rows, self._place_of(known)[columns])), shape=shape)

    def left_out(self, known, wanted):
        """(n_wanted, n_known) CSR float32: the shares of points as if each were not known.

        What this gives against what they know tells how far off the others are.

        Parameters
        ----------
        known, wanted : (n_known,), (n_wanted,) int
            `wanted` are among the known.
        """
        known, wanted = self._checked("known", known), self._checked("wanted", wanted)
        expect(np.isin(wanted, known).all(), "wanted: expected some of the known points")
        rows, columns, weights = self._taken(known, wanted, True)
        shape = len(wanted), len(known)
        rows, columns = self._place_of(wanted)[rows], self._place_of(known)[columns]
        return sp.csr_matrix((weights, (rows, columns)), shape=shape)

    def _checked(self, name, points):
        points = expect_array(name, points, (None,), np.int64, 0, self._n_points - 1)
        good = len(points) and len(np.unique(points)) == len(points)
        expect(good, f"{name}: expected at least one point, and each of them once")
        return points

    def _place_of(self, known):
        """(n_points,) int: where each point is among the known ones, where it is one."""
        place = np.zeros(self._n_points, np.int64)
        place[known] = np.arange(len(known))
        return place

    def _taken(self, known, wanted, itself):
        """Who takes (m,), from whom (m,), which share (m,)."""
        around = self._neighbours.around(known, wanted, _AROUND, _CANDIDATES, itself)
        facing = np.einsum("nkx,nx->nk", self._normals[around], self._normals[wanted])
        alone = np.flatnonzero(((around < 0) | (facing < _FACES)).all(axis=1))
        if len(alone):
            around[alone] = -1
            around[alone, 0] = self._nearest(known, wanted[alone], itself)
        taker, slot = np.nonzero(around >= 0)
        giver = around[taker, slot]
        way = self._places[giver] - self._places[wanted[taker]]
        weight = 1 / np.maximum(np.einsum("mx,mx->m", way, way), 1e-12)
        weight /= np.bincount(taker, weight, len(wanted))[taker]
        return wanted[taker], giver, weight.astype(np.float32)

    def _nearest(self, known, wanted, itself):
        """The nearest known point of any object, other than the point itself; -1: there is none."""
        count = min(1 + itself, len(known))
        _, index = cKDTree(self._places[known]).query(self._places[wanted], k=count)
        near = known[index.reshape(len(wanted), count)]
        if not itself:
            return near[:, 0]
        if count == 1:
            return np.full(len(wanted), -1)
        return np.where(near[:, 0] == wanted, near[:, 1], near[:, 0])
