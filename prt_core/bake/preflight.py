"""What a bake will cost and where it will look wrong, before it is started."""

from dataclasses import dataclass

import numpy as np

from prt_core.bake.bounces import MOST_ROUNDS
from prt_core.bake.memory import Memory
from prt_core.bake.settings import BakeSettings
from prt_core.bake.visibility import chosen_method
from prt_core.errors import expect_kind, expect_number
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport.gather import ROUND

# Rays a second where nothing was measured yet: two cores of a desktop machine.
_RATES = {"embree": 8e6, "blender": 1.7e6, "bvhtree": 3e5, "brute": 1e4}
# Bounce rounds most scenes need at 1 %; grows with the square of a smaller tolerance.
_ROUNDS = 2
# Rays of a point for each emitter, of direct light.
_EMISSION = 250
# Share of the rays that sampling casts at 60,000 points, and how much longer one takes.
_SAMPLED, _GRAZING = 0.06, 4.0
# What sampling holds for each byte of the rows of a tile, about; tiles are cut as if it were more.
_HELD = 4
# Points further apart than this share of the scene cannot show a shadow's edge.
_COARSE = 1 / 40


@dataclass(frozen=True)
class Preflight:
    """Points, rays, seconds and bytes of a bake; the last two are estimates.

    Attributes
    ----------
    points, hidden_points, triangles, rays : int
    seconds : float
    memory_bytes : int
        At the peak, above what is in use now.
    disk_bytes : int
    coarse : dict of str -> (float, int)
        Objects with too few points for shadows: how far apart these are (Blender units), and
        how many times each edge should be halved.
    """

    points: int
    hidden_points: int
    triangles: int
    rays: int
    seconds: float
    memory_bytes: int
    disk_bytes: int
    coarse: dict


def preflight(scene, settings, back_end="embree", rays_per_second=None):
    """Estimate a bake.

    Parameters
    ----------
    scene : Scene
    settings : BakeSettings
    back_end : str
        Who traces (`auto` must be resolved by the caller).
    rays_per_second : float, optional
        As an earlier bake's report has it; default: a typical figure of the back-end.

    Returns
    -------
    Preflight
    """
    expect_kind("scene", scene, Scene)
    expect_kind("settings", settings, BakeSettings)
    expect_kind("back_end", back_end, str, "the name of one")
    if rays_per_second is not None:
        expect_number("rays_per_second", rays_per_second, above=0)
    n_points = len(scene.points)
    n_directions = CubeMap(settings.resolution).n_directions
    # A point's rays are the directions above its surface: half the sphere.
    rays = n_points * n_directions // 2
    slower = 1.0
    if chosen_method(settings.method, n_points, n_directions) != "exhaustive":
        # The denser the points, the fewer of them disagree; those rays graze what they pass.
        rays = int(rays * min(1.0, _SAMPLED * (60_000 / n_points) ** 0.3))
        slower = _GRAZING
    gather = 0
    if settings.bounces != 0:
        wanted = int(np.ceil(_ROUNDS * (0.01 / settings.tolerance) ** 2))
        rounds = min(MOST_ROUNDS, max(_ROUNDS, wanted))
        gather = n_points * rounds * ROUND
    emission = n_points * len(scene.emitters) * _EMISSION
    row, memory = -(-n_directions // 8), Memory.of()
    bits = n_points * row
    # What does not fit is read from files, piece by piece.
    rows = max(_HELD * row * memory.tile_points(n_points, row), min(bits, memory.most_held))
    gathered = min(12 * gather, memory.most_held)
    return Preflight(
        points=n_points,
        hidden_points=int((~scene.points.visible).sum()),
        triangles=len(scene.triangles),
        rays=rays + gather + emission,
        seconds=(rays * slower + gather + emission)
        / (rays_per_second or _RATES.get(back_end, _RATES["blender"])),
        memory_bytes=rows + gathered + 200 * n_points + (64 << 20),
        disk_bytes=bits // 2 + 3 * gather + 100 * n_points,
        coarse=coarse_objects(scene),
    )


def coarse_objects(scene):
    """Objects that receive whose points are too far apart for shadows (see `Preflight`)."""
    coarse = {}
    points = scene.points
    for index, item in enumerate(scene.objects):
        if not item.receives:
            continue
        mine = points.visible & (points.object_index == index)
        if not mine.any():
            continue
        corners = scene.triangles[scene.triangle_object == index]
        a, b, c = np.moveaxis(scene.vertices[corners].astype(np.float64), 1, 0)
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        side, cells = np.sqrt(area), max(np.sqrt(mine.sum()) - 1, 1.0)
        spacing = float(side / (cells + 1))
        if spacing > _COARSE:
            # As on a square grid: halving every edge doubles the cells, not the points.
            halvings = int(np.ceil(np.log2((side / _COARSE - 1) / cells)))
            coarse[item.name] = spacing * scene.size, halvings
    return coarse
