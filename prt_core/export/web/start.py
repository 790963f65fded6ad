"""How a page begins: where it is looked at from, and what shines."""

import numpy as np

from prt_core.scene import auto_camera

# The light of a world whose brightest texel is not so many times its mean is even.
_EVEN = 1.05


def start_of(bake, surface):
    """The first view and light of a page, as numbers and texts.

    Returns
    -------
    dict
        eye, target (3,) in the scene's frame; up (3,); tangents (2,) of half the angles across
        and up; shift (2,); light: "world", "none" or "image"; lamps: whether they shine.
    """
    return {**view_of_page(bake, surface), **_light(bake)}


def view_of_page(bake, surface):
    """The first view alone, of a bake or a light field (see `start_of`), and the scene's size."""
    scene, camera = bake.scene, bake.camera
    shown = surface.points[scene.points.visible[surface.points]]
    positions = scene.points.positions[shown if len(shown) else surface.points]
    if camera is None or camera.lens != "perspective":
        camera = auto_camera(scene)
    eye = scene.to_frame(camera.position[None])[0]
    right, up, back = camera.axes.T
    away = (positions - eye) @ -back
    size = float(np.ptp(positions, axis=0).max())
    distance = float(np.median(away[away > 0])) if (away > 0).any() else size
    width, height = (
        side * aspect for side, aspect in zip(camera.frame, camera.pixel_aspect, strict=True)
    )
    fit = camera.sensor_fit
    if fit == "auto":
        fit = "horizontal" if width >= height else "vertical"
    fitted = width if fit == "horizontal" else height
    tangents = camera.tangent * width / fitted, camera.tangent * height / fitted
    shift = np.array(camera.shift) * 2 * camera.tangent
    target = eye - back * max(distance, 1e-3 * size)
    values = {"eye": eye, "target": target, "up": up, "tangents": tangents, "shift": shift}
    return {name: [float(v) for v in value] for name, value in values.items()} | {"size": size}


def _light(bake):
    """The scene's own light, where it has one that shows its forms; else the first image."""
    lamps = any(not lamp.of_world for lamp in bake.lamps) or bake.emission is not None
    world = bake.world
    lit = world is not None and bool(world.any())
    suns = any(lamp.of_world for lamp in bake.lamps)
    uneven = lit and float(world.max()) > _EVEN * float(world.mean())
    if lamps or suns or uneven:
        return {"light": "world" if lit or suns else "none", "lamps": lamps}
    return {"light": "image", "lamps": False}
