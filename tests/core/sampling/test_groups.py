"""Many small objects, and loose leaves: what is asked together, certified together, given up."""

import numpy as np
import pytest

from prt_core import BakeSettings, bake_steps, load, run
from prt_core.sampling import (
    AgreementSettings,
    CertificateSettings,
    certificate_steps,
    certified_together,
    sample_agreement,
)
from prt_core.sampling.groups import alike
from prt_core.sampling.tracer import count_bits
from prt_core.scene import Mesh, Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(16)


def stones(n=9):
    """n x n small balls of one mesh on a floor, and one ball that is another mesh."""
    place = np.linspace(-1.7, 1.7, n)
    balls = [
        sphere(4, 0.06, (x, y, 0.1), name=f"stone {i} {j}")
        for i, x in enumerate(place)
        for j, y in enumerate(place)
    ]
    return [plane(15, -2, 2, name="floor"), *balls, sphere(5, 0.2, (0.1, 0.1, 0.5), name="odd")]


def leaves(n=400):
    """A crown of loose quads that turn every way."""
    rng = np.random.default_rng(0)
    vertices, faces = [], []
    for i in range(n):
        way = rng.normal(size=3)
        centre = way / np.linalg.norm(way) * rng.random() ** (1 / 3) + [0, 0, 1.6]
        u, v = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * 0.13
        vertices += [centre - u, centre + 0.5 * v, centre + u, centre - 0.5 * v]
        faces.append(4 * i + np.arange(4))
    vertices, faces = np.array(vertices), np.array(faces)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corner = np.arange(faces.size).reshape(-1, 4)
    return Mesh(
        "leaves", vertices, faces.ravel(), np.repeat(normal, 4, axis=0),
        np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]]),
        np.full((faces.size, 3), 0.4), face_sizes=np.full(n, 4),
    )  # fmt: skip


@pytest.fixture(scope="module")
def field():
    return Scene.from_meshes(stones())


def test_instances_of_a_mesh_are_neighbours_and_nothing_else_is(field):
    group, index = alike(field), field.points.object_index
    names = np.array([item.name for item in field.objects])[index]
    stone = np.char.startswith(names, "stone")
    assert len(np.unique(group[stone])) == 1
    assert len(np.unique(group)) == 3 and group[stone][0] not in group[~stone]


def test_small_objects_are_certified_side_by_side(field):
    group, names = certified_together(field)
    index = field.points.object_index
    assert len(names) <= 14 and len(np.unique(index)) > 60
    # Objects are never cut, and every point is in a group with a name.
    for number in np.unique(index):
        assert len(np.unique(group[index == number])) == 1
    assert set(np.unique(group)) == set(names)
    assert any("and " in name and " more" in name for name in names.values())
    # Those of a group lie together.
    place = field.points.positions
    spread = [np.ptp(place[(group == g) & (index > 0)][:, 0]) for g in list(names)[2:6]]
    assert np.mean(spread) < 0.6 * np.ptp(place[:, 0])
    few = Scene.from_meshes([plane(5), sphere(4, 0.2, name="ball")])
    assert list(certified_together(few)[1].values()) == ["plane", "ball"]


def test_certifying_many_costs_as_much_as_certifying_few(field):
    caster = caster_of(field)
    sampled = run(sample_agreement(field, CUBE, caster, AgreementSettings(seed=1, looks=0)))
    light = {"even": np.ones((CUBE.n_directions, 3), np.float32)}
    rays = []
    for groups in (None, certified_together(field)):
        copy = type(sampled)(sampled.bits.copy(), sampled.traced.copy(), 0)
        result = run(
            certificate_steps(
                field, CUBE, caster, copy, light, CertificateSettings(), groups=groups
            )
        )
        rays.append(copy.rays)
        assert all(item.entries for item in result)
    assert len(result) <= 14 and rays[1] < 0.35 * rays[0]
    # The one figure is that of all their points.
    truth = visibility_bits(field, CUBE, caster, slice(None))
    group, names = groups
    number = max(names, key=lambda g: ((group == g) & (sampled.bits != truth).any(axis=1)).sum())
    item = next(i for i in result if i.name == names[number])
    mine = group == number
    worth = np.maximum(field.points.normals[mine] @ CUBE.vectors.T, 0) ** 2
    wrong, lit = (
        np.unpackbits(b[mine], axis=1, bitorder="little", count=CUBE.n_directions)
        for b in (sampled.bits ^ truth, truth)
    )
    error = np.sqrt((worth * wrong).sum() / (worth * lit).sum())
    assert item.matrix.low <= error <= item.matrix.high
    caster.close()


def test_leaves_are_given_up_early_and_a_floor_is_not():
    scene = Scene.from_meshes([leaves(), plane(41, -2, 2, name="floor")], max_hidden=0)
    caster, index = caster_of(scene), scene.points.object_index
    truth = visibility_bits(scene, CUBE, caster, slice(None))
    settings = AgreementSettings(seed=0, looks=0)
    blind = run(sample_agreement(scene, CUBE, caster, settings))
    result = run(sample_agreement(scene, CUBE, caster, AgreementSettings(
        seed=0, looks=0, most_wrong=0.08)))  # fmt: skip
    assert blind.attributes["given_up"] == 0 and result.attributes["given_up"] == (index == 0).sum()
    # Blind agreement is wrong about a tenth of what leaves see, and more.
    lit = count_bits(truth[index == 0])
    assert count_bits((blind.bits ^ truth)[index == 0]) > 0.1 * lit
    np.testing.assert_array_equal(result.bits[index == 0], truth[index == 0])
    floor = index == 1
    assert count_bits(result.traced[floor]) < 0.3 * count_bits(truth[floor])
    caster.close()


def test_a_bake_of_leaves_keeps_its_tolerance_for_no_more_than_all_its_rays(tmp_path):
    scene = Scene.from_meshes([leaves(), plane(41, -2, 2, name="floor")], max_hidden=0)
    reports = [
        run(bake_steps(scene, tmp_path / f"{method}.prt", BakeSettings(
            resolution=16, bounces=0, method=method)))
        for method in ("exhaustive", "auto")
    ]  # fmt: skip
    assert reports[1]["method"] == "agreement" and reports[1]["tolerance_met"]
    assert reports[1]["rays"] < 1.05 * reports[0]["rays"]
    assert load(tmp_path / "auto.prt").report["sampling"]["given_up"] == 1600
