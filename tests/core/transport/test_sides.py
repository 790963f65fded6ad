"""Which backs get points: those that are seen and lit, and no others."""

import numpy as np
import pytest

from prt_core.light.local import Lamp
from prt_core.runtime.progress import run
from prt_core.scene import Camera, Mesh, Scene
from prt_core.transport import side_steps
from tests.meshes import caster_of, plane, sphere


def joined(name, *meshes):
    """Several meshes as one object."""
    first_vertex = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    first_corner = np.cumsum([0, *(len(m.corner_vertex) for m in meshes)])
    return Mesh(
        name,
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.corner_vertex + f for m, f in zip(meshes, first_vertex, strict=False)]),
        np.concatenate([m.corner_normal for m in meshes]),
        np.concatenate(
            [m.triangle_corners + f for m, f in zip(meshes, first_corner, strict=False)]
        ),
        np.concatenate([m.materials.albedo for m in meshes]),
    )


def upright(x, facing, n=5, name="wall"):
    """A sheet at x from -1 to 1 in y, 0 to 2 in z, whose front faces along x by a sign."""
    mesh = plane(n, name=name)
    y, z, _ = mesh.vertices.T
    mesh.vertices = np.column_stack([np.full(len(y), float(x)), y * facing, z + 1])
    mesh.corner_normal = np.tile([facing * 1.0, 0, 0], (len(mesh.corner_vertex), 1))
    return mesh


def sided(meshes, **sources):
    """Of each object the share of its triangles whose backs have points; rays a point."""
    scene = Scene.from_meshes(meshes, max_hidden=0)
    result, n_rays = run(side_steps(scene, caster_of(scene), 0, **sources))
    has = result.lattice_back[result.lattice_start] >= 0
    shares = [has[scene.triangle_object == i].mean() for i in range(len(meshes))]
    return dict(zip([m.name for m in meshes], shares, strict=True)), n_rays


def test_a_wall_beside_the_ground_has_one_where_its_front_looks_away():
    for facing, share in ((1, 0), (-1, 1)):
        shares, _ = sided([plane(9, name="ground"), upright(-1, facing)])
        assert shares == {"ground": 0, "wall": share}


def test_closed_objects_have_none_and_cost_a_few_rays():
    # The inner ball's points see the outer one's back, where it is dark.
    meshes = [sphere(24, 0.5, (0, 0, 0.5), name="ball"), sphere(24, 0.3, (0.4, 0, 0.5), name="eye")]
    shares, n_rays = sided([plane(60, -2, 2, name="ground"), *meshes])
    assert shares == {"ground": 0, "ball": 0, "eye": 0}
    n_points = 60**2 + 2 * (23 * 48 + 2)
    assert n_rays < 4 * n_points


def test_an_open_part_leaves_a_closed_one_of_the_same_object_as_it_is():
    ball = sphere(8, 0.4, (0.3, 0, 0.5), name="ball")
    meshes = [plane(9, name="ground"), joined("both", upright(-1, -1), ball)]
    shares, _ = sided(meshes)
    assert 0 < shares["both"] < 0.2 and shares["ground"] == 0
    assert np.isclose(shares["both"], 32 / (32 + len(ball.triangle_corners)))


def test_into_a_closed_room_light_comes_from_lamps_only():
    lamp = Lamp("point", np.full(3, 10.0), np.array([0.5, 0.2, 3.0]))
    # Its faces look outwards; the ground is within.
    meshes = [plane(9, -0.5, 0.5, z=0.4, name="ground"), sphere(12, 2.0, (0, 0, 1.9), name="room")]
    assert sided(meshes)[0] == {"ground": 0, "room": 0}
    assert sided(meshes, lamps=[lamp])[0]["room"] == 1


def test_what_the_camera_sees_counts():
    lone = [plane(5, name="sheet")]
    assert sided(lone)[0] == {"sheet": 0}
    matrix = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix[2, 3] = -4
    assert sided(lone, camera=Camera(matrix, 0.4))[0] == {"sheet": 1}


@pytest.mark.parametrize("n", [40])
def test_small_sheets_of_one_owner_are_decided_together(n):
    rng, leaves = np.random.default_rng(0), []
    for i in range(n):
        leaf = upright(0, 1, 2, f"leaf {i}")
        leaf.vertices = leaf.vertices * 0.1 + rng.uniform(-0.4, 0.4, 3) + [0, 0, 0.5]
        leaf.owner = "hedge"
        leaves.append(leaf)
    # Closed, and met by too few rays to be decided on their own.
    berries = [sphere(3, 0.01, rng.uniform(-0.4, 0.4, 3) + [0, 0, 0.5]) for _ in range(3)]
    for i, berry in enumerate(berries):
        berry.name, berry.owner = f"berry {i}", "hedge"
    shares, _ = sided([plane(30, name="ground"), *leaves, *berries])
    assert {name for name, share in shares.items() if share} == {leaf.name for leaf in leaves}
    assert set(shares.values()) == {0, 1}
