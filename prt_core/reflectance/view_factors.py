"""What the view does to lobes besides their shape: light of further bounces, layers above.

Both depend on the material and the cosine of the view alone, so there is a table of them for each
material that differs; points between look it up. That is far quicker than to work them out for each
point and view.
"""

import numpy as np

from prt_core.reflectance.principled import GLOSSY_LOBES, principled_lobes

# Nodes along the cosine, closer where views graze; most materials that are told apart.
_N, _MOST = 49, 4096
_NAMES = (
    "albedo", "glossy", "metal", "metal_edge", "dielectric", "tint", "ior", "roughness",
    "anisotropy", "single", "coat", "coat_roughness", "coat_ior", "coat_tint", "opacity",
)  # fmt: skip
_STEP = 1 / 64


class ViewFactors:
    """Tables of the factors of some materials.

    Parameters
    ----------
    materials : Materials
        Of n points.
    most : int
        Materials that are told apart.

    Attributes
    ----------
    kind : (n,) int32
        Which material each point is of.
    tables : dict of str -> (n_kinds, n_nodes, 3) float32
        The factors of lobes by name, and "diffuse", at nodes whose cosines have roots in even
        steps from 0 to 1.
    """

    def __init__(self, materials, most=_MOST):
        values = np.concatenate(
            [np.asarray(getattr(materials, name), np.float64) for name in _NAMES], axis=1
        )
        step = _STEP
        while True:
            kinds = np.rint(values / step).astype(np.int64)
            _, first, kind = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
            if len(first) <= most:
                break
            step *= 2
        self.kind = kind.ravel().astype(np.int32)
        lobes = principled_lobes(materials[first])
        cosine = np.maximum(np.linspace(0, 1, _N) ** 2, 1e-4)
        view = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)[None]
        self.tables = {}
        for lobe in lobes.lobes:
            if lobe.name in GLOSSY_LOBES:
                factor = lobe.reflectance.gain(view) * lobes.reaching(lobe, view)
                table = np.ones((len(first), _N, 3), np.float32)
                table[lobe.rows] = factor
                self.tables[lobe.name] = table
        self.tables["diffuse"] = np.ascontiguousarray(lobes.diffuse_weight(view), np.float32)

    def at(self, rows, cosine, names=None):
        """The factors of points towards a view.

        Parameters
        ----------
        rows : (k,) int
        cosine : (k,) float
            Between view and normal, 0 to 1.
        names : sequence of str, optional
            Of the factors that are asked for; default: all there are.

        Returns
        -------
        dict of str -> (k, 3) float32
            By names of lobes, of those that any material has; and "diffuse", in parts of what is
            left of diffuse light as seen from straight above.
        """
        place = np.sqrt(np.clip(cosine, 0, 1)) * np.float32(_N - 1)
        low = np.minimum(place.astype(np.int32), _N - 2)
        share = (place - low).astype(np.float32)[:, None]
        index = self.kind[rows] * np.int32(_N) + low
        result = {}
        for name in self.tables if names is None else names:
            flat = self.tables[name].reshape(-1, 3)
            below, above = flat.take(index, axis=0), flat.take(index + 1, axis=0)
            result[name] = below + (above - below) * share
        return result

    def labels(self, names):
        """(n, m) float64: points of equal numbers have the same factors `names`, and only they."""
        columns = []
        for name in names:
            table = self.tables[name].reshape(len(self.tables[name]), -1)
            _, which = np.unique(table, axis=0, return_inverse=True)
            columns.append(which.ravel()[self.kind])
        return np.stack(columns, axis=1).astype(np.float64)
