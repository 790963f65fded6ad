"""GGX lobes at directions that each place has of its own: how they reflect, and sampling them.

What `reflectance.Microfacet` is for one lobe, of lobes that `PointLobes` gives towards a view, in
float32. Lobes at directions that places share are in `transport.lobe_values`.
"""

import numpy as np

from prt_core.reflectance.fresnel_powers import powers_at, powers_used
from prt_core.sphere import ggx_density, square_to_ggx_normals


class SampledLobes:
    """The lobes of k places towards a viewer.

    Directions are (k, m, 3) in the frames of the places; they are quickest where their components
    lie apart in memory (see `local`).

    Parameters
    ----------
    groups : list of (alpha, powers)
        (k, 2) and (k, N_POWERS, 3), see `PointLobes.at`.
    outgoing : (k, 3) float32
        Unit vectors to the viewer, above the horizon.
    """

    def __init__(self, groups, outgoing):
        self._view = outgoing[:, None]
        groups = [(alpha, powers) for alpha, powers in groups if powers.any()]
        height, self._groups = outgoing[:, 2], []
        at_height = np.stack(powers_at(height), axis=1)
        for alpha, powers in groups:
            alpha_x, alpha_y = alpha[:, :1], alpha[:, 1:]
            own = _length(self._view, alpha_x, alpha_y)
            # How often it is sampled: by what it reflects straight on.
            share = np.einsum("kp,kpc->k", at_height, powers)[:, None]
            powers = powers[:, : powers_used(powers)]
            self._groups.append((alpha_x, alpha_y, powers, own, np.maximum(share, 0)))
        total = sum(share for *_, share in self._groups)
        self._shares = [
            np.where(total > 0, share / np.where(total > 0, total, 1), 0)
            for *_, share in self._groups
        ]

    def at(self, ways):
        """`LobesAlong` of directions (k, m, 3)."""
        half, view = ways + self._view, self._view
        length = half[..., 0] ** 2 + half[..., 1] ** 2 + half[..., 2] ** 2
        cosine = np.minimum(np.sqrt(length) * np.float32(0.5), 1)
        height, own_height = np.maximum(ways[..., 2], 0), np.maximum(view[..., 2], 0)
        above = (ways[..., 2] > 0) & (own_height > 0)
        density, values = np.zeros(length.shape, np.float32), []
        for (alpha_x, alpha_y, powers, own, _), share in zip(
            self._groups, self._shares, strict=True
        ):
            area = ggx_density(half, alpha_x, alpha_y)
            area *= np.float32(0.5)
            density += area * (share / np.maximum(own_height + own, 1e-30))
            masked = height * own + own_height * _length(ways, alpha_x, alpha_y)
            area /= np.maximum(masked, np.finfo(np.float32).eps)
            area *= above
            values.append((area, powers))
        # Half vectors below the horizon are of facets that nobody sees.
        density *= (half[..., 2] > 0) & (own_height > 0)
        return LobesAlong(values, cosine, density)

    def sample(self, uv):
        """Directions (k, m, 3), about as densely as the lobes reflect, of `uv` (k, m, 2).

        Straight up, of density 0, where no place has a lobe.
        """
        if not self._groups:
            return np.broadcast_to(np.float32([0, 0, 1]), (*uv.shape[:2], 3))
        first, result, begin = uv[..., 0], None, 0
        for (alpha_x, alpha_y, *_), share in zip(self._groups, self._shares, strict=True):
            own = uv
            if len(self._groups) > 1:
                own = np.clip((first - begin) / np.maximum(share, 1e-30), 0, 1 - 1e-6)
                own = np.stack([own, uv[..., 1]], axis=-1)
            drawn = square_to_ggx_normals(own.astype(np.float32), self._view, alpha_x, alpha_y)
            drawn = drawn * (2 * (drawn * self._view).sum(axis=-1, keepdims=True)) - self._view
            result = drawn if result is None else _where(first >= begin, drawn, result)
            begin = begin + share
        return result

    def density_within(self, towards, angle):
        """The most that `LobesAlong.density` is within cones.

        Parameters
        ----------
        towards : (k, 3) float
            Unit vectors along the axes of the cones, in the frames of the places.
        angle : (k,) float
            Half of them, in radians.

        Returns
        -------
        (k,) float
            A bound.
        """
        view = self._view[:, 0]
        cosine = view[:, 2] * towards[:, 2] - (view[:, :2] * towards[:, :2]).sum(axis=1)
        # Facets turn by half as much as what they mirror, or more.
        turned = np.maximum(np.arccos(np.clip(cosine, -1, 1)) - angle, 0)[:, None] / 2
        up, across = np.cos(turned) ** 2, np.sin(turned) ** 2
        result = np.zeros((len(view), 1))
        for (alpha_x, alpha_y, _, own, _), share in zip(self._groups, self._shares, strict=True):
            widest = np.maximum(alpha_x, alpha_y)
            area = 1 / (np.pi * alpha_x * alpha_y * (up + across / widest**2) ** 2)
            result += share * area / (2 * np.maximum(np.maximum(view[:, 2:], 0) + own, 1e-30))
        return result[:, 0]


class LobesAlong:
    """Lobes at directions (k, m, 3).

    Parameters
    ----------
    values : list of (value, powers)
        White lobes (k, m), and the powers of their Fresnel terms (k, n_powers, 3).
    cosine : (k, m) float32
        Between direction and facet.
    density : (k, m) float32
        Of `SampledLobes.sample`, for solid angle.
    """

    def __init__(self, values, cosine, density):
        self._values, self._cosine, self.density = values, cosine, density

    def reflected(self, light):
        """(k, 3): what they reflect in all of light (k, m, 3), irradiance along each direction."""
        at_cosine = powers_at(self._cosine)
        result = np.zeros((len(light), 3), np.float32)
        for value, powers in self._values:
            for index in range(powers.shape[1]):
                weight = value * at_cosine[index] if index else value
                brought = np.matmul(weight[:, None], light)[:, 0]
                result += brought * powers[:, index]
        return result


def local(ways, frames):
    """Directions in the frames of places.

    Parameters
    ----------
    ways : (k, m, 3) float
        In the world.
    frames : (k, 3, 3) float

    Returns
    -------
    (k, m, 3) float32
        Components lie apart in memory.
    """
    result = np.empty((3, *ways.shape[:2]), np.float32)
    for axis in range(3):
        np.matmul(ways, frames[:, axis, :, None], out=result[axis][..., None], casting="same_kind")
    return np.moveaxis(result, 0, -1)


def _length(directions, alpha_x, alpha_y):
    """Of stretched directions (k, m, 3): (k, m)."""
    x, y, z = (directions[..., k] for k in range(3))
    return np.sqrt((alpha_x * x) ** 2 + (alpha_y * y) ** 2 + z * z)


def _where(mine, new, old):
    """Directions of `new` (k, m, 3) where `mine` (k, m), else of `old`."""
    return np.moveaxis(np.where(mine, np.moveaxis(new, -1, 0), np.moveaxis(old, -1, 0)), 0, -1)
