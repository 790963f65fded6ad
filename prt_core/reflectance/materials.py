"""`Materials`: what a surface is, in quantities at corners, at bake points or anywhere between.

A quantity is one line in `QUANTITIES`. All that is done to each of them walks that table: corners
are merged to points, places between points and whole areas get means, meshes and points are joined,
digested, stored, read, and replaced after a bake.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, shown

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
    # A clear layer over everything; light that crosses it once, straight, takes on its tint.
    "coat": Quantity(1, 0, 1, step=1 / 32, default=0.0),
    "coat_roughness": Quantity(1, 0, 1, step=1 / 32, default=0.03),
    "coat_ior": Quantity(1, 1, 1000, step=1 / 32, default=1.5),
    "coat_tint": Quantity(3, 0, 1, step=1 / 32, default=1.0),
    # Roughness of the diffuse reflection.
    "diffuse_roughness": Quantity(1, 0, 1, step=1 / 32, default=0.0),
}


class Materials:
    """The quantities of materials at places, an array each.

    Each quantity of `QUANTITIES` is an attribute by its name, (n, n_channels).

    Parameters
    ----------
    **values : (n, n_channels) array
        By the names of quantities; those left out have their defaults.

    Attributes
    ----------
    albedo : (n, 3) array
    opacity : (n, 1) array
    translucency, transmission : (n, 3) array

    Raises
    ------
    PRTError
        A name that is no quantity, one without a default that is missing, or a wrong shape.
    """

    def __init__(self, **values):
        unknown = sorted(set(values) - set(QUANTITIES))
        known = ", ".join(QUANTITIES)
        expect(not unknown, f"materials: expected {known}, got {', '.join(unknown)}")
        n = None
        for name, quantity in QUANTITIES.items():
            if name in values:
                array = expect_array(name, values[name], (n, quantity.n_channels))
                n = len(array)
                setattr(self, name, array)
        for name, quantity in QUANTITIES.items():
            if name not in values:
                expect(
                    quantity.default is not None,
                    f"materials: expected {name}, (n, {quantity.n_channels}); it has no default",
                )
                value = np.asarray(quantity.default, quantity.dtype)
                setattr(self, name, np.broadcast_to(value, (n or 0, quantity.n_channels)))

    def __len__(self):
        return len(getattr(self, next(iter(QUANTITIES))))

    def __repr__(self):
        return f"Materials of {len(self)} places: {', '.join(QUANTITIES)}"

    def __getitem__(self, places):
        return self.map(lambda _, values: values[places])

    @property
    def front(self):
        """(n, 3): share of the light on the front that leaves the front, as it is shown."""
        return self.albedo + self.transmission / 2 if self.transmission.any() else self.albedo

    @property
    def through(self):
        """(n, 3): share of the light on the back that leaves the front, as it is shown."""
        if self.transmission.any():
            return self.translucency + self.transmission / 2
        return self.translucency

    def arrays(self):
        """Name -> array of each quantity."""
        return {name: getattr(self, name) for name in QUANTITIES}

    def map(self, function):
        """`Materials` of `function(quantity, values)` of each quantity."""
        return _made_of(
            {name: function(QUANTITIES[name], values) for name, values in self.arrays().items()}
        )

    def replaced(self, **values):
        """`Materials` in which some quantities have other `values`."""
        return Materials(**{**self.arrays(), **values})

    @staticmethod
    def joined(parts):
        """Those of several places, one after the other.

        Parameters
        ----------
        parts : sequence of Materials

        Returns
        -------
        Materials
        """
        return _made_of(
            {
                name: np.concatenate(
                    [np.zeros((0, quantity.n_channels), quantity.dtype)]
                    if not parts
                    else [getattr(part, name) for part in parts]
                )
                for name, quantity in QUANTITIES.items()
            }
        )

    def between(self, around, weights):
        """Those of places between others.

        Parameters
        ----------
        around : (m, k) int
            The places around each.
        weights : (m, k) float
            Sum to 1.

        Returns
        -------
        Materials
            Of m places, float64.
        """
        weights = np.asarray(weights, np.float64)

        def mean(quantity, values):
            values = values[around].astype(np.float64, copy=False)
            return quantity.settled(np.einsum("mk,mkc->mc", weights, values))

        return self.map(mean)

    def in_steps(self):
        """(n, sum of channels) float64: equal where corners of a vertex may share a point."""
        return np.column_stack(
            [np.rint(getattr(self, name) / quantity.step) for name, quantity in QUANTITIES.items()]
        )

    def stored(self):
        """`Materials` in the types that bake points have, and the store."""
        return self.map(lambda quantity, values: np.ascontiguousarray(values, quantity.dtype))

    def nondefault(self):
        """Names of the quantities that are not their default everywhere."""
        return [
            name
            for name, quantity in QUANTITIES.items()
            if quantity.default is None
            or (getattr(self, name) != np.asarray(quantity.default, quantity.dtype)).any()
        ]

    def digested(self):
        """List of arrays that tell these from all others: what a digest of them is made of."""
        arrays = []
        for name in self.nondefault():
            if QUANTITIES[name].default is not None:
                # Without its name one that is not always there could pass for another.
                arrays.append(np.frombuffer(name.encode(), np.uint8))
            arrays.append(getattr(self, name))
        return arrays

    def of_what_is_met(self):
        """`Materials` with which light bounces, of that which does not go straight through.

        A ray that goes through has met nothing; of those that end here, more leave evenly than of
        all that arrive. No surface bounces more than arrives. The same object where nothing of
        that concerns it.
        """
        if (self.opacity == 1).all() and (self.albedo <= 1).all() and not self.transmission.any():
            return self
        share = np.asarray(self.opacity, np.float64)

        def given(values):
            part = np.where(share > 0, values / np.maximum(share, 1e-12), 0)
            return np.clip(part, 0, 1).astype(values.dtype)

        return self.replaced(
            albedo=given(self.albedo),
            translucency=given(self.translucency),
            transmission=np.zeros_like(self.transmission),
        )

    def equals(self, other):
        """Whether all quantities are those of `other`, value by value."""
        return all(
            np.array_equal(values, getattr(other, name)) for name, values in self.arrays().items()
        )


def expect_materials(name, value, count, dtype=None, rounded=False, bounced=False):
    """`value` as `Materials` whose values are finite and within their ranges.

    Parameters
    ----------
    name : str
        Said before that of the quantity which is wrong; may be empty.
    value : Materials or (count, 3) array
        An array is the albedo alone.
    count : int
    dtype : numpy type, optional
        Default: those of the values.
    rounded : bool
        Whether they are means, which may leave their range by rounding.
    bounced : bool
        Whether light bounces by them.

    Returns
    -------
    Materials

    Raises
    ------
    PRTError
        Names the quantity.
    """
    prefix = f"{name}: " if name else ""
    if not isinstance(value, Materials):
        expect(value is not None, f"{prefix}albedo: expected Materials or an array, got None")
        array = expect_array(f"{prefix}albedo", value, (count, QUANTITIES["albedo"].n_channels))
        value = Materials(albedo=array)
    expect(
        len(value) == count,
        f"{prefix}materials: expected those of {count} places, got {shown(value)}",
    )

    def checked(name, values):
        quantity = QUANTITIES[name]
        bounds = (quantity.least, quantity.most)
        if rounded:
            bounds = (quantity.lowest, quantity.highest(bounced))
        shape = count, quantity.n_channels
        return expect_array(f"{prefix}{name}", values, shape, dtype, *bounds)

    return _made_of({name: checked(name, values) for name, values in value.arrays().items()})


def _made_of(arrays):
    """`Materials` of arrays that are known to be right."""
    materials = object.__new__(Materials)
    vars(materials).update(arrays)
    return materials
