"""What rays meet of a lamp: where on it, and how densely `Lamp.sample` falls there."""

import numpy as np

from prt_core.sphere import cone_density, tangents


def met(lamp, positions, directions):
    """What rays meet of a lamp, were nothing in their way.

    Parameters
    ----------
    lamp : Lamp
        That is not small.
    positions, directions : (n, 3) float
        Where rays start, and unit vectors along them.

    Returns
    -------
    uv : (n, 2) float64
        Where on the lamp, as `Lamp.sample` takes it; any where it is missed.
    density : (n,) float64
        Of the directions of `Lamp.sample`, for solid angle: times its irradiance this is the
        radiance that comes along the ray. 0 where the ray misses the lamp.
    """
    if lamp.kind == "sun":
        cap = np.full(len(positions), 2 * np.sin(lamp.angle / 4) ** 2)
        return _on_cone(directions @ lamp.axes, cap)
    if lamp.kind == "area":
        return _on_area(lamp, positions, directions)
    ways = lamp.position - positions
    away = np.maximum(np.linalg.norm(ways, axis=1), 1e-30)
    towards = ways / away[:, None]
    cosine = np.einsum("nx,nx->n", directions, towards)
    if lamp.soft_falloff:
        # A disc that faces the place; what is met of it is round.
        distance = away / np.maximum(cosine, 1e-9)
        off = distance * np.sqrt(np.maximum(1 - cosine**2, 0)) / lamp.radius
        hit = (cosine > 1e-6) & (off <= 1)
        place = directions * distance[:, None] - ways
        density = distance**2 / (np.pi * lamp.radius**2 * np.maximum(cosine, 1e-9))
        return _round(off, place, towards), np.where(hit, density, 0)
    sine = lamp.radius / np.maximum(away, lamp.radius)
    cap = np.where(away <= lamp.radius, 2.0, sine**2 / (1 + np.sqrt(1 - sine**2)))
    aside = [np.einsum("nx,nx->n", directions, axis) for axis in tangents(towards)]
    return _on_cone(np.stack([*aside, cosine], axis=1), cap)


def _on_cone(local, cap):
    """Of directions about z, what a cone of `cap` has (see `square_to_cone`)."""
    down = (1 - local[:, 2]) / cap
    uv = np.stack([np.clip(down, 0, 1), np.arctan2(local[:, 1], local[:, 0]) / (2 * np.pi) % 1], 1)
    return uv, np.where(down <= 1, cone_density(cap), 0)


def _on_area(lamp, positions, directions):
    size, facing = np.maximum(lamp.size, 1e-30), directions @ lamp.axes[:, 2]
    height = (lamp.position - positions) @ lamp.axes[:, 2]
    distance = height / np.where(facing > 1e-9, facing, 1)
    hits = positions + distance[:, None] * directions - lamp.position
    place = hits @ lamp.axes[:, :2] / size
    hit = (facing > 1e-9) & (distance > 0)
    area = lamp.area
    if lamp.spread < np.pi - 1e-6:
        # Samples fall where the spread lets the place see the lamp.
        low, high = lamp.lit_window(positions)
        uv = (place - low) / np.maximum(high - low, 1e-30)
        hit &= ((uv >= 0) & (uv <= 1)).all(axis=1) & (high > low).all(axis=1)
        area = np.prod(lamp.size) * (high - low).prod(axis=1)
    elif lamp.ellipse:
        off = 2 * np.hypot(*place.T)
        uv = np.stack([np.minimum(off, 1) ** 2, np.arctan2(*place.T[::-1]) / (2 * np.pi) % 1], 1)
        hit &= off <= 1
    else:
        uv = place + 0.5
        hit &= ((uv >= 0) & (uv <= 1)).all(axis=1)
    density = distance**2 / np.maximum(area * facing, 1e-30)
    return np.clip(uv, 0, 1 - 1e-9), np.where(hit, density, 0)


def _round(off, place, towards):
    """Where on a disc that faces `towards` (n, 3) a place (n, 3) from its middle is.

    `off` (n,) is how far from there, in parts of the disc's radius.
    """
    across, up = (np.einsum("nx,nx->n", place, axis) for axis in tangents(towards))
    turn = np.arctan2(up, across) / (2 * np.pi) % 1
    return np.clip(np.stack([np.minimum(off, 1) ** 2, turn], axis=1), 0, 1 - 1e-9)
