"""Surfaces over the sphere: no flipped triangle, even areas, and what cannot be laid over it."""

from dataclasses import replace

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.bake import BakeSettings, bake_steps
from prt_core.bake.images import ImageSettings, image_steps
from prt_core.bake.load import load
from prt_core.rays import BruteForceCaster
from prt_core.runtime.progress import run
from prt_core.scene import Scene, geometry_layout, with_geometry_image
from prt_core.scene.images.closed_surface import closed_surface
from prt_core.scene.images.spherical import evenness, spherical_positions, turned
from prt_core.sphere import octahedral_directions, octahedral_square
from tests.meshes import plane, sphere


def arrays(mesh):
    return mesh.vertices, mesh.corner_vertex[mesh.solid_triangles()]


def bumpy(n=16):
    """A ball with six blunt horns as long as itself."""
    vertices, triangles = arrays(sphere(n))
    horns = np.exp(12 * (np.abs(vertices).max(axis=1) - 1))
    return vertices * (0.5 + horns)[:, None], triangles


def cube():
    """Every face has vertices of its own, as exporters write it."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5
    vertices, triangles = [], []
    for axis in range(3):
        for side in (-0.5, 0.5):
            square = np.insert(corners if side > 0 else corners[::-1], 0, side, axis=1)
            first = len(vertices)
            vertices += np.roll(square, axis, axis=1).tolist()
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return np.array(vertices), np.array(triangles)


def torus(n=12):
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    s, t = 2 * np.pi * i / n, 2 * np.pi * j / n
    ring = 2 + np.cos(t)
    vertices = np.column_stack([ring * np.cos(s), ring * np.sin(s), np.sin(t)])
    a, b = i * n + j, (i + 1) % n * n + j
    c, d = (i + 1) % n * n + (j + 1) % n, i * n + (j + 1) % n
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def over_sphere(vertices, triangles):
    surface = closed_surface("thing", np.asarray(vertices, float), np.asarray(triangles))
    place = spherical_positions("thing", surface.vertices, surface.faces)
    return surface, place


def expect_one_cover(place, faces):
    """Every face is turned the same way, and together they cover the sphere once."""
    assert (turned(place, faces) > 0).all()
    a, b, c = np.moveaxis(place[faces], 1, 0)
    # Van Oosterom & Strackee (1983).
    part = 1 + (a * b).sum(axis=1) + (b * c).sum(axis=1) + (c * a).sum(axis=1)
    angles = 2 * np.arctan2(np.linalg.det(np.stack([a, b, c], axis=1)), part)
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-9)


@pytest.mark.parametrize("scale", (1e-3, 1.0, 1e5))
@pytest.mark.parametrize(
    "make", (lambda: arrays(sphere(9)), cube, bumpy), ids=("ball", "cube", "horns")
)
def test_nothing_is_flipped_at_any_scale(make, scale):
    vertices, triangles = make()
    surface, place = over_sphere(vertices * scale + [40 * scale, 0, 0], triangles)
    assert len(surface.faces) >= len(triangles) and surface.n_holes == 0
    expect_one_cover(place, surface.faces)
    efficiency, least = evenness(surface.vertices, surface.faces, place)
    assert efficiency > 0.6 and least > 0.5


def test_a_ball_keeps_its_areas_and_angles():
    surface, place = over_sphere(*arrays(sphere(24)))
    efficiency, least = evenness(surface.vertices, surface.faces, place)
    assert efficiency > 0.98 and least > 0.9
    assert np.linalg.norm(place, axis=1) == pytest.approx(np.ones(len(place)))


def test_horns_get_their_share():
    """Without a say of areas they get a hundredth of it."""
    surface, place = over_sphere(*bumpy())
    tips = np.linalg.norm(surface.vertices, axis=1) > 0.4
    mine = tips[surface.faces].all(axis=1)
    corners = surface.vertices[surface.faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    share = turned(place, surface.faces)
    share, due = share[mine].sum() / share.sum(), area[mine].sum() / area.sum()
    assert 0.05 < due and 0.7 * due < share < 1.4 * due


def test_holes_are_filled_and_slivers_do_no_harm():
    vertices, triangles = arrays(sphere(12))
    centre = vertices[triangles].mean(axis=1)
    open_top = triangles[centre[:, 2] < 0.9]
    # A vertex in the middle of an edge, with a face of no area; one that nothing uses.
    a, b, c = open_top[100]
    vertices = np.concatenate([vertices, [(vertices[a] + vertices[b]) / 2, [9, 9, 9]]])
    n = len(vertices) - 2
    split = np.concatenate([np.delete(open_top, 100, axis=0), [[a, n, c], [n, b, c], [a, b, n]]])
    surface, place = over_sphere(vertices, split)
    expect_one_cover(place, surface.faces)
    assert surface.n_holes == 1 and 0 < surface.filled < 0.1
    assert surface.of_vertex[-1] == -1
    kept = surface.source >= 0
    corners = vertices[split[surface.source[kept]]]
    weights = np.insert(surface.places[kept], 0, 1 - surface.places[kept].sum(axis=2), axis=2)
    place = np.einsum("fkc,fcx->fkx", weights, corners) / 2
    np.testing.assert_allclose(surface.vertices[surface.faces[kept]], place, atol=0.03)
    kept = surface.of_vertex >= 0
    np.testing.assert_allclose(
        surface.vertices[surface.of_vertex[kept]], vertices[kept] / 2, atol=0.03
    )


def test_thin_triangles_and_a_vertex_with_many_neighbours():
    vertices, triangles = arrays(sphere(40))
    surface, place = over_sphere(vertices * [1, 1e-3, 1], triangles)
    expect_one_cover(place, surface.faces)
    n = 300
    turn = 2 * np.pi * np.arange(n) / n
    rim = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    top, bottom = np.full(n, n), np.full(n, n + 1)
    spindle = np.concatenate([np.column_stack([i, j, top]), np.column_stack([j, i, bottom])])
    surface, place = over_sphere(np.concatenate([rim, [[0, 0, 2], [0, 0, -2]]]), spindle)
    expect_one_cover(place, surface.faces)


def test_an_eye_is_left_out_and_touching_sheets_part():
    vertices, triangles = arrays(sphere(8))
    eye, eye_triangles = arrays(sphere(4, 0.1, (1.2, 0, 0)))
    both = (
        np.concatenate([vertices, eye]),
        np.concatenate([triangles, eye_triangles + len(vertices)]),
    )
    surface, _ = over_sphere(*both)
    assert (np.unique(surface.source) == np.arange(len(triangles))).all()
    assert 0 < surface.other < 0.02
    assert (surface.of_vertex[len(vertices) :] == -1).all()
    # Where two holes touch in a vertex the sheets part: one hole.
    star = np.flatnonzero((triangles == 70).any(axis=1))
    other = next(k for k in star if len({*triangles[star[0]]} & {*triangles[k]}) == 1)
    surface, place = over_sphere(vertices, np.delete(triangles, [star[0], other], axis=0))
    assert surface.n_holes == 1
    expect_one_cover(place, surface.faces)


def test_what_is_no_sphere_is_refused():
    vertices, triangles = arrays(sphere(8))
    ball = vertices, triangles
    double = (
        np.concatenate([vertices, vertices + 5]),
        np.concatenate([triangles, triangles + len(vertices)]),
    )
    turned_face = np.concatenate([triangles[:-1], triangles[-1:, ::-1]])
    for mesh, message in (
        (torus(), "thing: .* 1 handles .*UV map"),
        (arrays(plane(6)), "open sheet: .* 50%"),
        (double, "2 parts .* 50%"),
        ((ball[0], turned_face), "3 edges .* face different ways"),
        ((ball[0], triangles[:0]), "no triangle"),
    ):
        with pytest.raises(PRTError, match=message) as caught:
            over_sphere(*mesh)
        assert "\n" not in str(caught.value)


def test_the_octahedron_unfolds_without_seams():
    rng = np.random.default_rng(3)
    u, v = rng.random((2, 500))
    ways = octahedral_directions(u, v)
    assert np.abs(np.linalg.norm(ways, axis=1) - 1).max() < 1e-12
    np.testing.assert_allclose(octahedral_square(ways), [u, v], atol=1e-9)
    edge = np.zeros(500)
    for one, two in (((u, edge), (1 - u, edge)), ((edge + 1, v), (edge + 1, 1 - v))):
        np.testing.assert_allclose(
            octahedral_directions(*one), octahedral_directions(*two), atol=1e-12
        )
    # Places that are even in the square are even on the sphere.
    u, v = (x.ravel() / 128 + 1 / 256 for x in np.meshgrid(np.arange(128), np.arange(128)))
    ways = octahedral_directions(u, v)
    np.testing.assert_allclose(ways.T @ ways / len(ways), np.eye(3) / 3, atol=1e-3)
    assert np.mean(ways[:, 2] > 0.5) == pytest.approx(0.25, abs=5e-3)


def test_texels_lie_on_the_surface_and_neighbours_across_the_border_too():
    mesh = sphere(16, radius=2.0, centre=(30, 0, 1))
    scene = Scene.from_meshes([plane(3), mesh])
    layout = geometry_layout(mesh)
    assert layout.round and "stretch efficiency of 9" in layout.message
    caster = BruteForceCaster(layout.vertices, layout.triangles)
    result = with_geometry_image(scene, caster, layout, 16)
    place = result.to_world(result.points.positions[result.image.point]) - [30, 0, 1]
    assert np.abs(np.linalg.norm(place, axis=1) - 2).max() < 0.03
    picture = place.reshape(16, 16, 3)
    # Texels 2 pi / 16 of a half circle apart, about; across the border as well.
    inside = np.linalg.norm(np.diff(picture, axis=1), axis=2)
    across = np.linalg.norm(picture[0] - picture[0, ::-1], axis=1)
    assert inside.max() < 1.2 and across[7:9].max() < 0.6 and across[[0, -1]].max() < 0.6


def test_the_parametrisation_can_be_asked_for():
    ball = sphere(6)
    with_uv = replace(ball, corner_uv=ball.vertices[ball.corner_vertex][:, :2] / 2 + 0.5)
    assert not geometry_layout(with_uv).round and geometry_layout(with_uv, "sphere").round
    assert geometry_layout(ball).round
    with pytest.raises(PRTError, match="needs a UV map.*'sphere'"):
        geometry_layout(ball, "uv")
    with pytest.raises(PRTError, match="parametrisation: .* got 'cube'"):
        geometry_layout(ball, "cube")


def test_filled_holes_show_what_is_beside_them(tmp_path):
    ball = sphere(12, name="bowl")
    triangles = ball.triangle_corners
    height = ball.vertices[ball.corner_vertex[triangles], 2].mean(axis=1)
    bowl = replace(ball, triangle_corners=triangles[height < 0.8])
    scene = Scene.from_meshes([bowl])
    steps = image_steps(scene, [bowl], None, "auto", ImageSettings(None, 2, ("bowl", 12), "sphere"))
    built = run(steps)
    assert any("1 holes filled" in message for message in built.messages)
    n_new = len(built.points) - len(scene.points)
    assert 0.8 * 144 < n_new < 144
    run(bake_steps(built, tmp_path / "b.prt", BakeSettings(resolution=4, tolerance=0.1)))
    bake = load(tmp_path / "b.prt")
    picture = bake.image(bake.transport.radiance(np.ones((96, 3), np.float32)))
    assert picture.min() > 0
