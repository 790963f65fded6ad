"""`QUANTITIES`: the table of what there is to know of a surface, a line each."""

from dataclasses import dataclass

import numpy as np

# How far means of values may leave their range in float32, as a share of its bounds.
_ROUNDING = 1e-5


@dataclass(frozen=True)
class Quantity:
    """What there is to know of a quantity of materials.

    Between places that have it, and over an area, a quantity is the mean of its values by weight.

    Parameters
    ----------
    n_channels : int
    least, most : float
        Range of its values.
    step : float
        Corners of one vertex share a bake point where they agree to it.
    default : float or tuple of float, optional
        Of materials that do not say it, one for all channels or one each. None: all say it.
        A quantity that has its default everywhere is neither digested nor stored, so that bakes
        made before the quantity was known stay what they are.
    dtype : str
        Of bake points, in memory and in the store.
    is_direction : bool
        Whether its means are unit vectors again.
    most_bounced : float, optional
        Largest value with which light bounces, where more than that may be shown; default: `most`.
    """

    n_channels: int
    least: float
    most: float
    step: float
    default: float | tuple | None = None
    dtype: str = "float32"
    is_direction: bool = False
    most_bounced: float | None = None

    @property
    def lowest(self):
        """The least value that rounding makes of means."""
        return self.least - _ROUNDING * abs(self.least)

    def highest(self, bounced=False):
        """The largest value that rounding makes of means.

        Parameters
        ----------
        bounced : bool
            Of those by which light bounces.
        """
        most = self.most_bounced if bounced and self.most_bounced is not None else self.most
        return most + _ROUNDING * abs(most)

    def settled(self, means):
        """(n, n_channels) float64 of means (n, n_channels): as values are, without rounding."""
        if self.is_direction:
            length = np.linalg.norm(means, axis=1, keepdims=True)
            means = means / np.maximum(length, 1e-30)
        return np.clip(means, self.least, self.most)


QUANTITIES = {
    # Diffuse albedo: the share of the received light that leaves evenly to all sides. More than all
    # of it may be shown, as renderers do; bounces would not end then.
    "albedo": Quantity(3, 0, 64, step=1 / 32, most_bounced=1),
    # Radiance that the surface sends out of its own, evenly to all sides of both its faces.
    "emission": Quantity(3, 0, 1e15, step=1 / 32, default=0.0),
    # Share of the light that does not go straight through. What goes through is no part of albedo.
    "opacity": Quantity(1, 0, 1, step=1 / 32, default=1.0),
    # Share of the light on the back that leaves the front evenly to all sides.
    "translucency": Quantity(3, 0, 1, step=1 / 32, default=0.0),
    # Share of the light that glass lets through, bent. Rays go straight through it, as `opacity`
    # says; glass is shown by this, as long as views are not: half of it leaves evenly either way.
    "transmission": Quantity(3, 0, 1, step=1 / 32, default=0.0),
    # How strongly light near the horizon is dimmed where a material bends normals (see `bump`).
    "bump": Quantity(1, 0, 1, step=1 / 32, default=0.0),
    # The part of `albedo` that stands in for gloss, as metals have it; the rest is truly diffuse.
    "stand_in": Quantity(3, 0, 64, step=1 / 32, default=0.0),
    # Reflectance of a microfacet lobe that is the same from all sides, as Glossy BSDFs have it.
    "glossy": Quantity(3, 0, 64, step=1 / 32, default=0.0),
    # Metal: its reflectance seen from straight on (F0), and what tints it near 82 degrees (F82).
    "metal": Quantity(3, 0, 64, step=1 / 32, default=0.0),
    "metal_edge": Quantity(3, 0, 1, step=1 / 32, default=1.0),
    # Weight of a dielectric's reflection, what tints that seen from straight on, and its index of
    # refraction, in which a specular level is contained.
    "dielectric": Quantity(1, 0, 64, step=1 / 32, default=0.0),
    "tint": Quantity(3, 0, 64, step=1 / 32, default=1.0),
    "ior": Quantity(1, 1, 1000, step=1 / 32, default=1.5),
    # Of these three lobes: alpha is the square of roughness; along the tangent it is divided, and
    # across it multiplied, by sqrt(1 - 0.9 anisotropy). Without a tangent there is no direction.
    "roughness": Quantity(1, 0, 1, step=1 / 32, default=1.0),
    "anisotropy": Quantity(1, 0, 1, step=1 / 32, default=0.0),
    "tangent": Quantity(3, -1, 1, step=1 / 32, default=0.0, is_direction=True),
    # The part of these three lobes that is without the light of further bounces between facets.
    "single": Quantity(1, 0, 1, step=1 / 32, default=0.0),
    # A clear layer over everything; light that crosses it once, straight, takes on its tint.
    "coat": Quantity(1, 0, 1, step=1 / 32, default=0.0),
    "coat_roughness": Quantity(1, 0, 1, step=1 / 32, default=0.03),
    "coat_ior": Quantity(1, 1, 1000, step=1 / 32, default=1.5),
    "coat_tint": Quantity(3, 0, 1, step=1 / 32, default=1.0),
    # Roughness of the diffuse reflection.
    "diffuse_roughness": Quantity(1, 0, 1, step=1 / 32, default=0.0),
}
