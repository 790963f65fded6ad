"""Lamps at finite distance, and the sun: samples of their light at points of the scene."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_array,
    expect_flag,
    expect_kind,
    expect_number,
)
from prt_core.light.emission_pattern import falloff_at, pattern_on_sphere, pattern_on_square
from prt_core.light.environment import BRIGHTEST
from prt_core.sphere import sobol_points, square_to_cone, square_to_disc, tangents

KINDS = ("point", "spot", "area", "sun")
# Half angle in radians of what an area lamp without any spread sends out: a parallel beam has none.
_NARROWEST = 1e-3


@dataclass
class Lamp:
    """One lamp, in world space, with Blender's units.

    Parameters
    ----------
    kind : {"point", "spot", "area", "sun"}
    power : (3,) float
        Watts by channel; for a sun, W / m^2 on a surface that faces it.
    position : (3,) float
    axes : (3, 3) float
        Columns: the lamp's x, y and z axis, unit vectors; it shines along -z.
    radius : float
        Of the ball of a point or spot lamp.
    soft_falloff : bool
        Whether that ball is a disc that faces each receiver, as Blender has it by default, rather
        than a ball: they differ where the lamp is near.
    size : (2,) float
        Of an area lamp along x and y.
    ellipse : bool
        Whether an area lamp is an ellipse rather than a rectangle.
    cone, blend : float
        Full angle (radians) and soft share (0..1) of a spot lamp's cone.
    scale : (3,) float
        Of the lamp's object along x, y and z: an unequal one makes a spot's cone elliptical.
    angle : float
        Diameter of a sun in radians.
    spread : float
        Full angle (radians) that an area lamp shines into, as through a grid of slats; pi: all of
        it.
    casts_shadow : bool
        Whether anything is in the way of its light.
    receivers : sequence of str, optional
        Names of the objects that it lights (see `SceneObject.known_as`); default: all.
    blockers : sequence of str, optional
        Names of the objects that are in the way of its light; default: all.
    pattern : (n_rows, n_columns, 3) float, optional
        A factor on the power by the direction in the lamp's own axes, as an equirectangular image
        (see `equirectangular`).
    texture : (n_rows, n_columns, 3) float, optional
        A factor on the power of an area lamp by the place on it: the first row at the greatest y,
        the first column at the smallest x.
    falloff : (n, 2) float, optional
        Distances and a factor on the power at each, beside the square of the distance;
        power laws in between and beyond.
    of_world : bool
        Whether the sun is a part of the world's light, which shines together with it.
    highlights : bool
        Whether glossy surfaces show it.
    name : str
    """

    kind: str
    power: np.ndarray
    position: np.ndarray = (0.0, 0.0, 0.0)
    axes: np.ndarray = None
    radius: float = 0.0
    soft_falloff: bool = True
    size: tuple = (1.0, 1.0)
    ellipse: bool = False
    cone: float = np.pi / 4
    blend: float = 0.15
    scale: tuple = (1.0, 1.0, 1.0)
    angle: float = 0.0
    spread: float = np.pi
    casts_shadow: bool = True
    receivers: tuple | None = None
    blockers: tuple | None = None
    pattern: np.ndarray | None = None
    texture: np.ndarray | None = None
    falloff: np.ndarray | None = None
    of_world: bool = False
    highlights: bool = True
    name: str = "lamp"

    def __post_init__(self):
        name = expect_kind("lamp: name", self.name, str, "text")
        good = isinstance(self.kind, str) and self.kind in KINDS
        expect(good, f"{name}: kind expected one of {KINDS}, got {self.kind!r}")
        power = f"{name}: power"
        self.power = expect_array(power, self.power, (3,), np.float64, -BRIGHTEST, BRIGHTEST)
        self.position = expect_array(f"{name}: position", self.position, (3,), np.float64)
        size = expect_array(f"{name}: size", self.size, (2,), np.float64, 0)
        self.size = tuple(float(side) for side in size)
        scale = expect_array(f"{name}: scale", self.scale, (3,), np.float64, 0)
        self.scale = tuple(float(factor) for factor in scale)
        self.soft_falloff = expect_flag(f"{name}: soft_falloff", self.soft_falloff)
        axes = np.eye(3) if self.axes is None else self.axes
        self.axes = expect_array(f"{name}: axes", axes, (3, 3), np.float64)
        self.radius = expect_number(f"{name}: radius", self.radius, 0)
        self.ellipse = expect_flag(f"{name}: ellipse", self.ellipse)
        self.cone = expect_number(f"{name}: cone", self.cone, 0, 2 * np.pi)
        self.blend = expect_number(f"{name}: blend", self.blend, 0, 1)
        self.angle = expect_number(f"{name}: angle", self.angle, 0, 2 * np.pi)
        self.spread = expect_number(f"{name}: spread", self.spread, 0, 2 * np.pi)
        self.casts_shadow = expect_flag(f"{name}: casts_shadow", self.casts_shadow)
        self.of_world = expect_flag(f"{name}: of_world", self.of_world)
        self.highlights = expect_flag(f"{name}: highlights", self.highlights)
        for field in ("receivers", "blockers"):
            objects = getattr(self, field)
            if objects is not None:
                objects = expect_all(f"{name}: {field}", objects, str, "objects' names")
                setattr(self, field, tuple(objects))
        for field in ("pattern", "texture"):
            table = getattr(self, field)
            if table is not None:
                what, shape = f"{name}: {field}", (None, None, 3)
                table = expect_array(what, table, shape, np.float64, -BRIGHTEST, BRIGHTEST)
                expect(table.size, f"{what} expected at least one row and column")
                setattr(self, field, table)
        if self.falloff is not None:
            self.falloff = expect_array(f"{name}: falloff", self.falloff, (None, 2), np.float64, 0)
            rises = len(self.falloff) > 1 and (np.diff(self.falloff[:, 0], prepend=0) > 0).all()
            expect(rises, f"{name}: falloff expected two or more distances that rise from above 0")

    @property
    def is_small(self):
        """Whether the lamp is a single point or direction: one sample shows all of it."""
        area = self.kind == "area"
        return not (area or (self.angle if self.kind == "sun" else self.radius) > 0)

    @property
    def is_on_texels(self):
        """Whether its light can be put on the texels of a world: a sun as any other."""
        plain = self.casts_shadow and self.receivers is None and self.blockers is None
        return self.kind == "sun" and plain and not self.of_world and self.power.min() >= 0

    def seen_from(self, positions):
        """Where the lamp stands as seen from places, and how large it looks.

        Parameters
        ----------
        positions : (n, 3) float

        Returns
        -------
        directions : (n, 3) float64
            Unit vectors to its middle.
        angles : (n,) float64
            Half its width, in radians: of a disc as large as it is, which faces the place.
        """
        positions = np.asarray(positions, np.float64)
        if self.kind == "sun":
            directions = np.broadcast_to(self.towards, positions.shape)
            return directions, np.full(len(positions), self.angle / 2)
        ways = self.position - positions
        distances = np.maximum(np.linalg.norm(ways, axis=1), 1e-30)
        directions, radius = ways / distances[:, None], np.full(len(positions), self.radius)
        if self.kind == "area":
            # What is seen at an angle looks smaller.
            facing = np.abs(directions @ self.axes[:, 2])
            radius = np.sqrt(self.area * facing / np.pi)
        return directions, np.arctan2(radius, distances)

    def cone_from(self, positions):
        """How wide cones are that hold all of the lamp.

        Parameters
        ----------
        positions : (n, 3) float
            Where their tips are.

        Returns
        -------
        (n,) float64
            Half angles in radians, about the directions of `seen_from`; from within it pi / 2.
        """
        if self.kind == "sun":
            return np.full(len(positions), self.angle / 2)
        radius = self.radius
        if self.kind == "area":
            radius = (max(self.size) if self.ellipse else np.hypot(*self.size)) / 2
        distances = np.linalg.norm(self.position - positions, axis=1)
        return np.arcsin(np.minimum(radius / np.maximum(distances, 1e-30), 1))

    @property
    def area(self):
        """Of an area lamp, in square units."""
        return self.size[0] * self.size[1] / (4 / np.pi if self.ellipse else 1)

    @property
    def towards(self):
        """(3,) float64: from the scene towards a sun."""
        return self.axes[:, 2]

    def sample(self, positions, uv):
        """One sample of the lamp's light for each point.

        Parameters
        ----------
        positions : (n, 3) float64
            World positions of the receivers.
        uv : (n, 2) float in [0, 1)
            Where on the lamp.

        Returns
        -------
        direction : (n, 3) float64
            Unit vectors towards the sample.
        distance : (n,) float64
            Infinite for a sun.
        irradiance : (n, 3) float64
            On a surface facing the sample, were it the whole lamp: the mean over samples of
            `irradiance * cosine * visibility` is the lamp's irradiance.
        """
        positions = expect_array("positions", positions, (None, 3), np.float64)
        uv = expect_array("uv", uv, (len(positions), 2))
        direction, distance, irradiance = getattr(self, f"_sample_{self.kind}")(positions, uv)
        if self.pattern is not None and self.kind != "sun":
            irradiance = irradiance * pattern_on_sphere(self.pattern, -direction @ self.axes)
        if self.falloff is not None and self.kind != "sun":
            irradiance = irradiance * falloff_at(self.falloff, distance)[:, None]
        return direction, distance, irradiance

    def _sample_point(self, positions, uv):
        if self.radius > 0 and not self.soft_falloff:
            return self._sample_ball(positions, uv)
        # A disc of the lamp's radius that faces the receiver, of intensity power / 4 pi.
        to_lamp = self.position - positions
        towards, _ = _unit(to_lamp)
        u, v = tangents(towards)
        disc = square_to_disc(uv) * self.radius
        offset = disc[:, :1] * u + disc[:, 1:] * v
        direction, distance = _unit(to_lamp + offset)
        facing = np.einsum("ij,ij->i", direction, towards)
        intensity = facing / (4 * np.pi) / np.maximum(distance, 1e-30) ** 2
        return direction, distance, intensity[:, None] * self.power

    def _sample_ball(self, positions, uv):
        # Evenly over the solid angle of what is seen of the ball: from inside that is all of it.
        towards, away = _unit(self.position - positions)
        towards[away == 0] = self.axes[:, 2]
        sine = self.radius / np.maximum(away, self.radius)
        inside = away <= self.radius
        # 1 - cos of the half angle, without the difference of two numbers that are nearly one.
        cap = np.where(inside, 2.0, sine**2 / (1 + np.sqrt(1 - sine**2)))
        local = square_to_cone(uv, cap)
        direction = _turned(local, *tangents(towards), towards)
        along = away * local[:, 2]
        half = np.sqrt(np.maximum(self.radius**2 - away**2 + along**2, 0))
        distance = np.where(inside, along + half, along - half)
        # Radiance power / (4 pi^2 r^2) times the solid angle.
        factor = cap / (2 * np.pi * self.radius**2)
        return direction, distance, factor[:, None] * self.power

    def _sample_spot(self, positions, uv):
        direction, distance, irradiance = self._sample_point(positions, uv)
        local, _ = _unit(direction @ self.axes / np.maximum(self.scale, 1e-30))
        edge = np.cos(self.cone / 2)
        soft = (1 - edge) * self.blend
        z = local[:, 2]
        t = np.clip((z - edge) / soft, 0, 1) if soft > 0 else (z >= edge).astype(np.float64)
        if not self.soft_falloff:
            # From inside its ball a spot has no cone, as in Cycles.
            t[np.linalg.norm(self.position - positions, axis=1) <= self.radius] = 1
        return direction, distance, irradiance * (t * t * (3 - 2 * t))[:, None]

    def _sample_area(self, positions, uv):
        size = np.asarray(self.size)
        if not size.all():
            return _nothing(self.position - positions)
        narrow = self.spread < np.pi - 1e-6
        place, share = self._lit_part(positions, uv) if narrow else (None, 1.0)
        if not narrow:
            place = square_to_disc(uv) / 2 if self.ellipse else uv - 0.5
        local = place * size
        target = self.position + local[:, :1] * self.axes[:, 0] + local[:, 1:] * self.axes[:, 1]
        direction, distance = _unit(target - positions)
        facing = np.maximum(direction @ self.axes[:, 2], 0)
        # A Lambertian emitter of `power` watts: radiance power / (pi area), so the area cancels.
        factor = facing / (np.pi * np.maximum(distance, 1e-30) ** 2) * share
        if narrow:
            factor = factor * _through_slats(facing, self.spread)
        irradiance = factor[:, None] * self.power
        if self.texture is not None:
            irradiance = irradiance * pattern_on_square(self.texture, place + 0.5)
        return direction, distance, irradiance

    def lit_window(self, positions):
        """Where the spread of an area lamp lets places see it.

        Parameters
        ----------
        positions : (n, 3) float

        Returns
        -------
        low, high : (n, 2) float64
            Corners on the lamp, whose own are at -0.5 and 0.5; equal where it is not seen.
        """
        local = (positions - self.position) @ self.axes
        size = np.maximum(self.size, 1e-30)
        reach = np.abs(local[:, 2:]) * np.tan(_half_spread(self.spread)) / size
        middle = local[:, :2] / size
        return np.clip(middle - reach, -0.5, 0.5), np.clip(middle + reach, -0.5, 0.5)

    def _lit_part(self, positions, uv):
        """Samples where the spread lets receivers see the lamp, and the share of it that this is.

        Places are within -0.5..0.5; beyond an ellipse the share is 0.
        """
        low, high = self.lit_window(positions)
        place = low + uv * (high - low)
        share = (high - low).prod(axis=1)
        if self.ellipse:
            share = share * (4 / np.pi) * ((place**2).sum(axis=1) <= 0.25)
        return place, share

    def _sample_sun(self, positions, uv):
        # Evenly over the disc's solid angle, of the radiance that gives `power` where it is faced.
        cap = np.full(len(uv), 2 * np.sin(self.angle / 4) ** 2)
        direction = _turned(square_to_cone(uv, cap), *self.axes.T)
        count = len(positions)
        irradiance = self.power / np.cos(self.angle / 4) ** 2
        return direction, np.full(count, np.inf), np.broadcast_to(irradiance, (count, 3))


def lamp_samples(n_samples, shift):
    """(n, n_samples, 2) float64 well spread samples, shifted by `shift` (n, 2) for each point."""
    power = max(0, int(np.ceil(np.log2(n_samples))))
    base = sobol_points(power)[:n_samples] + 0.5 / n_samples
    return (base[None] + shift[:, None]) % 1.0


def _half_spread(spread):
    return np.clip(spread / 2, _NARROWEST, np.pi / 2)


def _through_slats(cosine, spread):
    """(n,) share of an area lamp's light at an angle that a grid of slats lets pass, as Cycles has
    it: the whole keeps its power."""
    half = _half_spread(spread)
    # The tangent less the angle, whose leading terms cancel where both are small.
    whole = np.tan(half) - half if half > 0.05 else half**3 / 3
    cosine = np.clip(cosine, 1e-30, 1)
    tangent = np.sqrt(1 - cosine**2) / cosine
    return np.maximum(np.tan(half) - tangent, 0) / whole


def _nothing(vectors):
    """A sample that brings no light, along `vectors` (n, 3)."""
    direction, distance = _unit(vectors)
    return direction, distance, np.zeros_like(direction)


def _unit(vectors):
    length = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(length, 1e-30)[:, None], length


def _turned(local, u, v, axis):
    """Local directions (m, 3) along the axes (m, 3), or (3,), of a frame."""
    return local[:, :1] * u + local[:, 1:2] * v + local[:, 2:] * axis
