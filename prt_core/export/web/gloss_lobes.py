"""The lobes of a page's points: surfaces that differ, and what the view does to each of them.

Lobes of one roughness are a group, as in `relight.point_lobes`: those below a coat, and the coat.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.reflectance.fresnel_powers import N_POWERS
from prt_core.reflectance.mean_gloss import with_mean_gloss
from prt_core.reflectance.view_factors import ViewFactors
from prt_core.relight.glossy_points import metal_among, narrowest_of
from prt_core.relight.point_lobes import PointLobes
from prt_core.scene import ended_at

# Materials that are told apart by their `ViewFactors`.
_KINDS = 256
# Steps of Fresnel terms, and of the logarithm of alphas.
_STEP, _ALPHA_STEP = 1 / 4096, 1 / 512
# Objects that a note names.
_NAMED = 5


@dataclass(frozen=True)
class PageLobes:
    """What is to be known of lobes besides what a page holds of them.

    Attributes
    ----------
    strong : (n,) bool
        Points of the page that reflect as much as metals do.
    notes : tuple of str
        What the page does not show as it is.
    """

    strong: np.ndarray
    notes: tuple


def pack_lobes(pack, bake, points):
    """Put lobes into a `Pack`: `surface`, which of the different ones each point has; `lobe`, them.

    A surface is texels of four numbers: alphas of both groups and the number of its table of
    factors; the share of its colour that stands in for gloss; and the powers of the Fresnel term
    of each lobe. Then come the tables: a texel a lobe, and one of diffuse light, at each node.

    Parameters
    ----------
    pack : Pack
    bake : Bake
    points : (n,) int
        Of the bake, in the page's order.

    Returns
    -------
    PageLobes
    dict
        What the page is told of them: lobes (the group of each), surfaces, nodes, parts.
    """
    own, normals = bake.scene.points.materials[points], bake.scene.points.normals[points]
    strong = metal_among(bake.scene.points, points)
    # What lets light pass is drawn as much less often as it is clear.
    materials = own.of_rays_that_end(ended_at(own))
    lobes = PointLobes(materials, normals)
    n, groups = len(points), [(group.alpha[:-1], group.lobes) for group in lobes.groups]
    least = narrowest_of(bake.cube_map)
    names = [(index, name) for index, (_, each) in enumerate(groups) for name in each]
    rows = np.zeros((n, 2 + N_POWERS * len(names), 4), np.float32)
    (mirrors, brushed), alphas = np.zeros((2, n), bool), []
    for index, (alpha, each) in enumerate(groups):
        there = sum(powers[:-1].any(axis=(1, 2)) for powers in each.values()) > 0
        mirrors |= there & (alpha.max(axis=1) < least)
        brushed |= there & (alpha[:, 0] != alpha[:, 1]) & ~mirrors
        # As wide as a round lobe of the same area of facets.
        width = np.maximum(np.sqrt(alpha.prod(axis=1)), least)
        rows[:, 0, index] = np.exp(_ALPHA_STEP * np.rint(np.log(width) / _ALPHA_STEP))
        alphas.append(width[there])
    factors = ViewFactors(materials, _KINDS)
    rows[:, 0, 2] = factors.kind
    sent = with_mean_gloss(own).of_rays_that_end(ended_at(own))
    rows[:, 1, :3] = np.broadcast_to(sent.stand_in, (n, 3))
    for place, (index, name) in enumerate(names):
        first = 2 + N_POWERS * place
        rows[:, first : first + N_POWERS, :3] = groups[index][1][name][:-1]
    rows[:, 1:] = _STEP * np.rint(rows[:, 1:] / _STEP)
    surfaces, surface = np.unique(rows.reshape(n, -1), axis=0, return_inverse=True)
    pack.add("surface", surface.ravel().astype(np.uint32), differences=True)
    tables = [factors.tables[name] for name in (*(name for _, name in names), "diffuse")]
    tables = np.stack(tables, axis=2)
    tables = np.pad(tables, ((0, 0), (0, 0), (0, 0), (0, 1)))
    pack.add("lobe", np.concatenate([surfaces.ravel(), tables.ravel()]).astype(np.float32))
    narrowest = min((float(each.min()) for each in alphas if len(each)), default=1.0)
    notes = (
        (mirrors, f"sharp mirrors are shown as rough as {np.sqrt(least):.2f}"),
        (brushed, "brushed metal is shown as rough to all sides"),
        (lobes.rough[:-1] > 0, "rough diffuse surfaces are shown as even to all sides"),
    )
    notes = tuple(
        f"{_named(bake.scene, points[some])}: {text}" for some, text in notes if some.any()
    )
    facts = {
        "lobes": [index for index, _ in names],
        "surfaces": len(surfaces),
        "nodes": tables.shape[1],
        "narrowest": narrowest,
    }
    return PageLobes(strong, notes), facts


def _named(scene, points):
    """Names of the objects of some points."""
    names = [scene.objects[index].name for index in np.unique(scene.points.object_index[points])]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
