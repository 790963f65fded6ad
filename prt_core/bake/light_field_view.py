"""A light field as it is looked at: radiance of its points towards a view, and pictures of it."""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.bake.light_field_compress import compressed_light_field
from prt_core.errors import expect, expect_one_of
from prt_core.evaluate.view import CameraRays
from prt_core.lightfield.hrdf import HRDFLayout
from prt_core.scene import Camera
from prt_core.transport import View

# Points of an image around a hit.
_AROUND = 4
# What surfaces look like whose light was not captured: dark, and not as dark as what is black.
GREY = 0.05


def field_toward(field, view, strengths=None, form="auto"):
    """Radiance that leaves the points of a light field towards a viewer.

    Parameters
    ----------
    field : LightField
    view : View
    strengths : dict of str -> float or (3,), optional
        Factors of the lights by name (see `LightField.weights`).
    form : {"auto", "exact", "compressed"}
        `auto`: the compressed form where there is one.

    Returns
    -------
    radiance : (n_scene_points, 3) float32
        Of all points of the scene; black where the field has none.
    used : {"exact", "compressed"}
    """
    expect_one_of("form", form, ("auto", "exact", "compressed"))
    weights = field.weights(strengths)
    positions = field.scene.to_world(field.scene.points.positions[field.point])
    ways = view.outgoing(positions)
    compressed = None if form == "exact" else compressed_light_field(field)
    expect(
        compressed is not None or form != "compressed",
        f"{field.store.path}: has no compressed form; 'prt lightfield compress' makes one",
    )
    if compressed is None:
        values = _exact_toward(field, ways, weights)
    else:
        values = compressed.toward(ways, weights)
    radiance = np.zeros((len(field.scene.points), 3), np.float32)
    radiance[field.point] = values
    return radiance, "exact" if compressed is None else "compressed"


def _exact_toward(field, ways, weights):
    """(n, 3) float32: between the four nearest directions of the tables as they were captured."""
    layout = HRDFLayout(*field.angles)
    local = np.einsum("nij,nj->ni", field.frames, ways)
    cells, shares = layout.bilinear(local)
    values = np.empty((len(field), 3), np.float32)
    for block, tables in field.tables(weights):
        rows = np.arange(len(tables))[:, None]
        corners = tables.reshape(len(tables), -1, 3)[rows, cells[block]]
        values[block] = np.einsum("nk,nkc->nc", shares[block], corners)
    return values


def camera_at(field, place):
    """A `Camera` at a place (3,) in the world that looks at the points of a field, all in sight."""
    positions = field.scene.to_world(field.scene.points.positions[field.point])
    low, high = positions.min(axis=0), positions.max(axis=0)
    middle, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    away = np.asarray(place, np.float64) - middle
    distance = np.linalg.norm(away)
    expect(distance > 0, "view: is in the middle of the light field; step back from it")
    away /= distance
    up = np.eye(3)[1] if abs(away[2]) > 0.999 else np.eye(3)[2]
    right = np.cross(up, away)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(away, right), away, np.asarray(place, float)], axis=1)
    share = min(radius / distance, 0.95)
    return Camera(matrix, max(share / np.sqrt(1 - share**2), 1e-3) * 1.05)


def view_of(camera):
    """The `View` of a camera: its place, or where it looks from where all its rays are parallel."""
    if camera.lens == "orthographic":
        return View(direction=camera.axes[:, 2])
    return View.of_camera(camera)


def uncaptured(field):
    """Names of the objects of a field's scene that no point of it is of."""
    scene = field.scene
    captured = set(scene.points.object_index[field.point].tolist())
    return [item.name for n, item in enumerate(scene.objects) if n not in captured]


def field_picture(field, radiance, camera, caster, width, height, grey=GREY):
    """A picture of a light field.

    Parameters
    ----------
    field : LightField
    radiance : (n_scene_points, 3) float32
        Of `field_toward` for the camera.
    camera : Camera
    caster : RayCaster
        Of what rays of cameras meet.
    width, height : int
    grey : float
        Radiance of surfaces that have no points of the field.

    Returns
    -------
    (height, width, 3) float32
        Linear; black where no surface is.
    """
    rays = CameraRays(field.scene, caster, camera, width, height)
    if field.scene.image is not None:
        _onto_image(field, rays)
    else:
        captured = np.zeros(len(field.scene.points) + 1, bool)
        captured[field.point] = True
        rays.points[~captured[rays.points].all(axis=1)] = -1
    return rays.picture(radiance, pointless=grey, whole=True)


def _onto_image(field, rays):
    """Let hits show the nearest points of an image on their side, not those of the mesh."""
    points = field.scene.points
    hit = np.flatnonzero(rays.points[:, 0] >= 0)
    own = points.object_index[rays.points[hit, 0]] == points.object_index[field.point[0]]
    rays.points[hit[~own]] = -1
    hit = hit[own]
    weights = rays.weights[hit].astype(np.float64)
    around = rays.points[hit]
    places = np.einsum("mk,mkx->mx", weights, points.positions[around])
    normals = np.einsum("mk,mkx->mx", weights, points.normals[around])
    step = np.sqrt(np.ptp(points.positions[field.point], axis=0).max() ** 2 / len(field))

    def key(positions, normal):
        return np.concatenate([positions / step, normal], axis=1)

    tree = cKDTree(key(points.positions[field.point], points.normals[field.point]))
    count = min(_AROUND, len(field))
    distance, nearest = tree.query(key(places, normals), count)
    distance, nearest = distance.reshape(-1, count), nearest.reshape(-1, count)
    shares = 1 / np.maximum(distance, 1e-6) ** 2
    rays.points = np.full((len(rays.points), count), -1, np.int32)
    rays.weights = np.zeros((len(rays.weights), count), np.float32)
    rays.points[hit] = field.point[nearest]
    rays.weights[hit] = shares / shares.sum(axis=1, keepdims=True)
