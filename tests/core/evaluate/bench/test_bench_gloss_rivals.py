import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import PointHaar
from prt_core.evaluate.bench.gloss_task import GlossTask
from prt_core.evaluate.bench.indirect import indirect_steps
from prt_core.evaluate.bench.reflection_maps import reflection_map_steps
from prt_core.evaluate.bench.transfer import transfer_steps
from prt_core.evaluate.bench.triple import triple_steps
from prt_core.reflectance import Lambert, Phong
from prt_core.runtime.progress import run
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import (
    Transport,
    View,
    gather_hits,
    gather_operator,
    visibility_bits,
)
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(16)


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(6, 0.5, (0, 0, 0.6)), plane(9)])


@pytest.fixture(scope="module")
def task(scene):
    caster, every = caster_of(scene), slice(0, len(scene.points))
    bits = visibility_bits(scene, CUBE, caster, every)
    gather = gather_operator(gather_hits(scene, caster, every, 0, 0).hits, len(scene.points))
    transport = Transport(CUBE, bits, gather, scene.points.normals, scene.points.albedo)
    outgoing = View(position=(2, -3, 2)).outgoing(scene.to_world(scene.points.positions))
    d = CUBE.directions
    lights = {
        "soft": np.stack([1.1 + d[:, 2], 1 + 0.5 * d[:, 0], 1 + 0.8 * d[:, 1]], axis=1),
        "hard": np.where(CUBE.directions @ [[0.3], [0.5], [0.81]] > 0.99, 50.0, 0.5) * np.ones(3),
    }
    return GlossTask(transport, outgoing, {"phong": Phong(6.0, 0.5)}, lights, n_sample=60)


def test_each_rival_says_what_it_costs_and_how_near_it_is(task):
    rows = run(triple_steps(task, n_mirrored=8, n_tilts=4))
    rows += run(transfer_steps(task))
    rows += run(reflection_map_steps(task))
    errors = {row["form"]: row["l2_mean"] for row in rows}
    assert len(errors) == len(rows) == 7
    assert errors["triple product, 1 %, 32 texels apart"] < 0.08
    assert errors["harmonics, 25 x 25 matrices, 16 texels apart"] < 0.05
    apart, together = (
        errors[f"harmonics, 25 x 25 matrices, {count} texels apart"] for count in (16, 0)
    )
    assert apart < 0.5 * together
    assert errors["reflection map, factor for shadows"] < 0.5 * errors["reflection map"]
    for row in rows:
        assert row["bytes"] > 0 and row["view_ms"] > 0 and row["light_ms"] > 0
        assert row["l2_worst"] >= row["l2_mean"] and row["worst_light"] in task.lights
        assert row["facing"] <= row["points"] and 0 <= row["negative"] <= 1
    by_form = {row["form"]: row for row in rows}
    assert by_form["reflection map, factor for shadows"]["points"] == 60
    assert by_form["harmonics, 25 x 25 matrices, 0 texels apart"]["negative"] > 0


def test_what_has_no_map_has_no_row(task):
    plain = GlossTask(task.transport, task.outgoing, {"plain": Lambert()}, task.lights, 20)
    assert run(reflection_map_steps(plain)) == []


def test_bounces_are_measured_too(scene, task):
    basis = PointHaar(scene.points.positions, scene.points.normals, scene.points.object_index)
    received = [task.transport.received(np.float32(light)) for light in task.lights.values()]
    points = np.arange(0, task.transport.n_points, 5)
    rows = run(indirect_steps(task.transport, basis, received, points, (0.05, 1.0)))
    assert [row["kept"] for row in rows] == [None, 0.05, 1.0]
    assert rows[0]["l2_mean"] == 0 < rows[2]["l2_mean"] < 0.01 and rows[1]["l2_mean"] < 0.05
    assert rows[1]["bytes"] < rows[2]["bytes"] and rows[1]["points"] == len(points)


def test_a_task_needs_something_to_see(task):
    with pytest.raises(PRTError, match="reflectances, lights: give at least one each"):
        GlossTask(task.transport, task.outgoing, {}, task.lights)
    with pytest.raises(PRTError, match="no point faces the viewer"):
        GlossTask(task.transport, -task.transport.normals, task.reflectances, task.lights)
