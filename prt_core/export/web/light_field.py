"""A light field in a page: what leaves each point to each cell of its hemisphere, in eight bits.

Of each light: the third root of R + G + B over the largest of the point, and the shares of R and
B, once for each 2 x 2 cells. Roots, as highlights are a hundred times as bright as the rest.
"""

import numpy as np

from prt_core.bake.light_field_compress import compressed_light_field
from prt_core.bake.light_field_view import field_toward, uncaptured
from prt_core.errors import expect
from prt_core.export.web.start import view_of_page
from prt_core.export.web.surface import octahedral, pack_surface, surface_of
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress
from prt_core.transport import View

# Points that are coded at once; texels of a table of the page, at most.
_BLOCK, _MOST = 1 << 10, 1 << 25
# Sides from which the coding is measured, and how high above the ground.
_SIDES, _ABOVE = 5, 0.6


def pack_light_field_steps(pack, field):
    """Put a `LightField` into a `Pack`, with the surface that shows it; a generator of `Progress`.

    Parameters
    ----------
    pack : Pack
    field : LightField

    Returns
    -------
    dict
        points, triangles, error (mean over some sides), worst, sides, notes.
    """
    scene, name = field.scene, field.store.path.name
    expect(
        scene.image is None,
        f"{name}: its points are texels of an image, and a page shows points of the mesh; bake it "
        "without --grid",
    )
    rows, columns = field.angles
    expect(
        len(field) * rows * columns <= _MOST,
        f"{name}: {len(field):,} points of {rows} x {columns} directions are more than a browser "
        f"takes, {_MOST:,} in all; bake fewer --objects or --angles",
    )
    surface = yield from in_thread("surface", surface_of, scene)
    pack_surface(pack, scene, surface)
    points = surface.points
    place = np.full(len(scene.points), -1)
    place[field.point] = np.arange(len(field))
    shown = np.flatnonzero(place[points] >= 0)
    expect(len(shown), f"{name}: cameras see none of its points; there is nothing to show")
    row_of = np.zeros(len(points), np.uint32)
    row_of[shown] = 1 + np.arange(len(shown))
    pack.add("field_row", row_of, differences=True)
    chosen = place[points[shown]]
    ways = np.stack([field.frames[chosen, 2], field.frames[chosen, 0]], axis=1).reshape(-1, 3)
    pack.add("field_frame", octahedral(ways))
    most = np.empty((len(field.lights), len(shown)), np.float32)
    model = yield from in_thread("light field", compressed_light_field, field)
    sides = yield from in_thread("light field", _Sides, field, points[shown], chosen)
    for light in range(len(field.lights)):
        sums, shares = yield from in_thread("light field", _coded, field, model, light, chosen,
                                            most[light], sides)  # fmt: skip
        # Cell by cell: neighbours along the curve are alike in each.
        pack.add(f"field_sum{light}", sums.T)
        pack.add(f"field_share{light}", shares.T)
        yield Progress("light field", light + 1, len(field.lights))
    pack.add("field_most", most)
    errors = sides.errors()
    pack.facts |= {
        "n_points": len(points),
        "n_triangles": len(surface.triangles),
        "n_single": surface.n_single,
        "n_between": len(surface.between),
        "start": view_of_page(field, surface),
        "field": {
            "lights": list(field.lights),
            "rows": rows,
            "columns": columns,
            "points": len(shown),
        },
        "about": f"A light field of {len(shown):,} points, within {np.mean(errors):.1%} of it.",
    }
    grey = uncaptured(field)
    report = {
        "points": len(points),
        "triangles": len(surface.triangles),
        "error": float(np.mean(errors)),
        "worst": float(np.max(errors)),
        "sides": len(errors),
        "form": "as captured" if model is None else "its compressed form",
        "notes": [f"{', '.join(grey[:5])}: no points of the light field, shown grey"] * bool(grey),
    }
    return report


def _coded(field, model, light, chosen, most, sides):
    """Codes of one light: (n, n_cells) and (n, 2 n_quarters) uint8; fills `most` in."""
    rows, columns = field.angles
    weights = np.zeros((len(field.lights), 3), np.float32)
    weights[light] = 1
    half = -(-rows // 2), -(-columns // 2)
    sums = np.empty((len(chosen), rows * columns), np.uint8)
    shares = np.empty((len(chosen), 2 * half[0] * half[1]), np.uint8)
    for first in range(0, len(chosen), _BLOCK):
        some = slice(first, min(first + _BLOCK, len(chosen)))
        if model is not None:
            radiance = model.decode(chosen[some], weights)
        else:
            radiance = np.stack([field.radiance[light, i] for i in chosen[some]])
        radiance = np.maximum(radiance, 0).astype(np.float32)
        total = radiance.sum(axis=3)
        most[some] = np.maximum(total.max(axis=(1, 2)), 1e-20)
        root = np.rint(255 * np.cbrt(total / most[some, None, None]))
        odd = (0, 0), (0, rows % 2), (0, columns % 2), (0, 0)
        fours = np.pad(radiance, odd).reshape(-1, half[0], 2, half[1], 2, 3).sum(axis=(2, 4))
        whole = np.maximum(fours.sum(axis=3, keepdims=True), 1e-20)
        share = np.rint(255 * fours[..., ::2] / whole)
        share[fours.sum(axis=3) <= 0] = 85
        sums[some] = root.reshape(len(root), -1)
        shares[some] = share.reshape(len(share), -1)
        colour = np.repeat(np.repeat(share / 255, 2, axis=1), 2, axis=2)[:, :rows, :columns]
        red, blue = np.moveaxis(colour, 3, 0)
        light_sum = (root / 255) ** 3 * most[some, None, None]
        near = np.stack([red, 1 - red - blue, blue], axis=3) * light_sum[..., None]
        sides.add(some, near.reshape(len(near), -1, 3))
    return sums, shares


class _Sides:
    """What codes look like from some sides, against the field itself.

    Parameters
    ----------
    field : LightField
    points : (n,) int
        Of its scene, that the page shows.
    chosen : (n,) int
        Points of the field that these are.
    """

    def __init__(self, field, points, chosen):
        positions = field.scene.to_world(field.scene.points.positions[points])
        middle, size = positions.mean(axis=0), np.ptp(positions, axis=0).max()
        layout, self._sides = HRDFLayout(*field.angles), []
        for turn in 2 * np.pi * np.arange(_SIDES) / _SIDES:
            view = View(position=middle + 2 * size * np.array([np.cos(turn), np.sin(turn), _ABOVE]))
            truth = field_toward(field, view)[0][points]
            local = np.einsum("nij,nj->ni", field.frames[chosen], view.outgoing(positions))
            around = layout.bilinear(local)
            self._sides.append((local[:, 2] > 0, truth, np.zeros(truth.shape), *around))

    def add(self, some, near):
        """Take in the light of a slice of the points: (k, n_cells, 3)."""
        rows = np.arange(len(near))[:, None]
        for _, _, mine, cells, shares in self._sides:
            mine[some] += np.einsum("nk,nkc->nc", shares[some], near[rows, cells[some]])

    def errors(self):
        """Relative L2 from each side, of the points that face it."""
        errors = [0.0]
        for facing, truth, mine, *_ in self._sides:
            total = np.linalg.norm(truth[facing].astype(np.float64))
            if total > 0:
                errors.append(float(np.linalg.norm((mine - truth)[facing]) / total))
        return errors[1:] or errors
