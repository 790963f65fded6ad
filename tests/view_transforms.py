"""A view transform that shows radiance as it is, for tests without Blender."""

import numpy as np

from prt_core.scene import ViewTransform


def plain_view_transform(name="Standard"):
    """A `ViewTransform` that sends radiance to the display without any curve, cut at 1."""
    steps = np.minimum(ViewTransform.steps(), 1)
    table = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"))
    return ViewTransform((table * 65535).astype(np.uint16), name=name)
