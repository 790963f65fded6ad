"""What points send out under a light, beside what lobes make of it for a view."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect
from prt_core.relight.lighting import Lighting


@dataclass(frozen=True)
class SentLight:
    """A light that is known, of which views are a matter of lobes.

    Attributes
    ----------
    even : (n_points, 3) float32
        What leaves evenly to all sides, without what stands in for gloss.
    own : (n_points, 3) float32, or 0
        What shines itself, of that.
    lamps : list of LitLamp
        What points have of each.
    lighting : Lighting
    gloss : Gloss or GlossForm
        What reflects it.
    """

    even: np.ndarray
    own: np.ndarray
    lamps: list
    lighting: Lighting
    gloss: object

    def toward_steps(self, view, pace=None, every=1, mapped=False):
        """(n_points, 3) float32 radiance towards a view (see `Relighter.view_steps`)."""
        how = pace, every, mapped
        reflected, share = yield from self.gloss.toward_steps(view, self.lamps, *how)
        radiance = (self.even - self.own) * share
        radiance += self.own
        radiance += reflected
        return exposed(radiance, self.lighting)

    def of_pixels(self, rays):
        """(n_lit, 3) float32 radiance of the samples of a picture's rays."""
        own = None if np.ndim(self.own) == 0 else self.own
        radiance = self.gloss.radiance_of_pixels(rays, self.even - self.own, own, self.lamps)
        return exposed(radiance, self.lighting)


def exposed(radiance, lighting):
    """Radiance at the exposure of a `Lighting`: (n_points, 3) or (height, width, 3) float32."""
    if lighting.exposure == 0:
        return radiance
    with np.errstate(over="ignore"):
        radiance = radiance * np.float32(lighting.exposure_factor)
    expect(
        np.isfinite(radiance).all(),
        f"exposure: {lighting.exposure:g} stops take the colours beyond what float32 holds",
    )
    return radiance
