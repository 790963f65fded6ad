"""Direct light of lamps at the bake points, by shadow rays: what K then bounces."""

import numpy as np

from prt_core.light.local import lamp_samples

_SEED_STAGE = 2
# Shadow rays end this share before the lamp, so that a lamp's own mesh does not shade it.
_SHORT = 1 - 1e-4


def lamp_light(scene, caster, lamps, n_samples=256, seed=0, block=4096, report=None):
    """Irradiance / pi of lamps at all points (direct-to-indirect transfer gathers it onwards).

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    lamps : sequence of Lamp or BrightPixels
    n_samples : int
        Shadow rays a point and lamp; a lamp without size needs one.
    seed, block : int
    report : callable(done, total), optional

    Returns
    -------
    (n_points, 3) float32
    """
    points = scene.points
    origins = scene.ray_origins
    world = scene.to_world(origins)
    received = np.zeros((len(points), 3))
    total = len(lamps) * len(points)
    for index, lamp in enumerate(lamps):
        count = 1 if lamp.is_small else n_samples
        for first in range(0, len(points), block):
            part = slice(first, min(first + block, len(points)))
            rng = np.random.default_rng([seed, _SEED_STAGE, index, first])
            n = part.stop - part.start
            uv = lamp_samples(count, rng.random((n, 2)))
            for sample in range(count):
                direction, distance, irradiance = lamp.sample(world[part], uv[:, sample])
                cosine = np.einsum("ij,ij->i", points.normals[part], direction)
                above = np.einsum("ij,ij->i", points.geometric_normals[part], direction) > 0
                lit = np.flatnonzero((cosine > 0) & above & (irradiance.max(axis=1) > 0))
                if not len(lit):
                    continue
                limit = (distance[lit] / scene.size * _SHORT).astype(np.float32)
                limited = np.isfinite(limit).all()
                free = ~caster.occluded(
                    origins[part][lit],
                    direction[lit].astype(np.float32),
                    limit if limited else None,
                )
                lit = lit[free]
                received[part][lit] += cosine[lit, None] * irradiance[lit] / (np.pi * count)
            if report is not None:
                report(index * len(points) + part.stop, total)
    return received.astype(np.float32)
