"""Clusters of rows, each with an affine model of its own: what PCA, VQ and clustered PCA share."""

import numpy as np

from prt_core.compress.base import Compressor, as_rows, pieces
from prt_core.compress.clusters.affine import Affine, fit_affine
from prt_core.compress.clusters.seams import border_points
from prt_core.compress.rows.row_code import RowCode
from prt_core.compress.state import array_of, expect_state, value_of
from prt_core.errors import expect, expect_array, expect_indices, expect_number
from prt_core.light.environment import BRIGHTEST
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress


class ClusterCompressor(Compressor):
    """Rows as `mean[c] + weights @ basis[c]` of their cluster c.

    Attributes
    ----------
    labels_ : (n_points,) int32
        Cluster of each point.
    order_ : (n_slots,) int64
        Points sorted by cluster. A point whose neighbours are in another cluster may have a
        second slot there (see `blend_borders`).
    place_ : (n_points,) int64
        Slot of each point in its own cluster.
    border_points_ : (g, 2) int64
        Points with a second slot, and that slot.
    shares_ : (g,) float32
        Of the second slot in the point's value.
    affine_ : list of Affine
        One a cluster, its weights in the order of `order_`.
    matrix_error_ : float
        Relative L2 error of the encoded rows.
    """

    def predict(self, rows):
        """Cluster of each row: the one whose affine space is nearest (the projected distance).

        Returns
        -------
        (n,) int32
        """
        rows = self._like(rows)
        parts = [self._nearest(rows.features(points))[0] for points in rows.blocks()]
        return np.concatenate(parts)

    def transform(self, rows):
        """Coordinates of rows.

        Returns
        -------
        (n, 1 + rank) float32
            The cluster, then the weights, zero beyond the cluster's rank.
        """
        rows = self._like(rows)
        width = 1 + max(len(a.basis) for a in self.affine_)
        parts = []
        for points in rows.blocks():
            features = rows.features(points)
            labels, _ = self._nearest(features)
            result = np.zeros((len(points), width), np.float32)
            result[:, 0] = labels
            for c in np.unique(labels):
                here, affine = labels == c, self.affine_[c]
                weights = (features[here] - affine.mean) @ affine.basis.T
                result[here, 1 : 1 + weights.shape[1]] = weights
            parts.append(result)
        return np.concatenate(parts)

    def _like(self, rows):
        """Rows as wide as those that were fitted."""
        self._expect_fitted()
        rows = as_rows(rows)
        wanted = self.n_directions_, self.n_outputs_
        shape = rows.n_directions, rows.n_outputs
        expect(shape == wanted, f"rows: expected (n, {wanted[0]}, {wanted[1]}), got {shape}")
        return rows

    def inverse_transform(self, coordinates):
        """Rows from coordinates: (n, n_directions, n_outputs) float32."""
        self._expect_fitted()
        width = 1 + max(len(a.basis) for a in self.affine_)
        limits = -BRIGHTEST, BRIGHTEST
        coordinates = expect_array("coordinates", coordinates, (None, width), np.float32, *limits)
        last = len(self.affine_) - 1
        labels = expect_array("coordinates: clusters", coordinates[:, 0], (None,), None, 0, last)
        labels = labels.astype(int)
        features = np.empty((len(labels), self.code_.n_features), np.float32)
        for c in np.unique(labels):
            here, affine = labels == c, self.affine_[c]
            features[here] = affine.mean
            features[here] += coordinates[here, 1 : 1 + len(affine.basis)] @ affine.basis
        return self.code_.decode(features)

    def reconstruct(self, points):
        """The compressed rows of some fitted points, (n, n_directions, n_outputs) float32."""
        self._expect_fitted()
        points = expect_indices("points", points, self.n_points_)
        features = self._of_points(points, lambda slots, _: self._slot_features(slots))
        return self.code_.decode(features)

    def _entries(self, points, columns):
        return self._of_points(points, lambda slots, i: self._slot_entries(slots, columns[i]))

    def _of_points(self, points, value):
        """`value(slots, which of the points)`: of their own slots, mixed with their second."""
        second = np.full(self.n_points_, -1)
        second[self.border_points_[:, 0]] = np.arange(len(self.border_points_))
        result = value(self.place_[points], slice(None))
        blended = np.flatnonzero(second[points] >= 0)
        border = second[points[blended]]
        other = value(self.border_points_[border, 1], blended)
        result[blended] += self.shares_[border, None] * (other - result[blended])
        return result

    def _slot_features(self, slots):
        features = np.empty((len(slots), self.code_.n_features), np.float32)
        for c, affine, here in self._by_cluster(slots):
            features[here] = affine.mean
            features[here] += affine.weights[slots[here] - self.starts_[c]] @ affine.basis
        return features

    def _slot_entries(self, slots, columns):
        """Means and components are looked up in a column, and then mixed by the weights."""
        result = np.empty((len(slots), self.n_outputs_), np.float32)
        for c, affine, here in self._by_cluster(slots):
            used, place = np.unique(columns[here], return_inverse=True)
            vectors = np.concatenate([affine.mean[None], affine.basis])
            looked_up = self.code_.responses(vectors, self.code_.texels(used))
            for part in pieces(len(here)):
                part_weights, weights = (
                    place[part],
                    affine.weights[slots[here[part]] - self.starts_[c]],
                )
                result[here[part]] = looked_up[0, part_weights]
                result[here[part]] += np.einsum("nk,kno->no", weights, looked_up[1:, part_weights])
        return result

    def _by_cluster(self, slots):
        """(cluster, its model, which of the slots) for each cluster that has some."""
        labels = np.searchsorted(self.starts_, slots, side="right") - 1
        order = np.argsort(labels, kind="stable")
        for here in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
            if len(here):
                yield labels[here[0]], self.affine_[labels[here[0]]], here

    def blend_borders(self, rows, pairs):
        """Mix what their own and the next cluster say about points at borders.

        The better the next cluster knows a point, the more it counts, up to a half where both
        are as near; so errors change gradually. Each border point costs a second set of weights.

        Parameters
        ----------
        rows : Rows
            The rows that were fitted.
        pairs : (m, 2) int
            Neighbours (see `neighbour_pairs`).

        Returns
        -------
        self
        """
        self._expect_fitted()
        expect(not len(self.border_points_), "blend_borders: the borders are blended already")
        points, clusters = border_points(self.labels_, pairs)
        members = np.split(self.order_, self.starts_[1:-1])
        order, slots_of, shares, start = [], [], [], 0
        own = self._slot_features(self.place_[points])
        for c, affine in enumerate(self.affine_):
            border = points[clusters == c]
            if len(border):
                features = rows.features(border)
                weights = (features - affine.mean) @ affine.basis.T
                here = ((features - own[clusters == c]) ** 2).sum(axis=1)
                error_there = ((features - affine.mean - weights @ affine.basis) ** 2).sum(axis=1)
                shares.append(here / np.maximum(here + error_there, 1e-30))
                affine.weights = np.concatenate([affine.weights, weights])
                slots = start + len(members[c]) + np.arange(len(border))
                slots_of.append(np.column_stack([border, slots]))
            self.place_[members[c]] = start + np.arange(len(members[c]))
            order += [members[c], border]
            start += len(members[c]) + len(border)
        self.order_ = np.concatenate(order)
        self.starts_ = np.concatenate([[0], np.cumsum([len(a.weights) for a in self.affine_])])
        if slots_of:
            self.border_points_ = np.concatenate(slots_of)
            self.shares_ = np.minimum(np.concatenate(shares), 0.5)
        return self

    @property
    def ranks_(self):
        """(n_clusters,) components of each cluster."""
        return np.array([len(a.basis) for a in self.affine_])

    @property
    def nbytes(self):
        """Of means, bases, weights and order."""
        self._expect_fitted()
        arrays = sum(a.mean.nbytes + a.basis.nbytes + a.weights.nbytes for a in self.affine_)
        return arrays + len(self.order_) * 4

    def _product(self, light):
        values = np.empty((len(self.order_), self.n_outputs_), np.float32)
        vectors = np.concatenate([part for a in self.affine_ for part in (a.mean[None], a.basis)])
        products = self.code_.products(vectors, self.code_.light(light))
        first = 0
        for c, affine in enumerate(self.affine_):
            mean, basis = products[first], products[first + 1 : first + 1 + len(affine.basis)]
            first += 1 + len(affine.basis)
            values[self.starts_[c] : self.starts_[c + 1]] = mean + affine.weights @ basis
        return blended(values, self.place_, self.border_points_, self.shares_)

    def _state(self):
        models = self.affine_
        return {
            "matrix_error": self.matrix_error_,
            "labels": self.labels_,
            "order": self.order_.astype(np.int32),
            "place": self.place_.astype(np.int32),
            "border_points": self.border_points_.astype(np.int32),
            "shares": self.shares_.astype(np.float32),
            "sizes": np.diff(self.starts_).astype(np.int64),
            "ranks": self.ranks_.astype(np.int64),
            "means": np.stack([a.mean for a in models]),
            "bases": np.concatenate([a.basis for a in models]),
            "weights": np.concatenate([a.weights.ravel() for a in models]),
            "energies": np.concatenate([a.energies for a in models]),
            "energy": np.array([a.energy for a in models], np.float64),
            **self.code_.state(),
        }

    def _restore(self, state):
        n_points = self.n_points_
        self.matrix_error_ = value_of(state, "matrix_error", float)
        sizes = array_of(state, "sizes", (None,), "int64")
        ranks = array_of(state, "ranks", (len(sizes),), "int64")
        energy = array_of(state, "energy", (len(sizes),), "float64")
        expect_state(
            len(sizes) and sizes.min() >= 0 and sizes.max() <= n_points and ranks.min() >= 0,
            "its clusters do not fit its points",
        )
        n_slots, n_rows = int(sizes.sum()), int(ranks.sum())
        self.starts_ = np.concatenate([[0], np.cumsum(sizes)])
        self.labels_ = array_of(state, "labels", (n_points,), "int32", len(sizes))
        self.order_ = array_of(state, "order", (n_slots,), "int32", n_points).astype(np.int64)
        self.place_ = array_of(state, "place", (n_points,), "int32", n_slots).astype(np.int64)
        # Forms of before were stored under another word.
        name = "border_points" if "border_points" in state else "guests"
        border = array_of(state, name, (None, 2), "int32", max(n_points, n_slots))
        self.border_points_ = border.astype(np.int64)
        expect_state(
            (border[:, 0] < n_points).all() and (border[:, 1] < n_slots).all(),
            "its borders do not fit its points",
        )
        self.shares_ = array_of(state, "shares", (len(border),), "float32")
        self.code_ = RowCode.from_state(state, self.n_directions_, self.reads_, self.resolution_)
        n_features = self.code_.n_features
        means = array_of(state, "means", (len(sizes), n_features), "float32")
        bases = array_of(state, "bases", (n_rows, n_features), "float32")
        energies = array_of(state, "energies", (n_rows,), "float64")
        weights = array_of(state, "weights", (int(sizes @ ranks),), "float32")
        rows, numbers = np.cumsum(ranks), np.cumsum(sizes * ranks)
        self.affine_ = [
            Affine(
                mean,
                bases[row - k : row],
                weights[end - n * k : end].reshape(n, k),
                energies[row - k : row],
                float(e),
            )
            for mean, n, k, row, end, e in zip(
                means, sizes, ranks, rows, numbers, energy, strict=True
            )
        ]

    def _nearest(self, features):
        """Nearest affine space of each feature vector, and the squared distance to it."""
        distances = np.stack([_distance(features, a) for a in self.affine_], axis=1)
        labels = distances.argmin(axis=1).astype(np.int32)
        return labels, np.take_along_axis(distances, labels[:, None], axis=1)[:, 0]

    def _fit_clusters(self, rows, labels, rank, tolerance=None):
        """Fit one affine model a cluster; clusters without points vanish. A generator."""
        used, labels = np.unique(labels, return_inverse=True)
        self.labels_ = labels.astype(np.int32)
        self.order_ = np.argsort(self.labels_, kind="stable")
        self.starts_ = np.concatenate([[0], np.cumsum(np.bincount(self.labels_))])
        self.place_ = np.argsort(self.order_)
        self.border_points_, self.shares_ = np.zeros((0, 2), np.int64), np.zeros(0, np.float32)
        self.code_ = rows.code
        members = np.split(self.order_, self.starts_[1:-1])
        self.affine_ = []
        models = in_parallel(lambda points: fit_affine(rows, points, rank), members)
        done = 0
        for points, affine in zip(members, models, strict=True):
            self.affine_.append(affine)
            done += len(points)
            yield Progress("principal components", done, rows.n_points)
        energy = sum(
            a.energy + len(a.weights) * float(a.mean.astype(np.float64) @ a.mean)
            for a in self.affine_
        )
        if tolerance is not None:
            ranks = ranks_within(self.affine_, tolerance**2 * energy)
            self.affine_ = [a.cut(r) for a, r in zip(self.affine_, ranks, strict=True)]
        error = sum(a.error for a in self.affine_)
        self.matrix_error_ = float(np.sqrt(error / energy)) if energy else 0.0
        return self._fitted(rows)


def blended(values, place, border_points, shares):
    """(n_points, n_outputs) from values of slots: each point's own, mixed with its second."""
    result = np.take(values, place, axis=0)
    if len(border_points):
        points, slots = border_points.T
        result[points] += shares[:, None] * (values[slots] - result[points])
    return result


def ranks_within(models, allowed):
    """The cheapest rank of each cluster that leaves at most `allowed` squared error in all.

    Components are taken by the error they remove for each number they add to the storage.

    Parameters
    ----------
    models : list of Affine
    allowed : float

    Returns
    -------
    (n_clusters,) int
        All components where even they leave more.
    """
    clusters = np.concatenate([np.full(len(a.energies), c) for c, a in enumerate(models)])
    gains = np.concatenate([a.energies for a in models]) if len(models) else np.zeros(0)
    costs = np.array([a.mean.size + len(a.weights) for a in models])
    order = np.argsort(-gains / costs[clusters.astype(int)], kind="stable")
    left = sum(a.energy for a in models) - np.cumsum(gains[order])
    enough = int((left > allowed).sum()) + 1
    if sum(a.energy for a in models) <= allowed:
        enough = 0
    return np.bincount(clusters[order[:enough]].astype(int), minlength=len(models))


def expect_tolerance(tolerance):
    """None, or a number between 0 and 1."""
    return None if tolerance is None else expect_number("tolerance", tolerance, above=0, below=1)


def _distance(features, affine: Affine):
    centred = features - affine.mean
    inside = centred @ affine.basis.T
    return np.einsum("nf,nf->n", centred, centred) - np.einsum("nk,nk->n", inside, inside)
