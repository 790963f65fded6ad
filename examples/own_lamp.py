"""A lamp of your own: a spot that throws stripes, with shadows and all bounces.

python examples/own_lamp.py BAKE.prt PICTURE.png
"""

import sys

import numpy as np

import prt_core
from prt_core.evaluate import render_view, to_display, write_png


class Stripes(prt_core.Lamp):
    """A spot lamp with a grating in front of it."""

    # A sample shows one stripe or none of it: a point of the scene wants many.
    is_small = False

    def sample(self, positions, uv):
        """As `Lamp.sample`: direction, distance, irradiance."""
        direction, distance, irradiance = super().sample(positions, uv)
        local = -direction @ self.axes
        bright = np.sin(24 * local[:, 0] / np.abs(local[:, 2])) > 0
        return direction, distance, irradiance * bright[:, None]


bake = prt_core.load(sys.argv[1])
size = bake.scene.size
# Above the middle of the scene; as long as nothing is said of its axes it shines straight down.
place = bake.scene.centre + [0, 0, 1.2 * size]
lamp = Stripes("spot", np.full(3, 60 * size**2), place, radius=0.02 * size, cone=1.2)
radiance = prt_core.relight_points(bake, lamps=[lamp], lamp_samples=64)
direct = prt_core.relight_points(bake, lamps=[lamp], lamp_samples=64, bounces=0)
print(f"bounces add {radiance.mean() / direct.mean() - 1:.1%}")
picture = render_view(bake, radiance, bake.make_caster(rays="camera"), 480, 300)
write_png(sys.argv[2], to_display(picture, bake.view_transform))
