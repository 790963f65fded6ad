"""Which rays can meet anything: an exact test against a few boxes, before any ray is cast.

A ray that misses the bounding box of every object is free. Most rays of a ground plane are, and
the test costs a few per cent of the cast.
"""

import numpy as np

# Boxes tested at most; nearer objects share one. Boxes grow by rounding, far below a ray offset.
_MOST, _PAD = 6, 2e-6


def occluder_boxes(scene):
    """(n, 2, 3) float32: lowest and highest corners of at most a few boxes around all objects."""
    corners = scene.vertices[scene.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    n_objects = len(scene.objects)
    boxes = np.empty((n_objects, 2, 3), np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    np.minimum.at(boxes[:, 0], scene.triangle_object, low)
    np.maximum.at(boxes[:, 1], scene.triangle_object, high)
    boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    if len(boxes) > 256:
        boxes = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])[None]
    while len(boxes) > _MOST:
        boxes = _merge_cheapest(boxes)
    return boxes + np.float32([[-_PAD], [_PAD]])


def _area(low, high):
    x, y, z = np.moveaxis(high - low, -1, 0)
    return x * y + y * z + z * x


def _merge_cheapest(boxes):
    """Join the two boxes whose common one has the least surface beyond their own."""
    low = np.minimum(boxes[:, None, 0], boxes[None, :, 0])
    high = np.maximum(boxes[:, None, 1], boxes[None, :, 1])
    own = _area(boxes[:, 0], boxes[:, 1])
    growth = _area(low, high) - np.minimum(own[:, None], own[None])
    np.fill_diagonal(growth, np.inf)
    i, j = np.unravel_index(growth.argmin(), growth.shape)
    joined = np.stack([low[i, j], high[i, j]])[None]
    return np.concatenate([np.delete(boxes, [i, j], axis=0), joined])


class BoxCulling:
    """Slab tests of many origins against the same directions (Kay & Kajiya 1986).

    Parameters
    ----------
    boxes : (n, 2, 3) float32
    directions : (n_directions, 3) float32
    """

    def __init__(self, boxes, directions):
        tiny = np.float32(1e-12)
        flat = np.abs(directions) < tiny
        self._inverse = np.ascontiguousarray((1 / np.where(flat, tiny, directions)).T)
        self._boxes = boxes
        towards_high = self._inverse > 0
        # Distances to the planes at which a ray from the middle enters and leaves each slab.
        self._enter = [np.where(towards_high, b[0][:, None], b[1][:, None]) * self._inverse
                       for b in boxes]  # fmt: skip
        self._leave = [np.where(towards_high, b[1][:, None], b[0][:, None]) * self._inverse
                       for b in boxes]  # fmt: skip

    def may_hit(self, origin):
        """(n_directions,) bool, or True where the origin lies inside a box.

        Parameters
        ----------
        origin : (3,) float32
        """
        inside = (origin >= self._boxes[:, 0]) & (origin <= self._boxes[:, 1])
        if inside.all(axis=1).any():
            return True
        start = origin[:, None] * self._inverse
        result = None
        for enter, leave in zip(self._enter, self._leave, strict=True):
            near, far = (enter - start).max(axis=0), (leave - start).min(axis=0)
            hit = (near <= far) & (far >= 0)
            result = hit if result is None else result | hit
        return result
