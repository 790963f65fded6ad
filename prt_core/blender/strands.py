"""Hair and points as few faces: what renders but is no mesh casts its shadow by these.

A strand becomes a tube of three sides, a point an octahedron; both are as wide as what they stand
for, in the mean over all directions that they are seen from. Where there are too many, some of them
stand for all and are as much wider.
"""

from dataclasses import dataclass, replace

import numpy as np

from prt_core.blender.raw_mesh import RawMesh

# Vertices of all strands, or all points, of one object at most; keys that Blender is asked for.
MOST_VERTICES, _MOST_ASKED = 20_000, 200_000
# Keys that are kept of a strand; how many should be, for light along it is not even; how far it may
# leave the line between them, and how much thinner or thicker it may be than in between, in radii.
_MOST_KEYS, _ENOUGH_KEYS, _STRAIGHT, _EVEN = 9, 4, 0.5, 0.1
# Of what has no radius of its own.
RADIUS = 0.01
# Circumradii: a triangle whose perimeter is pi times the diameter of a circle, as seen from all
# around; an octahedron whose surface is four times a disk, as seen from everywhere (Cauchy).
_TUBE, _OCTAHEDRON = 2 * np.pi / (3 * np.sqrt(3)), np.sqrt(np.pi / np.sqrt(3))
_SIDES = 3


@dataclass
class Strands:
    """Strands of hair, in the space of their object.

    Attributes
    ----------
    keys : (n_keys, 3) float64
    radii : (n_keys,) float64
    first : (n_strands + 1,) int64
        Where the keys of each begin, and where the last ends.
    slot : int
        Number of their material.
    share : int
        How many of the object's strands each of them stands for.
    """

    keys: np.ndarray
    radii: np.ndarray
    first: np.ndarray
    slot: int = 0
    share: int = 1

    def __len__(self):
        return len(self.first) - 1

    @property
    def number(self):
        """(n_keys,) int: which strand each key belongs to."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))


def particle_strands(source, system):
    """The `Strands` of a particle system of an evaluated object as Cycles draws them."""
    settings = system.settings
    parents, children = len(system.particles), len(system.child_particles)
    first = 0 if children == 0 or settings.use_parent_particles else parents
    count = parents + children - first
    steps = 2**settings.render_step + 1
    if settings.kink == "SPIRAL":
        steps += settings.kink_extra_steps
    # Evenly along a strand: each is a call.
    asked = np.unique(np.linspace(0, steps - 1, min(steps, _MOST_KEYS)).round().astype(int))
    share = max(1, -(-count * len(asked) // _MOST_ASKED))
    numbers = range(first, first + count, share)
    keys = [
        [system.co_hair(object=source, particle_no=n, step=int(k)) for k in asked] for n in numbers
    ]
    keys = np.array(keys, np.float64).reshape(-1, len(asked), 3)
    inverse = np.linalg.inv(np.array(source.matrix_world, np.float64))
    keys = keys @ inverse[:3, :3].T + inverse[:3, 3]
    # Cycles: the settings hold diameters; a shape below 0 is wide for longer.
    along = 1 - asked / (steps - 1)
    shape = settings.shape
    along = along ** (1 + shape if shape < 0 else 1 / max(1 - shape, 1e-3))
    root, tip = settings.root_radius, settings.tip_radius
    radii = (along * (root - tip) + tip) * settings.radius_scale / 2
    if settings.use_close_tip:
        radii[-1] = 0
    starts = np.arange(len(keys) + 1) * len(asked)
    slot = max(settings.material - 1, 0)
    return Strands(keys.reshape(-1, 3), np.tile(radii, len(keys)), starts, slot, share)


def curve_strands(data):
    """The `Strands` of a `bpy.types.Curves`."""
    first = np.empty(len(data.curves) + 1, np.int32)
    data.curve_offset_data.foreach_get("value", first)
    return Strands(_positions(data), _radii(data), first.astype(np.int64))


def point_octahedra(data, most=MOST_VERTICES // 6):
    """The points of a `bpy.types.PointCloud` as a `RawMesh`, and how many each stands for."""
    positions, radii = _positions(data), _radii(data)
    share = max(1, -(-len(positions) // most))
    positions, radii = positions[::share], radii[::share] * np.sqrt(share)
    axes = np.concatenate([np.eye(3), -np.eye(3)]) * _OCTAHEDRON
    vertices = (positions[:, None] + radii[:, None, None] * axes).reshape(-1, 3)
    x, y, z, u, v, w = range(6)
    faces = np.array([(x, y, z), (y, u, z), (u, v, z), (v, x, z),
                      (y, x, w), (u, y, w), (v, u, w), (x, v, w)])  # fmt: skip
    faces = (faces + 6 * np.arange(len(positions))[:, None, None]).reshape(-1, 3)
    return _smooth(vertices, np.tile(axes, (len(positions), 1)), faces), share


def tubes(strands):
    """`Strands` as a `RawMesh`, and how many of the object's strands each tube stands for."""
    strands = _only(strands, _bends(strands))
    share = max(1, -(-len(strands.keys) * _SIDES // MOST_VERTICES))
    if share > 1:
        strands = _only(strands, strands.number % share == 0)
    while len(strands.keys) < _ENOUGH_KEYS * len(strands):
        halved = _halved(strands)
        if len(halved.keys) * _SIDES > MOST_VERTICES or len(halved.keys) == len(strands.keys):
            break
        strands = halved
    keys, radii = strands.keys, strands.radii * strands.share * share
    share, number, first = strands.share * share, strands.number, strands.first
    next_key = np.minimum(np.arange(len(keys)) + 1, first[number + 1] - 1)
    before = np.maximum(np.arange(len(keys)) - 1, first[number])
    along = _unit(keys[next_key] - keys[before])
    # Strands side by side shall not all show the same side.
    helper = np.where(np.abs(along[:, 2:]) < 0.9, [[0, 0, 1.0]], [[1.0, 0, 0]])
    side = _unit(np.cross(along, helper))
    # Turned alike along a strand, so that the tube is not wrung.
    for level in range(1, int(np.diff(first).max(initial=0))):
        here = first[:-1][np.diff(first) > level] + level
        carried = side[here - 1]
        carried = carried - (carried * along[here]).sum(axis=1)[:, None] * along[here]
        side[here] = _unit(carried)
    other = np.cross(along, side)
    turns = 2 * np.pi * (np.arange(_SIDES)[None] / _SIDES + _golden(number)[:, None])
    around = np.cos(turns)[..., None] * side[:, None] + np.sin(turns)[..., None] * other[:, None]
    vertices = (keys[:, None] + _TUBE * radii[:, None, None] * around).reshape(-1, 3)
    lower = np.flatnonzero(next_key > np.arange(len(keys)))
    a, b = lower[:, None] * _SIDES + np.arange(_SIDES), lower[:, None] * _SIDES
    b = b + (np.arange(_SIDES) + 1) % _SIDES
    # Open at its ends: they are small, and cost points.
    faces = np.stack([a, b, b + _SIDES, a, b + _SIDES, a + _SIDES], axis=-1).reshape(-1, 3)
    normals = np.broadcast_to(around, (len(keys), _SIDES, 3)).reshape(-1, 3)
    return _smooth(vertices, normals, faces, strands.slot), share


def _bends(strands):
    """(n_keys,) bool: the keys without which a strand would run elsewhere, its ends always."""
    n_keys = np.diff(strands.first)
    kept = np.zeros(len(strands.keys), bool)
    kept[strands.first[:-1][n_keys > 0]] = kept[strands.first[1:][n_keys > 0] - 1] = True
    # Douglas and Peucker, all strands at once: between two kept keys the farthest is kept as well.
    for _ in range(_MOST_KEYS - 2):
        where = np.flatnonzero(kept)
        segment = np.cumsum(kept) - 1
        start, end = where[segment], where[np.minimum(segment + 1, len(where) - 1)]
        chord = strands.keys[end] - strands.keys[start]
        offset = strands.keys - strands.keys[start]
        length = np.maximum((chord * chord).sum(axis=1), 1e-30)
        share = np.clip((offset * chord).sum(axis=1) / length, 0, 1)[:, None]
        distance = np.linalg.norm(offset - share * chord, axis=1)
        # Or where it grows thinner otherwise than evenly.
        between = strands.radii[start] * (1 - share[:, 0]) + strands.radii[end] * share[:, 0]
        distance = np.maximum(distance / _STRAIGHT, np.abs(strands.radii - between) / _EVEN)
        far = (distance > strands.radii.max(initial=0)) & ~kept
        if not far.any():
            break
        candidates = np.flatnonzero(far)
        order = candidates[np.lexsort((-distance[candidates], segment[candidates]))]
        _, farthest = np.unique(segment[order], return_index=True)
        kept[order[farthest]] = True
    return kept


def _only(strands, kept):
    """`Strands` of some keys; those that have none left are gone."""
    _, lengths = np.unique(strands.number[kept], return_counts=True)
    first = np.concatenate([[0], np.cumsum(lengths)])
    return replace(strands, keys=strands.keys[kept], radii=strands.radii[kept], first=first)


def _halved(strands):
    """The same `Strands` with a key in the middle between any two."""
    inner = np.flatnonzero(np.diff(strands.number) == 0)
    keys = (strands.keys[inner] + strands.keys[inner + 1]) / 2
    radii = (strands.radii[inner] + strands.radii[inner + 1]) / 2
    number = np.insert(strands.number, inner + 1, strands.number[inner])
    return replace(
        strands,
        keys=np.insert(strands.keys, inner + 1, keys, axis=0),
        radii=np.insert(strands.radii, inner + 1, radii),
        first=np.searchsorted(number, np.arange(len(strands) + 1)),
    )


def _smooth(vertices, normals, faces, slot=0):
    """A `RawMesh` of the triangles that have an area, smoothly shaded."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]
    return RawMesh(
        vertices,
        faces.ravel().astype(np.int64),
        normals[faces.ravel()],
        np.arange(faces.size).reshape(-1, 3),
        np.full(len(faces), 3, np.int32),
        np.full(faces.size, slot, np.int64),
    )


def _positions(data):
    values = np.empty(len(data.points) * 3, np.float32)
    data.attributes["position"].data.foreach_get("vector", values)
    return values.reshape(-1, 3).astype(np.float64)


def _radii(data):
    values = np.full(len(data.points), RADIUS, np.float32)
    attribute = data.attributes.get("radius")
    if attribute is not None and attribute.domain == "POINT" and attribute.data_type == "FLOAT":
        attribute.data.foreach_get("value", values)
    return values.astype(np.float64)


def _golden(number):
    """Numbers in [0, 1) that lie evenly however many there are."""
    return number * 0.6180339887498949 % 1


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
