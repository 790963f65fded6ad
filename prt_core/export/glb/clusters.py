"""Weights and clusters of a compressed form, and the light's side of it, for engines.

A point receives `sum_k weight_k product[cluster, k]`, where `product` is what the rows of a cluster
give under a light: a matrix of all rows times the light, once a light. Weight 0, that of the mean,
is 1 and not written. The matrix is in groups: one of the light that arrives straight, and thin ones
of what bounces, whose rows are mixed from a few.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.basis import haar_rows
from prt_core.compress.clusters.clusters import ClusterCompressor
from prt_core.errors import expect
from prt_core.export.glb.placement import TO_GLTF
from prt_core.sphere import CubeMap

# What whole numbers of 16 bits with a sign hold, and rows that are worked on at once.
_MOST, _BLOCK = (1 << 15) - 1, 256


@dataclass(frozen=True)
class Group:
    """Rows over the texels of a light.

    Attributes
    ----------
    shares : (3,) float64
        Of red, green and blue in what these rows give.
    rows : (k, n_texels) int16
        As shares of the largest of each row.
    scale : (k,) float32
        The largest of each row.
    mix : (n_rows, k) float32 or None
        How the rows of the clusters are made of these; None: they are these.
    """

    shares: np.ndarray
    rows: np.ndarray
    scale: np.ndarray
    mix: np.ndarray | None = None

    def products(self, light):
        """(n_rows, 3) float32 of light (n_texels, 3), as an engine works them out."""
        each = (self.rows.astype(np.float32) @ light) * (self.scale / np.float32(_MOST))[:, None]
        each = each if self.mix is None else self.mix @ each
        return each * self.shares.astype(np.float32)


class ClusterWeights:
    """A clustered form as vertices and a light's texels need it.

    Parameters
    ----------
    form : CompressedForm
        Of the points of a bake.
    components : int
        Weights of a point at most.
    texels : int, optional
        Along an edge of a coarser cube map; default: as baked.

    Attributes
    ----------
    cluster : (n_points,) int64
    weights : (n_points, components) float32
        Zero beyond a cluster's rank.
    n_clusters : int
    groups : list of Group
        Of rows cluster by cluster, 1 + components of each: its mean, then its basis.
    cube_map : CubeMap
        Whose texels a light has.
    cut : int
        Components that the form has more than are written.

    Raises
    ------
    PRTError
        It is no clustered form, or `texels` does not divide the resolution.
    """

    def __init__(self, form, components, texels=None):
        model = form.model
        expect(
            isinstance(model, ClusterCompressor) and model.n_outputs_ == 3,
            f"weights: the compressed form is by {form.method}, whose numbers are no weights of "
            "clusters; run 'prt compress --method cpca' first",
        )
        resolution = model.resolution_
        texels = resolution if texels is None else texels
        expect(
            texels <= resolution and resolution % texels == 0,
            f"texels: expected a divisor of the {resolution} that were baked, got {texels}",
        )
        ranks = model.ranks_
        self.components = int(min(components, max(ranks.max(), 1)))
        self.cut = int(max(ranks.max() - self.components, 0))
        self.n_clusters, self.cube_map = len(ranks), CubeMap(texels)
        self.cluster = model.labels_.astype(np.int64)
        self.weights = np.zeros((model.n_points_, self.components), np.float32)
        for affine, first, after in zip(
            model.affine_, model.starts_[:-1], model.starts_[1:], strict=True
        ):
            # Slots of points of other clusters, at borders, come last; their own are elsewhere.
            slots = np.arange(first, after)
            points = model.order_[slots]
            own = model.place_[points] == slots
            kept = affine.weights[own, : self.components]
            self.weights[points[own], : kept.shape[1]] = kept
        self.groups = list(self._groups(model))

    @property
    def n_rows(self):
        """Of the products, cluster by cluster."""
        return self.n_clusters * (1 + self.components)

    def products(self, light):
        """(n_rows, 3) float32: what the rows give under light on texels (n_texels, 3)."""
        return sum(group.products(light.astype(np.float32)) for group in self.groups)

    def on_texels(self, light, resolution):
        """Light on the texels of a bake, as means over those of `cube_map`."""
        if resolution == self.cube_map.resolution:
            return light
        solid = CubeMap(resolution).solid_angles[:, None]
        whole, parts = (self._blocks((x).T, resolution) for x in (light * solid, solid))
        return (whole / parts).T

    def _groups(self, model):
        code, count = model.code_, 1 + self.components
        for group, part in zip(code.groups, code.slices, strict=True):
            rows = np.zeros((self.n_rows, part.stop - part.start), np.float32)
            for cluster, affine in enumerate(model.affine_):
                first = cluster * count
                basis = affine.basis[: self.components, part]
                rows[first], rows[first + 1 : first + 1 + len(basis)] = affine.mean[part], basis
            shares = np.asarray(group.shares, np.float64)
            expect(
                np.array_equal(code.reads, np.arange(3)),
                "weights: the compressed form mixes channels of the light; compress again",
            )
            if group.basis is None:
                yield Group(shares, *self._in_texels(code, rows))
            else:
                yield Group(shares, *self._in_texels(code, group.basis), rows)

    def _in_texels(self, code, coded):
        """Coded rows over texels, as shares of the largest of each."""
        values = np.empty((len(coded), self.cube_map.n_directions), np.int16)
        scale = np.empty(len(coded), np.float32)
        for first in range(0, len(coded), _BLOCK):
            part = slice(first, first + _BLOCK)
            rows = coded[part] if code.scale is None else coded[part] / code.scale
            if code.resolution:
                rows = haar_rows(rows, code.resolution, inverse=True)
            rows = self._blocks(rows, code.resolution)
            scale[part] = np.abs(rows).max(axis=1)
            values[part] = np.rint(rows / np.maximum(scale[part], 1e-30)[:, None] * _MOST)
        return values, scale

    def _blocks(self, rows, resolution):
        """(k, n_texels) sums of rows over the texels of a finer cube map."""
        n = self.cube_map.resolution
        size = resolution // n
        if size == 1:
            return rows
        return rows.reshape(-1, 6, n, size, n, size).sum(axis=(3, 5)).reshape(len(rows), -1)


def described(document, weights, light):
    """What the document says of the light's side (dict); its arrays are added.

    Parameters
    ----------
    document : Document
    weights : ClusterWeights
    light : (n_texels, 3) float, or None
        That the colours were made under, on the texels of the weights.
    """
    directions = (weights.cube_map.directions @ TO_GLTF.T).astype(np.float32)
    groups = []
    for group in weights.groups:
        if not len(group.scale):
            continue
        said = {
            "shares": group.shares.tolist(),
            "count": len(group.scale),
            "rows": document.add_array(group.rows.reshape(-1), "data", normalised=True),
            "scale": document.add_array(group.scale, "data"),
        }
        if group.mix is not None:
            said["mix"] = document.add_array(group.mix.reshape(-1), "data")
        groups.append(said)
    products = None
    if light is not None:
        products = document.add_array(weights.products(light), "data")
    return {
        "clusters": weights.n_clusters,
        "components": weights.components,
        "attributes": list(weight_names(weights.components)),
        "texels": weights.cube_map.n_directions,
        "directions": document.add_array(directions, "data"),
        "groups": groups,
        "products": products,
    }


def weight_names(components):
    """Names of the attributes that have four weights each (tuple of str)."""
    return tuple(f"_PRT_W{i}" for i in range(-(-components // 4)))
