"""Lamps at finite distance, and the sun: samples of their light at points of the scene."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_flag,
    expect_kind,
    expect_number,
)
from prt_core.light.environment import BRIGHTEST
from prt_core.sobol import sobol_points

KINDS = ("point", "spot", "area", "sun")


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
    size : (2,) float
        Of an area lamp along x and y.
    ellipse : bool
        Whether an area lamp is an ellipse rather than a rectangle.
    cone, blend : float
        Full angle (radians) and soft share (0..1) of a spot lamp's cone.
    angle : float
        Diameter of a sun in radians.
    name : str
    """

    kind: str
    power: np.ndarray
    position: np.ndarray = (0.0, 0.0, 0.0)
    axes: np.ndarray = None
    radius: float = 0.0
    size: tuple = (1.0, 1.0)
    ellipse: bool = False
    cone: float = np.pi / 4
    blend: float = 0.15
    angle: float = 0.0
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
        axes = np.eye(3) if self.axes is None else self.axes
        self.axes = expect_array(f"{name}: axes", axes, (3, 3), np.float64)
        self.radius = expect_number(f"{name}: radius", self.radius, 0)
        self.ellipse = expect_flag(f"{name}: ellipse", self.ellipse)
        self.cone = expect_number(f"{name}: cone", self.cone, 0, 2 * np.pi)
        self.blend = expect_number(f"{name}: blend", self.blend, 0, 1)
        self.angle = expect_number(f"{name}: angle", self.angle, 0, 2 * np.pi)

    @property
    def is_small(self):
        """Whether the lamp is a single point or direction: one sample shows all of it."""
        area = self.kind == "area"
        return not (area or (self.angle if self.kind == "sun" else self.radius) > 0)

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
        return getattr(self, f"_sample_{self.kind}")(positions, uv)

    def _sample_point(self, positions, uv):
        # A disc of the lamp's radius that faces the receiver, of intensity power / 4 pi.
        to_lamp = self.position - positions
        towards = to_lamp / np.maximum(np.linalg.norm(to_lamp, axis=1, keepdims=True), 1e-30)
        u, v = _tangents(towards)
        disc = _disc(uv) * self.radius
        offset = disc[:, :1] * u + disc[:, 1:] * v
        direction, distance = _unit(to_lamp + offset)
        facing = np.einsum("ij,ij->i", direction, towards)
        intensity = facing / (4 * np.pi) / np.maximum(distance, 1e-30) ** 2
        return direction, distance, intensity[:, None] * self.power

    def _sample_spot(self, positions, uv):
        direction, distance, irradiance = self._sample_point(positions, uv)
        z = direction @ self.axes[:, 2]
        edge = np.cos(self.cone / 2)
        soft = (1 - edge) * self.blend
        t = np.clip((z - edge) / soft, 0, 1) if soft > 0 else (z >= edge).astype(np.float64)
        return direction, distance, irradiance * (t * t * (3 - 2 * t))[:, None]

    def _sample_area(self, positions, uv):
        local = _disc(uv) / 2 if self.ellipse else uv - 0.5
        local = local * np.asarray(self.size)
        target = self.position + local[:, :1] * self.axes[:, 0] + local[:, 1:] * self.axes[:, 1]
        direction, distance = _unit(target - positions)
        facing = np.maximum(direction @ self.axes[:, 2], 0)
        # A Lambertian emitter of `power` watts: radiance power / (pi area), so the area cancels.
        factor = facing / (np.pi * np.maximum(distance, 1e-30) ** 2)
        return direction, distance, factor[:, None] * self.power

    def _sample_sun(self, positions, uv):
        spread = np.tan(self.angle / 2)
        disc = _disc(uv) * spread
        direction, _ = _unit(
            self.axes[:, 2] + disc[:, :1] * self.axes[:, 0] + disc[:, 1:] * self.axes[:, 1]
        )
        count = len(positions)
        return direction, np.full(count, np.inf), np.broadcast_to(self.power, (count, 3))


def lamp_samples(n_samples, shift):
    """(n, n_samples, 2) float64 well spread samples, shifted by `shift` (n, 2) for each point."""
    power = max(0, int(np.ceil(np.log2(n_samples))))
    base = sobol_points(power)[:n_samples] + 0.5 / n_samples
    return (base[None] + shift[:, None]) % 1.0


def _unit(vectors):
    length = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(length, 1e-30)[:, None], length


def _disc(uv):
    radius, angle = np.sqrt(uv[:, 0]), 2 * np.pi * uv[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _tangents(axis):
    """Two unit vectors at right angles to each unit vector (Duff et al. 2017)."""
    x, y, z = axis.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1 / (sign + z)
    b = x * y * a
    u = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return u, np.stack([b, sign + y * y * a, -y], axis=1)
