"""The light field of a bake under its own light, by its transport: for where Cycles cannot shoot.

Surfaces of a bake are diffuse: what leaves a point is the same in all directions. So the field is
the exit radiance of its points, and its use is another: a Blender without a camera for light
fields, and a check of those that were captured.
"""

import numpy as np

from prt_core.errors import expect
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from prt_core.runtime.progress import run

_WORLD, _EMISSION = "world", "emission"


class TransportCamera:
    """Radiance of a bake's points in all directions.

    Parameters
    ----------
    bake : Bake
    each : bool
        Whether there is a field of each of its lights: lamps, world, emitting materials; else one
        of all of them.
    caster : str
        For shadow rays.
    samples : int
        Shadow rays a point and lamp.

    Raises
    ------
    PRTError
        The bake has no light of its own.
    """

    name = "transport"
    most_points = 1 << 16

    def __init__(self, bake, each=False, caster="auto", samples=256):
        self._scene = bake.scene
        parts = {}
        if bake.world is not None and np.any(bake.world):
            # Suns of the world belong to its light.
            parts[_WORLD] = Lighting("world", lamp_samples=samples, emission="none")
        for lamp in bake.lamps:
            if not lamp.of_world and not lamp.is_on_texels and np.any(lamp.power):
                name = lamp.name if lamp.name not in parts else f"{lamp.name} {len(parts)}"
                parts[name] = Lighting(lamps=[lamp], lamp_samples=samples, emission="none")
        if bake.emission is not None:
            parts[_EMISSION] = Lighting(emission="all")
        expect(
            parts, f"{bake.path}: the baked scene has no light of its own; add a lamp or a world"
        )
        self.lights = tuple(parts) if each else ()
        relighter = Relighter(bake, caster, "exact")
        try:
            fields = [np.asarray(run(relighter.steps(light))) for light in parts.values()]
        finally:
            relighter.close()
        fields = np.stack(fields)
        self._radiance = fields if each else fields.sum(axis=0, keepdims=True)

    def shoot(self, points, angles, samples, seed):
        """See `LightFieldCamera.shoot`: no ray misses, and the seed changes nothing."""
        radiance = self._radiance[:, points.point, None, None]
        shape = (*radiance.shape[:2], *angles, 3)
        whole = np.ascontiguousarray(np.broadcast_to(radiance, shape), np.float32)
        return whole, np.zeros(len(points), np.float32), 0.0
