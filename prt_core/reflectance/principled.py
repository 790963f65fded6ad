"""The lobes of Blender's Principled BSDF (and Glossy), of the quantities that points have.

Layers lie on each other as in Cycles: what a layer reflects towards the viewer does not reach those
below it. Its table of albedos decides, by the view alone, so that layers are not reciprocal.

Albedo was read by Cycles' Diffuse Color pass, which looks straight down: what coat and specular
layer take away is in it, as seen from there. So the diffuse lobe has a factor of the view that is 1
straight above.

Source: Blender's Principled BSDF (Cycles 4.3 and later), `kernel/svm/closure.h`.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, expect_one_of
from prt_core.reflectance.arrays import channel_of, expect_both, expect_viewed
from prt_core.reflectance.brdf import Reflectance, local_frames
from prt_core.reflectance.energy import ggx_fresnel_share
from prt_core.reflectance.fresnel import Constant, Dielectric, F82Tint, RealSchlick, f0_of_ior
from prt_core.reflectance.microfacet import Microfacet, alphas
from prt_core.reflectance.oren_nayar import OrenNayar

# What is read of materials, and the number of channels of each.
_READ = {
    "albedo": 3, "stand_in": 3, "glossy": 3, "metal": 3, "metal_edge": 3, "dielectric": 1,
    "tint": 3, "ior": 1, "roughness": 1, "anisotropy": 1, "tangent": 3, "single": 1, "coat": 1,
    "coat_roughness": 1, "coat_ior": 1, "coat_tint": 3, "diffuse_roughness": 1, "opacity": 1,
}  # fmt: skip
GLOSSY_LOBES = ("metal", "dielectric", "glossy", "coat")


@dataclass(frozen=True)
class Lobe:
    """A lobe of some of the points.

    Parameters
    ----------
    name : str
        One of `GLOSSY_LOBES`, or diffuse.
    rows : (n_rows,) array of int, or slice
        The points that have it.
    reflectance : Reflectance
        Its parameters are (n_rows, 1), its colours (n_rows, 1, n_channels).
    weight : (n_rows, 1, 1) array
        That it has besides.
    """

    name: str
    rows: np.ndarray | slice
    reflectance: Reflectance
    weight: np.ndarray


def principled_lobes(materials):
    """The lobes of points, of what their materials are.

    Parameters
    ----------
    materials : Materials
        Or anything that has its quantities of gloss as attributes, (n, n_channels).

    Returns
    -------
    PrincipledLobes

    Raises
    ------
    PRTError
        A quantity is missing, or has a wrong shape or values out of range.
    """
    return PrincipledLobes(materials)


class PrincipledLobes:
    """All lobes of n points; `eval`, `sample` and `pdf` are of the glossy ones together.

    It is quickest where n m is some 60,000, say 16 points and 4,096 directions. Channels of answers
    lie apart in memory (see `arrays.from_channels`).

    Directions are (n, m, 3), or have 1 in place of n or m, in the frames of the points (`frames`).
    Of one point, directions may have any number in place of n.

    Parameters
    ----------
    materials : Materials
        See `principled_lobes`.

    Attributes
    ----------
    n_points : int
    n_channels : int
    lobes : tuple of Lobe
        Those that any point has, the diffuse one last.
    """

    n_channels = 3

    def __init__(self, materials):
        read, n = {}, None
        for name, n_channels in _READ.items():
            there = hasattr(materials, name)
            expect(there, f"materials: expected the quantity '{name}', which it does not have")
            value, shape = getattr(materials, name), (n, n_channels)
            read[name] = expect_array(f"materials.{name}", value, shape, np.float64)
            n = len(read[name])
        self.n_points, self._tangent, self._coat_tint = n, read["tangent"], read["coat_tint"]
        diffuse = np.maximum(read["albedo"] - read["stand_in"], 0)
        metal = _metal_weight(read, diffuse)
        # What is neither metal nor gloss; a specular layer lies over this much of it.
        rest = read["opacity"] - metal - read["glossy"].max(axis=1, keepdims=True)
        rest = np.maximum(rest, np.maximum(read["dielectric"], 1e-6))
        self._share = np.minimum(read["dielectric"] / rest, 1)
        self.lobes = tuple(_glossy_lobes(read, metal))
        self._straight = self._through(np.array([[[0, 0, 1.0]]]))
        rows = _rows(diffuse.any(axis=1))
        if rows is not None:
            # The colour of facets, without the weight that the lobe has.
            colour = diffuse / np.maximum(rest * self._straight[:, 0], 1e-6)
            rough = read["diffuse_roughness"][rows]
            lobe = OrenNayar(diffuse[rows, None], rough, colour[rows, None])
            self.lobes += (Lobe("diffuse", rows, lobe, np.ones((1, 1, 1))),)

    @property
    def roughness(self):
        """Slider of the narrowest glossy lobe; 1 where there is none."""
        return min((float(lobe.reflectance.roughness.min()) for lobe in self._glossy), default=1.0)

    def frames(self, normals):
        """The frames that directions are in, of normals (n, 3): (n, 3, 3), see `local_frames`."""
        return local_frames(normals, self._tangent)

    def eval(self, incoming, outgoing):
        """The glossy part of the BRDF, without the cosine.

        Parameters
        ----------
        incoming, outgoing : (n, m, 3) float
            Or with 1 in place of n or m.

        Returns
        -------
        (n, m, 3) array
        """
        return self._sum(incoming, outgoing, GLOSSY_LOBES)

    def diffuse_eval(self, incoming, outgoing):
        """The diffuse part of the BRDF, as `eval` has the glossy one, of incoming and outgoing."""
        return self._sum(incoming, outgoing, ("diffuse",))

    def lobe_eval(self, name, incoming, outgoing):
        """One lobe of the BRDF, as `eval` has the glossy ones.

        Parameters
        ----------
        name : str
            One of `GLOSSY_LOBES`, or diffuse; where no point has it, it is 0.
        incoming, outgoing : (n, m, 3) float
            See `eval`.

        Returns
        -------
        (n, m, 3) array
        """
        expect_one_of("name", name, (*GLOSSY_LOBES, "diffuse"))
        return self._sum(incoming, outgoing, (name,))

    def diffuse_weight(self, outgoing):
        """What coat and specular layer let through of diffuse light, in parts of straight above.

        Where diffuse light leaves evenly to all sides (no diffuse roughness), this times the baked
        albedo over pi is all that the view does to it.

        Parameters
        ----------
        outgoing : (n, m, 3) float
            See `eval`.

        Returns
        -------
        (n, m, 3) array
        """
        outgoing = self._fitting(outgoing, outgoing)[1]
        shape = (max(self.n_points, len(outgoing)), outgoing.shape[1], 3)
        # What lets nothing through straight above has no albedo either.
        least = np.where(self._straight > 1e-6, self._straight, 1)
        ratio = np.where(self._straight > 1e-6, self._through(outgoing) / least, 1)
        return np.broadcast_to(ratio.astype(outgoing.dtype, copy=False), shape)

    def reaching(self, lobe, outgoing):
        """What the coat lets through to a glossy lobe and back to the viewer.

        Parameters
        ----------
        lobe : Lobe
            Of these; the coat itself, and Blender's Glossy BSDF, lie under nothing.
        outgoing : (n, m, 3) float
            See `eval`.

        Returns
        -------
        (n_rows, m, 3) array, or with 1 in place of n_rows or of 3
        """
        if lobe.name not in ("metal", "dielectric"):
            return np.ones((1, 1, 1), outgoing.dtype)
        return _of(lobe.rows, self._below_coat(outgoing))[0]

    def sample(self, outgoing, uv):
        """Directions to the light, about as densely as the glossy lobes reflect.

        Parameters
        ----------
        outgoing : (n, m, 3) float
        uv : (n, m, 2) float

        Returns
        -------
        (n, m, 3) array
        """
        self._expect_gloss()
        outgoing, uv = expect_viewed(outgoing, uv)
        outgoing = self._fitting(outgoing, outgoing)[1]
        n = max(len(outgoing), self.n_points)
        outgoing, uv = (np.broadcast_to(a, (n, *a.shape[1:])) for a in (outgoing, uv))
        shares = self._shares(outgoing)
        ends = np.cumsum(shares, axis=0)
        result, first = np.empty_like(outgoing), uv[..., 0]
        for k, lobe in enumerate(self._glossy):
            begin = ends[k] - shares[k]
            mine = (first >= begin) & (first < ends[k] if k + 1 < len(ends) else True)
            again = np.clip((first - begin) / np.maximum(shares[k], 1e-30), 0, 1 - 1e-6)
            again = np.stack([again.astype(uv.dtype), uv[..., 1]], axis=-1)
            drawn = lobe.reflectance.sample(outgoing[lobe.rows], again[lobe.rows])
            mine = (mine & (shares[k] > 0))[lobe.rows]
            result[lobe.rows] = np.where(mine[..., None], drawn, result[lobe.rows])
        # Points without gloss: straight up, with a density of 0.
        return np.where(shares.sum(axis=0)[..., None] > 0, result, [0, 0, 1]).astype(uv.dtype)

    def pdf(self, incoming, outgoing):
        """Density (n, m) of `sample` at incoming of outgoing (n, m, 3); 0 without gloss."""
        self._expect_gloss()
        incoming, outgoing = self._fitting(incoming, outgoing)
        result = np.zeros(self._axes(incoming, outgoing), incoming.dtype)
        for share, lobe in zip(self._shares(outgoing), self._glossy, strict=True):
            density = lobe.reflectance.pdf(*_of(lobe.rows, incoming, outgoing))
            result[lobe.rows] += share[lobe.rows] * density
        return result

    @property
    def _glossy(self):
        return [lobe for lobe in self.lobes if lobe.name != "diffuse"]

    def _expect_gloss(self):
        expect(self._glossy, "materials: no point has a glossy lobe to sample")

    def _fitting(self, incoming, outgoing):
        incoming, outgoing = expect_both(incoming, outgoing)
        for name, array in (("incoming", incoming), ("outgoing", outgoing)):
            good = array.ndim == 3 and (self.n_points == 1 or len(array) in (1, self.n_points))
            expect(
                good,
                f"{name}: expected shape ({self.n_points}, m, 3) or (1, m, 3), got {array.shape}",
            )
        return incoming, outgoing

    def _axes(self, incoming, outgoing):
        """(n, m) of an answer."""
        n, m, _ = np.broadcast_shapes(incoming.shape, outgoing.shape)
        return max(n, self.n_points), m

    def _sum(self, incoming, outgoing, names):
        incoming, outgoing = self._fitting(incoming, outgoing)
        planes = np.zeros((3, *self._axes(incoming, outgoing)), incoming.dtype)
        for lobe in self.lobes:
            if lobe.name not in names:
                continue
            value = lobe.reflectance.eval(*_of(lobe.rows, incoming, outgoing))
            if lobe.name == "diffuse":
                scale = lobe.weight * self.diffuse_weight(outgoing)[lobe.rows]
            else:
                scale = lobe.weight * self.reaching(lobe, outgoing)
            scale = scale.astype(value.dtype, copy=False)
            for k, plane in enumerate(planes):
                plane[lobe.rows] += channel_of(value, k) * channel_of(scale, k)
        return np.moveaxis(planes, 0, -1)

    def _through(self, outgoing):
        """What reaches the diffuse lobe: (n, m, 3), or with 1 for n where there are no layers."""
        return self._below_coat(outgoing) * self._below_specular(outgoing)

    def _below_coat(self, outgoing):
        """What the coat lets through."""
        lobe = next((lobe for lobe in self.lobes if lobe.name == "coat"), None)
        if lobe is None:
            return np.ones((1, 1, 1), outgoing.dtype)
        (view,) = _of(lobe.rows, outgoing)
        ior, height = lobe.reflectance.fresnel.ior, np.clip(view[..., 2], 0, 1)
        kept = np.clip(1 - lobe.weight * _reflected(lobe.reflectance, view, f0_of_ior(ior)), 0, 1)
        # The way through the coat is longer at an angle: Beer's law for its tint.
        depth = 1 / np.sqrt(np.maximum(1 - (1 - height**2) / ior**2, 1e-6))
        tint = self._coat_tint[lobe.rows, None] ** depth[..., None]
        kept = kept * (1 + (tint - 1) * lobe.weight)
        return self._scattered(lobe.rows, kept, outgoing)

    def _below_specular(self, outgoing):
        """What the specular layer lets through."""
        lobe = next((lobe for lobe in self.lobes if lobe.name == "dielectric"), None)
        if lobe is None:
            return np.ones((1, 1, 1), outgoing.dtype)
        (view,) = _of(lobe.rows, outgoing)
        reflected = _reflected(lobe.reflectance, view, lobe.reflectance.fresnel.f0)
        kept = 1 - np.clip(reflected.max(axis=-1, keepdims=True), 0, 1)
        return self._scattered(lobe.rows, 1 - self._share[lobe.rows, None] * (1 - kept), outgoing)

    def _scattered(self, rows, values, outgoing):
        if isinstance(rows, slice):
            return values
        result = np.ones((self.n_points, outgoing.shape[1], values.shape[-1]), outgoing.dtype)
        result[rows] = values
        return result

    def _shares(self, outgoing):
        """(n_lobes, n, m) how often each glossy lobe is sampled: by what it reflects."""
        n = max(self.n_points, len(outgoing))
        shares = np.zeros((len(self._glossy), n, outgoing.shape[1]), outgoing.dtype)
        for share, lobe in zip(shares, self._glossy, strict=True):
            (view,) = _of(lobe.rows, outgoing)
            value = lobe.reflectance.fresnel(np.clip(view[..., 2], 0, 1)) * lobe.weight
            share[lobe.rows] = value.mean(axis=-1)
        total = shares.sum(axis=0)
        return shares / np.where(total > 0, total, 1)


def _glossy_lobes(read, metal_weight):
    """The lobes that any point has, of quantities by name (n, n_channels)."""
    # Without a tangent there is no direction to be rough along.
    anisotropy = np.where(read["tangent"].any(axis=1), read["anisotropy"][:, 0], 0)
    facets = alphas(read["roughness"][:, 0], anisotropy)
    one, many = np.ones_like(metal_weight), 1 - read["single"][:, 0]
    # Where a lobe is, its weight, how rough its facets are and how much light bounces between them.
    each = {
        "metal": (metal_weight[:, 0] > 0, one, (*facets, many)),
        "dielectric": (read["ior"][:, 0] != 1, read["dielectric"], (*facets, many)),
        "glossy": (read["glossy"].any(axis=1), one, (*facets, many)),
        "coat": (one[:, 0] > 0, read["coat"], (*alphas(read["coat_roughness"][:, 0]), one[:, 0])),
    }
    for name, (there, weight, (*alpha, multiple)) in each.items():
        rows = _rows(there & (weight[:, 0] > 0))
        if rows is not None:
            here = {key: values[rows, None] for key, values in read.items()}
            fresnel = _fresnel(name, here, metal_weight[rows, None])
            lobe = Microfacet(*(a[rows, None] for a in alpha), fresnel, multiple[rows, None])
            yield Lobe(name, rows, lobe, weight[rows, None])


def _fresnel(name, read, metal_weight):
    """The Fresnel term of a lobe, of quantities by name (n_rows, 1, n_channels)."""
    if name == "metal":
        return F82Tint(read["metal"], read["metal_edge"], metal_weight)
    if name == "dielectric":
        tint = read["tint"]
        # Without a colour one channel does.
        tint = tint if np.ptp(tint, axis=-1).any() else tint[..., :1]
        return RealSchlick(f0_of_ior(read["ior"]) * tint, 1.0, read["ior"][..., 0])
    if name == "glossy":
        return Constant(read["glossy"])
    return Dielectric(np.maximum(read["coat_ior"][..., 0], 1))


def _reflected(lobe, outgoing, f0):
    """The albedo that Cycles takes a layer to have, to a view (n, m, 3): (n, m, n_channels)."""
    share = ggx_fresnel_share(lobe.roughness, np.clip(outgoing[..., 2], 0, 1), lobe.fresnel.ior)
    f0 = np.asarray(f0).reshape(len(share), 1, -1)
    return lobe.darkening(outgoing) * (f0 + (1 - f0) * share[..., None])


def _metal_weight(q, diffuse):
    """(n, 1) how much of a surface is metal: what dielectrics, gloss and diffuse light leave.

    Its F0 has this weight in it; near the horizon it reflects so much of white.
    """
    most = q["metal"].max(axis=1)
    other = np.maximum(q["dielectric"][:, 0], diffuse.max(axis=1)) + q["glossy"].max(axis=1)
    weight = np.clip(q["opacity"][:, 0] - other, most, np.maximum(most, 1))
    return np.where(most > 0, weight, 0)[:, None]


def _rows(there):
    """The rows where something is, as a slice where it is everywhere; None where it is nowhere."""
    if there.all() and len(there):
        return slice(None)
    rows = np.flatnonzero(there)
    return rows if len(rows) else None


def _of(rows, *arrays):
    """Rows of arrays (n, ...); those with one for all points stay as they are."""
    return [a if len(a) == 1 and not isinstance(rows, slice) else a[rows] for a in arrays]
