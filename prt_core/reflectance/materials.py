"""`Materials`: what a surface is, in quantities at corners, at bake points or anywhere between.

A quantity is one line in `QUANTITIES`. All that is done to each of them walks that table: corners
are merged to points, places between points and whole areas get means, meshes and points are joined,
digested, stored, read, and replaced after a bake.
"""

import numpy as np

from prt_core.errors import expect, expect_array, shown
from prt_core.reflectance.quantities import QUANTITIES

# Besides albedo and translucency: shares of the light that what is partly clear sends back.
_REFLECTED = ("stand_in", "glossy", "metal", "dielectric", "coat")


class Materials:
    """The quantities of materials at places, an array each.

    Each quantity of `QUANTITIES` is an attribute by its name, (n, n_channels).

    Parameters
    ----------
    **values : (n, n_channels) array
        By the names of quantities; those left out have their defaults, one row for all.

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
        count = np.shape(np.broadcast_to(True, len(self))[places])
        if not count:
            return self.map(lambda _, values: values[places])
        return self.gathered(count[0], lambda _, values: values[places])

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

    def gathered(self, count, function):
        """`Materials` of places each of which is made of some of these.

        A quantity of one value for all, as those have that were left out, stays that: it takes no
        room and no time.

        Parameters
        ----------
        count : int
            Places that there are then.
        function : callable(quantity, values)
            The (count, n_channels) values of one that differs.
        """

        def made(quantity, values):
            if not _is_one(values):
                return function(quantity, values)
            return np.broadcast_to(values[:1], (count, quantity.n_channels))

        return self.map(made)

    def put(self, places, other):
        """Change those of some places to `other` ones, which have as many."""
        for name, values in other.arrays().items():
            own = getattr(self, name)
            if _is_one(own):
                if _is_one(values) and (own[0] == values[0]).all():
                    continue
                own = np.array(own, np.result_type(own, values))
                setattr(self, name, own)
            own[places] = values

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
        if not parts:
            return _made_of(
                {name: np.zeros((0, q.n_channels), q.dtype) for name, q in QUANTITIES.items()}
            )
        count = sum(len(part) for part in parts)

        def whole(name):
            values = [getattr(part, name) for part in parts if len(part)] or [
                getattr(parts[0], name)
            ]
            first = values[0]
            if all(_is_one(each) and (each[0] == first[0]).all() for each in values):
                return np.broadcast_to(first[:1], (count, first.shape[1]))
            return np.concatenate(values)

        return _made_of({name: whole(name) for name in QUANTITIES})

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

        return self.gathered(len(weights), mean)

    def in_steps(self):
        """(n, channels) float64: equal where corners of a vertex may share a point."""
        steps = [np.rint(getattr(self, n) / QUANTITIES[n].step) for n in self.differing()]
        return np.column_stack([np.zeros((len(self), 0)), *steps])

    def differing(self):
        """Names of the quantities that are not one value for all."""
        return [name for name, values in self.arrays().items() if not _is_one(values)]

    def stored(self):
        """`Materials` in the types that bake points have, and the store."""

        def kept(quantity, values):
            if _is_one(values):
                return np.broadcast_to(values[:1].astype(quantity.dtype), values.shape)
            return np.ascontiguousarray(values, quantity.dtype)

        return self.map(kept)

    def nondefault(self):
        """Names of the quantities that are not their default everywhere."""
        return [
            name
            for name, quantity in QUANTITIES.items()
            if quantity.default is None
            or (_few(getattr(self, name)) != np.asarray(quantity.default, quantity.dtype)).any()
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

        shares = {"albedo", "translucency", *(set(_REFLECTED) & set(self.nondefault()))}
        return self.replaced(
            **{name: given(getattr(self, name)) for name in shares},
            transmission=np.zeros_like(self.transmission),
        )

    def of_rays_that_end(self, share):
        """`Materials` of places where rays end, each shown by so many of them alone.

        Parameters
        ----------
        share : (n,) float
            Of the rays, above 0 (see `scene.ended_share`).
        """
        if (share == 1).all():
            return self
        names = {"albedo", "emission", "opacity", "translucency", "transmission", *_REFLECTED}
        names &= {"albedo", *self.nondefault()}

        def given(name):
            values = getattr(self, name)
            most = QUANTITIES[name].most
            return np.minimum(values / share[:, None], most).astype(values.dtype)

        return self.replaced(**{name: given(name) for name in names})

    def equals(self, other):
        """Whether all quantities are those of `other`, value by value."""
        pairs = [(values, getattr(other, name)) for name, values in self.arrays().items()]
        return all(
            np.array_equal(_few(one), _few(two))
            if len(one) == len(two) and _is_one(one) and _is_one(two)
            else np.array_equal(one, two)
            for one, two in pairs
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
        if _is_one(values) and len(values) == count:
            row = (1, quantity.n_channels)
            one = expect_array(f"{prefix}{name}", values[:1], row, dtype, *bounds)
            return values if one.dtype == values.dtype else np.broadcast_to(one, shape)
        return expect_array(f"{prefix}{name}", values, shape, dtype, *bounds)

    arrays = {name: checked(name, values) for name, values in value.arrays().items()}
    # Instances are known by having the very same materials.
    same = all(array is getattr(value, name) for name, array in arrays.items())
    return value if same else _made_of(arrays)


def _is_one(values):
    """Whether an array is one row that stands for all."""
    return values.ndim == 2 and len(values) > 0 and values.strides[0] == 0


def _few(values):
    """Rows that have all values of an array."""
    return values[:1] if _is_one(values) else values


def _made_of(arrays):
    """`Materials` of arrays that are known to be right."""
    materials = object.__new__(Materials)
    vars(materials).update(arrays)
    return materials
