"""The lenses of cameras that see further round than a plane shows."""

import numpy as np

LENSES = ("perspective", "orthographic", "equirectangular", "equidistant", "equisolid")


def panorama_directions(camera, x, y, width, height):
    """Directions of the samples of a panorama, in the camera's axes.

    Parameters
    ----------
    camera : Camera
        Of one of the last three of `LENSES`.
    x, y : (m,) float64
        Where in the picture, 0..1 to the right and up.
    width, height : int
        Of the picture.

    Returns
    -------
    directions : (m, 3) float64
    shown : (m,) bool
        False outside of a fisheye's disc.
    """
    # A panorama is shifted by parts of its own sides.
    x, y = x + camera.shift[0], y + camera.shift[1]
    if camera.lens == "equirectangular":
        left, right, low, high = camera.panorama
        along, above = left + x * (right - left), low + y * (high - low)
        level = np.cos(above)
        ways = [np.sin(along) * level, np.sin(above), -np.cos(along) * level]
        return np.stack(ways, axis=1), np.ones(len(x), bool)
    angle, focal, sensor_width, sensor_height = camera.fisheye
    if camera.lens == "equidistant":
        x, y = 2 * x - 1, 2 * y - 1
        radius, reach = np.hypot(x, y), 1.0
        away = radius * angle / 2
    else:
        sensor = _sensor(camera, width, height, sensor_width, sensor_height)
        x, y = (x - 0.5) * sensor[0], (y - 0.5) * sensor[1]
        radius, reach = np.hypot(x, y), 2 * focal * np.sin(angle / 4)
        away = 2 * np.arcsin(np.minimum(radius / (2 * focal), 1))
    outward = np.sin(away) / np.maximum(radius, 1e-30)
    return np.stack([x * outward, y * outward, -np.cos(away)], axis=1), radius <= reach


def _sensor(camera, width, height, sensor_width, sensor_height):
    """Width and height of the part of a sensor that the picture takes."""
    wide, high = width * camera.pixel_aspect[0], height * camera.pixel_aspect[1]
    fit = camera.sensor_fit
    if fit == "horizontal" or (fit == "auto" and wide >= high):
        return sensor_width, sensor_width * high / wide
    side = sensor_height if fit == "vertical" else sensor_width
    return side * wide / high, side
